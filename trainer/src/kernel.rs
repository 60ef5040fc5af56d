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

/// `N` vectors of a row. Plain loops: a closure here may end up outside the dispatched function,
/// and then the tile lives in memory instead of registers.
#[inline(always)]
fn vectors<const N: usize>(row: &[f32]) -> [[f32; LANES]; N] {
    let mut out = [[0.0; LANES]; N];
    for v in 0..N {
        out[v].copy_from_slice(&row[v * LANES..(v + 1) * LANES]);
    }
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
fn store<const N: usize>(acc: &Accumulators<N>, c: &mut [f32], stride: usize, add: bool) {
    for r in 0..ROWS {
        let row = &mut c[r * stride..r * stride + N * LANES];
        for v in 0..N {
            let out = &mut row[v * LANES..(v + 1) * LANES];
            if add {
                for i in 0..LANES {
                    out[i] += acc[r][v][i];
                }
            } else {
                out.copy_from_slice(&acc[r][v]);
            }
        }
    }
}

/// `C = A·B`, or `C += A·B` with `add`: `A` is rows × depth, `B` depth × columns.
struct Product<'a, const N: usize> {
    a: &'a [f32],
    /// Floats between two rows of `A`; only the first `depth` of them are read.
    a_stride: usize,
    b: &'a [f32],
    /// Floats of a row of `B` and of `C`.
    stride: usize,
    c: &'a mut [f32],
    depth: usize,
    add: bool,
}

impl<const N: usize> Vectorised for Product<'_, N> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Product { a, a_stride, b, stride, c, depth, add } = self;
        for (a, c) in a.chunks(a_stride * ROWS).zip(c.chunks_mut(stride * ROWS)) {
            let mut rows: [&[f32]; ROWS] = [&[]; ROWS];
            for r in 0..ROWS {
                rows[r] = &a[r * a_stride..r * a_stride + depth];
            }
            let mut acc: Accumulators<N> = [[[0.0; LANES]; N]; ROWS];
            for (k, b_row) in b.chunks(stride).take(depth).enumerate() {
                let b_row = vectors::<N>(b_row);
                for r in 0..ROWS {
                    let x = rows[r][k];
                    for v in 0..N {
                        acc[r][v] = accumulate::<FUSED>(x, &b_row[v], acc[r][v]);
                    }
                }
            }
            store(&acc, c, stride, add);
        }
    }
}

/// `C += Aᵀ·B`: `A` is depth × rows, `B` depth × columns.
struct Transposed<'a, const N: usize> {
    a: &'a [f32],
    rows: usize,
    b: &'a [f32],
    stride: usize,
    c: &'a mut [f32],
}

impl<const N: usize> Vectorised for Transposed<'_, N> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Transposed { a, rows, b, stride, c } = self;
        for (row, c) in (0..rows).step_by(ROWS).zip(c.chunks_mut(stride * ROWS)) {
            let mut acc: Accumulators<N> = [[[0.0; LANES]; N]; ROWS];
            for (a_row, b_row) in a[row..].chunks(rows).zip(b.chunks(stride)) {
                let mut xs = [0.0; ROWS];
                xs.copy_from_slice(&a_row[..ROWS]);
                let b_row = vectors::<N>(b_row);
                for r in 0..ROWS {
                    for v in 0..N {
                        acc[r][v] = accumulate::<FUSED>(xs[r], &b_row[v], acc[r][v]);
                    }
                }
            }
            store(&acc, c, stride, true);
        }
    }
}

/// Vectors of the next block of columns, of `left` that remain: two at a time, three where that
/// leaves none over.
const fn block(left: usize) -> usize {
    match left {
        1 => 1,
        3 => 3,
        _ => 2,
    }
}

/// `C = A·B`, or `C += A·B` with `add`: `A` is rows × `a_stride`, of which the first `depth`
/// columns count; `B` is depth × `columns` and `C` rows × `columns`.
pub(crate) fn product(
    (a, a_stride): (&[f32], usize),
    b: &[f32],
    c: &mut [f32],
    depth: usize,
    columns: usize,
    add: bool,
) {
    let mut at = 0;
    while at < columns {
        let (b, c, stride) = (&b[at..], &mut c[at..], columns);
        let n = block((columns - at) / LANES);
        match n {
            1 => vectorised(Product::<1> { a, a_stride, b, stride, c, depth, add }),
            3 => vectorised(Product::<3> { a, a_stride, b, stride, c, depth, add }),
            _ => vectorised(Product::<2> { a, a_stride, b, stride, c, depth, add }),
        }
        at += n * LANES;
    }
}

/// `C += Aᵀ·B`: `A` is depth × `rows`, `B` depth × `columns`, `C` rows × columns.
pub(crate) fn product_transposed(
    (a, rows): (&[f32], usize),
    (b, columns): (&[f32], usize),
    c: &mut [f32],
) {
    let mut at = 0;
    while at < columns {
        let (b, c, stride) = (&b[at..], &mut c[at..], columns);
        let n = block((columns - at) / LANES);
        match n {
            1 => vectorised(Transposed::<1> { a, rows, b, stride, c }),
            3 => vectorised(Transposed::<3> { a, rows, b, stride, c }),
            _ => vectorised(Transposed::<2> { a, rows, b, stride, c }),
        }
        at += n * LANES;
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

    #[test]
    fn products_equal_the_definition_at_every_column_count() {
        for columns in [16, 32, 48, 64, 80, 128] {
            let (rows, depth) = (24, 48);
            let (a, b) = (matrix(1, rows * depth), matrix(2, depth * columns));
            let mut plain = vec![9.0; rows * columns];
            let mut transposed = vec![1.0; depth * columns];
            product((&a, depth), &b, &mut plain, depth, columns, false);
            // Aᵀ·C with C = A·B, on top of what is there.
            product_transposed((&a, depth), (&plain, columns), &mut transposed);
            let mut twice = plain.clone();
            product((&a, depth), &b, &mut twice, depth, columns, true);
            assert!(twice.iter().zip(&plain).all(|(t, p)| *t == 2.0 * p));
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
