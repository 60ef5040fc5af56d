//! An integer layer: its accumulators over every prefix of the sum, its rescalings, its outputs.

use super::inputs::{Inputs, Merged};
use super::range::{Range, RealRange};
use crate::naive::number::{divide, power};
use ntmu_isa::Asset;
use ntmu_isa::activation::{Activation, gate, gate_argument, leak, table_index};
use ntmu_isa::layer::{IntegerParameters, Layer};
use ntmu_isa::rescale::{Multiplier, Requantizer};
use ntmu_isa::round::Rounding;
use ntmu_isa::shape::{LaneFormat, OutputFormat};
use serde::Serialize;

/// The narrowest accumulator there is.
pub(super) const NARROWEST: u8 = 16;
/// The widest accumulator there is.
pub(super) const WIDEST: u8 = 32;

/// What is known of an integer layer's sums.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct IntegerSums {
    /// Every accumulator after its bias and after each product, in rows of any width.
    pub sums: Range,
    /// The narrowest accumulator, 16..=32 bits, that holds them all; none if 32 do not.
    pub width: Option<u8>,
    /// Bits of the profile's accumulators.
    pub profile_width: u8,
    /// These are enough: no sum overflows, whatever the latents.
    pub is_wide_enough: bool,
    /// Every rescaling of every row keeps what its arithmetic asks for.
    pub rescales_are_safe: bool,
    /// Row by row.
    pub rows: Vec<Row>,
}

/// What is known of one row.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// The accumulator after its bias and after each product.
    pub sums: Range,
    /// The accumulator after all of them.
    pub last: Range,
    /// The narrowest accumulator that holds `sums`; none if 32 bits do not.
    pub width: Option<u8>,
    /// The rescalings of the row.
    pub rescales: Vec<Rescale>,
}

/// What a rescaling is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Purpose {
    /// A hard GELU's argument, from the accumulator.
    Argument,
    /// A table's index, from the accumulator.
    Index,
    /// The output or channel, from the activated accumulator.
    Output,
    /// The skip path's term.
    Skip,
}

/// One rescaling, and what can come to it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Rescale {
    /// What it is for.
    pub purpose: Purpose,
    /// What is rescaled.
    pub value: Range,
    /// Bits of the product of value and mantissa (its upper sixteen bits, if narrow), signed.
    pub product_bits: u8,
    /// −2^(shift−1) ≤ value < 2^(shift−1), which TOSA 1.0 requires of `apply_scale_32`; for a narrow
    /// one of `apply_scale_16`, with its own shift, smaller by sixteen.
    pub keeps_tosa: bool,
    /// The product is at most 2^62 in magnitude; for a narrow one it has 48 bits.
    pub product_fits: bool,
    /// The result has 32 bits before it is saturated to them.
    pub result_fits: bool,
}

impl Rescale {
    fn of(purpose: Purpose, requantizer: Requantizer, value: Range, scale: Multiplier) -> Rescale {
        let (mantissa, shift) = (i128::from(scale.mantissa()), u32::from(scale.shift()));
        let is_narrow = requantizer == Requantizer::Narrow;
        let (factor, own_shift) = if is_narrow {
            let upper = divide(mantissa, power(16), Rounding::HalfUp).min(32_767);
            (upper, shift.saturating_sub(16))
        } else {
            (mantissa, shift)
        };
        // At most 2^32 times 2^31.
        let product = value.times(factor as i64);
        let limit = if own_shift == 0 {
            0
        } else {
            1_i64 << (own_shift - 1)
        };
        // Every rule gives the floor or one more.
        let result = |end: i64| {
            let scaled = i128::from(end) * factor * power(shift - own_shift);
            divide(scaled, power(shift), Rounding::Floor)
        };
        let most = power(31) - 1;
        Rescale {
            purpose,
            value,
            product_bits: product.bits(),
            keeps_tosa: -limit <= value.low && value.high < limit,
            product_fits: if is_narrow {
                product.bits() <= 48
            } else {
                product.magnitude() <= 1 << 62
            },
            result_fits: result(value.low) >= -power(31) && result(value.high) < most,
        }
    }

    /// All three hold.
    #[must_use]
    pub fn is_safe(&self) -> bool {
        self.keeps_tosa && self.product_fits && self.result_fits
    }
}

/// The sums of a row: over every prefix, and the whole.
#[derive(Clone, Copy)]
pub(super) struct Prefixes {
    pub(super) all: Range,
    pub(super) last: Range,
}

impl Prefixes {
    fn start(bias: i32) -> Prefixes {
        let bias = Range::point(i64::from(bias));
        Prefixes {
            all: bias,
            last: bias,
        }
    }

    /// After more products.
    fn then(self, weights: &[i8], lanes: impl Iterator<Item = Range>) -> Prefixes {
        let products = weights.iter().zip(lanes);
        products.fold(self, |sum, (&weight, lane)| {
            let last = sum.last.plus(lane.times(i64::from(weight)));
            Prefixes {
                all: sum.all.union(last),
                last,
            }
        })
    }

    /// By intervals.
    pub(super) fn of(bias: i32, weights: &[i8], lanes: &[Range]) -> Prefixes {
        Prefixes::start(bias).then(weights, lanes.iter().copied())
    }

    /// In the first layer: every class of texels, and every latent that several lanes hold once.
    pub(super) fn of_inputs(
        asset: &Asset,
        bias: i32,
        weights: &[i8],
        inputs: &Inputs,
    ) -> Option<Prefixes> {
        let (of_latents, of_places) = weights.split_at(inputs.latents.len());
        let mut known: Vec<(Merged, Prefixes)> = Vec::new();
        let mut all: Option<Prefixes> = None;
        for class in &inputs.classes {
            let found = known.iter().find(|(merged, _)| *merged == class.merged);
            let latents = match found {
                Some((_, latents)) => *latents,
                None => {
                    let latent_of = Inputs::latent_of(asset, class.merged);
                    let sums = Prefixes::shared(bias, of_latents, &inputs.latents, &latent_of);
                    known.push((class.merged, sums));
                    sums
                }
            };
            let values = class.values.iter().map(|&value| Range::point(value));
            let sums = latents.then(of_places, values);
            all = Some(all.map_or(sums, |all| Prefixes {
                all: all.all.union(sums.all),
                last: all.last.union(sums.last),
            }));
        }
        all
    }

    /// Of lanes some of which hold the same latent: its weights add up before it takes an end.
    fn shared(bias: i32, weights: &[i8], lanes: &[Range], latent_of: &[usize]) -> Prefixes {
        let mut held = vec![0_i64; lanes.len()];
        let mut sums = Prefixes::start(bias);
        for ((&weight, &lane), &latent) in weights.iter().zip(lanes).zip(latent_of) {
            let before = lane.times(held[latent]);
            held[latent] += i64::from(weight);
            let after = lane.times(held[latent]);
            sums.last = Range {
                low: sums.last.low - before.low + after.low,
                high: sums.last.high - before.high + after.high,
            };
            sums.all = sums.all.union(sums.last);
        }
        sums
    }
}

/// The narrowest accumulator for a range.
pub(super) fn width(sums: Range) -> Option<u8> {
    let bits = sums.bits().max(NARROWEST);
    (bits <= WIDEST).then_some(bits)
}

/// A layer whose rows have these sums, and the ranges of its outputs (none in the last layer).
pub(super) fn layer(
    asset: &Asset,
    index: usize,
    prefixes: &[Prefixes],
    registers: &[Vec<RealRange>],
) -> Option<(IntegerSums, Vec<RealRange>)> {
    let layer = &asset.layers[index];
    let parameters = layer.integer()?;
    let profile_width = asset.profile.accumulator.bits;
    let is_last = index + 1 == asset.layers.len();
    let (mut rows, mut outputs) = (Vec::new(), Vec::new());
    for (row, prefix) in prefixes.iter().enumerate() {
        let width = width(prefix.all);
        let held = Range::signed(profile_width);
        // A sum that wrapped or saturated on its way may be anything.
        let sum = if held.holds(prefix.all) {
            prefix.last
        } else {
            held
        };
        let mut rescales = Vec::new();
        let activated = activate(asset, layer, parameters, (row, sum), &mut rescales);
        let source = asset.skip_source(index).map(|from| {
            let zero_point = match asset.layers[from].output_format() {
                LaneFormat::Integer { zero_point, .. } => i64::from(zero_point),
                LaneFormat::Half => 0,
            };
            // The inputs come first.
            let lane = registers[from + 1][row].integers();
            lane.plus(Range::point(-zero_point))
        });
        if is_last {
            // An fp16 channel is rounded from the full product, by no requantiser.
            if asset.shape.outputs[row] != OutputFormat::Float16 {
                let scale = parameters.scales[row];
                let rescale = Rescale::of(Purpose::Output, asset.profile.output, activated, scale);
                rescales.push(rescale);
            }
        } else {
            let lane = (row, activated);
            let output = output(asset, (layer, parameters), lane, source, &mut rescales);
            outputs.push(RealRange::from(output));
        }
        rows.push(Row {
            sums: prefix.all,
            last: prefix.last,
            width,
            rescales,
        });
    }
    let sums = rows.iter().map(|row| row.sums).reduce(Range::union)?;
    let width = width(sums);
    let sums = IntegerSums {
        sums,
        width,
        profile_width,
        is_wide_enough: width.is_some_and(|bits| bits <= profile_width),
        rescales_are_safe: rows
            .iter()
            .flat_map(|row| &row.rescales)
            .all(Rescale::is_safe),
        rows,
    };
    Some((sums, outputs))
}

/// An accumulator's range after the activation. Sums have 32 bits here.
fn activate(
    asset: &Asset,
    layer: &Layer,
    parameters: &IntegerParameters,
    (row, sum): (usize, Range),
    rescales: &mut Vec<Rescale>,
) -> Range {
    let profile = &asset.profile;
    let (requantizer, scale) = (profile.requantize, parameters.scales[row]);
    match layer.activation {
        Activation::Identity => sum,
        Activation::Relu => sum.rising(|a| a.max(0)),
        Activation::Leaky { shift } => {
            sum.rising(|a| i64::from(leak(a as i32, shift, profile.leak)))
        }
        Activation::HardGelu { is_clamped, .. } => {
            rescales.push(Rescale::of(Purpose::Argument, requantizer, sum, scale));
            let argument = |a| i64::from(gate_argument(a as i32, scale, requantizer, is_clamped));
            let x = sum.rising(argument);
            let at = |x: i64| i64::from(gate(x as i32));
            // The product falls to −192 and rises from there.
            let lowest = (-192).clamp(x.low, x.high);
            Range {
                low: at(lowest),
                high: at(x.low).max(at(x.high)),
            }
        }
        Activation::Table => {
            rescales.push(Rescale::of(Purpose::Index, requantizer, sum, scale));
            let index = |a: i64| table_index(a as i32, scale, requantizer);
            let entries = &parameters.table[index(sum.low)..=index(sum.high)];
            let entries = entries.iter().map(|&entry| Range::point(i64::from(entry)));
            entries.reduce(Range::union).unwrap_or(Range::point(0))
        }
    }
}

/// What a hidden layer's row writes to its register.
fn output(
    asset: &Asset,
    (layer, parameters): (&Layer, &IntegerParameters),
    (row, activated): (usize, Range),
    source: Option<Range>,
    rescales: &mut Vec<Rescale>,
) -> Range {
    let profile = &asset.profile;
    let requantizer = profile.requantize;
    let scale = match layer.activation {
        Activation::HardGelu { scale, .. } => Some(scale),
        Activation::Identity | Activation::Relu | Activation::Leaky { .. } => {
            Some(parameters.scales[row])
        }
        Activation::Table => None,
    };
    let rescaled = |requantizer: Requantizer, value: Range, scale| {
        value.rising(|end| i64::from(requantizer.apply(end as i32, scale)))
    };
    let mut value = match scale {
        Some(scale) => {
            rescales.push(Rescale::of(Purpose::Output, requantizer, activated, scale));
            rescaled(requantizer, activated, scale)
        }
        None => activated,
    };
    if let (Some(skip), Some(source)) = (layer.skip, source) {
        rescales.push(Rescale::of(Purpose::Skip, profile.skip, source, skip.scale));
        let held = Range::signed(profile.residual_bits);
        let term = rescaled(profile.skip, source, skip.scale);
        value = value.plus(term.rising(|term| term.clamp(held.low, held.high)));
    }
    let held = Range::signed(parameters.output_bits);
    value
        .plus(Range::point(i64::from(parameters.zero_point)))
        .rising(|value| value.clamp(held.low, held.high))
}
