//! Weights: the parameters of a layer, in the order in which the kernels read them.

use super::tile::{BLOCK_ROWS, GROUP_ROWS};

/// An 8-bit layer: `rows` rows of `inputs` signed bytes, filled up with zeros to whole blocks.
#[derive(Clone, Debug)]
pub struct Dense8 {
    pub(super) rows: usize,
    pub(super) quads: usize,
    /// \[block of rows\]\[quad of inputs\]\[row\]\[input\].
    pub(super) bytes: Vec<[[i8; 4]; BLOCK_ROWS]>,
    /// The same at 16 bits, inputs in the order 0, 2, 1, 3: what is left when a quad of bytes is
    /// split into even and odd bytes.
    #[cfg(target_arch = "x86_64")]
    pub(super) words: Vec<[[i16; 4]; BLOCK_ROWS]>,
    /// The bias, less the 128 that stored bytes have too much.
    pub(super) bias: Vec<[i32; BLOCK_ROWS]>,
    /// \[group of rows\]\[quad of inputs\]\[row\]\[input\], for the latency kernel.
    pub(super) groups: Vec<[[i8; 4]; GROUP_ROWS]>,
    pub(super) group_bias: Vec<[i32; GROUP_ROWS]>,
}

impl Dense8 {
    /// Packs rows of `inputs` weights, row after row, and one bias for each row.
    #[must_use]
    pub fn new(weights: &[i8], inputs: usize, bias: &[i32]) -> Dense8 {
        let rows = bias.len();
        let quads = inputs.div_ceil(4);
        let weight = |row: usize, quad: usize, lane: usize| {
            let input = 4 * quad + lane;
            if row < rows && input < inputs {
                weights[row * inputs + input]
            } else {
                0
            }
        };
        let corrected: Vec<i32> = bias
            .iter()
            .zip(weights.chunks_exact(inputs))
            .map(|(&bias, row)| {
                bias.wrapping_sub(128 * row.iter().map(|&w| i32::from(w)).sum::<i32>())
            })
            .collect();
        let of_row = |row: usize| corrected.get(row).copied().unwrap_or(0);
        let (blocks, groups) = (rows.div_ceil(BLOCK_ROWS), rows.div_ceil(GROUP_ROWS));
        let bytes: Vec<[[i8; 4]; BLOCK_ROWS]> = (0..blocks * quads)
            .map(|at| {
                let (block, quad) = (at / quads, at % quads);
                std::array::from_fn(|r| {
                    std::array::from_fn(|lane| weight(block * BLOCK_ROWS + r, quad, lane))
                })
            })
            .collect();
        Dense8 {
            rows,
            quads,
            #[cfg(target_arch = "x86_64")]
            words: bytes
                .iter()
                .map(|block| block.map(|row| [0, 2, 1, 3].map(|lane: usize| i16::from(row[lane]))))
                .collect(),
            bytes,
            bias: (0..blocks)
                .map(|b| std::array::from_fn(|r| of_row(b * BLOCK_ROWS + r)))
                .collect(),
            groups: (0..groups * quads)
                .map(|at| {
                    let (group, quad) = (at / quads, at % quads);
                    std::array::from_fn(|r| {
                        std::array::from_fn(|lane| weight(group * GROUP_ROWS + r, quad, lane))
                    })
                })
                .collect(),
            group_bias: (0..groups)
                .map(|g| std::array::from_fn(|r| of_row(g * GROUP_ROWS + r)))
                .collect(),
        }
    }

    /// Rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// Quads of inputs.
    #[must_use]
    pub fn quads(&self) -> usize {
        self.quads
    }
}

/// A layer with weights and activations of up to 16 bits; its sums wrap at 32 bits.
#[derive(Clone, Debug)]
pub struct Dense16 {
    pub(super) pairs: usize,
    /// \[block of rows\]\[pair of inputs\]\[row\]\[input\].
    pub(super) weights: Vec<[[i16; 2]; BLOCK_ROWS]>,
    pub(super) bias: Vec<[i32; BLOCK_ROWS]>,
}

impl Dense16 {
    /// Packs rows of `inputs` weights, row after row, and one bias for each row.
    #[must_use]
    pub fn new(weights: &[i16], inputs: usize, bias: &[i32]) -> Dense16 {
        let (rows, pairs) = (bias.len(), inputs.div_ceil(2));
        let blocks = rows.div_ceil(BLOCK_ROWS);
        let weight = |row: usize, input: usize| {
            if row < rows && input < inputs {
                weights[row * inputs + input]
            } else {
                0
            }
        };
        Dense16 {
            pairs,
            weights: (0..blocks * pairs)
                .map(|at| {
                    let (block, pair) = (at / pairs, at % pairs);
                    std::array::from_fn(|r| {
                        [0, 1].map(|lane| weight(block * BLOCK_ROWS + r, 2 * pair + lane))
                    })
                })
                .collect(),
            bias: (0..blocks)
                .map(|b| {
                    std::array::from_fn(|r| bias.get(b * BLOCK_ROWS + r).copied().unwrap_or(0))
                })
                .collect(),
        }
    }

    /// Pairs of inputs.
    #[must_use]
    pub fn pairs(&self) -> usize {
        self.pairs
    }
}

/// A layer whose weights, biases and activations are fp16 values held as `f32`.
#[derive(Clone, Debug)]
pub struct DenseHalf {
    /// Inputs, filled up to whole groups of the order.
    pub(super) inputs: usize,
    pub(super) order: HalfOrder,
    /// \[block of rows\]\[input\]\[row\].
    pub(super) weights: Vec<[f32; BLOCK_ROWS]>,
    pub(super) bias: Vec<[f32; BLOCK_ROWS]>,
}

/// The orders of sums in `f32`, see `ntmu_isa::half::SumOrder`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HalfOrder {
    /// One product after the other.
    Sequential,
    /// Groups of four, each a balanced tree.
    Tree4,
    /// Groups of eight, each a balanced tree.
    Tree8,
}

impl HalfOrder {
    /// Every order.
    pub const ALL: [HalfOrder; 3] = [HalfOrder::Sequential, HalfOrder::Tree4, HalfOrder::Tree8];

    /// Products of a group.
    const fn group(self) -> usize {
        match self {
            HalfOrder::Sequential => 1,
            HalfOrder::Tree4 => 4,
            HalfOrder::Tree8 => 8,
        }
    }
}

impl DenseHalf {
    /// Packs rows of `inputs` weights, row after row, and one bias for each row.
    ///
    /// The last group of a tree is filled up with weights of +0, whose products are +0 because the
    /// kernels fill up the inputs with +0 too.
    #[must_use]
    pub fn new(weights: &[f32], inputs: usize, bias: &[f32], order: HalfOrder) -> DenseHalf {
        let rows = bias.len();
        let blocks = rows.div_ceil(BLOCK_ROWS);
        let padded = inputs.next_multiple_of(order.group());
        let weight = |row: usize, input: usize| {
            if row < rows && input < inputs {
                weights[row * inputs + input]
            } else {
                0.0
            }
        };
        DenseHalf {
            inputs: padded,
            order,
            weights: (0..blocks * padded)
                .map(|at| {
                    let (block, input) = (at / padded, at % padded);
                    std::array::from_fn(|r| weight(block * BLOCK_ROWS + r, input))
                })
                .collect(),
            bias: (0..blocks)
                .map(|b| {
                    std::array::from_fn(|r| bias.get(b * BLOCK_ROWS + r).copied().unwrap_or(0.0))
                })
                .collect(),
        }
    }

    /// Inputs that the kernels read: the layer's, filled up to whole groups of its order.
    #[must_use]
    pub fn inputs(&self) -> usize {
        self.inputs
    }
}
