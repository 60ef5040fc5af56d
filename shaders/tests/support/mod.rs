//! Assets of every kind, and a decoder of a few lines that uses nothing but the specification.

use ntmu_isa::Asset;
use ntmu_isa::activation::{Activation, gate, gate_argument, leak};
use ntmu_isa::asset::{Encoding, Map, Metadata, Parts};
use ntmu_isa::embed::{corner_input, lerp_input, level_input, wave_input};
use ntmu_isa::latent::LatentFormat;
use ntmu_isa::layer::{Layer, Skip};
use ntmu_isa::position::{AddressMode, AxisPosition, CornerSnap, corner_weights};
use ntmu_isa::profile::Profile;
use ntmu_isa::rescale::{Multiplier, Requantizer};
use ntmu_isa::round::{Rounding, saturate};
use ntmu_isa::shape::{GridShape, OutputFormat, Shape};
use ntmu_shaders::{Gpu, GridTap, LayerTap, Taps};

/// A device; `None`, and a line that says so, where there is none and none is demanded.
pub(crate) fn gpu() -> Option<Gpu> {
    match Gpu::open() {
        Ok(gpu) => Some(gpu),
        Err(error) if error.is_no_adapter() => {
            let demanded = ["NTMU_REQUIRE_ALL", "NTMU_REQUIRE_ADAPTER"]
                .iter()
                .find(|name| std::env::var_os(name).is_some_and(|v| v == "1"));
            assert!(demanded.is_none(), "{demanded:?} is 1 and {error}");
            eprintln!("SKIPPED: {error}");
            None
        }
        Err(error) => panic!("{error}"),
    }
}

/// A small generator; the same numbers everywhere.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn next(&mut self) -> u64 {
        // splitmix64 (Steele, Lea, Flood 2014).
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// `low..=high`.
    pub(crate) fn within(&mut self, low: i64, high: i64) -> i64 {
        low + (self.next() % (high - low + 1) as u64) as i64
    }

    pub(crate) fn one_of<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.within(0, choices.len() as i64 - 1) as usize]
    }

    /// A multiplier that brings a sum of `lanes` products to about eight bits.
    pub(crate) fn scale(&mut self, lanes: u32) -> Multiplier {
        let mantissa = self.within(1 << 30, i64::from(i32::MAX)) as i32;
        let shift = 35 + lanes.ilog2() as i64 / 2 + self.within(0, 3);
        Multiplier::new(mantissa, shift as u8).unwrap()
    }
}

/// What an asset is made of; the rest is random.
#[derive(Clone, Debug)]
pub(crate) struct Recipe {
    pub(crate) shape: Shape,
    pub(crate) profile: Profile,
    pub(crate) weight_bits: u8,
    /// Outputs of each layer but the last.
    pub(crate) hidden: Vec<u16>,
    /// Skip spans to try; 0 is none. Taken only where the widths allow them.
    pub(crate) spans: Vec<u8>,
    /// Multipliers far outside what layers have, so that everything saturates.
    pub(crate) is_wild: bool,
}

pub(crate) fn shape(
    size: (u32, u32),
    grids: [(u16, u8, u8); 2],
    outputs: Vec<OutputFormat>,
) -> Shape {
    let (width, height) = size;
    Shape {
        width,
        height,
        mip_count: Shape::max_mip_count(width, height),
        octaves: 3,
        snap: CornerSnap::Cell,
        address_mode: AddressMode::Wrap,
        grids: grids.map(|(channels, bits, scale_log2)| GridShape {
            channels,
            format: LatentFormat::new(bits).unwrap(),
            scale_log2,
        }),
        outputs,
    }
}

impl Recipe {
    /// The ordinary synthesizer: `hidden` wide, with residual blocks.
    pub(crate) fn ordinary(shape: Shape, hidden: Vec<u16>) -> Recipe {
        Recipe {
            shape,
            profile: Profile::NORMATIVE,
            weight_bits: 8,
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
        shape.snap = random.one_of(&CornerSnap::ALL);
        shape.address_mode = random.one_of(&AddressMode::ALL);
        let widths = [random.within(1, 40) as u16, random.within(1, 40) as u16];
        let layers = random.within(0, 6);
        Recipe {
            shape,
            profile: Profile {
                input: random.one_of(&Rounding::ALL),
                leak: random.one_of(&Rounding::ALL),
                requantize: random.one_of(&Requantizer::ALL),
                skip: random.one_of(&Requantizer::ALL),
                output: random.one_of(&Requantizer::ALL),
            },
            weight_bits: random.within(2, 8) as u8,
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
        let widths = self.hidden.iter().copied().chain([shape.channel_count()]);
        for (index, outputs) in widths.enumerate() {
            let is_last = index == self.hidden.len();
            layers.push(self.layer(random, &layers, inputs, outputs, is_last));
            inputs = outputs;
        }
        Asset::new(Parts {
            shape: shape.clone(),
            profile: self.profile,
            grids,
            weight_bits: self.weight_bits,
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

    fn layer(
        &self,
        random: &mut Random,
        before: &[Layer],
        inputs: u16,
        outputs: u16,
        is_last: bool,
    ) -> Layer {
        let limit = 1_i64 << (self.weight_bits - 1);
        let scale = |random: &mut Random| {
            if self.is_wild {
                let mantissa = random.within(1 << 30, i64::from(i32::MAX)) as i32;
                Multiplier::new(mantissa, random.within(2, 62) as u8).unwrap()
            } else {
                random.scale(u32::from(inputs))
            }
        };
        let bias = if self.is_wild { (1 << 30) - 1 } else { 20_000 };
        let activation = match random.within(0, 3) {
            _ if is_last => Activation::Identity,
            0 => Activation::Identity,
            1 => Activation::Relu,
            2 => Activation::Leaky {
                shift: random.within(1, 7) as u8,
            },
            _ => Activation::HardGelu {
                scale: scale(random),
            },
        };
        let span = random.one_of(&self.spans);
        let source = before.len().checked_sub(usize::from(span));
        let reaches = source.is_some_and(|at| before.get(at).is_some_and(|l| l.outputs == outputs));
        let skip = (span > 0 && reaches && !is_last).then(|| Skip {
            span,
            scale: if self.is_wild {
                scale(random)
            } else {
                Multiplier::power_of_two(1)
            },
        });
        Layer {
            inputs,
            outputs,
            weights: (0..usize::from(inputs) * usize::from(outputs))
                .map(|_| random.within(-limit, limit - 1) as i8)
                .collect(),
            bias: (0..outputs)
                .map(|_| random.within(-bias, bias) as i32)
                .collect(),
            scales: (0..outputs).map(|_| scale(random)).collect(),
            zero_point: if is_last {
                0
            } else {
                random.within(-128, 127) as i16
            },
            activation,
            skip,
        }
    }
}

/// One texel, straight from the specification.
pub(crate) fn reference(asset: &Asset, request: (u32, u32, u8)) -> Taps {
    let (x, y, mip) = request;
    let shape = &asset.shape;
    let profile = &asset.profile;
    let grids = [0, 1].map(|index| {
        let (width, height) = shape.grid_size(index);
        let axis = |t| AxisPosition::of(t, mip, shape.grids[index].scale_log2, shape.snap);
        let columns = axis(x).corners(width, shape.address_mode);
        let rows = axis(y).corners(height, shape.address_mode);
        let mut codes = Vec::new();
        for row in rows {
            for column in columns {
                codes.extend_from_slice(asset.cell(index, column, row));
            }
        }
        GridTap {
            x: axis(x),
            y: axis(y),
            columns,
            rows,
            codes,
        }
    });

    let [first, second] = [0, 1].map(|index: usize| shape.grids[index].format);
    let mut inputs: Vec<i32> = Vec::new();
    for &code in &grids[0].codes {
        inputs.push(corner_input(first.value(code), first, profile.input));
    }
    let weights = corner_weights(grids[1].x, grids[1].y);
    let channels = usize::from(shape.grids[1].channels);
    for channel in 0..channels {
        let value = |corner: usize| second.value(grids[1].codes[corner * channels + channel]);
        let sum = (0..4).map(|corner| weights[corner] * value(corner)).sum();
        inputs.push(lerp_input(sum, second, profile.input));
    }
    for octave in 0..shape.octaves {
        for (texel, quarter) in [(x, false), (x, true), (y, false), (y, true)] {
            inputs.push(wave_input(texel, mip, octave, quarter));
        }
    }
    inputs.push(level_input(mip, shape.mip_count));

    let mut vectors = vec![inputs];
    let mut layers = Vec::new();
    let mut codes = Vec::new();
    for (index, layer) in asset.layers.iter().enumerate() {
        let accumulators: Vec<i32> = (0..usize::from(layer.outputs))
            .map(|row| {
                let products = layer.row(row).iter().zip(&vectors[index]);
                layer.bias[row] + products.map(|(&w, &v)| i32::from(w) * v).sum::<i32>()
            })
            .collect();
        let activated: Vec<i32> = accumulators
            .iter()
            .zip(&layer.scales)
            .map(|(&accumulator, &scale)| match layer.activation {
                Activation::Identity => accumulator,
                Activation::Relu => accumulator.max(0),
                Activation::Leaky { shift } => leak(accumulator, shift, profile.leak),
                Activation::HardGelu { .. } => {
                    gate(gate_argument(accumulator, scale, profile.requantize))
                }
            })
            .collect();
        let mut outputs: Vec<i32> = Vec::new();
        if index + 1 == asset.layers.len() {
            for (row, &value) in activated.iter().enumerate() {
                let (low, high) = shape.outputs[row].range();
                let rescaled = profile.output.apply(value, layer.scales[row]);
                codes.push(rescaled.clamp(low, high));
            }
        } else {
            for (row, &value) in activated.iter().enumerate() {
                let scale = match layer.activation {
                    Activation::HardGelu { scale } => scale,
                    Activation::Identity | Activation::Relu | Activation::Leaky { .. } => {
                        layer.scales[row]
                    }
                };
                let mut sum = i64::from(profile.requantize.apply(value, scale));
                if let Some(skip) = layer.skip {
                    let source = index - usize::from(skip.span);
                    let zero_point = i32::from(asset.layers[source].zero_point);
                    let real = vectors[source + 1][row] - zero_point;
                    sum += i64::from(profile.skip.apply(real, skip.scale));
                }
                outputs.push(saturate(sum + i64::from(layer.zero_point), -128, 127));
            }
        }
        layers.push(LayerTap {
            accumulators,
            activated,
            outputs: outputs.iter().map(|&value| value as i16).collect(),
        });
        vectors.push(outputs);
    }
    Taps {
        request,
        grids,
        inputs: vectors[0].iter().map(|&value| value as i16).collect(),
        layers,
        codes,
    }
}
