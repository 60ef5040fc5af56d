//! The plan of an integer layer.

use crate::engine::general;
use crate::engine::kernel::{Dense8, Dense16, Finish, Scale, Step};
use crate::engine::register::Held;
use ntmu_isa::Asset;
use ntmu_isa::accumulate::{Overflow, signed_range};
use ntmu_isa::activation::{Activation, GATE_FRACTION_BITS, GATE_RANGE};
use ntmu_isa::layer::{IntegerParameters, Layer};
use ntmu_isa::profile::Profile;
use ntmu_isa::round::Rounding;
use ntmu_isa::shape::{LaneFormat, OutputFormat};

/// An integer layer, ready to run.
#[derive(Clone, Debug)]
pub(in crate::engine) struct IntegerLayer {
    pub(in crate::engine) sums: IntegerSums,
    /// Rows whose sums depend on the order: saturating accumulators that may fill up.
    pub(in crate::engine) ordered: Vec<usize>,
    pub(in crate::engine) then: Then,
    /// How the results are held; none in the last layer, which gives codes.
    pub(in crate::engine) output: Option<Held>,
    /// Per row the smallest and the largest result.
    pub(in crate::engine) ranges: Vec<(i32, i32)>,
}

/// What computes the sums.
#[derive(Clone, Debug)]
pub(in crate::engine) enum IntegerSums {
    /// Of stored bytes.
    Bytes(Dense8),
    /// Of words.
    Words(Dense16),
}

/// What follows the sums.
#[derive(Clone, Debug)]
pub(in crate::engine) enum Then {
    /// Sums and all that follows in one kernel.
    Fused(Finish),
    /// Kernels on rows of sums: activation and rescaling, then the skip path.
    Rows(Finish, Option<Scale>),
    /// The rules of the specification, lane by lane.
    General,
}

/// What stored bytes have more than values.
const STORED: i32 = 128;

/// The largest product of a hard GELU, see `ntmu_isa::activation::gate`.
const LARGEST_GATE: i64 = 32_768 * 1536;

impl IntegerLayer {
    pub(super) fn new(asset: &Asset, index: usize, parameters: &IntegerParameters) -> IntegerLayer {
        let layer = &asset.layers[index];
        let (LaneFormat::Integer { bits, .. }, inputs) =
            (asset.input_format(index), usize::from(layer.inputs))
        else {
            // A validated integer layer reads integers.
            return IntegerLayer::nothing();
        };
        let plan = Plan {
            asset,
            index,
            layer,
            parameters,
            largest: largest_sums(parameters, layer.inputs, bits),
        };
        let sums = match Held::of(asset.input_format(index)) {
            Held::Bytes | Held::Halves => {
                IntegerSums::Bytes(Dense8::new(&parameters.weights, inputs, &parameters.bias))
            }
            Held::Words => {
                let weights: Vec<i16> = parameters.weights.iter().map(|&w| i16::from(w)).collect();
                IntegerSums::Words(Dense16::new(&weights, inputs, &parameters.bias))
            }
        };
        let is_last = index + 1 == asset.layers.len();
        let output = (!is_last).then(|| Held::of(layer.output_format()));
        let rows = parameters.bias.len();
        let ranges = if is_last {
            asset
                .shape
                .outputs
                .iter()
                .map(|format| format.range())
                .collect()
        } else {
            vec![signed_range(parameters.output_bits); rows]
        };
        let limit = i64::from(asset.profile.accumulator.range().1);
        let full = |row: &usize| plan.largest[*row] > limit;
        let then = if (0..rows).any(|row| full(&row)) {
            None
        } else if is_last {
            plan.last(&sums, &ranges)
        } else {
            plan.hidden(&sums, output, &ranges)
        };
        let ordered = match asset.profile.accumulator.overflow {
            Overflow::Wrap => Vec::new(),
            Overflow::Saturate => (0..rows).filter(full).collect(),
        };
        IntegerLayer {
            sums,
            ordered,
            then: then.unwrap_or(Then::General),
            output,
            ranges,
        }
    }

    fn nothing() -> IntegerLayer {
        IntegerLayer {
            sums: IntegerSums::Bytes(Dense8::new(&[], 1, &[])),
            ordered: Vec::new(),
            then: Then::General,
            output: None,
            ranges: Vec::new(),
        }
    }
}

/// The largest magnitude of each row's sum, over all inputs.
fn largest_sums(parameters: &IntegerParameters, inputs: u16, bits: u8) -> Vec<i64> {
    let largest_input = 1_i64 << (bits - 1);
    let rows = parameters.weights.chunks_exact(usize::from(inputs));
    rows.zip(&parameters.bias)
        .map(|(row, &bias)| {
            let weights: i64 = row.iter().map(|&w| i64::from(w).abs()).sum();
            i64::from(bias).abs() + largest_input * weights
        })
        .collect()
}

/// A layer and where it stands.
struct Plan<'a> {
    asset: &'a Asset,
    index: usize,
    layer: &'a Layer,
    parameters: &'a IntegerParameters,
    largest: Vec<i64>,
}

impl Plan<'_> {
    fn hidden(
        &self,
        sums: &IntegerSums,
        output: Option<Held>,
        ranges: &[(i32, i32)],
    ) -> Option<Then> {
        if !Scale::folds(self.asset.profile.requantize) {
            return None;
        }
        let source = self.asset.skip_source(self.index);
        let source = source.map(|from| self.asset.layers[from].output_format());
        let is_fused = match (sums, output, source.map(Held::of)) {
            (IntegerSums::Bytes(_), Some(Held::Bytes), None | Some(Held::Bytes)) => true,
            (IntegerSums::Words(_), Some(Held::Words), None) => true,
            (IntegerSums::Bytes(_) | IntegerSums::Words(_), _, _) => false,
        };
        let stored = match (is_fused, sums) {
            (true, IntegerSums::Bytes(_)) => STORED,
            (true, IntegerSums::Words(_)) | (false, _) => 0,
        };
        let zero = i32::from(self.parameters.zero_point) + stored;
        let ranges: Vec<(i32, i32)> = ranges
            .iter()
            .map(|(low, high)| (low + stored, high + stored))
            .collect();
        let step = self.step(zero)?;
        // A gate adds the zero point after its own rescaling.
        let after = match step {
            Step::Gate { .. } => 0,
            Step::Identity | Step::Relu | Step::Leaky { .. } => zero,
        };
        let scales = self.scales(after)?;
        let skip = match source {
            None => None,
            Some(source) => Some(self.skip(source, is_fused)?),
        };
        // A rescaling is monotone and gives the zero point for a zero. Where results saturate at the
        // zero point, they do what the ReLU does.
        let at_the_end = ranges.first().is_some_and(|&(low, _)| low == after);
        let is_saturated = step == Step::Relu && skip.is_none() && at_the_end;
        let step = if is_saturated { Step::Identity } else { step };
        Some(if is_fused {
            Then::Fused(Finish::new(step, &scales, skip, &ranges))
        } else {
            Then::Rows(Finish::new(step, &scales, None, &[]), skip)
        })
    }

    fn last(&self, sums: &IntegerSums, ranges: &[(i32, i32)]) -> Option<Then> {
        let formats = &self.asset.shape.outputs;
        let is_float = formats.contains(&OutputFormat::Float16);
        if is_float || !Scale::folds(self.asset.profile.output) {
            return None;
        }
        let finish = Finish::new(Step::Identity, &self.scales(0)?, None, ranges);
        Some(match sums {
            IntegerSums::Bytes(_) => Then::Fused(finish),
            IntegerSums::Words(_) => Then::Rows(finish, None),
        })
    }

    /// The activation as a fused step, if its rounding is one that a shift of a sum gives.
    fn step(&self, zero: i32) -> Option<Step> {
        match self.layer.activation {
            Activation::Identity => Some(Step::Identity),
            Activation::Relu => Some(Step::Relu),
            Activation::Leaky { shift } => {
                let half = match self.asset.profile.leak {
                    Rounding::HalfUp => 1_i32 << (shift - 1),
                    Rounding::Floor => 0,
                    Rounding::HalfEven | Rounding::HalfAway => return None,
                };
                // The kernels add the half in 32 bits.
                let room = i64::from(i32::MAX) - i64::from(half);
                let fits = self.largest.iter().all(|&sum| sum <= room);
                fits.then_some(Step::Leaky {
                    shift: u32::from(shift),
                    half,
                })
            }
            Activation::HardGelu { scale, is_clamped } => {
                let limit = if is_clamped {
                    3 << GATE_FRACTION_BITS
                } else {
                    GATE_RANGE.1
                };
                let scale = Scale::fold(scale, 0, zero, LARGEST_GATE)?;
                Some(Step::Gate { scale, limit })
            }
            Activation::Table => None,
        }
    }

    fn scales(&self, after: i32) -> Option<Vec<Scale>> {
        let rows = self.parameters.scales.iter().zip(&self.largest);
        rows.map(|(&scale, &largest)| Scale::fold(scale, 0, after, largest))
            .collect()
    }

    /// The scale of the skip path, where its term never reaches the end of the residual bits.
    fn skip(&self, source: LaneFormat, is_fused: bool) -> Option<Scale> {
        let (
            skip,
            Profile {
                skip: requantizer,
                residual_bits,
                ..
            },
        ) = (self.layer.skip?, self.asset.profile);
        let LaneFormat::Integer { bits, .. } = source else {
            return None;
        };
        if !Scale::folds(requantizer) {
            return None;
        }
        let zero = general::skip_zero(self.asset, self.index);
        let (low, high) = signed_range(bits);
        // A rescaling is monotone, so its ends are those of its argument.
        let range = signed_range(residual_bits);
        let fits = [low, high].into_iter().all(|value| {
            let term = requantizer.apply(value - zero, skip.scale);
            range.0 <= term && term <= range.1
        });
        if !fits {
            return None;
        }
        if is_fused {
            Scale::fold_skip(skip.scale, STORED + zero)
        } else {
            Scale::fold(skip.scale, zero, 0, -i64::from(low))
        }
    }
}
