//! The assets of the texel suite, each there for one family of rules.

use crate::flag::{self, Flag};
use crate::synthetic::{Spec, SpecActivation, SpecScale, corners, interpolated};
use ntmu_isa::position::{AddressMode, CornerSnap};
use ntmu_isa::profile::Profile;
use ntmu_isa::rescale::Requantizer;
use ntmu_isa::round::Rounding;
use ntmu_isa::shape::{OutputFormat, Shape};

/// One asset of the suite.
pub(super) struct Subject {
    /// Its name in the file.
    pub(super) name: &'static str,
    /// What it is for.
    pub(super) comment: &'static str,
    /// Of all of its cases.
    pub(super) flags: &'static [Flag],
    /// What it looks like.
    pub(super) spec: Spec,
}

/// All of them, in the order of the file. Their seeds are their places, so new ones go to the end.
pub(super) fn subjects() -> Vec<Subject> {
    let normative = Profile::NORMATIVE;
    let ties = |name, requantizer: Requantizer, activation, comment, flags| {
        let mut spec = Spec::small(16, 16);
        let one = requantizer;
        spec.profile = Profile {
            requantize: one,
            skip: one,
            output: one,
            ..normative
        };
        // Sixteen bits show a hidden LSB that eight would round away.
        spec.shape.outputs = vec![OutputFormat::Unorm16, OutputFormat::Snorm8];
        // Small weights drop few bits, so that ties are frequent.
        spec.scale = SpecScale::PowerOfTwo;
        spec = spec.with_bits(3, 8);
        spec.activation = activation;
        Subject {
            name,
            comment,
            flags,
            spec,
        }
    };
    let relu = SpecActivation::Relu;
    let leaky = SpecActivation::Leaky(3);
    let alternate: &[Flag] = &[
        flag::ALTERNATE_PROFILE,
        flag::SKIP_PATH,
        flag::TIES_EVERYWHERE,
    ];
    let mut subjects = vec![Subject {
        name: "plain",
        comment: "one hidden layer, normative profile",
        flags: &[],
        spec: Spec {
            blocks: 0,
            ..Spec::small(16, 16)
        },
    }];
    let deep = Spec {
        shape: Shape {
            snap: CornerSnap::Stride,
            grids: [corners(1, 4, 3), interpolated(2, 3, 3)],
            octaves: 0,
            ..Spec::small(128, 64).shape
        },
        blocks: 0,
        ..Spec::small(128, 64)
    };
    let mut deep_cell = deep.clone();
    deep_cell.shape.snap = CornerSnap::Cell;
    deep_cell.shape.address_mode = AddressMode::Clamp;
    let (name, comment) = ("deep", "eight mips, corners snapped to the stride, wrap");
    subjects.push(Subject {
        name,
        comment,
        flags: &[],
        spec: deep,
    });
    let (name, comment) = ("deep-cell", "eight mips, corners at the cell, clamp");
    subjects.push(Subject {
        name,
        comment,
        flags: &[],
        spec: deep_cell,
    });

    let odd = Spec {
        shape: Shape {
            address_mode: AddressMode::Mirror,
            grids: [corners(2, 1, 2), interpolated(1, 7, 1)],
            octaves: 3,
            outputs: OutputFormat::ALL.to_vec(),
            ..Spec::small(37, 21).shape
        },
        activation: leaky,
        ..Spec::small(37, 21).with_bits(2, 8)
    };
    let comment = "no size is a power of two, mirror, weights of two bits, all output formats";
    let flags = &[
        flag::SKIP_PATH,
        flag::LEAK,
        flag::NON_POWER_OF_TWO,
        flag::FLOAT_OUTPUT,
    ];
    subjects.push(Subject {
        name: "odd",
        comment,
        flags,
        spec: odd,
    });

    let eight = Spec {
        shape: Shape {
            grids: [corners(3, 8, 3), interpolated(3, 8, 2)],
            ..Spec::small(24, 24).shape
        },
        profile: Profile {
            input: Rounding::HalfEven,
            leak: Rounding::HalfAway,
            ..normative
        },
        activation: leaky,
        block_span: 3,
        ..Spec::small(24, 24)
    };
    let comment = "latents of eight bits, input rounding half-even, leak half-away, span of three";
    let flags = &[
        flag::EIGHT_BIT_LATENT,
        flag::ALTERNATE_PROFILE,
        flag::LEAK,
        flag::SKIP_PATH,
    ];
    subjects.push(Subject {
        name: "eight-bits",
        comment,
        flags,
        spec: eight,
    });

    let floor = Spec {
        profile: Profile {
            input: Rounding::Floor,
            leak: Rounding::Floor,
            ..normative
        },
        activation: SpecActivation::Leaky(1),
        blocks: 2,
        block_span: 1,
        ..Spec::small(9, 17)
    };
    let comment = "floors for input and leak, two blocks of one layer";
    let flags = &[flag::ALTERNATE_PROFILE, flag::LEAK, flag::SKIP_PATH];
    subjects.push(Subject {
        name: "floor",
        comment,
        flags,
        spec: floor,
    });

    let gate = Spec {
        activation: SpecActivation::HardGelu,
        ..Spec::small(16, 8)
    };
    let flags = &[flag::GATE, flag::SKIP_PATH];
    subjects.push(Subject {
        name: "gate",
        comment: "hard GELU",
        flags,
        spec: gate,
    });

    let one = Spec {
        hidden: Vec::new(),
        ..Spec::small(1, 1)
    };
    let comment = "one texel, no hidden layer";
    subjects.push(Subject {
        name: "one-texel",
        comment,
        flags: &[flag::ONE_TEXEL],
        spec: one,
    });

    let linear = Spec {
        shape: Shape {
            outputs: vec![OutputFormat::Unorm16, OutputFormat::Snorm8],
            ..Spec::small(32, 32).shape
        },
        activation: SpecActivation::Identity,
        scale: SpecScale::BelowTies,
        ..Spec::small(32, 32)
    };
    let comment = "no activation, scales that land just below ties, sixteen bits out";
    let flags = &[flag::SKIP_PATH];
    subjects.push(Subject {
        name: "linear",
        comment,
        flags,
        spec: linear,
    });

    let comment = "power-of-two scales, normative";
    let flags = &[flag::SKIP_PATH, flag::TIES_EVERYWHERE];
    subjects.push(ties("ties", Requantizer::Single, leaky, comment, flags));
    let comment = "power-of-two scales, normative, no activation: ties on both sides of zero";
    subjects.push(ties(
        "ties-linear",
        Requantizer::Single,
        SpecActivation::Identity,
        comment,
        flags,
    ));
    let comment = "power-of-two scales, double rounding";
    subjects.push(ties(
        "ties-double",
        Requantizer::Double,
        relu,
        comment,
        alternate,
    ));
    let comment = "power-of-two scales, ties to even";
    subjects.push(ties(
        "ties-even",
        Requantizer::HalfEven,
        relu,
        comment,
        alternate,
    ));
    let comment = "power-of-two scales, ties away from zero";
    subjects.push(ties(
        "ties-away",
        Requantizer::HalfAway,
        leaky,
        comment,
        alternate,
    ));
    let mut narrow = ties(
        "narrow",
        Requantizer::Narrow,
        relu,
        "16-bit multipliers",
        &[],
    );
    narrow.flags = &[
        flag::ALTERNATE_PROFILE,
        flag::SKIP_PATH,
        flag::NARROW_MANTISSA,
    ];
    narrow.spec.scale = SpecScale::BelowTies;
    subjects.push(narrow);
    subjects.extend(super::arithmetics::subjects());
    subjects.extend(super::pyramids::subjects());
    subjects
}
