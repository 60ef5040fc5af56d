//! Recipe: assets of every kind.

use super::Random;
use ntmu_isa::Asset;
use ntmu_isa::accumulate::{Accumulator, Overflow, signed_range};
use ntmu_isa::activation::{Activation, TABLE_ENTRIES};
use ntmu_isa::asset::{Encoding, Map, Metadata, Parts};
use ntmu_isa::embed::Wave;
use ntmu_isa::filter::FilterRule;
use ntmu_isa::half::{Half, SumOrder};
use ntmu_isa::latent::LatentFormat;
use ntmu_isa::layer::{HalfParameters, IntegerParameters, Layer, Parameters, Quantize, Skip};
use ntmu_isa::position::{AddressMode, CornerSnap};
use ntmu_isa::profile::Profile;
use ntmu_isa::pyramid::Pyramid;
use ntmu_isa::rescale::{Multiplier, Requantizer};
use ntmu_isa::round::Rounding;
use ntmu_isa::shape::{GridShape, LaneFormat, OutputFormat, Sampling, Shape};

/// Which layers compute in fp16.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Halves {
    None,
    Some,
    All,
}

/// What an asset is made of; the rest is random.
#[derive(Clone, Debug)]
pub(crate) struct Recipe {
    pub(crate) shape: Shape,
    pub(crate) profile: Profile,
    pub(crate) halves: Halves,
    /// Bits of an integer register but the first, smallest and largest.
    pub(crate) lane_bits: (u8, u8),
    /// Outputs of each layer but the last.
    pub(crate) hidden: Vec<u16>,
    /// Skip spans to try; 0 is none. Taken only where the layers allow them.
    pub(crate) spans: Vec<u8>,
    /// Numbers far outside what layers have, so that everything saturates.
    pub(crate) is_wild: bool,
}

pub(crate) fn shape(
    size: (u32, u32),
    grids: [(u16, u8, u8); 2],
    outputs: Vec<OutputFormat>,
) -> Shape {
    let (width, height) = size;
    let grid = |(channels, bits, scale_log2), sampling| GridShape {
        channels,
        format: LatentFormat::new(bits).unwrap(),
        scale_log2,
        sampling,
    };
    let [first, second] = grids;
    Shape::whole_chain(
        width,
        height,
        [
            grid(first, Sampling::Corners),
            grid(second, Sampling::Interpolated),
        ],
        outputs,
    )
}

/// Any profile, with the accumulators as often narrow as not.
fn profile(random: &mut Random) -> Profile {
    Profile {
        subtexel_bits: random.within(4, 12) as u8,
        interpolate: random.one_of(&FilterRule::ALL),
        input: random.one_of(&Rounding::ALL),
        accumulator: Accumulator {
            bits: random.one_of(&[16, 18, 20, 24, 31, 32, 32]),
            overflow: random.one_of(&Overflow::ALL),
        },
        bias_bits: random.within(8, 32) as u8,
        leak: random.one_of(&Rounding::ALL),
        requantize: random.one_of(&Requantizer::ALL),
        skip: random.one_of(&Requantizer::ALL),
        residual_bits: random.one_of(&[8, 9, 12, 16, 31, 32]),
        output: random.one_of(&Requantizer::ALL),
        sum: random.one_of(&SumOrder::ALL),
        convert: random.one_of(&Rounding::ALL),
        ..Profile::NORMATIVE
    }
}

/// Where a layer stands.
struct Place<'a> {
    before: &'a [Layer],
    input: LaneFormat,
    inputs: u16,
    outputs: u16,
    is_last: bool,
}

impl Recipe {
    /// The ordinary synthesizer: `hidden` wide, with residual blocks.
    pub(crate) fn ordinary(shape: Shape, hidden: Vec<u16>) -> Recipe {
        Recipe {
            shape,
            profile: Profile::NORMATIVE,
            halves: Halves::None,
            lane_bits: (8, 8),
            hidden,
            spans: vec![0, 2],
            is_wild: false,
        }
    }

    /// Any shape, profile and synthesizer, small enough to decode many.
    pub(crate) fn any(random: &mut Random) -> Recipe {
        let size = (random.within(1, 70) as u32, random.within(1, 70) as u32);
        let grids = [(); 2].map(|()| {
            let channels = random.within(1, 13) as u16;
            let bits = random.within(1, 8) as u8;
            (channels, bits, random.within(1, 3) as u8)
        });
        let outputs = (0..random.within(1, 16))
            .map(|_| random.one_of(&OutputFormat::ALL))
            .collect();
        let mut shape = shape(size, grids, outputs);
        shape.mip_count = random.within(1, i64::from(shape.mip_count)) as u8;
        shape.octaves = random.within(0, 3) as u8;
        shape.wave = random.one_of(&Wave::ALL);
        shape.padding = random.one_of(&[0, 0, 1, 7, 15]);
        shape.input_bits = random.within(4, 16) as u8;
        shape.snap = random.one_of(&CornerSnap::ALL);
        shape.address_mode = random.one_of(&AddressMode::ALL);
        let first = random.within(1, 6);
        let several = Pyramid::new(first as u8, random.within(1, first) as u8);
        shape.pyramid = random.one_of(&[Pyramid::SINGLE, several.unwrap_or(Pyramid::SINGLE)]);
        for grid in &mut shape.grids {
            grid.sampling = random.one_of(&Sampling::ALL);
        }
        let widths = [random.within(1, 40) as u16, random.within(1, 40) as u16];
        let layers = random.within(0, 6);
        Recipe {
            shape,
            profile: profile(random),
            halves: random.one_of(&[Halves::None, Halves::Some, Halves::Some, Halves::All]),
            lane_bits: random.one_of(&[(4, 8), (4, 16), (9, 16)]),
            hidden: (0..layers).map(|_| random.one_of(&widths)).collect(),
            spans: vec![0, 1, 2, 3],
            is_wild: random.within(0, 4) == 0,
        }
    }

    pub(crate) fn asset(&self, random: &mut Random) -> Asset {
        let shape = &self.shape;
        let grids = [0, 1].map(|grid| {
            let max = i64::from(shape.grids[grid].format.max_code());
            let count = shape.grid_latents(grid);
            (0..count).map(|_| random.within(0, max) as u8).collect()
        });
        let mut layers: Vec<Layer> = Vec::new();
        let mut inputs = shape.input_count() as u16;
        let mut input = shape.input_format();
        let widths = self.hidden.iter().copied().chain([shape.channel_count()]);
        for (index, outputs) in widths.enumerate() {
            let layer = self.layer(
                random,
                &Place {
                    before: &layers,
                    input,
                    inputs,
                    outputs,
                    is_last: index == self.hidden.len(),
                },
            );
            input = layer.output_format();
            layers.push(layer);
            inputs = outputs;
        }
        Asset::new(Parts {
            shape: shape.clone(),
            profile: self.profile,
            grids,
            layers,
            metadata: Metadata {
                name: "test".to_owned(),
                maps: vec![Map {
                    name: "all".to_owned(),
                    first_channel: 0,
                    channel_count: shape.channel_count(),
                    encoding: Encoding::Linear,
                    bit_depth: 8,
                }],
                record: Vec::new(),
            },
        })
        .unwrap()
    }

    fn layer(&self, random: &mut Random, place: &Place<'_>) -> Layer {
        let is_half = match self.halves {
            Halves::None => false,
            Halves::Some => place.input == LaneFormat::Half || random.within(0, 1) == 0,
            Halves::All => true,
        };
        let activation = self.activation(random, place, is_half);
        Layer {
            inputs: place.inputs,
            outputs: place.outputs,
            skip: self.skip(random, place, is_half),
            parameters: if is_half {
                Parameters::Half(self.half(random, place))
            } else {
                Parameters::Integer(self.integer(random, place, activation))
            },
            activation,
        }
    }

    fn activation(&self, random: &mut Random, place: &Place<'_>, is_half: bool) -> Activation {
        match random.within(0, 5) {
            _ if place.is_last => Activation::Identity,
            1 => Activation::Relu,
            2 => Activation::Leaky {
                shift: random.within(1, 7) as u8,
            },
            3 | 4 => Activation::HardGelu {
                scale: if is_half {
                    Multiplier::power_of_two(0)
                } else {
                    self.scale(random, 18, 8)
                },
                is_clamped: random.within(0, 1) == 0,
            },
            5 if !is_half => Activation::Table,
            _ => Activation::Identity,
        }
    }

    /// From sums of about `from` bits to about `to`; anything at all if wild.
    fn scale(&self, random: &mut Random, from: i64, to: i64) -> Multiplier {
        let mantissa = random.within(1 << 30, i64::from(i32::MAX)) as i32;
        let shift = if self.is_wild {
            random.within(2, 62)
        } else {
            (30 + from - to + random.within(-1, 2)).clamp(2, 62)
        };
        Multiplier::new(mantissa, shift as u8).unwrap()
    }

    fn skip(&self, random: &mut Random, place: &Place<'_>, is_half: bool) -> Option<Skip> {
        let span = random.one_of(&self.spans);
        let at = place.before.len().checked_sub(usize::from(span))?;
        let source = place.before.get(at)?;
        let holds_halves = source.output_format() == LaneFormat::Half;
        let reaches = source.outputs == place.outputs && holds_halves == is_half;
        (span > 0 && reaches && !place.is_last).then(|| Skip {
            span,
            scale: if is_half {
                Multiplier::power_of_two(0)
            } else if self.is_wild {
                self.scale(random, 8, 8)
            } else {
                Multiplier::power_of_two(1)
            },
        })
    }

    /// Bits of a register, and its zero point.
    fn register(&self, random: &mut Random) -> (u8, i16) {
        let (low, high) = self.lane_bits;
        let bits = random.within(low.into(), high.into()) as u8;
        let (low, high) = signed_range(bits);
        (bits, random.within(low.into(), high.into()) as i16)
    }

    fn integer(
        &self,
        random: &mut Random,
        place: &Place<'_>,
        activation: Activation,
    ) -> IntegerParameters {
        let LaneFormat::Integer { bits, .. } = place.input else {
            panic!("an integer layer after halves");
        };
        let rows = usize::from(place.outputs);
        let weight_bits = random.within(2, 8) as u8;
        let (low, high) = signed_range(weight_bits);
        let weights = (0..rows * usize::from(place.inputs))
            .map(|_| random.within(low.into(), high.into()) as i8)
            .collect();
        let profile = &self.profile;
        let (low, high) = signed_range(profile.bias_bits.min(profile.accumulator.bits));
        let limit = if self.is_wild { i32::MAX } else { 20_000 };
        let bias = (0..rows)
            .map(|_| random.within(low.max(-limit).into(), high.min(limit).into()) as i32)
            .collect();
        let (output_bits, zero_point) = if place.is_last {
            (8, 0)
        } else {
            self.register(random)
        };
        let entries = match activation {
            Activation::Table => TABLE_ENTRIES,
            Activation::Identity
            | Activation::Relu
            | Activation::Leaky { .. }
            | Activation::HardGelu { .. } => 0,
        };
        let sum_bits = i64::from(bits + weight_bits) - 2 + i64::from(place.inputs.ilog2()) / 2;
        let (low, high) = signed_range(if self.is_wild { 16 } else { output_bits });
        IntegerParameters {
            weight_bits,
            weights,
            bias,
            scales: (0..rows)
                .map(|_| self.scale(random, sum_bits, output_bits.into()))
                .collect(),
            output_bits,
            zero_point,
            table: (0..entries)
                .map(|_| random.within(low.into(), high.into()) as i16)
                .collect(),
        }
    }

    /// A finite half: of magnitude 1 or so, now and then a zero or a subnormal number; anything at
    /// all if wild.
    fn number(&self, random: &mut Random) -> Half {
        let sign = random.within(0, 1) << 15;
        let magnitude = match random.within(0, 15) {
            _ if self.is_wild => random.within(0, 0x7bff),
            0 => 0,
            1 => random.within(0, 0x3ff),
            _ => random.within(0x2800, 0x3c00),
        };
        Half::from_bits((sign | magnitude) as u16)
    }

    fn half(&self, random: &mut Random, place: &Place<'_>) -> HalfParameters {
        let rows = usize::from(place.outputs);
        let macs = rows * usize::from(place.inputs);
        let quantizes = match self.halves {
            Halves::None | Halves::All => false,
            Halves::Some => random.within(0, 1) == 0,
        };
        HalfParameters {
            weights: (0..macs).map(|_| self.number(random)).collect(),
            bias: (0..rows).map(|_| self.number(random)).collect(),
            quantize: (quantizes && !place.is_last).then(|| {
                let (bits, zero_point) = self.register(random);
                let exponent = if self.is_wild {
                    random.within(-16, 24)
                } else {
                    i64::from(bits) - 2
                };
                Quantize {
                    bits,
                    exponent: exponent as i8,
                    zero_point,
                }
            }),
        }
    }
}
