//! Assets of a given shape with random weights, for measuring speed.

use ntmu_isa::Asset;
use ntmu_isa::activation::Activation;
use ntmu_isa::asset::{Encoding, Map, Metadata, Parts};
use ntmu_isa::half::Half;
use ntmu_isa::latent::LatentFormat;
use ntmu_isa::layer::{HalfParameters, IntegerParameters, Layer, Parameters, Skip};
use ntmu_isa::profile::Profile;
use ntmu_isa::rescale::Multiplier;
use ntmu_isa::shape::{GridShape, OutputFormat, Sampling, Shape};

/// What to make.
#[derive(Clone, Copy)]
pub(crate) struct Kind {
    /// In tables and JSON.
    pub(crate) name: &'static str,
    /// Width of the hidden layers.
    pub(crate) hidden: u16,
    /// Hidden layers before the blocks.
    pub(crate) plain: usize,
    /// Residual blocks of two layers.
    pub(crate) blocks: usize,
    /// Channels of the grids.
    pub(crate) grids: [u16; 2],
    /// Channels of the set.
    pub(crate) channels: usize,
    /// fp16 layers instead of int8 ones.
    pub(crate) is_half: bool,
}

/// A plain MLP with 64 inputs, two hidden layers and eight channels.
pub(crate) const fn plain(name: &'static str, hidden: u16) -> Kind {
    Kind {
        name,
        hidden,
        plain: 2,
        blocks: 0,
        grids: [8, 19],
        channels: 8,
        is_half: false,
    }
}

/// One hidden layer and four residual blocks, as the presets of the design have them.
pub(crate) const fn residual(name: &'static str, hidden: u16, grids: [u16; 2]) -> Kind {
    Kind {
        name,
        hidden,
        plain: 1,
        blocks: 4,
        grids,
        channels: 9,
        is_half: false,
    }
}

/// The same in fp16.
pub(crate) const fn half(name: &'static str, kind: Kind) -> Kind {
    Kind {
        name,
        is_half: true,
        ..kind
    }
}

pub(crate) const KINDS: [Kind; 8] = [
    plain("64-32-32-8", 32),
    plain("64-64-64-8", 64),
    plain("64-128-128-8", 128),
    residual("cntc-16", 64, [8, 16]),
    residual("cntc-32", 128, [16, 32]),
    half("64-32-32-8-fp16", plain("", 32)),
    half("64-64-64-8-fp16", plain("", 64)),
    half("64-128-128-8-fp16", plain("", 128)),
];

struct Random(u64);

impl Random {
    /// A number below `end`.
    fn below(&mut self, end: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) % end
    }
}

/// The multiplier nearest to a positive scale.
fn multiplier(scale: f64) -> Multiplier {
    let bits = scale.to_bits();
    let significand = (bits & ((1 << 52) - 1)) | 1 << 52;
    Multiplier::nearest(significand, (bits >> 52) as i32 - 1023 - 52).unwrap()
}

/// Weights within ±1/4, biases within 0..1.
fn half_parameters(weights: &[i8], outputs: u16, random: &mut Random) -> HalfParameters {
    HalfParameters {
        weights: weights
            .iter()
            .map(|&w| Half::from_fixed(i128::from(w), 9))
            .collect(),
        bias: (0..outputs)
            .map(|_| Half::from_fixed(i128::from(random.below(1024)), 10))
            .collect(),
        quantize: None,
    }
}

/// An asset of `size` × `size` texels, whole chain.
pub(crate) fn asset(kind: Kind, size: u32) -> Asset {
    let mut random = Random(0x1234_5678_9abc_def1);
    let four = LatentFormat::new(4).unwrap();
    let shape = Shape::whole_chain(
        size,
        size,
        [0, 1].map(|grid: usize| GridShape {
            channels: kind.grids[grid],
            format: four,
            scale_log2: 3,
            sampling: [Sampling::Corners, Sampling::Interpolated][grid],
        }),
        vec![OutputFormat::Unorm8; kind.channels],
    );
    let grids = [0, 1].map(|grid| {
        let latents = shape.grid_latents(grid);
        (0..latents).map(|_| random.below(16) as u8).collect()
    });
    let mut widths = vec![(kind.hidden, false); kind.plain];
    for _ in 0..kind.blocks {
        widths.extend([(kind.hidden, false), (kind.hidden, true)]);
    }
    widths.push((kind.channels as u16, false));
    let mut inputs = shape.input_count() as u16;
    let last = widths.len() - 1;
    let mut layers = Vec::new();
    for (index, &(outputs, has_skip)) in widths.iter().enumerate() {
        let weights: Vec<i8> = (0..inputs as usize * outputs as usize)
            .map(|_| random.below(255) as i8)
            .collect();
        // Stored activations lie above a zero point of -128: the bias takes out what that adds.
        let zero = if index == 0 { 0 } else { 128 };
        let reach = 74.0 * 60.0 * f64::from(inputs).sqrt();
        let bias: Vec<i32> = weights
            .chunks_exact(usize::from(inputs))
            .map(|row| zero * row.iter().map(|&w| i32::from(w)).sum::<i32>())
            .map(|bias| {
                bias + random.below(20_000) as i32 + if index == last { reach as i32 } else { 0 }
            })
            .collect();
        let parameters = if kind.is_half {
            Parameters::Half(half_parameters(&weights, outputs, &mut random))
        } else {
            Parameters::Integer(IntegerParameters {
                weight_bits: 8,
                weights,
                bias,
                scales: (0..outputs)
                    .map(|_| multiplier(100.0 / reach * (0.8 + random.below(400) as f64 / 1000.0)))
                    .collect(),
                output_bits: 8,
                zero_point: if index == last { 0 } else { -128 },
                table: Vec::new(),
            })
        };
        layers.push(Layer {
            inputs,
            outputs,
            parameters,
            activation: if index == last {
                Activation::Identity
            } else {
                Activation::Relu
            },
            skip: has_skip.then(|| Skip {
                span: 2,
                scale: multiplier(0.6),
            }),
        });
        inputs = outputs;
    }
    Asset::new(Parts {
        metadata: Metadata {
            name: kind.name.to_owned(),
            maps: vec![Map {
                name: "all".to_owned(),
                first_channel: 0,
                channel_count: kind.channels as u16,
                encoding: Encoding::Linear,
                bit_depth: 8,
            }],
            record: Vec::new(),
        },
        shape,
        profile: Profile::NORMATIVE,
        grids,
        layers,
    })
    .unwrap()
}

/// Texels of a batch: what the comparison with other engines uses too.
pub(crate) const BATCH: usize = 16_384;

/// Inputs of the synthesizer that use their whole range.
pub(crate) fn inputs(asset: &Asset) -> Vec<i8> {
    let mut state = 1_u32;
    (0..BATCH * asset.shape.input_count() as usize)
        .map(|_| {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as i8
        })
        .collect()
}
