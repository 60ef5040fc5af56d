//! AVX-512 with VNNI: sixteen lanes, four products of bytes to an accumulator in one instruction.

use super::body::{each_row, kernels};
use super::body_half::half_kernels;
use super::body_rows::row_kernels;
use super::half::LARGEST_HALF;
use std::arch::x86_64::*;

const LANES: usize = 16;
const VECTORS: usize = 4;

type V = __m512i;
type F = __m512;
type PackedWeights = [[i8; 4]; 4];

/// A scale in every lane.
struct Splat {
    mantissa: V,
    addend: V,
    shift: V,
    /// The shift less 32, for a product's upper half.
    upper_shift: V,
}

fn packed(layer: &Dense8) -> &[PackedWeights] {
    &layer.bytes
}

/// Every function here needs the same features.
macro_rules! primitives {
    ($($(#[$meta:meta])* fn $name:ident($($argument:ident: $type:ty),*) $(-> $result:ty)? $body:block)*) => {
        $(
            $(#[$meta])*
            #[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
            #[inline]
            fn $name($($argument: $type),*) $(-> $result)? $body
        )*
    };
}

primitives! {
    fn splat(value: i32) -> V { _mm512_set1_epi32(value) }
    fn add(a: V, b: V) -> V { _mm512_add_epi32(a, b) }
    fn min(a: V, b: V) -> V { _mm512_min_epi32(a, b) }
    fn max(a: V, b: V) -> V { _mm512_max_epi32(a, b) }
    fn multiply(a: V, b: V) -> V { _mm512_mullo_epi32(a, b) }

    fn and(a: V, b: V) -> V { _mm512_and_si512(a, b) }
    fn shift_lanes(value: V, bits: V) -> V { _mm512_srav_epi32(value, bits) }

    fn load(lanes: &[i32; LANES]) -> V {
        // SAFETY: the reference is to 64 readable bytes; the load needs no alignment.
        unsafe { _mm512_loadu_si512(lanes.as_ptr().cast()) }
    }

    fn store(value: V, lanes: &mut [i32; LANES]) {
        // SAFETY: the reference is to 64 writable bytes; the store needs no alignment.
        unsafe { _mm512_storeu_si512(lanes.as_mut_ptr().cast(), value) }
    }

    fn load_bytes(texels: &[[u8; 4]; LANES]) -> V {
        // SAFETY: the reference is to 64 readable bytes; the load needs no alignment.
        unsafe { _mm512_loadu_si512(texels.as_ptr().cast()) }
    }

    fn load_quads(texels: &[[u8; 4]; LANES]) -> V { load_bytes(texels) }

    fn load_pairs(texels: &[[i16; 2]; LANES]) -> V {
        // SAFETY: the reference is to 64 readable bytes; the load needs no alignment.
        unsafe { _mm512_loadu_si512(texels.as_ptr().cast()) }
    }

    fn splat_weights(weights: &[i8; 4]) -> V { splat(i32::from_ne_bytes(weights.map(|w| w as u8))) }
    fn splat_quad(quad: [u8; 4]) -> V { splat(i32::from_ne_bytes(quad)) }

    fn splat_pair(pair: [i16; 2]) -> V {
        splat(i32::from(pair[0]) & 0xffff | i32::from(pair[1]) << 16)
    }

    fn dot(sum: V, texels: V, weights: V) -> V { _mm512_dpbusd_epi32(sum, texels, weights) }
    fn dot_pairs(sum: V, texels: V, weights: V) -> V { _mm512_dpwssd_epi32(sum, texels, weights) }

    fn dot_rows(sum: V, texel: V, weights: &[[i8; 4]; LANES]) -> V {
        // SAFETY: the reference is to 64 readable bytes; the load needs no alignment.
        let weights = unsafe { _mm512_loadu_si512(weights.as_ptr().cast()) };
        _mm512_dpbusd_epi32(sum, texel, weights)
    }

    /// A product's upper half is the result's lane of `odd` already, and one lane up in `even`.
    fn rescale_high(value: V, scale: &Splat) -> V {
        let (even, odd) = products(value, scale);
        let upper = _mm512_mask_shuffle_epi32::<0xf5>(odd, 0x5555, even);
        _mm512_srav_epi32(upper, scale.upper_shift)
    }

    fn rescale_low(value: V, scale: &Splat) -> V {
        let (even, odd) = products(value, scale);
        let (even, odd) = (_mm512_srav_epi64(even, scale.shift), _mm512_srav_epi64(odd, scale.shift));
        _mm512_mask_blend_epi32(0xaaaa, even, _mm512_slli_epi64::<32>(odd))
    }

    fn products(value: V, scale: &Splat) -> (V, V) {
        let odd = _mm512_srli_epi64::<32>(value);
        let even = _mm512_add_epi64(_mm512_mul_epi32(value, scale.mantissa), scale.addend);
        (even, _mm512_add_epi64(_mm512_mul_epi32(odd, scale.mantissa), scale.addend))
    }

    fn splat_scale(scale: &Scale) -> Splat {
        Splat {
            mantissa: splat(scale.mantissa as i32),
            addend: _mm512_set1_epi64(scale.addend),
            shift: _mm512_set1_epi64(i64::from(scale.shift)),
            upper_shift: splat(scale.shift as i32 - 32)
        }
    }

    fn shift_left_16(value: V) -> V { _mm512_slli_epi32::<16>(value) }
    fn shift_left_8(value: V) -> V { _mm512_slli_epi32::<8>(value) }
    fn shift_right_8(value: V) -> V { _mm512_srli_epi32::<8>(value) }

    /// Like `rescale_high`, of a value that is not negative.
    fn rescale_byte(value: V, scale: &Splat) -> V {
        let odd = _mm512_srli_epi64::<32>(value);
        let even = _mm512_add_epi64(_mm512_mul_epu32(value, scale.mantissa), scale.addend);
        let odd = _mm512_add_epi64(_mm512_mul_epu32(odd, scale.mantissa), scale.addend);
        _mm512_srav_epi32(_mm512_mask_shuffle_epi32::<0xf5>(odd, 0x5555, even), scale.upper_shift)
    }

    fn rescale_rows(value: V, group: &ScaleGroup, part: usize) -> V {
        let _ = part;
        let mantissa = load(&group.mantissa);
        let even = shifted(_mm512_mul_epi32(value, mantissa), &group.addend[0], &group.shift[0]);
        let odd = _mm512_mul_epi32(_mm512_srli_epi64::<32>(value), _mm512_srli_epi64::<32>(mantissa));
        let odd = shifted(odd, &group.addend[1], &group.shift[1]);
        _mm512_mask_blend_epi32(0xaaaa, even, _mm512_slli_epi64::<32>(odd))
    }

    fn shifted(product: V, addend: &[i64; 8], shift: &[i64; 8]) -> V {
        // SAFETY: both references are to 64 readable bytes; the loads need no alignment.
        let (addend, shift) = unsafe {
            (_mm512_loadu_si512(addend.as_ptr().cast()), _mm512_loadu_si512(shift.as_ptr().cast()))
        };
        _mm512_srav_epi64(_mm512_add_epi64(product, addend), shift)
    }

    /// Four rows become the four bytes of each texel, saturated to 0..=255.
    fn store_bytes(rows: [V; 4], texels: &mut [[u8; 4]; LANES]) {
        let low = _mm512_packs_epi32(rows[0], rows[1]);
        let high = _mm512_packs_epi32(rows[2], rows[3]);
        // In each 128 bits: four texels of row 0, of row 1, of row 2, of row 3.
        let bytes = _mm512_packus_epi16(low, high);
        let by_texel = _mm512_broadcast_i32x4(_mm_setr_epi8(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15));
        let bytes = _mm512_shuffle_epi8(bytes, by_texel);
        // SAFETY: the reference is to 64 writable bytes; the store needs no alignment.
        unsafe { _mm512_storeu_si512(texels.as_mut_ptr().cast(), bytes) }
    }

    fn store_pairs(first: V, second: V, texels: &mut [[i16; 2]; LANES]) {
        let pairs = _mm512_mask_blend_epi16(0xaaaa_aaaa, first, _mm512_slli_epi32::<16>(second));
        // SAFETY: the reference is to 64 writable bytes; the store needs no alignment.
        unsafe { _mm512_storeu_si512(texels.as_mut_ptr().cast(), pairs) }
    }

    /// Limited to ±65504 first, because the conversion gives infinities beyond; between that and the
    /// first number that would become one it gives 65504 anyway. It keeps subnormals and the sign of
    /// a zero.
    fn round_lanes(lanes: &mut [f32; LANES]) {
        let largest = splat_f32(LARGEST_HALF);
        let smallest = splat_f32(-LARGEST_HALF);
        let limited = _mm512_max_ps(_mm512_min_ps(load_f32(lanes), largest), smallest);
        let half = _mm512_cvtps_ph::<_MM_FROUND_TO_NEAREST_INT>(limited);
        store_f32(_mm512_cvtph_ps(half), lanes);
    }

    fn splat_f32(value: f32) -> F { _mm512_set1_ps(value) }
    fn multiply_f32(a: F, b: F) -> F { _mm512_mul_ps(a, b) }
    fn add_f32(a: F, b: F) -> F { _mm512_add_ps(a, b) }
    fn multiply_add(a: F, b: F, sum: F) -> F { _mm512_fmadd_ps(a, b, sum) }

    fn load_f32(lanes: &[f32; LANES]) -> F {
        // SAFETY: the reference is to 64 readable bytes; the load needs no alignment.
        unsafe { _mm512_loadu_ps(lanes.as_ptr()) }
    }

    fn store_f32(value: F, lanes: &mut [f32; LANES]) {
        // SAFETY: the reference is to 64 writable bytes; the store needs no alignment.
        unsafe { _mm512_storeu_ps(lanes.as_mut_ptr(), value) }
    }
}

kernels!(#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]);
row_kernels!(#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]);
half_kernels!(#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]);

/// Texel after texel becomes lane after lane: sixteen texels by sixteen quads at a time, transposed in
/// registers.
#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
pub(super) fn bring(inputs: &[i8], count: usize, output: &mut [Quad]) {
    const SIDE: usize = 16;
    for (first, texels) in (0..TILE).step_by(SIDE).zip(inputs.chunks(SIDE * count)) {
        for from in (0..count).step_by(4 * SIDE) {
            let length = (count - from).min(4 * SIDE);
            let mask = u64::MAX >> (4 * SIDE - length);
            let mut rows = [splat(0); SIDE];
            for (row, texel) in rows.iter_mut().zip(texels.chunks_exact(count)) {
                let bytes: &[i8] = &texel[from..from + length];
                // SAFETY: the mask has `length` bits; bytes without one are not read.
                let bytes = unsafe { _mm512_maskz_loadu_epi8(mask, bytes.as_ptr()) };
                *row = _mm512_xor_si512(bytes, _mm512_set1_epi8(i8::MIN));
            }
            let quads = &mut output[from / 4..(from + length).div_ceil(4)];
            for (quad, column) in quads.iter_mut().zip(transposed(rows)) {
                let texels: &mut [[[u8; 4]; SIDE]] = quad.0.as_chunks_mut().0;
                // SAFETY: the reference is to 64 writable bytes; the store needs no alignment.
                unsafe { _mm512_storeu_si512(texels[first / SIDE].as_mut_ptr().cast(), column) }
            }
        }
    }
}

/// Rows become columns, of 32 bits: by halves of 64 bits, of 128 bits, and then among the four 128-bit
/// parts of a register.
#[target_feature(enable = "avx512f,avx512bw,avx512vnni")]
#[inline]
fn transposed(rows: [V; 16]) -> [V; 16] {
    let mut pairs = rows;
    for i in 0..8 {
        pairs[2 * i] = _mm512_unpacklo_epi32(rows[2 * i], rows[2 * i + 1]);
        pairs[2 * i + 1] = _mm512_unpackhi_epi32(rows[2 * i], rows[2 * i + 1]);
    }
    // Register 4·g + c: columns c, 4 + c, 8 + c, 12 + c of rows 4·g to 4·g + 3.
    let mut fours = rows;
    for g in 0..4 {
        for half in 0..2 {
            let (low, high) = (pairs[4 * g + half], pairs[4 * g + 2 + half]);
            fours[4 * g + 2 * half] = _mm512_unpacklo_epi64(low, high);
            fours[4 * g + 2 * half + 1] = _mm512_unpackhi_epi64(low, high);
        }
    }
    let mut columns = rows;
    for c in 0..4 {
        let a = _mm512_shuffle_i32x4::<0x88>(fours[c], fours[4 + c]);
        let b = _mm512_shuffle_i32x4::<0xdd>(fours[c], fours[4 + c]);
        let d = _mm512_shuffle_i32x4::<0x88>(fours[8 + c], fours[12 + c]);
        let e = _mm512_shuffle_i32x4::<0xdd>(fours[8 + c], fours[12 + c]);
        columns[c] = _mm512_shuffle_i32x4::<0x88>(a, d);
        columns[4 + c] = _mm512_shuffle_i32x4::<0x88>(b, e);
        columns[8 + c] = _mm512_shuffle_i32x4::<0xdd>(a, d);
        columns[12 + c] = _mm512_shuffle_i32x4::<0xdd>(b, e);
    }
    columns
}
