//! Grid position: which cells surround a place of a mip, and how far in it lies.
//!
//! One axis at a time; both axes obey the same rule.

/// Sixteenths: at texel centres an axis weight has four fractional bits at every mip.
pub const PHASE_BITS: u8 = 4;

/// log2 of the largest coordinate in texels, of either sign: 16 bits before the point, as in the
/// 17.8 fixed point of Direct3D 11.3 (section 7.18.9).
pub const COORDINATE_LOG2: u8 = 16;

/// Where the first corner lies when the stride is more than one cell.
///
/// The paper (section 4.3) says that the other corners follow the first at the stride, and leaves
/// open whether the first is itself snapped to a multiple of the stride.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum CornerSnap {
    /// The first corner is the cell just below the place.
    Cell,
    /// The first corner is the multiple of the stride just below the place.
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

/// One axis of the square of corners around a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct AxisPosition {
    /// The first corner, in cells; may lie outside the grid (see [`AddressMode`]).
    pub first: i32,
    /// The distance from the first to the second corner, in cells: 1, or 2^(mip − scale).
    pub stride: u32,
    /// How far the place lies from the first towards the second corner, in 1/2^`phase_bits`. The
    /// weight of the first corner is `2^phase_bits − phase`, that of the second `phase`.
    pub phase: u16,
    /// Bits of the phase: [`PHASE_BITS`] at texel centres.
    pub phase_bits: u8,
}

impl AxisPosition {
    /// The position of texel `texel` of mip `mip` in a grid at 1/2^`scale_log2` of the resolution:
    /// that of its centre, with a phase of [`PHASE_BITS`].
    ///
    /// Real meaning (DESIGN, "grid position"): the texel centre is
    /// `g = (texel + ½)·2^mip / 2^scale − ½` in cells, and `phase = ⌊16·(g − first)/stride⌋`. With
    /// scale ≤ 3 the floor loses nothing up to mip scale + 3, because the fraction is a multiple of
    /// 1/16 there.
    #[must_use]
    pub const fn of(texel: u32, mip: u8, scale_log2: u8, snap: CornerSnap) -> AxisPosition {
        let centre = 2 * texel as i64 + 1;
        AxisPosition::at(centre, 1, mip, scale_log2, snap, PHASE_BITS)
    }

    /// The position of any place of mip `mip`, in a grid at 1/2^`scale_log2` of the resolution.
    ///
    /// `coordinate` counts 1/2^`bits` texels of the mip from the edge of texel 0, so the centre of a
    /// texel is `(2·texel + 1)·2^(bits − 1)`. It may be negative or beyond the mip; the corners are
    /// then the grid's to resolve. Real meaning: `g = coordinate/2^bits · 2^mip / 2^scale − ½` in
    /// cells, and `phase = ⌊2^phase_bits·(g − first)/stride⌋`. In integers, `g` counts
    /// 1/2^(scale + bits) cells and is exact.
    ///
    /// `bits` and `phase_bits` are 1..=12, `scale_log2` 1..=3, `mip` ≤ 14, and the coordinate is at
    /// most 2^[`COORDINATE_LOG2`] texels in magnitude: no intermediate leaves 45 bits, `first` lies
    /// within ±2^29, and the phase is below 2^12.
    #[must_use]
    pub const fn at(
        coordinate: i64,
        bits: u8,
        mip: u8,
        scale_log2: u8,
        snap: CornerSnap,
        phase_bits: u8,
    ) -> AxisPosition {
        let cell_log2 = scale_log2 as u32 + bits as u32;
        let stride_log2 = (mip as u32).saturating_sub(scale_log2 as u32);
        let place = (coordinate << mip) - (1 << (cell_log2 - 1));
        let below = place >> cell_log2;
        let first = match snap {
            CornerSnap::Cell => below,
            CornerSnap::Stride => (below >> stride_log2) << stride_log2,
        };
        let inside = place - (first << cell_log2);
        let phase = (inside << phase_bits) >> (cell_log2 + stride_log2);
        AxisPosition {
            first: first as i32,
            stride: 1 << stride_log2,
            phase: phase as u16,
            phase_bits,
        }
    }

    /// The phase as the fraction of a filter with `bits` bits, which are no fewer than its own.
    #[must_use]
    pub const fn fraction(self, bits: u8) -> u32 {
        (self.phase as u32) << (bits - self.phase_bits)
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
    fn outside_a_grid_wrap_repeats_mirror_reflects_and_clamp_stays() {
        for size in 1..=64_u32 {
            let n = size as i32;
            for cell in -200..200_i32 {
                let [wrap, mirror, clamp] = AddressMode::ALL.map(|m| m.resolve(cell, size) as i32);
                assert_eq!((wrap - cell) % n, 0);
                assert_eq!(clamp, cell.clamp(0, n - 1));
                // Walking outwards from the edge meets the cells in reverse order.
                let mut reflected = cell;
                while !(0..n).contains(&reflected) {
                    reflected = if reflected < 0 {
                        -1 - reflected
                    } else {
                        2 * n - 1 - reflected
                    };
                }
                assert_eq!(mirror, reflected);
            }
        }
    }

    /// The definition, by inequalities in units of 1/2^(scale + bits) cells.
    fn assert_by_definition(coordinate: i64, bits: u8, mip: u8, scale: u8, phase_bits: u8) {
        let one = 1_i128 << (scale + bits);
        let place = (i128::from(coordinate) << mip) - one / 2;
        let stride = 1_i128 << mip.saturating_sub(scale);
        for (snap, step) in [(CornerSnap::Cell, 1), (CornerSnap::Stride, stride)] {
            let p = AxisPosition::at(coordinate, bits, mip, scale, snap, phase_bits);
            let (first, phase) = (i128::from(p.first), i128::from(p.phase));
            let at = format!("{coordinate}/2^{bits} mip {mip} scale {scale} {snap:?} {phase_bits}");
            assert_eq!((i128::from(p.stride), p.phase_bits), (stride, phase_bits));
            assert_eq!(first.rem_euclid(step), 0, "{at}");
            assert!(first * one <= place && place < (first + step) * one, "{at}");
            let inside = (place - first * one) << phase_bits;
            let phase_unit = stride * one;
            assert!(
                phase * phase_unit <= inside && inside < (phase + 1) * phase_unit,
                "{at}"
            );
        }
    }

    #[test]
    fn every_place_obeys_the_definition_to_the_ends_of_the_range() {
        for (bits, mip) in (1..=12).flat_map(|bits| (0..=14).map(move |mip| (bits, mip))) {
            let limit = 1_i64 << (COORDINATE_LOG2 + bits);
            let near = (-130..=130)
                .chain(limit - 3..=limit)
                .chain(-limit..=3 - limit);
            for coordinate in near {
                for (scale, phase_bits) in [(1, 1), (1, 12), (2, 4), (2, 8), (3, 4), (3, 12)] {
                    assert_by_definition(coordinate, bits, mip, scale, phase_bits);
                }
            }
        }
    }

    #[test]
    fn the_centre_of_a_texel_is_the_texel_at_every_number_of_bits() {
        // Every texel of every mip of shapes of these sizes, whole chains.
        for size in [1_u32, 7, 64, 100, 256] {
            for mip in 0..=size.ilog2() as u8 {
                for texel in 0..(size >> mip).max(1) {
                    for (scale, snap) in (1..=3).flat_map(|s| CornerSnap::ALL.map(|c| (s, c))) {
                        let of = AxisPosition::of(texel, mip, scale, snap);
                        for bits in 1..=12 {
                            let centre = i64::from(2 * texel + 1) << (bits - 1);
                            let at = AxisPosition::at(centre, bits, mip, scale, snap, PHASE_BITS);
                            assert_eq!(at, of);
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn a_coarser_phase_is_a_finer_one_without_its_low_bits() {
        for (coordinate, mip) in (-600..600).flat_map(|c| (0..=14).map(move |mip| (c, mip))) {
            let at = |bits| AxisPosition::at(coordinate, 5, mip, 3, CornerSnap::Stride, bits);
            for bits in 1..12 {
                assert_eq!(at(bits).phase, at(12).phase >> (12 - bits));
                assert_eq!(at(bits).first, at(12).first);
            }
        }
    }
}
