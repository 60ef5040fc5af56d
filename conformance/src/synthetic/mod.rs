//! Synthetic: assets that exercise every rule, from a [`Spec`] and a seed.
//!
//! Codes and weights are random. Biases, scales, tables and zero points are then fitted layer by layer to
//! what the oracle finds at a sample of texels, so that activations use their range, some saturate,
//! and no channel is constant where the inputs are not. Same spec and seed, same asset: the fit
//! uses only `+ − × ÷` of `f64`, which IEEE 754 defines to the bit.

mod arbitrary;
mod fit;
mod preset;
mod random;
mod spec;

pub use arbitrary::arbitrary_spec;
pub use preset::SpecPrecision;
pub use random::Random;
pub use spec::{Spec, SpecActivation, SpecKind, SpecScale, corners, interpolated};

use crate::oracle::embed;
use crate::oracle::synthesizer::{Source, activated, bias, outputs, reading, weights};
use ntmu_isa::asset::{Encoding, Map, Metadata, Parts};
use ntmu_isa::layer::Layer;
use ntmu_isa::limits;
use ntmu_isa::shape::{LaneFormat, OutputFormat, Shape};
use ntmu_isa::{Asset, AssetError};
use ntmu_model::Request;

/// Texels that the scales are fitted to.
const SAMPLE_COUNT: i32 = 48;

/// The asset of a spec and a seed.
///
/// # Errors
/// When the spec itself is outside the limits of an asset; [`arbitrary_spec`] never is.
pub fn asset(spec: &Spec, seed: u64) -> Result<Asset, AssetError> {
    let mut random = Random::new(seed ^ 0x6e74_6d75);
    // The sizes are used below before there is an asset that vouches for them.
    check(spec)?;
    let shape = spec.shape.clone();
    let grids = [0, 1].map(|grid: usize| {
        let max = i32::from(shape.grids[grid].format.max_code());
        (0..shape.grid_latents(grid))
            .map(|_| random.within(0, max) as u8)
            .collect::<Vec<u8>>()
    });
    let layers = synthesizer(spec, &grids, &mut random);
    Asset::new(Parts {
        metadata: Metadata {
            name: format!("synthetic-{seed}"),
            maps: vec![Map {
                name: "all".to_owned(),
                first_channel: 0,
                channel_count: shape.channel_count(),
                encoding: Encoding::Linear,
                bit_depth: if shape.outputs.contains(&OutputFormat::Unorm16) {
                    16
                } else {
                    8
                },
            }],
            record: vec![("seed".to_owned(), seed.to_string())],
        },
        shape,
        profile: spec.profile,
        grids,
        layers,
    })
}

/// Refuses what an asset may not have and what the making of one would stumble over.
fn check(spec: &Spec) -> Result<(), AssetError> {
    let weight = limits::WEIGHT_BITS;
    let lane = limits::LANE_BITS;
    let most = i32::from(limits::MAX_LANES);
    let layers = spec.hidden.len() as i32 + i32::from(spec.blocks) * i32::from(spec.block_span) + 1;
    let span = (1, i32::from(limits::MAX_SKIP_SPAN));
    let mut ranges = vec![
        ("block_span", i32::from(spec.block_span), span),
        ("layers", layers, (1, i32::from(limits::MAX_LAYERS))),
        ("reach", i32::from(spec.reach), (-12, 15)),
    ];
    let mut bits = |name, found: u8, (low, high): (u8, u8)| {
        ranges.push((name, i32::from(found), (i32::from(low), i32::from(high))));
    };
    for &kind in &spec.kinds {
        match kind {
            SpecKind::Integer {
                weight_bits,
                output_bits,
            } => {
                bits("weight_bits", weight_bits, weight);
                bits("output_bits", output_bits, lane);
            }
            SpecKind::Half { quantize } => bits("quantize", quantize.unwrap_or(8), lane),
        }
    }
    let widths = spec
        .hidden
        .iter()
        .map(|&width| ("hidden", i32::from(width), (1, most)));
    for (name, found, (low, high)) in ranges.into_iter().chain(widths) {
        if found < low || found > high {
            return Err(AssetError::Field {
                field: format!("spec.{name}"),
                found: found.to_string(),
                allowed: format!("{low}..={high}"),
            });
        }
    }
    // `Asset::new` checks the shape first; grids that are left out make it stop right after. So the
    // profile is checked with an asset of one texel.
    let refused = |shape: &Shape, grids| {
        Asset::new(Parts {
            shape: shape.clone(),
            profile: spec.profile,
            grids,
            layers: Vec::new(),
            metadata: Metadata::default(),
        })
    };
    match refused(&spec.shape, [Vec::new(), Vec::new()]) {
        Err(AssetError::Field { field, .. }) if field.starts_with("grid") => {}
        Err(error) => return Err(error),
        Ok(_) => {}
    }
    let tiny = Spec::small(1, 1).shape;
    let zeros = [0, 1].map(|grid| vec![0; tiny.grid_latents(grid) as usize]);
    match refused(&tiny, zeros) {
        Err(AssetError::Field { field, .. }) if field.starts_with("weights") => Ok(()),
        Err(error) => Err(error),
        Ok(_) => Ok(()),
    }
}

/// The widths of all layers, and the span of the skip path that ends at each.
fn plan(spec: &Spec) -> Vec<(u16, Option<u8>)> {
    let mut plan: Vec<(u16, Option<u8>)> = spec.hidden.iter().map(|&width| (width, None)).collect();
    if let Some(&width) = spec.hidden.last() {
        for _ in 0..spec.blocks {
            plan.extend((1..spec.block_span).map(|_| (width, None)));
            plan.push((width, Some(spec.block_span)));
        }
    }
    plan.push((spec.shape.channel_count(), None));
    plan
}

fn synthesizer(spec: &Spec, grids: &[Vec<u8>; 2], random: &mut Random) -> Vec<Layer> {
    let samples = sample(&spec.shape, random);
    // Per sample, the inputs and then the outputs of every layer so far.
    let mut values: Vec<Vec<Vec<f64>>> = samples
        .iter()
        .map(|&request| vec![embed::inputs(&spec.shape, &spec.profile, grids, request)])
        .collect();
    let mut layers: Vec<Layer> = Vec::new();
    let plan = plan(spec);
    for (index, &(width, span)) in plan.iter().enumerate() {
        let before = layers.last().map(Layer::output_format);
        let place = fit::Place {
            spec,
            index,
            inputs: values[0][index].len(),
            rows: usize::from(width),
            input: before.unwrap_or(spec.shape.input_format()),
            is_last: index + 1 == plan.len(),
            // values[n + 1] are layer n's outputs, so the source of a span is at index + 1 − span.
            source: span.map(|span| (span, layers[index - usize::from(span)].output_format())),
        };
        let registers: Vec<&[f64]> = values
            .iter()
            .map(|sample| sample[index].as_slice())
            .collect();
        let layer = fit::layer(&place, &registers, random);
        if !place.is_last {
            for sample in &mut values {
                let sums = sums(&layer, place.input, &sample[index]);
                let source = layer.skip.map(|skip| {
                    let from = index - usize::from(skip.span);
                    let zero_point = match layers[from].output_format() {
                        LaneFormat::Integer { zero_point, .. } => f64::from(zero_point),
                        LaneFormat::Half => 0.0,
                    };
                    Source {
                        values: &sample[from + 1],
                        zero_point,
                    }
                });
                let active = activated(&layer, &sums);
                let made = outputs(&layer, &spec.profile, &active, source);
                sample.push(made);
            }
        }
        layers.push(layer);
    }
    layers
}

/// bias + Σ weight · input, of a register in this format.
fn sums(layer: &Layer, format: LaneFormat, register: &[f64]) -> Vec<f64> {
    let (zero_point, one) = reading(layer, format).unwrap_or((0.0, 1.0));
    (0..usize::from(layer.outputs))
        .map(|row| {
            let products = weights(layer, row);
            let products = products.iter().zip(register);
            products.fold(bias(layer, row), |sum, (w, x)| {
                sum + w * ((x - zero_point) / one)
            })
        })
        .collect()
}

/// Texels from all over the chain.
fn sample(shape: &Shape, random: &mut Random) -> Vec<Request> {
    (0..SAMPLE_COUNT)
        .filter_map(|_| {
            let mip = random.within(0, i32::from(shape.mip_count) - 1) as u8;
            let (width, height) = shape.mip_size(mip);
            let x = random.within(0, width as i32 - 1) as u32;
            Request::new(shape, x, random.within(0, height as i32 - 1) as u32, mip).ok()
        })
        .collect()
}
