//! Synthetic: assets that exercise every rule, from a [`Spec`] and a seed.
//!
//! Codes and weights are random. Biases, scales and zero points are then fitted layer by layer to
//! what the oracle finds at a sample of texels, so that activations use their range, some saturate,
//! and no channel is constant where the inputs are not. Same spec and seed, same asset: the fit
//! uses only `+ − × ÷` of `f64`, which IEEE 754 defines to the bit.

mod random;
mod spec;

pub use random::Random;
pub use spec::{Spec, SpecActivation, SpecScale, arbitrary_spec, grid};

use crate::oracle::{embed, synthesizer};
use ntmu_isa::activation::Activation;
use ntmu_isa::asset::{Encoding, Map, Metadata, Parts};
use ntmu_isa::layer::{Layer, Skip};
use ntmu_isa::limits;
use ntmu_isa::rescale::Multiplier;
use ntmu_isa::shape::{OutputFormat, Shape};
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
        weight_bits: spec.weight_bits,
        layers,
    })
}

/// Refuses what an asset may not have and what the making of one would stumble over.
fn check(spec: &Spec) -> Result<(), AssetError> {
    let (low, high) = limits::WEIGHT_BITS;
    let most = i32::from(limits::MAX_LANES);
    let layers = spec.hidden.len() as i32 + i32::from(spec.blocks) * i32::from(spec.block_span) + 1;
    let ranges = [
        (
            "weight_bits",
            i32::from(spec.weight_bits),
            (i32::from(low), i32::from(high)),
        ),
        (
            "block_span",
            i32::from(spec.block_span),
            (1, i32::from(limits::MAX_SKIP_SPAN)),
        ),
        ("layers", layers, (1, i32::from(limits::MAX_LAYERS))),
    ];
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
    // `Asset::new` checks the shape first; grids that are left out make it stop right after.
    let parts = Parts {
        shape: spec.shape.clone(),
        profile: spec.profile,
        grids: [Vec::new(), Vec::new()],
        weight_bits: spec.weight_bits,
        layers: Vec::new(),
        metadata: Metadata::default(),
    };
    match Asset::new(parts) {
        Err(AssetError::Field { field, .. }) if field.starts_with("grid") => Ok(()),
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
        .map(|&request| vec![embed::inputs(&spec.shape, grids, request)])
        .collect();
    let mut layers: Vec<Layer> = Vec::new();
    let plan = plan(spec);
    for (index, &(width, span)) in plan.iter().enumerate() {
        let is_last = index + 1 == plan.len();
        let inputs = values[0][index].len();
        let mut layer = Layer {
            inputs: inputs as u16,
            outputs: width,
            weights: weights(spec.weight_bits, inputs, usize::from(width), random),
            bias: Vec::new(),
            scales: Vec::new(),
            zero_point: 0,
            activation: Activation::Identity,
            skip: None,
        };
        let sums: Vec<Vec<f64>> = values.iter().map(|v| products(&layer, &v[index])).collect();
        if is_last {
            fit_output(spec, &mut layer, &sums, random);
        } else {
            fit_hidden(spec, &mut layer, &sums, span, random);
            for (sample, sums) in values.iter_mut().zip(&sums) {
                let biased = sums.iter().zip(&layer.bias).map(|(s, &b)| s + f64::from(b));
                let activated = synthesizer::activated(&layer, &biased.collect::<Vec<_>>());
                // values[n + 1] are layer n's outputs, so the source of a span is at index + 1 − span.
                let source = span.map(|span| index + 1 - usize::from(span));
                let source =
                    source.map(|at| (sample[at].as_slice(), f64::from(layers[at - 1].zero_point)));
                let outputs = synthesizer::outputs(&layer, &activated, source);
                sample.push(outputs);
            }
        }
        layers.push(layer);
    }
    layers
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

fn weights(bits: u8, inputs: usize, rows: usize, random: &mut Random) -> Vec<i8> {
    let largest = (1 << (bits - 1)) - 1;
    let mut weights: Vec<i8> = (0..inputs * rows)
        .map(|_| random.within(-largest - 1, largest) as i8)
        .collect();
    for row in weights.chunks_exact_mut(inputs) {
        // A row of zeros would be a constant.
        if row.iter().all(|&w| w == 0) {
            row[0] = 1;
        }
    }
    weights
}

fn products(layer: &Layer, input: &[f64]) -> Vec<f64> {
    let rows = (0..usize::from(layer.outputs)).map(|row| layer.row(row));
    rows.map(|row| row.iter().zip(input).map(|(&w, x)| f64::from(w) * x).sum())
        .collect()
}

/// The middle of a row's sums over the samples, and how far they reach from it; at least 1.
fn spread(sums: &[Vec<f64>], row: usize) -> (f64, f64) {
    let of_row = || sums.iter().map(|sums| sums[row]);
    let low = of_row().fold(f64::INFINITY, f64::min);
    let high = of_row().fold(f64::NEG_INFINITY, f64::max);
    ((low + high) / 2.0, ((high - low) / 2.0).max(1.0))
}

fn fit_hidden(
    spec: &Spec,
    layer: &mut Layer,
    sums: &[Vec<f64>],
    span: Option<u8>,
    random: &mut Random,
) {
    // A skip path brings its own share of the range.
    let share = if span.is_some() { 0.6 } else { 1.0 };
    // The gate's product reaches 3·256·1536 where its argument does reach 3.
    let gate = multiplier(spec, share * 220.0 / (768.0 * 1536.0));
    let (zero_point, activation) = match spec.activation {
        SpecActivation::Identity => (random.within(-16, 16), Activation::Identity),
        SpecActivation::Relu => (-128, Activation::Relu),
        SpecActivation::Leaky(shift) => (-90, Activation::Leaky { shift }),
        SpecActivation::HardGelu => (-112, Activation::HardGelu { scale: gate }),
    };
    (layer.zero_point, layer.activation) = (zero_point as i16, activation);
    layer.skip = span.map(|span| Skip {
        span,
        scale: multiplier(spec, 0.4 + 0.5 * random.unit()),
    });
    for row in 0..usize::from(layer.outputs) {
        let (middle, reach) = spread(sums, row);
        let bias = -middle + reach * (random.unit() - 0.4) * 0.6;
        let top = reach * 1.3;
        // Some rows saturate at their extremes, most do not.
        let slack = 0.8 + 0.5 * random.unit();
        let target = match spec.activation {
            SpecActivation::Identity => 120.0 * share,
            SpecActivation::Relu => 255.0 * share,
            SpecActivation::Leaky(_) => 217.0 * share,
            SpecActivation::HardGelu => 768.0,
        };
        layer.bias.push(bias.floor() as i32);
        layer.scales.push(multiplier(spec, target * slack / top));
    }
}

fn fit_output(spec: &Spec, layer: &mut Layer, sums: &[Vec<f64>], random: &mut Random) {
    for (row, format) in spec.shape.outputs.iter().enumerate() {
        let (low, high) = format.range();
        let (middle, reach) = spread(sums, row);
        let slack = 0.8 + 0.35 * random.unit();
        let scale = multiplier(spec, f64::from(high - low) * slack / (2.0 * reach));
        // There is no zero point here: the bias puts the middle of the sums on that of the format.
        let centre = f64::from(high + low) / 2.0 / synthesizer::scale(scale);
        layer.bias.push((centre - middle).floor() as i32);
        layer.scales.push(scale);
    }
}

/// A multiplier near a positive scale, of the kind that the spec asks for.
fn multiplier(spec: &Spec, scale: f64) -> Multiplier {
    // A finite positive normal: 52 bits of fraction below an implied one.
    let bits = scale.to_bits();
    let exponent = (bits >> 52) as i32 - 1023;
    let (significand, width) = match spec.scale {
        SpecScale::Arbitrary => ((bits & ((1 << 52) - 1)) | 1 << 52, 52),
        SpecScale::PowerOfTwo => (1, 0),
        // ⌊7/5 · 2^30⌋. Its lower half, 0x9999, is more than one half of 2^16.
        SpecScale::BelowTies => (0x5999_9999, 30),
    };
    // Scales here lie between 2^−30 and 2^17, well within what a multiplier expresses.
    Multiplier::nearest(significand, exponent - width).unwrap_or(Multiplier::power_of_two(0))
}
