//! Assets of the texel suite whose arithmetic, widths or rules are others than those of eight-bit
//! integers under the normative profile.

use super::subjects::Subject;
use crate::flag::{self, Flag};
use crate::synthetic::{Spec, SpecActivation, SpecKind, SpecScale, corners, interpolated};
use ntmu_isa::accumulate::{Accumulator, Overflow};
use ntmu_isa::embed::Wave;
use ntmu_isa::filter::FilterRule;
use ntmu_isa::half::SumOrder;
use ntmu_isa::profile::Profile;
use ntmu_isa::round::Rounding;
use ntmu_isa::shape::OutputFormat;

/// All of them, in the order of the file.
pub(super) fn subjects() -> Vec<Subject> {
    let mut subjects = integers();
    subjects.extend(halves());
    subjects.extend(rules());
    subjects
}

pub(super) fn subject(
    name: &'static str,
    comment: &'static str,
    flags: &'static [Flag],
    spec: Spec,
) -> Subject {
    Subject {
        name,
        comment,
        flags,
        spec,
    }
}

/// Widths and activations of integer layers.
fn integers() -> Vec<Subject> {
    let small = || Spec::small(16, 8);
    let with = |activation| Spec {
        activation,
        ..small()
    };
    let mut floats = with(SpecActivation::Identity);
    floats.shape.outputs = vec![OutputFormat::Float16; 2];
    let mut padded = small();
    (
        padded.shape.wave,
        padded.shape.padding,
        padded.shape.octaves,
    ) = (Wave::Saw, 3, 3);
    let mut wide = small().with_bits(8, 16);
    (wide.shape.input_bits, wide.shape.outputs) = (16, vec![OutputFormat::Unorm16; 2]);
    let mut narrow = small().with_bits(4, 4);
    narrow.shape.input_bits = 4;
    let mut mixed = small();
    mixed.kinds = vec![
        SpecKind::Integer {
            weight_bits: 8,
            output_bits: 12,
        },
        SpecKind::Integer {
            weight_bits: 3,
            output_bits: 6,
        },
    ];
    let accumulator = |bits, overflow| {
        let mut spec = small();
        spec.profile.accumulator = Accumulator { bits, overflow };
        spec.activation = SpecActivation::Identity;
        spec
    };
    let mut residual = small();
    (residual.profile.residual_bits, residual.profile.bias_bits) = (8, 15);
    residual.blocks = 2;
    vec![
        subject(
            "gate-3",
            "hard GELU of an argument limited to 3",
            &[flag::GATE, flag::CLAMPED_GATE, flag::SKIP_PATH],
            with(SpecActivation::ClampedGelu),
        ),
        subject(
            "table",
            "a table for every hidden layer",
            &[flag::TABLE_LOOKUP, flag::SKIP_PATH],
            with(SpecActivation::Table),
        ),
        subject(
            "floats",
            "integer layers, fp16 channels",
            &[flag::FLOAT_OUTPUT, flag::SKIP_PATH],
            floats,
        ),
        subject(
            "padded",
            "three octaves of saw waves, three zeros after the level",
            &[flag::SAW, flag::PADDING, flag::SKIP_PATH],
            padded,
        ),
        subject(
            "sixteen-bits",
            "inputs and activations of sixteen bits",
            &[flag::INPUT_BITS, flag::LANE_BITS, flag::SKIP_PATH],
            wide,
        ),
        subject(
            "four-bits",
            "inputs, weights and activations of four bits",
            &[flag::INPUT_BITS, flag::LANE_BITS, flag::SKIP_PATH],
            narrow,
        ),
        subject(
            "widths",
            "weights of eight and three bits, activations of twelve and six, in turns",
            &[flag::WEIGHT_BITS, flag::LANE_BITS, flag::SKIP_PATH],
            mixed,
        ),
        subject(
            "accumulator-wrap",
            "accumulators of sixteen bits that wrap",
            &[
                flag::ALTERNATE_PROFILE,
                flag::NARROW_ACCUMULATOR,
                flag::SKIP_PATH,
            ],
            accumulator(16, Overflow::Wrap),
        ),
        subject(
            "accumulator-saturate",
            "accumulators of sixteen bits that saturate after every product",
            &[
                flag::ALTERNATE_PROFILE,
                flag::NARROW_ACCUMULATOR,
                flag::SKIP_PATH,
            ],
            accumulator(16, Overflow::Saturate),
        ),
        subject(
            "residual",
            "skip terms of eight bits, biases of fifteen",
            &[
                flag::ALTERNATE_PROFILE,
                flag::NARROW_RESIDUAL,
                flag::SKIP_PATH,
            ],
            residual,
        ),
    ]
}

/// fp16 layers, alone and among integer layers.
fn halves() -> Vec<Subject> {
    let small = || Spec::small(8, 8).with_halves();
    let summed = |sum| {
        let mut spec = small();
        spec.activation = SpecActivation::Leaky(3);
        spec.shape.outputs = vec![OutputFormat::Unorm16, OutputFormat::Float16];
        spec.profile.sum = sum;
        spec
    };
    let ordered: &[Flag] = &[
        flag::ALTERNATE_PROFILE,
        flag::HALF_LAYER,
        flag::SUM_ORDER,
        flag::SKIP_PATH,
        flag::FLOAT_OUTPUT,
    ];
    let mut large = small();
    (large.reach, large.activation) = (15, SpecActivation::Identity);
    large.shape.outputs = vec![OutputFormat::Float16, OutputFormat::Unorm8];
    let gelu = |activation| Spec {
        activation,
        ..small()
    };
    let mut mixed = Spec::small(8, 16);
    mixed.kinds = vec![
        SpecKind::Half { quantize: None },
        SpecKind::Integer {
            weight_bits: 8,
            output_bits: 14,
        },
        SpecKind::Half { quantize: Some(16) },
    ];
    mixed.hidden = vec![6, 6, 6];
    mixed.shape.outputs = vec![OutputFormat::Unorm16, OutputFormat::Snorm8];
    let mut floor = mixed.clone();
    floor.profile.convert = Rounding::Floor;
    floor.activation = SpecActivation::Identity;
    vec![
        subject(
            "half",
            "fp16 layers, leaky ReLU, fp16 and unorm16 channels",
            &[
                flag::HALF_LAYER,
                flag::LEAK,
                flag::SKIP_PATH,
                flag::FLOAT_OUTPUT,
            ],
            summed(SumOrder::Sequential),
        ),
        subject(
            "half-fused",
            "fp16 layers that sum in fp16",
            ordered,
            summed(SumOrder::Fused),
        ),
        subject(
            "half-tree-4",
            "fp16 layers that sum four products at a time",
            ordered,
            summed(SumOrder::Tree4),
        ),
        subject(
            "half-tree-8",
            "fp16 layers that sum eight products at a time",
            ordered,
            summed(SumOrder::Tree8),
        ),
        subject(
            "half-gate",
            "fp16 layers with a hard GELU",
            &[flag::HALF_LAYER, flag::GATE, flag::SKIP_PATH],
            gelu(SpecActivation::HardGelu),
        ),
        subject(
            "half-gate-3",
            "fp16 layers with a hard GELU of an argument limited to 3",
            &[
                flag::HALF_LAYER,
                flag::GATE,
                flag::CLAMPED_GATE,
                flag::SKIP_PATH,
            ],
            gelu(SpecActivation::ClampedGelu),
        ),
        subject(
            "half-large",
            "fp16 layers whose numbers reach 65504",
            &[
                flag::HALF_LAYER,
                flag::HALF_SATURATION,
                flag::FLOAT_OUTPUT,
                flag::SKIP_PATH,
            ],
            large,
        ),
        subject(
            "mixed",
            "fp16, integer and fp16 layers that give sixteen-bit integers, in turns",
            &[flag::HALF_LAYER, flag::MIXED_LAYERS, flag::LANE_BITS],
            mixed,
        ),
        subject(
            "mixed-floor",
            "as mixed, without an activation, sums floored to integers",
            &[
                flag::ALTERNATE_PROFILE,
                flag::HALF_LAYER,
                flag::MIXED_LAYERS,
                flag::CONVERT,
            ],
            floor,
        ),
    ]
}

/// Where grids are sampled otherwise.
fn rules() -> Vec<Subject> {
    let with = |interpolate, subtexel_bits| {
        let mut spec = Spec::small(16, 16);
        spec.profile = Profile {
            interpolate,
            subtexel_bits,
            ..Profile::NORMATIVE
        };
        // Every input matters, and sixteen bits show it.
        spec.shape.grids = [corners(1, 8, 3), interpolated(4, 8, 3)];
        spec.shape.outputs = vec![OutputFormat::Unorm16; 2];
        (spec.hidden, spec.scale) = (Vec::new(), SpecScale::Arbitrary);
        spec
    };
    let mut swapped = Spec::small(16, 16);
    swapped.shape.grids = [interpolated(3, 4, 3), corners(2, 5, 2)];
    let flags: &[Flag] = &[flag::ALTERNATE_PROFILE, flag::INTERPOLATION_RULE];
    vec![
        subject(
            "swapped",
            "grid 0 interpolated, the corners of grid 1 concatenated",
            &[flag::SAMPLING, flag::SKIP_PATH],
            swapped,
        ),
        subject(
            "factored",
            "weights from one rounded product of five subtexel bits",
            flags,
            with(FilterRule::Factored, 5),
        ),
        subject(
            "separable",
            "an interpolation that rounds along u, then along v",
            flags,
            with(FilterRule::Separable, 8),
        ),
        subject(
            "all-ones",
            "weights k/15, rounded along u, then along v",
            flags,
            with(FilterRule::AllOnes, 4),
        ),
    ]
}
