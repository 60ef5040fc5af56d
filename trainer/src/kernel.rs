//! Matrix products on plain slices, and the dispatch of vector code.
//!
//! A step of the refinement is a few hundred products of matrices with a side of 16 to 128. The
//! general products of a tensor library spend most of their time around such a matrix; here every
//! inner loop is a register tile of [`ROWS`] rows by one, two or three vectors.
//!
//! All matrices are row-major. Row counts are multiples of [`ROWS`], column counts of [`LANES`].

use macerator::{AutoArch, Simd, WithSimd};

/// Floats of one vector of the register tile; every width is padded to a multiple of it.
pub(crate) const LANES: usize = 16;

/// Rows of the register tile.
pub(crate) const ROWS: usize = 8;

/// `n` rounded up to a multiple of [`LANES`].
pub(crate) const fn padded(n: usize) -> usize {
    n.div_ceil(LANES) * LANES
}

/// A computation that gains from wide vectors.
///
/// `run` and what it calls must be `#[inline(always)]`: only code that ends up inside the
/// dispatcher's function is compiled for the processor's vectors.
pub(crate) trait Vectorised {
    /// The computation. `FUSED` says that a multiply-add is one instruction.
    fn run<const FUSED: bool>(self);
}

struct Dispatched<T>(T);

impl<T: Vectorised> WithSimd for Dispatched<T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self) {
        if <f32 as macerator::VFma>::is_accelerated::<S>() {
            self.0.run::<true>();
        } else {
            self.0.run::<false>();
        }
    }
}

/// Runs `work` with the widest vectors of this processor.
pub(crate) fn vectorised<T: Vectorised>(work: T) {
    AutoArch::new().dispatch(Dispatched(work));
}

/// a·b + c; fused where that is one instruction, because the library call is very slow.
#[inline(always)]
pub(crate) fn multiply_add<const FUSED: bool>(a: f32, b: f32, c: f32) -> f32 {
    if FUSED { a.mul_add(b, c) } else { a * b + c }
}

type Accumulators<const N: usize> = [[[f32; LANES]; N]; ROWS];

#[inline(always)]
fn vector(slice: &[f32], at: usize) -> [f32; LANES] {
    let mut out = [0.0; LANES];
    out.copy_from_slice(&slice[at..at + LANES]);
    out
}

#[inline(always)]
fn accumulate<const FUSED: bool>(x: f32, b: &[f32; LANES], mut c: [f32; LANES]) -> [f32; LANES] {
    for i in 0..LANES {
        c[i] = multiply_add::<FUSED>(x, b[i], c[i]);
    }
    c
}

#[inline(always)]
fn store<const N: usize, const ADD: bool>(acc: &Accumulators<N>, c: &mut [f32], stride: usize) {
    for (row, acc) in c.chunks_mut(stride).zip(acc) {
        for (v, acc) in acc.iter().enumerate() {
            let out = &mut row[v * LANES..(v + 1) * LANES];
            for i in 0..LANES {
                out[i] = if ADD { out[i] + acc[i] } else { acc[i] };
            }
        }
    }
}

/// `ROWS` rows and `N` vectors of columns of `A·B`; `A` is rows × depth.
#[inline(always)]
fn tile<const FUSED: bool, const N: usize, const ADD: bool>(
    depth: usize,
    a: (&[f32], usize),
    b: (&[f32], usize),
    c: (&mut [f32], usize),
) {
    let mut acc: Accumulators<N> = [[[0.0; LANES]; N]; ROWS];
    let rows: [&[f32]; ROWS] = std::array::from_fn(|r| &a.0[r * a.1..r * a.1 + depth]);
    for (k, b_row) in b.0.chunks(b.1).take(depth).enumerate() {
        let b_row: [[f32; LANES]; N] = std::array::from_fn(|v| vector(b_row, v * LANES));
        for r in 0..ROWS {
            let x = rows[r][k];
            for v in 0..N {
                acc[r][v] = accumulate::<FUSED>(x, &b_row[v], acc[r][v]);
            }
        }
    }
    store::<N, ADD>(&acc, c.0, c.1);
}

/// `ROWS` rows and `N` vectors of columns of `Aᵀ·B`; `A` is depth × rows.
#[inline(always)]
fn tile_transposed<const FUSED: bool, const N: usize>(
    a: (&[f32], usize),
    b: (&[f32], usize),
    c: (&mut [f32], usize),
) {
    let mut acc: Accumulators<N> = [[[0.0; LANES]; N]; ROWS];
    for (a_row, b_row) in a.0.chunks(a.1).zip(b.0.chunks(b.1)) {
        let mut xs = [0.0; ROWS];
        xs.copy_from_slice(&a_row[..ROWS]);
        let b_row: [[f32; LANES]; N] = std::array::from_fn(|v| vector(b_row, v * LANES));
        for r in 0..ROWS {
            for v in 0..N {
                acc[r][v] = accumulate::<FUSED>(xs[r], &b_row[v], acc[r][v]);
            }
        }
    }
    store::<N, true>(&acc, c.0, c.1);
}

/// Calls `$tile` for blocks of columns: two vectors at a time, three where that leaves none over.
macro_rules! for_columns {
    ($columns:expr, |$at:ident, $n:ident| $body:expr) => {
        let mut $at = 0;
        while $at < $columns {
            let left = ($columns - $at) / LANES;
            if left == 1 {
                const $n: usize = 1;
                $body;
                $at += LANES;
            } else if left == 3 {
                const $n: usize = 3;
                $body;
                $at += 3 * LANES;
            } else {
                const $n: usize = 2;
                $body;
                $at += 2 * LANES;
            }
        }
    };
}

/// `C = A·B`, or `C += A·B` with `ADD`: `A` is rows × depth, `B` depth × columns.
///
/// `depth` may be less than `A`'s row length `a_stride`: what lies beyond is not read.
#[inline(always)]
pub(crate) fn product<const FUSED: bool, const ADD: bool>(
    (a, a_stride): (&[f32], usize),
    b: &[f32],
    c: &mut [f32],
    depth: usize,
    columns: usize,
) {
    for (a, c) in a.chunks(a_stride * ROWS).zip(c.chunks_mut(columns * ROWS)) {
        for_columns!(columns, |at, N| tile::<FUSED, N, ADD>(
            depth,
            (a, a_stride),
            (&b[at..], columns),
            (&mut c[at..], columns)
        ));
    }
}

/// `C += Aᵀ·B`: `A` is depth × rows, `B` depth × columns.
#[inline(always)]
pub(crate) fn product_transposed<const FUSED: bool>(
    (a, rows): (&[f32], usize),
    (b, columns): (&[f32], usize),
    c: &mut [f32],
) {
    for (row, c) in (0..rows).step_by(ROWS).zip(c.chunks_mut(columns * ROWS)) {
        for_columns!(columns, |at, N| tile_transposed::<FUSED, N>(
            (&a[row..], rows),
            (&b[at..], columns),
            (&mut c[at..], columns)
        ));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Purpose, Stream};

    fn matrix(seed: u64, len: usize) -> Vec<f32> {
        let stream = Stream::new(seed, Purpose::Batch, 0);
        // Small integers: every product and sum is exact, so the results must be equal.
        (0..len as u64).map(|i| stream.below(i, 17) as f32 - 8.0).collect()
    }

    struct Both<'a> {
        a: &'a [f32],
        b: &'a [f32],
        plain: &'a mut [f32],
        transposed: &'a mut [f32],
        shape: (usize, usize, usize),
    }

    impl Vectorised for Both<'_> {
        #[inline(always)]
        fn run<const FUSED: bool>(self) {
            let (rows, depth, columns) = self.shape;
            product::<FUSED, false>((self.a, depth), self.b, self.plain, depth, columns);
            // Aᵀ·C with C = A·B, on top of what is there.
            product_transposed::<FUSED>((self.a, depth), (self.plain, columns), self.transposed);
            assert_eq!(self.plain.len(), rows * columns);
        }
    }

    #[test]
    fn products_equal_the_definition_at_every_column_count() {
        for columns in [16, 32, 48, 64, 80, 128] {
            let (rows, depth) = (24, 48);
            let (a, b) = (matrix(1, rows * depth), matrix(2, depth * columns));
            let mut plain = vec![9.0; rows * columns];
            let mut transposed = vec![1.0; depth * columns];
            vectorised(Both {
                a: &a,
                b: &b,
                plain: &mut plain,
                transposed: &mut transposed,
                shape: (rows, depth, columns),
            });
            for r in 0..rows {
                for c in 0..columns {
                    let sum: f32 = (0..depth).map(|k| a[r * depth + k] * b[k * columns + c]).sum();
                    assert_eq!(plain[r * columns + c], sum);
                }
            }
            for k in 0..depth {
                for c in 0..columns {
                    let sum: f32 =
                        (0..rows).map(|r| a[r * depth + k] * plain[r * columns + c]).sum();
                    assert_eq!(transposed[k * columns + c], 1.0 + sum);
                }
            }
        }
    }
}
