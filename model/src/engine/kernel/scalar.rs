//! Scalar: plain Rust, eight lanes that a compiler may put into whatever registers it has.

use super::body::{each_row, kernels};
use super::body_half::{half_kernels, round_kernel};
use super::body_rows::{bring_kernel, row_kernels};

const LANES: usize = 8;
const VECTORS: usize = 1;

type V = [i32; LANES];
type F = [f32; LANES];
type PackedWeights = [[i8; 4]; 4];
type Splat = Scale;

fn packed(layer: &Dense8) -> &[PackedWeights] {
    &layer.bytes
}

fn each(a: V, b: V, of: impl Fn(i32, i32) -> i32) -> V {
    std::array::from_fn(|lane| of(a[lane], b[lane]))
}

fn splat(value: i32) -> V {
    [value; LANES]
}

fn add(a: V, b: V) -> V {
    each(a, b, i32::wrapping_add)
}

fn min(a: V, b: V) -> V {
    each(a, b, i32::min)
}

fn max(a: V, b: V) -> V {
    each(a, b, i32::max)
}

fn multiply(a: V, b: V) -> V {
    each(a, b, i32::wrapping_mul)
}

fn shift_lanes(value: V, bits: V) -> V {
    each(value, bits, |value, bits| value >> bits)
}

fn load(lanes: &[i32; LANES]) -> V {
    *lanes
}

fn store(value: V, lanes: &mut [i32; LANES]) {
    *lanes = value;
}

fn load_bytes(texels: &[[u8; 4]; LANES]) -> V {
    texels.map(i32::from_le_bytes)
}

fn load_quads(texels: &[[u8; 4]; LANES]) -> [[u8; 4]; LANES] {
    *texels
}

fn load_pairs(texels: &[[i16; 2]; LANES]) -> [[i16; 2]; LANES] {
    *texels
}

fn splat_weights(weights: &[i8; 4]) -> [i8; 4] {
    *weights
}

fn splat_quad(quad: [u8; 4]) -> [u8; 4] {
    quad
}

fn splat_pair(pair: [i16; 2]) -> [i16; 2] {
    pair
}

fn dot(sum: V, texels: [[u8; 4]; LANES], weights: [i8; 4]) -> V {
    std::array::from_fn(|lane| sum[lane].wrapping_add(products(texels[lane], weights)))
}

fn products(texel: [u8; 4], weights: [i8; 4]) -> i32 {
    (0..4)
        .map(|k| i32::from(texel[k]) * i32::from(weights[k]))
        .sum()
}

fn dot_pairs(sum: V, texels: [[i16; 2]; LANES], weights: [i16; 2]) -> V {
    std::array::from_fn(|lane| {
        let product = |k: usize| i32::from(texels[lane][k]) * i32::from(weights[k]);
        sum[lane].wrapping_add(product(0)).wrapping_add(product(1))
    })
}

fn dot_rows(sum: V, texel: [u8; 4], weights: &[[i8; 4]; LANES]) -> V {
    std::array::from_fn(|lane| sum[lane].wrapping_add(products(texel, weights[lane])))
}

fn rescale_high(value: V, scale: &Splat) -> V {
    value.map(|lane| scale.apply(lane))
}

fn rescale_low(value: V, scale: &Splat) -> V {
    rescale_high(value, scale)
}

fn splat_scale(scale: &Scale) -> Splat {
    *scale
}

fn rescale_byte(value: V, scale: &Splat) -> V {
    rescale_high(value, scale)
}

fn and(a: V, b: V) -> V {
    each(a, b, |a, b| a & b)
}

fn shift_left_16(value: V) -> V {
    value.map(|lane| lane << 16)
}

fn shift_left_8(value: V) -> V {
    value.map(|lane| lane << 8)
}

fn shift_right_8(value: V) -> V {
    value.map(|lane| lane >> 8)
}

fn rescale_rows(value: V, group: &ScaleGroup, part: usize) -> V {
    std::array::from_fn(|lane| {
        let row = part * LANES + lane;
        let product = i64::from(value[lane]) * i64::from(group.mantissa[row]);
        let (odd, pair) = (row % 2, row / 2);
        ((product + group.addend[odd][pair]) >> group.shift[odd][pair]) as i32
    })
}

fn store_bytes(rows: [V; 4], texels: &mut [[u8; 4]; LANES]) {
    for (lane, texel) in texels.iter_mut().enumerate() {
        *texel = rows.map(|row| row[lane].clamp(0, 255) as u8);
    }
}

fn store_pairs(first: V, second: V, texels: &mut [[i16; 2]; LANES]) {
    for (lane, texel) in texels.iter_mut().enumerate() {
        *texel = [first[lane] as i16, second[lane] as i16];
    }
}

fn splat_f32(value: f32) -> F {
    [value; LANES]
}

fn multiply_f32(a: F, b: F) -> F {
    std::array::from_fn(|lane| a[lane] * b[lane])
}

fn add_f32(a: F, b: F) -> F {
    std::array::from_fn(|lane| a[lane] + b[lane])
}

fn multiply_add(a: F, b: F, sum: F) -> F {
    std::array::from_fn(|lane| sum[lane] + a[lane] * b[lane])
}

fn load_f32(lanes: &[f32; LANES]) -> F {
    *lanes
}

fn store_f32(value: F, lanes: &mut [f32; LANES]) {
    *lanes = value;
}

kernels!();
row_kernels!();
bring_kernel!();
half_kernels!();
round_kernel!();
