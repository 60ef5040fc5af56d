//! AVX2: eight lanes. Bytes are split into even and odd 16-bit words and multiplied in pairs; the
//! instruction for bytes saturates its sums and would not be exact.

use super::body::{each_row, kernels};
use super::body_half::{half_kernels, round_kernel};
use super::body_rows::{bring_kernel, row_kernels};
use std::arch::x86_64::*;

const LANES: usize = 8;
const VECTORS: usize = 2;

type V = __m256i;
type F = __m256;
/// Bytes 0 and 2, bytes 1 and 3 of each lane, as words.
type Split = [__m256i; 2];
type PackedWeights = [[i16; 4]; 4];

/// A scale in every lane.
struct Splat {
    mantissa: V,
    addend: V,
    shift: V,
    /// The shift less 32, for a product's upper half.
    upper_shift: V,
}

fn packed(layer: &Dense8) -> &[PackedWeights] {
    &layer.words
}

/// Every function here needs the same features.
macro_rules! primitives {
    ($($(#[$meta:meta])* fn $name:ident($($argument:ident: $type:ty),*) $(-> $result:ty)? $body:block)*) => {
        $(
            $(#[$meta])*
            #[target_feature(enable = "avx2,fma")]
            #[inline]
            fn $name($($argument: $type),*) $(-> $result)? $body
        )*
    };
}

primitives! {
    fn splat(value: i32) -> V { _mm256_set1_epi32(value) }
    fn add(a: V, b: V) -> V { _mm256_add_epi32(a, b) }
    fn min(a: V, b: V) -> V { _mm256_min_epi32(a, b) }
    fn max(a: V, b: V) -> V { _mm256_max_epi32(a, b) }
    fn multiply(a: V, b: V) -> V { _mm256_mullo_epi32(a, b) }

    fn and(a: V, b: V) -> V { _mm256_and_si256(a, b) }
    fn shift_lanes(value: V, bits: V) -> V { _mm256_srav_epi32(value, bits) }

    fn load(lanes: &[i32; LANES]) -> V {
        // SAFETY: the reference is to 32 readable bytes; the load needs no alignment.
        unsafe { _mm256_loadu_si256(lanes.as_ptr().cast()) }
    }

    fn store(value: V, lanes: &mut [i32; LANES]) {
        // SAFETY: the reference is to 32 writable bytes; the store needs no alignment.
        unsafe { _mm256_storeu_si256(lanes.as_mut_ptr().cast(), value) }
    }

    fn load_bytes(texels: &[[u8; 4]; LANES]) -> V {
        // SAFETY: the reference is to 32 readable bytes; the load needs no alignment.
        unsafe { _mm256_loadu_si256(texels.as_ptr().cast()) }
    }

    fn load_quads(texels: &[[u8; 4]; LANES]) -> Split { split_unsigned(load_bytes(texels)) }

    fn split_unsigned(bytes: V) -> Split {
        [_mm256_and_si256(bytes, _mm256_set1_epi16(255)), _mm256_srli_epi16::<8>(bytes)]
    }

    fn load_pairs(texels: &[[i16; 2]; LANES]) -> V {
        // SAFETY: the reference is to 32 readable bytes; the load needs no alignment.
        unsafe { _mm256_loadu_si256(texels.as_ptr().cast()) }
    }

    fn splat_weights(weights: &[i16; 4]) -> Split {
        [splat_pair([weights[0], weights[1]]), splat_pair([weights[2], weights[3]])]
    }

    fn splat_quad(quad: [u8; 4]) -> Split { split_unsigned(splat(i32::from_ne_bytes(quad))) }

    fn splat_pair(pair: [i16; 2]) -> V {
        splat(i32::from(pair[0]) & 0xffff | i32::from(pair[1]) << 16)
    }

    fn dot(sum: V, texels: Split, weights: Split) -> V {
        let even = _mm256_madd_epi16(texels[0], weights[0]);
        add(add(sum, even), _mm256_madd_epi16(texels[1], weights[1]))
    }

    fn dot_pairs(sum: V, texels: V, weights: V) -> V { add(sum, _mm256_madd_epi16(texels, weights)) }

    fn dot_rows(sum: V, texel: Split, weights: &[[i8; 4]; LANES]) -> V {
        // SAFETY: the reference is to 32 readable bytes; the load needs no alignment.
        let weights = unsafe { _mm256_loadu_si256(weights.as_ptr().cast()) };
        let even = _mm256_srai_epi16::<8>(_mm256_slli_epi16::<8>(weights));
        dot(sum, texel, [even, _mm256_srai_epi16::<8>(weights)])
    }

    /// A product's upper half is the result's lane of `odd` already, and one lane up in `even`.
    fn rescale_high(value: V, scale: &Splat) -> V {
        let (even, odd) = products(value, scale);
        let upper = _mm256_blend_epi32::<0xaa>(_mm256_shuffle_epi32::<0xf5>(even), odd);
        _mm256_srav_epi32(upper, scale.upper_shift)
    }

    fn rescale_low(value: V, scale: &Splat) -> V {
        let (even, odd) = products(value, scale);
        let (even, odd) = (sra64(even, scale.shift), sra64(odd, scale.shift));
        _mm256_blend_epi32::<0xaa>(even, _mm256_slli_epi64::<32>(odd))
    }

    fn products(value: V, scale: &Splat) -> (V, V) {
        let odd = _mm256_srli_epi64::<32>(value);
        let even = _mm256_add_epi64(_mm256_mul_epi32(value, scale.mantissa), scale.addend);
        (even, _mm256_add_epi64(_mm256_mul_epi32(odd, scale.mantissa), scale.addend))
    }

    /// An arithmetic shift of 64 bits: the sign bit is turned into an offset of 2^63, shifted with
    /// the rest, and taken away.
    fn sra64(value: V, shift: V) -> V {
        let sign = _mm256_set1_epi64x(i64::MIN);
        let unsigned = _mm256_xor_si256(value, sign);
        _mm256_sub_epi64(_mm256_srlv_epi64(unsigned, shift), _mm256_srlv_epi64(sign, shift))
    }

    fn splat_scale(scale: &Scale) -> Splat {
        Splat {
            mantissa: splat(scale.mantissa as i32),
            addend: _mm256_set1_epi64x(scale.addend),
            shift: _mm256_set1_epi64x(i64::from(scale.shift)),
            upper_shift: splat(scale.shift as i32 - 32)
        }
    }

    fn shift_left_16(value: V) -> V { _mm256_slli_epi32::<16>(value) }
    fn shift_left_8(value: V) -> V { _mm256_slli_epi32::<8>(value) }
    fn shift_right_8(value: V) -> V { _mm256_srli_epi32::<8>(value) }

    /// Like `rescale_high`, of a value that is not negative.
    fn rescale_byte(value: V, scale: &Splat) -> V {
        let odd = _mm256_srli_epi64::<32>(value);
        let even = _mm256_add_epi64(_mm256_mul_epu32(value, scale.mantissa), scale.addend);
        let odd = _mm256_add_epi64(_mm256_mul_epu32(odd, scale.mantissa), scale.addend);
        _mm256_srav_epi32(_mm256_blend_epi32::<0xaa>(_mm256_shuffle_epi32::<0xf5>(even), odd), scale.upper_shift)
    }

    fn rescale_rows(value: V, group: &ScaleGroup, part: usize) -> V {
        let mantissa = load(&group.mantissa.as_chunks().0[part]);
        let even = _mm256_mul_epi32(value, mantissa);
        let odd = _mm256_mul_epi32(_mm256_srli_epi64::<32>(value), _mm256_srli_epi64::<32>(mantissa));
        let [addend, shift] = [&group.addend, &group.shift].map(|of| [0, 1].map(|odd| &of[odd].as_chunks().0[part]));
        let even = shifted(even, addend[0], shift[0]);
        let odd = shifted(odd, addend[1], shift[1]);
        _mm256_blend_epi32::<0xaa>(even, _mm256_slli_epi64::<32>(odd))
    }

    fn shifted(product: V, addend: &[i64; 4], shift: &[i64; 4]) -> V {
        // SAFETY: both references are to 32 readable bytes; the loads need no alignment.
        let (addend, shift) = unsafe {
            (_mm256_loadu_si256(addend.as_ptr().cast()), _mm256_loadu_si256(shift.as_ptr().cast()))
        };
        sra64(_mm256_add_epi64(product, addend), shift)
    }

    /// Four rows become the four bytes of each texel, saturated to 0..=255.
    fn store_bytes(rows: [V; 4], texels: &mut [[u8; 4]; LANES]) {
        let low = _mm256_packs_epi32(rows[0], rows[1]);
        let high = _mm256_packs_epi32(rows[2], rows[3]);
        // In each 128 bits: four texels of row 0, of row 1, of row 2, of row 3.
        let bytes = _mm256_packus_epi16(low, high);
        let by_texel = _mm_setr_epi8(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15);
        let bytes = _mm256_shuffle_epi8(bytes, _mm256_broadcastsi128_si256(by_texel));
        // SAFETY: the reference is to 32 writable bytes; the store needs no alignment.
        unsafe { _mm256_storeu_si256(texels.as_mut_ptr().cast(), bytes) }
    }

    fn store_pairs(first: V, second: V, texels: &mut [[i16; 2]; LANES]) {
        let pairs = _mm256_blend_epi16::<0xaa>(first, _mm256_slli_epi32::<16>(second));
        // SAFETY: the reference is to 32 writable bytes; the store needs no alignment.
        unsafe { _mm256_storeu_si256(texels.as_mut_ptr().cast(), pairs) }
    }

    fn splat_f32(value: f32) -> F { _mm256_set1_ps(value) }
    fn multiply_f32(a: F, b: F) -> F { _mm256_mul_ps(a, b) }
    fn add_f32(a: F, b: F) -> F { _mm256_add_ps(a, b) }
    fn multiply_add(a: F, b: F, sum: F) -> F { _mm256_fmadd_ps(a, b, sum) }

    fn load_f32(lanes: &[f32; LANES]) -> F {
        // SAFETY: the reference is to 32 readable bytes; the load needs no alignment.
        unsafe { _mm256_loadu_ps(lanes.as_ptr()) }
    }

    fn store_f32(value: F, lanes: &mut [f32; LANES]) {
        // SAFETY: the reference is to 32 writable bytes; the store needs no alignment.
        unsafe { _mm256_storeu_ps(lanes.as_mut_ptr(), value) }
    }
}

kernels!(#[target_feature(enable = "avx2,fma")]);
row_kernels!(#[target_feature(enable = "avx2,fma")]);
bring_kernel!(#[target_feature(enable = "avx2,fma")]);
half_kernels!(#[target_feature(enable = "avx2,fma")]);
round_kernel!(#[target_feature(enable = "avx2,fma")]);
