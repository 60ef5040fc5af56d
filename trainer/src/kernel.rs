//! Matrix products on plain slices, and the dispatch of vector code.
//!
//! A step of the refinement is a few hundred products of matrices with a side of 16 to 128. The
//! general products of a tensor library spend most of their time around such a matrix; here every
//! inner loop is a register tile of [`ROWS`] rows by two vectors.
//!
//! All matrices are row-major. Row counts are multiples of [`ROWS`], column counts of [`COLUMNS`].

use macerator::{AutoArch, Simd, WithSimd};

/// Floats of one vector of the register tile.
const LANES: usize = 16;

/// Vectors of a row of the register tile. With eight rows, two are what 32 registers hold best;
/// one and three compile to several times slower code.
const N: usize = 2;

/// Columns of the register tile; every width is padded to a multiple of it.
pub(crate) const COLUMNS: usize = N * LANES;

/// Rows of the register tile.
pub(crate) const ROWS: usize = 8;

/// `n` rounded up to a multiple of [`COLUMNS`].
pub(crate) const fn padded(n: usize) -> usize {
    n.div_ceil(COLUMNS) * COLUMNS
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

type Vector = [f32; LANES];
type Accumulators = [[Vector; N]; ROWS];

/// The vector that starts at `at`.
///
/// The tiles below stay in registers because every vector is an array *by value*: loaded whole,
/// combined whole, stored whole. Written with slices they end up in memory, twenty times slower.
#[inline(always)]
fn vector(row: &[f32], at: usize) -> Vector {
    match row[at..].first_chunk::<LANES>() {
        Some(vector) => *vector,
        None => [0.0; LANES],
    }
}

#[inline(always)]
fn accumulate<const FUSED: bool>(x: f32, b: &Vector, mut c: Vector) -> Vector {
    for i in 0..LANES {
        c[i] = multiply_add::<FUSED>(x, b[i], c[i]);
    }
    c
}

/// The tile to start from: zeros, or what is in `c`.
#[inline(always)]
fn load<const ADD: bool>(c: &[f32], stride: usize) -> Accumulators {
    let mut acc: Accumulators = [[[0.0; LANES]; N]; ROWS];
    if ADD {
        for (r, row) in acc.iter_mut().enumerate() {
            for (v, acc) in row.iter_mut().enumerate() {
                *acc = vector(c, r * stride + v * LANES);
            }
        }
    }
    acc
}

#[inline(always)]
fn store(acc: &Accumulators, c: &mut [f32], stride: usize) {
    for r in 0..ROWS {
        let row = &mut c[r * stride..r * stride + N * LANES];
        for v in 0..N {
            row[v * LANES..(v + 1) * LANES].copy_from_slice(&acc[r][v]);
        }
    }
}

/// `C = A·B`, or `C += A·B` with `ADD`: `A` is rows × depth, `B` depth × columns.
struct Product<'a, const ADD: bool> {
    a: &'a [f32],
    /// Floats between two rows of `A`; only the first `depth` of them are read.
    a_stride: usize,
    b: &'a [f32],
    /// Floats of a row of `B` and of `C`.
    stride: usize,
    c: &'a mut [f32],
    depth: usize,
}

impl<const ADD: bool> Vectorised for Product<'_, ADD> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Product {
            a,
            a_stride,
            b,
            stride,
            c,
            depth,
        } = self;
        for (a, c) in a.chunks(a_stride * ROWS).zip(c.chunks_mut(stride * ROWS)) {
            let rows: [&[f32]; ROWS] =
                std::array::from_fn(|r| &a[r * a_stride..r * a_stride + depth]);
            let mut acc = load::<ADD>(c, stride);
            for (k, b_row) in b.chunks(stride).take(depth).enumerate() {
                let b_row: [Vector; N] = std::array::from_fn(|v| vector(b_row, v * LANES));
                for r in 0..ROWS {
                    let x = rows[r][k];
                    for v in 0..N {
                        acc[r][v] = accumulate::<FUSED>(x, &b_row[v], acc[r][v]);
                    }
                }
            }
            store(&acc, c, stride);
        }
    }
}

/// `C += Aᵀ·B`: `A` is depth × rows, `B` depth × columns.
struct Transposed<'a> {
    a: &'a [f32],
    rows: usize,
    b: &'a [f32],
    stride: usize,
    c: &'a mut [f32],
}

impl Vectorised for Transposed<'_> {
    #[inline(always)]
    fn run<const FUSED: bool>(self) {
        let Transposed {
            a,
            rows,
            b,
            stride,
            c,
        } = self;
        for (row, c) in (0..rows).step_by(ROWS).zip(c.chunks_mut(stride * ROWS)) {
            let mut acc = load::<true>(c, stride);
            for (a_row, b_row) in a[row..].chunks(rows).zip(b.chunks(stride)) {
                let Some(xs) = a_row.first_chunk::<ROWS>() else {
                    continue;
                };
                let b_row: [Vector; N] = std::array::from_fn(|v| vector(b_row, v * LANES));
                for r in 0..ROWS {
                    for v in 0..N {
                        acc[r][v] = accumulate::<FUSED>(xs[r], &b_row[v], acc[r][v]);
                    }
                }
            }
            store(&acc, c, stride);
        }
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
    let stride = columns;
    for at in (0..columns).step_by(COLUMNS) {
        let (b, c) = (&b[at..], &mut c[at..]);
        if add {
            vectorised(Product::<true> {
                a,
                a_stride,
                b,
                stride,
                c,
                depth,
            });
        } else {
            vectorised(Product::<false> {
                a,
                a_stride,
                b,
                stride,
                c,
                depth,
            });
        }
    }
}

/// `C += Aᵀ·B`: `A` is depth × `rows`, `B` depth × `columns`, `C` rows × columns.
pub(crate) fn product_transposed(
    (a, rows): (&[f32], usize),
    (b, columns): (&[f32], usize),
    c: &mut [f32],
) {
    for at in (0..columns).step_by(COLUMNS) {
        vectorised(Transposed {
            a,
            rows,
            b: &b[at..],
            stride: columns,
            c: &mut c[at..],
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::{Purpose, Stream};

    fn matrix(seed: u64, len: usize) -> Vec<f32> {
        let stream = Stream::new(seed, Purpose::Batch, 0);
        // Small integers: every product and sum is exact, so the results must be equal.
        (0..len as u64)
            .map(|i| stream.below(i, 17) as f32 - 8.0)
            .collect()
    }

    #[test]
    fn products_equal_the_definition_at_every_column_count() {
        for columns in [32, 64, 96, 128] {
            let (rows, depth) = (24, 64);
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
                    let sum: f32 = (0..depth)
                        .map(|k| a[r * depth + k] * b[k * columns + c])
                        .sum();
                    assert_eq!(plain[r * columns + c], sum);
                }
            }
            for k in 0..depth {
                for c in 0..columns {
                    let sum: f32 = (0..rows)
                        .map(|r| a[r * depth + k] * plain[r * columns + c])
                        .sum();
                    assert_eq!(transposed[k * columns + c], 1.0 + sum);
                }
            }
        }
    }
}
