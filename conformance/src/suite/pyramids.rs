//! Assets of the texel suite whose grids have several levels.

use super::arithmetics::subject;
use super::subjects::Subject;
use crate::flag;
use crate::synthetic::{Spec, corners, interpolated};
use ntmu_isa::position::{AddressMode, CornerSnap};
use ntmu_isa::pyramid::Pyramid;
use ntmu_isa::shape::Shape;

/// All of them, in the order of the file.
pub(super) fn subjects() -> Vec<Subject> {
    let with = |pyramid, spec: Spec| Spec {
        shape: Shape {
            pyramid,
            octaves: 0,
            ..spec.shape
        },
        hidden: Vec::new(),
        blocks: 0,
        ..spec
    };
    let mut ntc = with(Pyramid::NTC, Spec::small(40, 24));
    ntc.shape.grids = [corners(1, 2, 2), interpolated(2, 4, 3)];
    ntc.shape.snap = CornerSnap::Stride;
    let mut every = with(FINEST, Spec::small(21, 9));
    every.shape.grids = [corners(1, 3, 1), interpolated(1, 4, 2)];
    every.shape.address_mode = AddressMode::Clamp;
    vec![
        subject(
            "pyramid",
            "NTC's levels: level 0 for four mips, then one for every two; corners snapped to the stride, wrap",
            &[],
            ntc,
        ),
        subject(
            "pyramid-every-mip",
            "a level for every mip, no size a power of two, clamp",
            &[flag::NON_POWER_OF_TWO],
            every,
        ),
    ]
}

/// A level for every mip.
const FINEST: Pyramid = match Pyramid::new(1, 1) {
    Some(pyramid) => pyramid,
    None => panic!("1 ≤ each ≤ first"),
};
