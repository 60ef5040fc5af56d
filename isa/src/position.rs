//! Grid position: which cells surround a texel of a mip, and how far in it lies.
//!
//! One axis at a time; both axes obey the same rule.

/// Sixteenths: an axis weight has four fractional bits at every mip.
pub const PHASE_BITS: u8 = 4;

/// Where the first corner lies when the stride is more than one cell.
///
/// The paper (section 4.3) says that the other corners follow the first at the stride, and leaves
/// open whether the first is itself snapped to a multiple of the stride.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum CornerSnap {
    /// The first corner is the cell just below the texel centre.
    Cell,
    /// The first corner is the multiple of the stride just below the texel centre.
    Stride,
}

impl CornerSnap {
    /// Every choice, in the order of its code in a file.
    pub const ALL: [CornerSnap; 2] = [CornerSnap::Cell, CornerSnap::Stride];

    /// The name in tables, assembly and JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            CornerSnap::Cell => "cell",
            CornerSnap::Stride => "stride",
        }
    }

    /// The code in a file.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// The choice with this code, if there is one.
    #[must_use]
    pub fn from_code(code: u8) -> Option<CornerSnap> {
        CornerSnap::ALL.get(usize::from(code)).copied()
    }
}

/// What a corner outside the grid means.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum AddressMode {
    /// The grid repeats.
    Wrap,
    /// The grid repeats, every other copy reversed; the edge cell appears twice.
    Mirror,
    /// The edge cell continues.
    Clamp,
}

impl AddressMode {
    /// Every mode, in the order of its code in a file.
    pub const ALL: [AddressMode; 3] = [AddressMode::Wrap, AddressMode::Mirror, AddressMode::Clamp];

    /// The name in tables, assembly and JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            AddressMode::Wrap => "wrap",
            AddressMode::Mirror => "mirror",
            AddressMode::Clamp => "clamp",
        }
    }

    /// The code in a file.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// The mode with this code, if there is one.
    #[must_use]
    pub fn from_code(code: u8) -> Option<AddressMode> {
        AddressMode::ALL.get(usize::from(code)).copied()
    }

    /// The cell 0..`size` that `cell` means. `size` is at least 1.
    #[must_use]
    pub const fn resolve(self, cell: i32, size: u32) -> u32 {
        let size = size as i32;
        let resolved = match self {
            AddressMode::Wrap => cell.rem_euclid(size),
            AddressMode::Mirror => {
                let folded = cell.rem_euclid(2 * size);
                if folded < size {
                    folded
                } else {
                    2 * size - 1 - folded
                }
            }
            AddressMode::Clamp => {
                if cell < 0 {
                    0
                } else if cell >= size {
                    size - 1
                } else {
                    cell
                }
            }
        };
        resolved as u32
    }
}

/// One axis of the square of corners around a texel centre.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct AxisPosition {
    /// The first corner, in cells; may lie outside the grid (see [`AddressMode`]).
    pub first: i32,
    /// The distance from the first to the second corner, in cells: 1, or 2^(mip − scale).
    pub stride: u32,
    /// How far the texel centre lies from the first towards the second corner, in sixteenths:
    /// 0..16. The weight of the first corner is `16 − phase`, that of the second `phase`.
    pub phase: u8,
}

impl AxisPosition {
    /// The position of texel `texel` of mip `mip` in a grid at 1/2^`scale_log2` of the resolution.
    ///
    /// Real meaning (DESIGN, "grid position"): the texel centre is
    /// `g = (texel + ½)·2^mip / 2^scale − ½` in cells, and `phase = ⌊16·(g − first)/stride⌋`. In
    /// integers, `g` counts 1/2^(scale+1) cells and is exact. With scale ≤ 3 the floor loses
    /// nothing up to mip scale + 3, because the fraction is a multiple of 1/16 there.
    ///
    /// `texel` < 2^14 and `mip` ≤ 14, and `texel · 2^mip` is below the texture's size, so no
    /// intermediate leaves 31 bits.
    #[must_use]
    pub const fn of(texel: u32, mip: u8, scale_log2: u8, snap: CornerSnap) -> AxisPosition {
        let cell_log2 = scale_log2 as u32 + 1;
        let stride_log2 = (mip as u32).saturating_sub(scale_log2 as u32);
        let centre = ((2 * texel + 1) << mip) as i32 - (1 << scale_log2);
        let below = centre >> cell_log2;
        let first = match snap {
            CornerSnap::Cell => below,
            CornerSnap::Stride => (below >> stride_log2) << stride_log2,
        };
        let inside = centre - (first << cell_log2);
        let phase = (inside << PHASE_BITS) >> (cell_log2 + stride_log2);
        AxisPosition {
            first,
            stride: 1 << stride_log2,
            phase: phase as u8,
        }
    }

    /// The two corners as cells of a grid of `size` cells.
    #[must_use]
    pub const fn corners(self, size: u32, mode: AddressMode) -> [u32; 2] {
        [
            mode.resolve(self.first, size),
            mode.resolve(self.first + self.stride as i32, size),
        ]
    }
}

/// The weights of the corners (0,0), (1,0), (0,1), (1,1), in 1/256; their sum is 256.
#[must_use]
pub const fn corner_weights(x: AxisPosition, y: AxisPosition) -> [i32; 4] {
    let one = 1 << PHASE_BITS;
    let (wx, wy) = (x.phase as i32, y.phase as i32);
    [
        (one - wx) * (one - wy),
        wx * (one - wy),
        (one - wx) * wy,
        wx * wy,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_are_exact_up_to_three_mips_past_the_grid() {
        for scale in 1..=3_u8 {
            for mip in 0..=scale + 3 {
                for texel in 0..64_u32 {
                    for snap in CornerSnap::ALL {
                        let p = AxisPosition::of(texel, mip, scale, snap);
                        // Both sides times 32: 32·g = 32·first + 2·phase·stride.
                        let g32 = ((2 * i64::from(texel) + 1) << (mip + 4 - scale)) - 16;
                        let back =
                            32 * i64::from(p.first) + 2 * i64::from(p.phase) * i64::from(p.stride);
                        assert_eq!(g32, back, "texel {texel} mip {mip} scale {scale} {snap:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_snapped_corner_is_a_multiple_of_the_stride_and_lies_within_it() {
        for mip in 0..=14_u8 {
            for texel in 0..(1_u32 << (14 - mip)).min(512) {
                let p = AxisPosition::of(texel, mip, 3, CornerSnap::Stride);
                assert_eq!(p.first.rem_euclid(p.stride as i32), 0);
                assert!(p.phase < 16);
                let cell = AxisPosition::of(texel, mip, 3, CornerSnap::Cell);
                assert!(p.first <= cell.first && cell.first < p.first + p.stride as i32);
            }
        }
    }

    #[test]
    fn address_modes_agree_inside_and_differ_outside() {
        for size in 1..=64_u32 {
            for cell in -200..200_i32 {
                for mode in AddressMode::ALL {
                    let resolved = mode.resolve(cell, size);
                    assert!(resolved < size);
                    if (0..size as i32).contains(&cell) {
                        assert_eq!(resolved, cell as u32);
                    }
                }
            }
        }
        assert_eq!(AddressMode::ALL.map(|m| m.resolve(-1, 4)), [3, 0, 0]);
        assert_eq!(AddressMode::ALL.map(|m| m.resolve(5, 4)), [1, 2, 3]);
    }

    #[test]
    fn weights_sum_to_one() {
        let axis = |phase| AxisPosition {
            first: 0,
            stride: 1,
            phase,
        };
        for x in 0..16 {
            for y in 0..16 {
                assert_eq!(corner_weights(axis(x), axis(y)).iter().sum::<i32>(), 256);
            }
        }
    }
}
