//! Tile: the values of 64 texels, in the order in which the kernels read them.

use ntmu_isa::rescale::{Multiplier, Requantizer};

/// Texels of a tile: four vectors of sixteen.
pub const TILE: usize = 64;

/// Rows of a layer that a batch kernel makes at once.
pub const BLOCK_ROWS: usize = 4;

/// Rows of a layer that the latency kernel makes at once.
pub const GROUP_ROWS: usize = 16;

/// Four lanes of a tile of 8-bit values: \[texel\]\[lane\], stored as value + 128.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C, align(64))]
pub struct Quad(pub [[u8; 4]; TILE]);

impl Quad {
    /// All lanes zero, as stored.
    pub const ZERO: Quad = Quad([[0; 4]; TILE]);
}

/// Two lanes of a tile of values of up to 16 bits: \[texel\]\[lane\].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C, align(64))]
pub struct Pair(pub [[i16; 2]; TILE]);

impl Pair {
    /// All lanes zero.
    pub const ZERO: Pair = Pair([[0; 2]; TILE]);
}

/// One lane of a tile of accumulators or channel codes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C, align(64))]
pub struct Sums(pub [i32; TILE]);

impl Sums {
    /// All zero.
    pub const ZERO: Sums = Sums([0; TILE]);
}

/// One lane of a tile of fp16 values, held as `f32`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct Halves(pub [f32; TILE]);

impl Halves {
    /// All zero.
    pub const ZERO: Halves = Halves([0.0; TILE]);
}

/// Lanes of a tile of integers.
#[derive(Clone, Copy, Debug)]
pub enum Integers<'q> {
    /// Of up to 8 bits.
    Quads(&'q [Quad]),
    /// Of up to 16 bits.
    Pairs(&'q [Pair]),
}

impl Integers<'_> {
    /// One value.
    #[must_use]
    pub fn value(self, lane: usize, texel: usize) -> i32 {
        match self {
            Integers::Quads(quads) => i32::from(quads[lane / 4].0[texel][lane % 4]) - 128,
            Integers::Pairs(pairs) => i32::from(pairs[lane / 2].0[texel][lane % 2]),
        }
    }

    /// One lane of all texels.
    #[inline(always)]
    pub(super) fn lane(self, lane: usize, values: &mut [i32; TILE]) {
        match self {
            Integers::Quads(quads) => {
                // A shift of the whole quad is what vector instructions have.
                let (quad, bits) = (&quads[lane / 4].0, 8 * (lane % 4) as u32);
                for (value, &texel) in values.iter_mut().zip(quad) {
                    *value = (u32::from_le_bytes(texel) >> bits & 0xff) as i32 - 128;
                }
            }
            Integers::Pairs(pairs) => {
                let (pair, word) = (&pairs[lane / 2].0, lane % 2);
                for (value, texel) in values.iter_mut().zip(pair) {
                    *value = i32::from(texel[word]);
                }
            }
        }
    }
}

/// A rescaling with its offsets folded in: `(value · mantissa + addend) >> shift`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scale {
    pub(super) mantissa: i64,
    pub(super) addend: i64,
    pub(super) shift: u32,
}

/// The largest magnitude that a [`Scale`] may give, so that the sum of two still has room.
const LARGEST_RESULT: i128 = 1 << 29;

impl Scale {
    /// Maps everything to zero: the rows that fill a block up.
    pub const NONE: Scale = Scale {
        mantissa: 0,
        addend: 0,
        shift: 32,
    };

    /// `Requantizer::Single.apply(value − before, multiplier) + after` for all `value` of magnitude
    /// up to `largest`, if no step of it leaves 64 bits and no result leaves 29.
    ///
    /// The fold is exact: `before` moves through a product and `after` through a floor.
    #[must_use]
    pub fn fold(multiplier: Multiplier, before: i32, after: i32, largest: i64) -> Option<Scale> {
        let shift = u32::from(multiplier.shift());
        let mantissa = i128::from(multiplier.mantissa());
        let half = 1_i128 << (shift - 1);
        let addend = half - i128::from(before) * mantissa + (i128::from(after) << shift);
        let reach = i128::from(largest) * mantissa + addend.abs();
        let fits = reach < 1 << 63 && reach >> shift < LARGEST_RESULT && largest < 1 << 31;
        fits.then(|| Scale {
            mantissa: i64::from(multiplier.mantissa()),
            addend: addend as i64,
            shift,
        })
    }

    /// The scale of a skip path's stored bytes, which the kernels find at bits 16..24 of a lane:
    /// `Requantizer::Single.apply(byte − before, multiplier)` from `byte · 2^16`, with a shift of at
    /// least 32.
    ///
    /// Value, addend and shift grow alike, so the floor stays what it is.
    #[must_use]
    pub fn fold_skip(multiplier: Multiplier, before: i32) -> Option<Scale> {
        let Scale {
            mantissa,
            addend,
            shift,
        } = Scale::fold(multiplier, before, 0, 255)?;
        let raised = addend.checked_mul(1 << 16)?;
        let fits = (16..=46).contains(&shift) && raised.abs() < 1 << 62;
        fits.then_some(Scale {
            mantissa,
            addend: raised,
            shift: shift + 16,
        })
    }

    /// Whether `requantizer` is the one that [`Scale::fold`] folds.
    #[must_use]
    pub const fn folds(requantizer: Requantizer) -> bool {
        match requantizer {
            Requantizer::Single => true,
            Requantizer::Double
            | Requantizer::HalfEven
            | Requantizer::HalfAway
            | Requantizer::Narrow => false,
        }
    }

    /// The rescaled value.
    #[must_use]
    pub const fn apply(self, value: i32) -> i32 {
        ((value as i64 * self.mantissa + self.addend) >> self.shift) as i32
    }
}

/// What a fused kernel does to an accumulator before it is rescaled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Step {
    /// Nothing.
    Identity,
    /// max(x, 0).
    Relu,
    /// `max(x, (x + half) >> shift)`.
    ///
    /// For n ≥ 1 and a half h of 0 or 2^(n−1), with floor((x + h) / 2^n) = y: where x ≥ 0,
    /// x + h < (x + 1)·2^n, so y ≤ x; where x < 0, x + h ≥ x ≥ x·2^n, so y ≥ x. The larger of the
    /// two is therefore the leaky ReLU with ties up (h = 2^(n−1)) or with the floor (h = 0).
    Leaky {
        /// n.
        shift: u32,
        /// h.
        half: i32,
    },
    /// A hard GELU: the rows' scales give its argument, which is limited to `limit`; this one
    /// follows its product.
    Gate {
        /// From the product to the result.
        scale: Scale,
        /// The largest argument, of 16 bits.
        limit: i32,
    },
}

/// Sixteen scales side by side, split into even and odd rows as the 64-bit multipliers take them.
#[derive(Clone, Copy, Debug)]
#[repr(C, align(64))]
pub(super) struct ScaleGroup {
    pub(super) mantissa: [i32; GROUP_ROWS],
    pub(super) addend: [[i64; GROUP_ROWS / 2]; 2],
    pub(super) shift: [[i64; GROUP_ROWS / 2]; 2],
}

impl ScaleGroup {
    pub(super) fn new(scales: &[Scale]) -> ScaleGroup {
        let at = |row: usize| scales.get(row).copied().unwrap_or(Scale::NONE);
        let split = |part: fn(Scale) -> i64| {
            [0, 1].map(|odd| std::array::from_fn(|pair| part(at(2 * pair + odd))))
        };
        ScaleGroup {
            mantissa: std::array::from_fn(|row| at(row).mantissa as i32),
            addend: split(|scale| scale.addend),
            shift: split(|scale| i64::from(scale.shift)),
        }
    }
}

/// What follows the sums of a layer, where the fused kernels can do it.
#[derive(Clone, Debug)]
pub struct Finish {
    pub(super) step: Step,
    pub(super) scales: Vec<[Scale; BLOCK_ROWS]>,
    /// Every shift is at least 32: a result lies in the upper half of its product.
    pub(super) high: bool,
    pub(super) groups: Vec<ScaleGroup>,
    pub(super) skip: Option<Scale>,
    /// A range is narrower than that of stored bytes.
    pub(super) clamps: bool,
    pub(super) clamp: Vec<[(i32, i32); BLOCK_ROWS]>,
}

impl Finish {
    /// A finish with one scale and one range of results for each row, and the skip path's scale from
    /// [`Scale::fold_skip`].
    ///
    /// Kernels that write bytes store 0..=255 at most; they need no ranges where that is the range.
    #[must_use]
    pub fn new(step: Step, scales: &[Scale], skip: Option<Scale>, ranges: &[(i32, i32)]) -> Finish {
        let blocks = scales.len().div_ceil(BLOCK_ROWS);
        let block = |b: usize| std::array::from_fn(|r| b * BLOCK_ROWS + r);
        let gate = match step {
            Step::Gate { scale, .. } => scale,
            Step::Identity | Step::Relu | Step::Leaky { .. } => Scale::NONE,
        };
        Finish {
            step,
            high: scales.iter().chain([&gate]).all(|scale| scale.shift >= 32),
            scales: (0..blocks)
                .map(|b| block(b).map(|row| scales.get(row).copied().unwrap_or(Scale::NONE)))
                .collect(),
            groups: scales.chunks(GROUP_ROWS).map(ScaleGroup::new).collect(),
            skip,
            clamps: ranges.iter().any(|&range| range != (0, 255)),
            clamp: (0..blocks)
                .map(|b| block(b).map(|row| ranges.get(row).copied().unwrap_or((0, 0))))
                .collect(),
        }
    }
}
