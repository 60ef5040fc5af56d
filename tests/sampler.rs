//! A sampler before real decodes: what it reads is what the unit decodes, and what it gives lies within
//! the bound of its roundings.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use ntmu::conformance::oracle::sampler::{RealRequest, RealSampler, bound, real};
use ntmu::conformance::synthetic::{self, Spec};
use ntmu::isa::layout::Layout;
use ntmu::isa::profile::NamedProfile;
use ntmu::isa::sampler::{
    Address, Detail, Filter, Footprint, MipBlend, MipFilter, Order, SampleRequest, Sampler,
};
use ntmu::isa::shape::OutputFormat;
use ntmu::isa::{Asset, Program};
use ntmu::model::Request;
use ntmu::model::exec::Decoder;
use ntmu::model::sampler::Texture;

fn asset(seed: u64) -> Asset {
    synthetic::asset(&Spec::small(20, 12), seed).unwrap()
}

fn request(u: f32, v: f32, lod: f32) -> SampleRequest {
    SampleRequest {
        place: [u.to_bits(), v.to_bits()],
        detail: Detail::Lod(lod.to_bits()),
        random: 0,
    }
}

/// u, v and the texel of every centre of every mip.
fn centres(asset: &Asset) -> Vec<(f32, f32, Request)> {
    let mut centres = Vec::new();
    for mip in 0..asset.shape.mip_count {
        let (width, height) = asset.shape.mip_size(mip);
        for texel in Request::blocks(&asset.shape, mip) {
            let u = (texel.x() as f32 + 0.5) / width as f32;
            let v = (texel.y() as f32 + 0.5) / height as f32;
            centres.push((u, v, texel));
        }
    }
    centres
}

#[test]
fn a_sample_at_a_texels_centre_is_the_texel_by_every_filter_and_order() {
    let asset = asset(1);
    let program = Program::compile(&asset, Layout::TILED);
    let decoder = Decoder::new(&asset, &program);
    let base = Sampler::default();
    let samplers = [
        Sampler {
            filter: Filter::Point,
            mip_filter: MipFilter::Point,
            ..base.clone()
        },
        base.clone(),
        Sampler {
            order: Order::FilterThenDecode,
            ..base.clone()
        },
        Sampler {
            order: Order::FilterThenDecode,
            mip_blend: MipBlend::Level,
            ..base.clone()
        },
        Sampler {
            stochastic: true,
            ..base
        },
    ];
    for sampler in samplers {
        let texture = Texture::new(&decoder, sampler).unwrap();
        for (u, v, texel) in centres(&asset) {
            let sample = texture.sample(&request(u, v, f32::from(texel.mip())));
            assert_eq!(sample.codes, decoder.texel(texel, &mut ()), "{texel:?}");
            assert_eq!((sample.reads, sample.decodes), (1, 1));
        }
    }
}

#[test]
fn samples_of_every_named_profile_lie_within_the_bound_of_their_roundings() {
    for (seed, named) in NamedProfile::all().unwrap().into_iter().enumerate() {
        let mut spec = Spec {
            profile: named.profile,
            ..Spec::small(20, 12)
        };
        spec.shape.outputs = OutputFormat::ALL.to_vec();
        let asset = synthetic::asset(&spec, seed as u64).unwrap();
        let program = Program::compile(&asset, Layout::TILED);
        let decoder = Decoder::new(&asset, &program);
        for address in [
            Address::Wrap,
            Address::Mirror,
            Address::MirrorOnce,
            Address::Clamp,
        ] {
            let sampler = Sampler {
                address: [address; 2],
                max_anisotropy: 8,
                ..Sampler::default()
            };
            let texture = Texture::new(&decoder, sampler.clone()).unwrap();
            let oracle = RealSampler::new(&sampler, &asset.shape, &asset.profile);
            let codes = |mip, x, y| {
                let texel = Request::new(&asset.shape, x, y, mip).unwrap();
                decoder.texel(texel, &mut ())
            };
            for step in 0..12_u8 {
                let footprint = Footprint {
                    probes: 1 + step % 8,
                    line: [1 << 22, i32::from(step) << 19],
                    lod: i32::from(step) << 14,
                };
                let place = [f32::from(step) / 5.0 - 1.0, f32::from(step) / 3.7];
                let sample = texture.sample(&SampleRequest {
                    place: place.map(f32::to_bits),
                    detail: Detail::Footprint(footprint),
                    random: 0,
                });
                let asked = RealRequest {
                    place,
                    probes: footprint.probes,
                    line: footprint.line,
                    lod: f64::from(footprint.lod) / 65_536.0,
                };
                let reals = oracle.sample(&asked, codes);
                let filtered: Vec<Vec<i32>> = texture
                    .reads(&SampleRequest {
                        place: place.map(f32::to_bits),
                        detail: Detail::Footprint(footprint),
                        random: 0,
                    })
                    .texels()
                    .iter()
                    .map(|&texel| decoder.texel(texel, &mut ()))
                    .collect();
                for (channel, &format) in asset.shape.outputs.iter().enumerate() {
                    let of = |codes: &Vec<i32>| real(format, codes[channel]);
                    let low = filtered.iter().map(of).fold(f64::INFINITY, f64::min);
                    let high = filtered.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
                    let found = real(format, sample.codes[channel]);
                    assert!((low..=high).contains(&found), "{}", named.name);
                    let distance = (found - reals[channel]).abs();
                    // Sums of f64: far below the last place of 16-bit codes.
                    let slack = high.abs().max(low.abs()) * 2_f64.powi(-40);
                    let bound = bound(&asset.profile, format, high - low, reals[channel]) + slack;
                    assert!(distance <= bound, "{}: {distance} > {bound}", named.name);
                }
            }
        }
    }
}

#[test]
fn a_trace_of_a_samples_reads_has_its_decodes() {
    let asset = asset(3);
    let program = Program::compile(&asset, Layout::TILED);
    let decoder = Decoder::new(&asset, &program);
    for order in [Order::DecodeThenFilter, Order::FilterThenDecode] {
        let sampler = Sampler {
            order,
            ..Sampler::default()
        };
        let texture = Texture::new(&decoder, sampler).unwrap();
        let request = request(0.31, 0.77, 0.5);
        let reads = texture.reads(&request);
        let trace = match order {
            Order::DecodeThenFilter => decoder.trace(reads.texels().iter().copied()),
            Order::FilterThenDecode => decoder.trace_places(reads.places().iter().copied()),
        };
        let decodes = texture.sample(&request).decodes;
        assert_eq!(trace.texel_count(), decodes as usize);
        assert_eq!(decodes, reads.decodes());
    }
}

#[test]
fn a_constant_set_stays_constant_in_both_orders() {
    // Grids of one latent everywhere and no waves decode to one colour in a mip, wherever asked.
    let mut spec = Spec::small(24, 24);
    spec.shape.octaves = 0;
    let mut parts = synthetic::asset(&spec, 4).unwrap().into_parts();
    for grid in &mut parts.grids {
        grid.fill(3);
    }
    let asset = Asset::new(parts).unwrap();
    let program = Program::compile(&asset, Layout::TILED);
    let decoder = Decoder::new(&asset, &program);
    let colour = decoder.texel(Request::new(&asset.shape, 0, 0, 0).unwrap(), &mut ());
    for order in [Order::DecodeThenFilter, Order::FilterThenDecode] {
        let sampler = Sampler {
            order,
            ..Sampler::default()
        };
        let texture = Texture::new(&decoder, sampler).unwrap();
        for step in 0..200_u8 {
            let (u, v) = (f32::from(step) / 61.0, f32::from(step) / 97.0);
            assert_eq!(texture.sample(&request(u, v, 0.0)).codes, colour);
        }
    }
}
