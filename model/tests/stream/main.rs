//! Streams: what each promises.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod demands;
mod orders;
mod scans;
mod scenes;
mod specs;

use ntmu_isa::latent::LatentFormat;
use ntmu_isa::profile::Profile;
use ntmu_isa::sampler::footprint::{Footprint, GRADIENT_BITS};
use ntmu_isa::sampler::{Address, Detail, Filter, MipFilter, Order, SampleRequest, Sampler};
use ntmu_isa::shape::{GridShape, OutputFormat, Sampling, Shape};
use ntmu_model::sampler::{Decode, Sampled, Texture};
use ntmu_model::stream::{AccessSpec, Interleave, Sample, Scene, SceneSpec, Stream, TexelSpec};
use ntmu_model::{Demand, Demands, Place, Request};
use proptest::prelude::*;
use std::collections::{BTreeMap, BTreeSet};

pub(crate) const PROFILE: Profile = Profile::NORMATIVE;

pub(crate) fn shape(width: u32, height: u32) -> Shape {
    let grid = GridShape {
        channels: 1,
        format: LatentFormat::new(4).unwrap(),
        scale_log2: 3,
        sampling: Sampling::Interpolated,
    };
    Shape {
        octaves: 1,
        ..Shape::whole_chain(width, height, [grid; 2], vec![OutputFormat::Unorm8; 3])
    }
}

pub(crate) fn sampled(width: u32, height: u32, sampler: Sampler) -> Sampled {
    Sampled::new(shape(width, height), sampler, PROFILE).unwrap()
}

pub(crate) fn trilinear(width: u32, height: u32) -> Sampled {
    sampled(width, height, Sampler::default())
}

pub(crate) fn texel_spec(text: &str) -> TexelSpec {
    match text.parse().unwrap() {
        AccessSpec::Texels(spec) => spec,
        AccessSpec::Scene(_) | AccessSpec::File(_) => panic!("{text} is no texel scan"),
    }
}

pub(crate) fn scene_spec(text: &str) -> SceneSpec {
    match text.parse().unwrap() {
        AccessSpec::Scene(spec) => spec,
        AccessSpec::Texels(_) | AccessSpec::File(_) => panic!("{text} is no scene"),
    }
}

pub(crate) fn all(mut demands: impl Demands<Error = std::convert::Infallible>) -> Vec<Demand> {
    let (mut found, mut demand) = (Vec::new(), Demand::default());
    while demands.advance(&mut demand).unwrap() {
        found.push(demand.clone());
    }
    let last = demand.clone();
    assert!(!demands.advance(&mut demand).unwrap());
    assert_eq!(demand, last, "left as it is at the end");
    found
}

pub(crate) fn scan(text: &str, materials: &[Sampled]) -> Vec<Demand> {
    all(Stream::texels(&texel_spec(text), materials)
        .unwrap()
        .demands())
}

pub(crate) fn texel(x: u32, y: u32, mip: u8, material: u16, shape: &Shape) -> Demand {
    Demand {
        pixel: [x, y],
        material,
        places: vec![Place::of(Request::new(shape, x, y, mip).unwrap())],
        weights: 1,
    }
}

pub(crate) fn samples(
    text: &str,
    screen: [u32; 2],
    materials: &[Sampled],
    interleave: Interleave,
) -> Vec<Sample> {
    let scene = Scene::new(&scene_spec(text), screen, materials, interleave).unwrap();
    scene.samples(0..scene.tiles()).collect()
}

pub(crate) const SIZES: [(u32, u32); 5] = [(1, 1), (7, 5), (64, 64), (100, 36), (16, 130)];
pub(crate) const ORDERS: [&str; 3] = ["raster", "blocks", "zorder"];
pub(crate) const SCENES: [&str; 4] = [
    "quad:scale=1",
    "quad:scale=3.7",
    "plane:pitch=12",
    "sphere:distance=1.6",
];
