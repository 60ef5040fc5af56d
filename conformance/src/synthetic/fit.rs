//! Fit: the numbers of one layer, so that what it gives uses its range.

use super::random::Random;
use super::spec::{Spec, SpecActivation, SpecKind, SpecScale};
use crate::oracle::number::{channel_range, signed};
use crate::oracle::synthesizer::{reading, scale};
use ntmu_isa::activation::{Activation, TABLE_ENTRIES};
use ntmu_isa::half::Half;
use ntmu_isa::layer::{HalfParameters, IntegerParameters, Layer, Parameters, Quantize, Skip};
use ntmu_isa::limits;
use ntmu_isa::rescale::Multiplier;
use ntmu_isa::shape::{LaneFormat, OutputFormat};

/// A layer that is to be made.
pub(super) struct Place<'a> {
    pub(super) spec: &'a Spec,
    pub(super) index: usize,
    pub(super) inputs: usize,
    pub(super) rows: usize,
    /// The register that it reads.
    pub(super) input: LaneFormat,
    pub(super) is_last: bool,
    /// The span of a skip path, and the register at its start.
    pub(super) source: Option<(u8, LaneFormat)>,
}

impl Place<'_> {
    /// The activation that the spec has here.
    fn activation(&self) -> SpecActivation {
        let ends_block = self.source.is_some();
        if self.is_last || ends_block && self.spec.has_plain_block_ends {
            SpecActivation::Identity
        } else {
            self.spec.activation
        }
    }
}

/// The layer, fitted to the registers of some samples.
pub(super) fn layer(place: &Place<'_>, registers: &[&[f64]], random: &mut Random) -> Layer {
    match place.spec.kind(place.index) {
        SpecKind::Integer {
            weight_bits,
            output_bits,
        } => integer(place, registers, (weight_bits, output_bits), random),
        SpecKind::Half { quantize } => {
            let is_read_by_integers =
                matches!(place.spec.kind(place.index + 1), SpecKind::Integer { .. });
            let quantize = if place.is_last {
                None
            } else if is_read_by_integers {
                Some(quantize.unwrap_or(8))
            } else {
                quantize
            };
            half(place, registers, quantize, random)
        }
    }
}

/// The middle of a row's sums over the samples, and how far they reach from it; at least `least`.
fn spread(sums: impl Iterator<Item = f64> + Clone, least: f64) -> (f64, f64) {
    let low = sums.clone().fold(f64::INFINITY, f64::min);
    let high = sums.fold(f64::NEG_INFINITY, f64::max);
    let reach = (high - low) / 2.0;
    ((low + high) / 2.0, if reach < least { 1.0 } else { reach })
}

fn dot(weights: &[f64], register: &[f64]) -> f64 {
    weights.iter().zip(register).map(|(w, x)| w * x).sum()
}

fn integer(
    place: &Place<'_>,
    registers: &[&[f64]],
    (weight_bits, output_bits): (u8, u8),
    random: &mut Random,
) -> Layer {
    let spec = place.spec;
    let weights = weights(weight_bits, place.inputs, place.rows, random);
    // Fitted for eight bits; others have steps of another size.
    let steps = 2_f64.powi(i32::from(output_bits) - 8);
    let source = place.source.and_then(|(span, format)| match format {
        LaneFormat::Integer { bits, .. } => Some((span, bits)),
        LaneFormat::Half => None,
    });
    // A skip path brings its own share of the range.
    let share = if source.is_some() { 0.6 } else { 1.0 };
    // The gate's product reaches 3·256·1536 where its argument does reach 3.
    let gate = multiplier(spec, share * 220.0 * steps / (768.0 * 1536.0));
    let gelu = |is_clamped| Activation::HardGelu {
        scale: gate,
        is_clamped,
    };
    let (zero_point, activation) = match place.activation() {
        _ if place.is_last => (0.0, Activation::Identity),
        SpecActivation::Identity => (f64::from(random.within(-16, 16)), Activation::Identity),
        SpecActivation::Relu => (-128.0, Activation::Relu),
        SpecActivation::Leaky(shift) => (-90.0, Activation::Leaky { shift }),
        SpecActivation::HardGelu => (-112.0, gelu(false)),
        SpecActivation::ClampedGelu => (-112.0, gelu(true)),
        SpecActivation::Table => (f64::from(random.within(-16, 16)), Activation::Table),
    };
    let skip = source.filter(|_| !place.is_last).map(|(span, bits)| {
        let steps = 2_f64.powi(i32::from(output_bits) - i32::from(bits));
        Skip {
            span,
            scale: multiplier(spec, (0.4 + 0.5 * random.unit()) * steps),
        }
    });
    let mut parameters = IntegerParameters {
        weight_bits,
        bias: Vec::new(),
        scales: Vec::new(),
        output_bits: if place.is_last { 8 } else { output_bits },
        zero_point: (zero_point * steps).floor() as i16,
        table: if activation == Activation::Table {
            table(120.0 * share * steps)
        } else {
            Vec::new()
        },
        weights,
    };
    let profile = &spec.profile;
    let (low, high) = signed(profile.bias_bits.min(profile.accumulator.bits));
    for row in 0..place.rows {
        let lanes = row * place.inputs..(row + 1) * place.inputs;
        let reals: Vec<f64> = parameters.weights[lanes]
            .iter()
            .map(|&w| f64::from(w))
            .collect();
        let (middle, reach) = spread(registers.iter().map(|x| dot(&reals, x)), 1.0);
        let (bias, scale) = if place.is_last {
            channel_row(spec, row, (middle, reach), random)
        } else {
            let bias = -middle + reach * (random.unit() - 0.4) * 0.6;
            let top = reach * 1.3;
            // Some rows saturate at their extremes, most do not.
            let slack = 0.8 + 0.5 * random.unit();
            let target = match place.activation() {
                SpecActivation::Identity => 120.0 * share * steps,
                SpecActivation::Relu => 255.0 * share * steps,
                SpecActivation::Leaky(_) => 217.0 * share * steps,
                SpecActivation::HardGelu | SpecActivation::ClampedGelu => 768.0,
                SpecActivation::Table => 120.0,
            };
            (bias, multiplier(spec, target * slack / top))
        };
        parameters.bias.push(bias.floor().clamp(low, high) as i32);
        parameters.scales.push(scale);
    }
    Layer {
        inputs: place.inputs as u16,
        outputs: place.rows as u16,
        parameters: Parameters::Integer(parameters),
        activation,
        skip,
    }
}

/// Bias and scale of a channel of an integer layer.
fn channel_row(
    spec: &Spec,
    row: usize,
    (middle, reach): (f64, f64),
    random: &mut Random,
) -> (f64, Multiplier) {
    let slack = 0.8 + 0.35 * random.unit();
    let format = spec.shape.outputs[row];
    if format == OutputFormat::Float16 {
        let top = 2_f64.powi(i32::from(spec.reach));
        return (
            -middle + reach * random.unit(),
            multiplier(spec, slack * top / reach),
        );
    }
    let (low, high) = channel_range(format);
    let multiplier = multiplier(spec, (high - low) * slack / (2.0 * reach));
    // There is no zero point here: the bias puts the middle of the sums on that of the format.
    let centre = (high + low) / 2.0 / scale(multiplier);
    (centre - middle, multiplier)
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

/// A curve that flattens at both ends: 3/2 · t / (½ + |t|) of the index' share t.
fn table(reach: f64) -> Vec<i16> {
    let entry = |index: usize| {
        let t = (index as f64 - 128.0) / 128.0;
        (reach * 1.5 * t / (0.5 + t.abs())).floor()
    };
    (0..TABLE_ENTRIES)
        .map(|index| entry(index).clamp(-32_768.0, 32_767.0) as i16)
        .collect()
}

fn half(
    place: &Place<'_>,
    registers: &[&[f64]],
    quantize: Option<u8>,
    random: &mut Random,
) -> Layer {
    let spec = place.spec;
    let source = place
        .source
        .filter(|(_, format)| *format == LaneFormat::Half);
    let one = Multiplier::power_of_two(0);
    let gelu = |is_clamped| Activation::HardGelu {
        scale: one,
        is_clamped,
    };
    let mut layer = Layer {
        inputs: place.inputs as u16,
        outputs: place.rows as u16,
        parameters: Parameters::Half(HalfParameters {
            weights: Vec::new(),
            bias: Vec::new(),
            quantize: None,
        }),
        activation: match place.activation() {
            _ if place.is_last => Activation::Identity,
            SpecActivation::Identity => Activation::Identity,
            SpecActivation::Relu | SpecActivation::Table => Activation::Relu,
            SpecActivation::Leaky(shift) => Activation::Leaky { shift },
            SpecActivation::HardGelu => gelu(false),
            SpecActivation::ClampedGelu => gelu(true),
        },
        skip: source
            .filter(|_| !place.is_last)
            .map(|(span, _)| Skip { span, scale: one }),
    };
    let (zero_point, unit) = reading(&layer, place.input).unwrap_or((0.0, 1.0));
    let reads: Vec<Vec<f64>> = registers
        .iter()
        .map(|lanes| lanes.iter().map(|x| (x - zero_point) / unit).collect())
        .collect();
    let top = 2_f64.powi(i32::from(spec.reach));
    let mut parameters = HalfParameters {
        weights: Vec::new(),
        bias: Vec::new(),
        quantize: quantize.map(|bits| quantization(place, bits)),
    };
    for row in 0..place.rows {
        let raw: Vec<f64> = (0..place.inputs)
            .map(|_| 2.0 * random.unit() - 1.0)
            .collect();
        let sums = reads.iter().map(|x| dot(&raw, x));
        let (middle, reach) = spread(sums, 2_f64.powi(-20));
        let slack = 0.8 + 0.5 * random.unit();
        let shift = random.unit();
        let (gain, centre) = match spec.shape.outputs.get(row) {
            Some(OutputFormat::Unorm8 | OutputFormat::Unorm16) if place.is_last => {
                (0.5 * slack / reach, 0.5)
            }
            Some(OutputFormat::Snorm8) if place.is_last => (slack / reach, 0.0),
            _ => (top * slack / reach, top * (shift - 0.4) * 0.6),
        };
        // The nearest half; what is too large saturates.
        let nearest = |real: f64| Half::round(real as f32);
        parameters
            .weights
            .extend(raw.iter().map(|w| nearest(w * gain)));
        parameters.bias.push(nearest(centre - middle * gain));
    }
    layer.parameters = Parameters::Half(parameters);
    layer
}

/// Integers of these bits for sums that reach the spec's power of two.
fn quantization(place: &Place<'_>, bits: u8) -> Quantize {
    let is_positive = matches!(
        place.activation(),
        SpecActivation::Relu | SpecActivation::Table
    );
    let (low, _) = signed(bits);
    let (least, most) = limits::QUANTIZE_EXPONENT;
    let exponent = i32::from(bits) - 2 - i32::from(place.spec.reach) + i32::from(is_positive);
    Quantize {
        bits,
        exponent: exponent.clamp(i32::from(least), i32::from(most)) as i8,
        zero_point: if is_positive { low as i16 } else { 1 },
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
    // Scales here lie between 2^−31 and 2^26, within what a multiplier expresses.
    Multiplier::nearest(significand, exponent - width).unwrap_or(Multiplier::power_of_two(0))
}
