//! Kernel: the layers of a tile of texels, in the instructions of each processor.
//!
//! The only room of the workspace with `unsafe` code. There are two reasons for it: a vector load
//! or store takes a pointer, which here always comes from a reference to an array of that size; and
//! calling a function that needs a processor's feature is sound only where the processor has it,
//! which a [`Kernels`] proves.
//!
//! Kernels know slices and small structures, not assets. Each exists once, in `body`, over the
//! primitives of an instruction set; the tests hold every set against plain definitions.

mod body;
mod body_half;
mod body_rows;
mod half;
#[cfg(test)]
mod half_tests;
mod scalar;
#[cfg(test)]
mod tests;
mod tile;
mod weights;

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod avx512;
#[cfg(target_arch = "aarch64")]
mod neon;
mod peak;

pub use half::{HalfStep, HalfToInteger, LARGEST_HALF, round_to_half};
pub use tile::{
    BLOCK_ROWS, Finish, GROUP_ROWS, Halves, Integers, Pair, Quad, Scale, Step, Sums, TILE,
};
pub use weights::{Dense8, Dense16, DenseHalf, HalfOrder};

use super::path::Path;

/// The kernels of one instruction set, known to run on this processor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Kernels {
    set: Set,
}

/// The sets that this program was compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Set {
    Scalar,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
    #[cfg(target_arch = "aarch64")]
    Neon,
}

/// Calls a kernel of the set at hand.
macro_rules! dispatch {
    ($set:expr, $kernel:ident($($argument:expr),* $(,)?)) => {
        match $set {
            Set::Scalar => scalar::$kernel($($argument),*),
            // SAFETY: `Kernels::new` found AVX2 and FMA.
            #[cfg(target_arch = "x86_64")]
            Set::Avx2 => unsafe { avx2::$kernel($($argument),*) },
            // SAFETY: `Kernels::new` found AVX-512 F, BW and VNNI.
            #[cfg(target_arch = "x86_64")]
            Set::Avx512 => unsafe { avx512::$kernel($($argument),*) },
            // SAFETY: `Kernels::new` found NEON.
            #[cfg(target_arch = "aarch64")]
            Set::Neon => unsafe { neon::$kernel($($argument),*) },
        }
    };
}

impl Kernels {
    /// The kernels of a path, if this processor has its instructions.
    #[must_use]
    pub fn new(path: Path) -> Option<Kernels> {
        let set = match path {
            Path::Scalar => Some(Set::Scalar),
            Path::Avx2 => avx2_set(),
            Path::Avx512Vnni => avx512_set(),
            Path::Neon => neon_set(),
        };
        set.map(|set| Kernels { set })
    }

    /// The kernels of the fastest path of this processor.
    #[must_use]
    pub fn fastest() -> (Path, Kernels) {
        let scalar = Kernels { set: Set::Scalar };
        Path::ALL
            .into_iter()
            .filter_map(|path| Some((path, Kernels::new(path)?)))
            .next_back()
            .unwrap_or((Path::Scalar, scalar))
    }

    /// One 8-bit layer: stored bytes to stored bytes. `source` is the start of the skip path.
    ///
    /// # Panics
    /// When the input has fewer quads than the layer, or the output or the source fewer than the
    /// layer's rows fill.
    pub fn dense8(
        self,
        layer: &Dense8,
        finish: &Finish,
        input: &[Quad],
        source: Option<&[Quad]>,
        output: &mut [Quad],
    ) {
        let input = &input[..layer.quads];
        dispatch!(self.set, dense8(layer, finish, input, source, output));
    }

    /// One 8-bit layer with 32-bit results, clamped to the ranges of `finish`.
    ///
    /// # Panics
    /// When the input has fewer quads than the layer.
    pub fn emit8(self, layer: &Dense8, finish: &Finish, input: &[Quad], output: &mut [Sums]) {
        let input = &input[..layer.quads];
        dispatch!(self.set, emit8(layer, finish, input, output));
    }

    /// The sums of one 8-bit layer: bias plus products.
    ///
    /// # Panics
    /// When the input has fewer quads than the layer.
    pub fn raw8(self, layer: &Dense8, input: &[Quad], output: &mut [Sums]) {
        let input = &input[..layer.quads];
        dispatch!(self.set, raw8(layer, input, output));
    }

    /// One layer of values of up to 16 bits, clamped to the ranges of `finish`.
    ///
    /// # Panics
    /// When the input has fewer pairs than the layer.
    pub fn dense16(self, layer: &Dense16, finish: &Finish, input: &[Pair], output: &mut [Pair]) {
        let input = &input[..layer.pairs];
        dispatch!(self.set, dense16(layer, finish, input, output));
    }

    /// The sums of one layer of values of up to 16 bits, modulo 2^32.
    ///
    /// # Panics
    /// When the input has fewer pairs than the layer.
    pub fn raw16(self, layer: &Dense16, input: &[Pair], output: &mut [Sums]) {
        let input = &input[..layer.pairs];
        dispatch!(self.set, raw16(layer, input, output));
    }

    /// Activation and rescaling of sums, row by row, in place; neither skip path nor clamp.
    ///
    /// # Panics
    /// When there are more rows than `finish` has.
    pub fn finish_rows(self, finish: &Finish, rows: &mut [Sums]) {
        dispatch!(self.set, finish_rows(finish, rows));
    }

    /// Adds a rescaled skip path to rows of results; `before` is the source's zero.
    ///
    /// # Panics
    /// When the source has fewer lanes than there are rows.
    pub fn add_rows(self, skip: Scale, source: Integers<'_>, rows: &mut [Sums]) {
        dispatch!(self.set, add_rows(skip, source, rows));
    }

    /// Rows of results within `low..=high` as stored bytes.
    ///
    /// # Panics
    /// When the output has fewer quads than the rows fill.
    pub fn pack_quads(self, rows: &[Sums], (low, high): (i32, i32), output: &mut [Quad]) {
        dispatch!(self.set, pack_quads(rows, (low, high), output));
    }

    /// Rows of results within `low..=high` as words.
    ///
    /// # Panics
    /// When the output has fewer pairs than the rows fill.
    pub fn pack_pairs(self, rows: &[Sums], (low, high): (i32, i32), output: &mut [Pair]) {
        dispatch!(self.set, pack_pairs(rows, (low, high), output));
    }

    /// Signed bytes, \[texel\]\[input\], of up to a tile of texels with `count` inputs each, as lanes.
    ///
    /// # Panics
    /// When they are more than a tile, or the output has fewer quads than the inputs fill.
    pub fn bring(self, inputs: &[i8], count: usize, output: &mut [Quad]) {
        assert!(inputs.len() <= TILE * count, "a tile");
        dispatch!(self.set, bring(inputs, count, output));
    }

    /// The sums of one fp16 layer, in `f32`.
    ///
    /// # Panics
    /// When the input has more lanes than the layer's filled up ones.
    pub fn half_sums(self, layer: &DenseHalf, input: &[Halves], output: &mut [Halves]) {
        dispatch!(self.set, half_sums(layer, input, output));
    }

    /// What follows those sums, row by row, in place: the activation, then the skip path, then, if
    /// `is_rounded`, the rounding to fp16.
    pub fn half_finish(
        self,
        step: HalfStep,
        source: Option<&[Halves]>,
        is_rounded: bool,
        rows: &mut [Halves],
    ) {
        dispatch!(self.set, half_finish(step, source, is_rounded, rows));
    }

    /// One row of an fp16 layer's finished sums as integers.
    pub fn half_integers(self, rule: HalfToInteger, sums: &Halves, output: &mut Sums) {
        dispatch!(self.set, half_integers(rule, sums, output));
    }

    /// Integers as an fp16 layer reads them: (value − `zero`) · `factor`, rounded to fp16. The factor
    /// is a power of two.
    pub fn half_inputs(self, input: Integers<'_>, zero: i32, factor: f32, output: &mut [Halves]) {
        dispatch!(self.set, half_inputs(input, zero, factor, output));
    }

    /// The sums of one 8-bit layer of one texel, sixteen rows at a time.
    ///
    /// # Panics
    /// When the input has fewer quads than the layer.
    pub fn row_sums(self, layer: &Dense8, input: &[[u8; 4]], output: &mut [[i32; GROUP_ROWS]]) {
        let input = &input[..layer.quads];
        dispatch!(self.set, row_sums(layer, input, output));
    }

    /// What follows those sums, in place: activation, rescaling, skip path; no clamp.
    ///
    /// # Panics
    /// When the source has fewer bytes than the groups of `finish` have rows.
    pub fn row_finish(
        self,
        finish: &Finish,
        source: Option<&[u8]>,
        sums: &mut [[i32; GROUP_ROWS]],
    ) {
        dispatch!(self.set, row_finish(finish, source, sums));
    }

    /// Four cells of codes become one of stored bytes: `(Σ weight · code + addend) >> shift`. The
    /// weights are in 1/256 and sum to 256.
    ///
    /// # Panics
    /// When a cell is shorter than the output.
    pub fn interpolate(
        self,
        cells: [&[u8]; 4],
        weights: [u16; 4],
        addend: i32,
        shift: u32,
        output: &mut [u8],
    ) {
        dispatch!(self.set, interpolate(cells, weights, addend, shift, output));
    }

    /// Runs `steps` steps of the set's 8-bit dot product on registers alone, with as many sums at
    /// once as the kernels have; gives the products computed. For measuring the peak.
    #[doc(hidden)]
    #[must_use]
    pub fn peak8(self, steps: usize) -> u64 {
        peak::run(self.set, steps)
    }
}

#[cfg(target_arch = "x86_64")]
fn avx2_set() -> Option<Set> {
    (is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma")).then_some(Set::Avx2)
}

#[cfg(target_arch = "x86_64")]
fn avx512_set() -> Option<Set> {
    let found = is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx512vnni");
    found.then_some(Set::Avx512)
}

#[cfg(target_arch = "aarch64")]
fn neon_set() -> Option<Set> {
    std::arch::is_aarch64_feature_detected!("neon").then_some(Set::Neon)
}

#[cfg(not(target_arch = "x86_64"))]
fn avx2_set() -> Option<Set> {
    None
}

#[cfg(not(target_arch = "x86_64"))]
fn avx512_set() -> Option<Set> {
    None
}

#[cfg(not(target_arch = "aarch64"))]
fn neon_set() -> Option<Set> {
    None
}
