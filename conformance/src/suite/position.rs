//! The position suite: where texels lie in a grid, along one axis.

use crate::emit::Builder;
use crate::flag::{self, Flag};
use crate::vector::{Answer, PositionAnswer, PositionQuery, Query, VectorFile};
use ntmu_isa::position::{AddressMode, AxisPosition, CornerSnap};

/// Texels of mip 0 along the axis, and the mips looked at. 1 stands for the short axis of a long
/// texture, whose one texel is asked for at every mip of the long one.
const AXES: [(u32, &[u8]); 5] = [
    (64, &[0, 2, 3, 4, 6]),
    (100, &[0, 1, 4, 6]),
    (37, &[0, 3, 5]),
    (1, &[0, 4, 9]),
    (16_384, &[0, 7, 10, 13, 14]),
];

/// The suite.
#[must_use]
pub fn suite() -> VectorFile {
    let about = "first corner, stride, phase and cells of a texel in a grid, along one axis";
    let mut builder = Builder::new("position", about);
    for (size, mips) in AXES {
        for scale_log2 in [3, 2, 1] {
            for &mip in mips {
                for texel in texels(size, mip) {
                    axis(&mut builder, size, scale_log2, mip, texel);
                }
            }
        }
    }
    builder.build()
}

/// The first, a middle one and the last texel of a mip.
fn texels(size: u32, mip: u8) -> Vec<u32> {
    let count = (size >> mip).max(1);
    let mut texels = vec![0, count * 2 / 5, count - 1];
    texels.dedup();
    texels
}

fn axis(builder: &mut Builder, size: u32, scale_log2: u8, mip: u8, texel: u32) {
    let cells = size.div_ceil(1 << scale_log2);
    let positions = CornerSnap::ALL.map(|snap| AxisPosition::of(texel, mip, scale_log2, snap));
    let snaps_differ = positions[0] != positions[1];
    for (snap, position) in CornerSnap::ALL.into_iter().zip(positions) {
        if snap == CornerSnap::Stride && !snaps_differ && mip <= scale_log2 {
            // With a stride of one cell both rules are the same rule: the first snap stands for both.
            continue;
        }
        let second = position.first + position.stride as i32;
        let is_seam = position.first < 0 || second >= cells as i32;
        let flags: Vec<Flag> = [
            (is_seam, flag::SEAM),
            (mip > scale_log2, flag::DEEP_MIP),
            (mip > scale_log2 + 3, flag::DROPPED_FRACTION),
            (snaps_differ, flag::SNAP),
            (position.phase == 0, flag::LATTICE),
            (!cells.is_power_of_two(), flag::NON_POWER_OF_TWO),
        ]
        .into_iter()
        .filter_map(|(holds, flag)| holds.then_some(flag))
        .collect();
        let flags = if flags.is_empty() {
            vec![flag::PLAIN]
        } else {
            flags
        };
        for address_mode in AddressMode::ALL {
            if !is_seam && address_mode != AddressMode::Wrap {
                continue;
            }
            let comment = format!(
                "texel {texel} of mip {mip} of {size}, grid at 1/{}",
                1 << scale_log2
            );
            let query = PositionQuery {
                texel,
                mip,
                scale_log2,
                snap,
                address_mode,
                cells,
            };
            let answer = PositionAnswer {
                first: position.first,
                stride: position.stride,
                phase: position.phase,
                corners: position.corners(cells, address_mode),
            };
            builder.exact(
                &comment,
                &flags,
                Query::Position(query),
                Answer::Position(answer),
            );
        }
    }
}
