//! Lane: the two ways in which an input of the synthesizer is held.

use super::kernel::{Kernels, Pair, Quad};

/// A byte (value + 128) or a word.
pub(super) trait Lane: Copy + std::fmt::Debug + Send + Sync + 'static {
    /// Several lanes of a tile.
    type Group;
    /// Lanes of a group.
    const COUNT: usize;
    /// What a held lane has more than its value.
    const STORED: i32;
    /// The value 0.
    const ZERO: Self;

    /// The lane that holds a value of its width.
    fn of(value: i32) -> Self;

    /// Sets the lanes of one texel, group after group.
    fn put(groups: &mut [Self::Group], texel: usize, lanes: &[Self]);

    /// Sets the same lanes for a run of texels.
    fn fill(groups: &mut [Self::Group], at: usize, length: usize, lanes: &[Self]);

    /// `((Σ weight · code << left) + addend) >> right` of four cells; the weights are in 1/256.
    fn interpolate(
        kernels: Kernels,
        cells: [&[u8]; 4],
        weights: [u16; 4],
        fold: Fold,
        lanes: &mut [Self],
    );
}

/// The rounding of an interpolated sum of codes, with zero points folded in; either `left` or
/// `right` is 0, `left` always for bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Fold {
    pub(super) left: u32,
    pub(super) addend: i32,
    pub(super) right: u32,
}

impl Lane for u8 {
    type Group = Quad;
    const COUNT: usize = 4;
    const STORED: i32 = 128;
    const ZERO: u8 = 128;

    fn of(value: i32) -> u8 {
        (value + 128) as u8
    }

    #[inline]
    fn put(groups: &mut [Quad], texel: usize, lanes: &[u8]) {
        let (whole, rest) = lanes.as_chunks::<4>();
        for (group, lanes) in groups.iter_mut().zip(whole) {
            group.0[texel] = *lanes;
        }
        if !rest.is_empty() {
            groups[whole.len()].0[texel][..rest.len()].copy_from_slice(rest);
        }
    }

    fn fill(groups: &mut [Quad], at: usize, length: usize, lanes: &[u8]) {
        for (group, lanes) in groups.iter_mut().zip(lanes.as_chunks::<4>().0) {
            group.0[at..at + length].fill(*lanes);
        }
    }

    #[inline]
    fn interpolate(
        kernels: Kernels,
        cells: [&[u8]; 4],
        weights: [u16; 4],
        fold: Fold,
        lanes: &mut [u8],
    ) {
        kernels.interpolate(cells, weights, fold.addend, fold.right, lanes);
    }
}

impl Lane for i16 {
    type Group = Pair;
    const COUNT: usize = 2;
    const STORED: i32 = 0;
    const ZERO: i16 = 0;

    fn of(value: i32) -> i16 {
        value as i16
    }

    #[inline]
    fn put(groups: &mut [Pair], texel: usize, lanes: &[i16]) {
        let (whole, rest) = lanes.as_chunks::<2>();
        for (group, lanes) in groups.iter_mut().zip(whole) {
            group.0[texel] = *lanes;
        }
        if let [last] = rest {
            groups[whole.len()].0[texel][0] = *last;
        }
    }

    fn fill(groups: &mut [Pair], at: usize, length: usize, lanes: &[i16]) {
        for (group, lanes) in groups.iter_mut().zip(lanes.as_chunks::<2>().0) {
            group.0[at..at + length].fill(*lanes);
        }
    }

    fn interpolate(
        _: Kernels,
        cells: [&[u8]; 4],
        weights: [u16; 4],
        fold: Fold,
        lanes: &mut [i16],
    ) {
        let [a, b, c, d] = cells.map(|cell| &cell[..lanes.len()]);
        for (at, lane) in lanes.iter_mut().enumerate() {
            let sum = i32::from(weights[0]) * i32::from(a[at])
                + i32::from(weights[1]) * i32::from(b[at])
                + i32::from(weights[2]) * i32::from(c[at])
                + i32::from(weights[3]) * i32::from(d[at]);
            *lane = (((sum << fold.left) + fold.addend) >> fold.right) as i16;
        }
    }
}
