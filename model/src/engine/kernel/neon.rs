//! NEON: four lanes. Bytes are multiplied as signed ones, widened to 16 bits, and added in pairs.

use super::body::{each_row, kernels};
use super::body_half::{half_kernels, round_kernel};
use super::body_rows::{bring_kernel, row_kernels};
use std::arch::aarch64::*;

const LANES: usize = 4;
const VECTORS: usize = 2;

type V = int32x4_t;
type F = float32x4_t;
type PackedWeights = [[i8; 4]; 4];

/// A scale in every lane.
struct Splat {
    mantissa: int32x2_t,
    addend: int64x2_t,
    /// Less than zero: NEON shifts to the left.
    shift: int64x2_t,
}

fn packed(layer: &Dense8) -> &[PackedWeights] {
    &layer.bytes
}

/// Every function here needs the same features.
macro_rules! primitives {
    ($($(#[$meta:meta])* fn $name:ident($($argument:ident: $type:ty),*) $(-> $result:ty)? $body:block)*) => {
        $(
            $(#[$meta])*
            #[target_feature(enable = "neon")]
            #[inline]
            fn $name($($argument: $type),*) $(-> $result)? $body
        )*
    };
}

primitives! {
    fn splat(value: i32) -> V { vdupq_n_s32(value) }
    fn add(a: V, b: V) -> V { vaddq_s32(a, b) }
    fn min(a: V, b: V) -> V { vminq_s32(a, b) }
    fn max(a: V, b: V) -> V { vmaxq_s32(a, b) }
    fn multiply(a: V, b: V) -> V { vmulq_s32(a, b) }
    fn shift_lanes(value: V, bits: V) -> V { vshlq_s32(value, vnegq_s32(bits)) }

    fn load(lanes: &[i32; LANES]) -> V {
        // SAFETY: the reference is to 16 readable bytes.
        unsafe { vld1q_s32(lanes.as_ptr()) }
    }

    fn store(value: V, lanes: &mut [i32; LANES]) {
        // SAFETY: the reference is to 16 writable bytes.
        unsafe { vst1q_s32(lanes.as_mut_ptr(), value) }
    }

    fn load_bytes(texels: &[[u8; 4]; LANES]) -> V {
        // SAFETY: the reference is to 16 readable bytes.
        vreinterpretq_s32_u8(unsafe { vld1q_u8(texels.as_flattened().as_ptr()) })
    }

    fn load_quads(texels: &[[u8; 4]; LANES]) -> uint8x16_t { vreinterpretq_u8_s32(load_bytes(texels)) }

    fn load_pairs(texels: &[[i16; 2]; LANES]) -> int16x8_t {
        // SAFETY: the reference is to 16 readable bytes.
        unsafe { vld1q_s16(texels.as_flattened().as_ptr()) }
    }

    fn splat_weights(weights: &[i8; 4]) -> int8x16_t {
        vreinterpretq_s8_s32(splat(i32::from_ne_bytes(weights.map(|w| w as u8))))
    }

    fn splat_quad(quad: [u8; 4]) -> uint8x16_t { vreinterpretq_u8_s32(splat(i32::from_ne_bytes(quad))) }

    fn splat_pair(pair: [i16; 2]) -> int16x8_t {
        vreinterpretq_s16_s32(splat(i32::from(pair[0]) & 0xffff | i32::from(pair[1]) << 16))
    }

    /// Stored bytes and weights as 16-bit words: a product of an unsigned and a signed byte fits
    /// them only just, a sum of two does not, so the pairs are added at 32 bits.
    fn dot(sum: V, texels: uint8x16_t, weights: int8x16_t) -> V {
        let words = |bytes| vreinterpretq_s16_u16(bytes);
        let low = vmulq_s16(words(vmovl_u8(vget_low_u8(texels))), vmovl_s8(vget_low_s8(weights)));
        let high = vmulq_s16(words(vmovl_high_u8(texels)), vmovl_high_s8(weights));
        add(sum, vpaddq_s32(vpaddlq_s16(low), vpaddlq_s16(high)))
    }

    fn dot_pairs(sum: V, texels: int16x8_t, weights: int16x8_t) -> V {
        let low = vmull_s16(vget_low_s16(texels), vget_low_s16(weights));
        add(sum, vpaddq_s32(low, vmull_high_s16(texels, weights)))
    }

    fn dot_rows(sum: V, texel: uint8x16_t, weights: &[[i8; 4]; LANES]) -> V {
        // SAFETY: the reference is to 16 readable bytes.
        dot(sum, texel, unsafe { vld1q_s8(weights.as_flattened().as_ptr()) })
    }

    fn rescale_high(value: V, scale: &Splat) -> V { rescale_low(value, scale) }

    fn rescale_low(value: V, scale: &Splat) -> V {
        let low = vmlal_s32(scale.addend, vget_low_s32(value), scale.mantissa);
        let high = vmlal_s32(scale.addend, vget_high_s32(value), scale.mantissa);
        vcombine_s32(vmovn_s64(vshlq_s64(low, scale.shift)), vmovn_s64(vshlq_s64(high, scale.shift)))
    }

    fn splat_scale(scale: &Scale) -> Splat {
        Splat {
            mantissa: vdup_n_s32(scale.mantissa as i32),
            addend: vdupq_n_s64(scale.addend),
            shift: vdupq_n_s64(-i64::from(scale.shift))
        }
    }

    fn and(a: V, b: V) -> V { vandq_s32(a, b) }
    fn shift_left_16(value: V) -> V { vshlq_n_s32::<16>(value) }
    fn shift_left_8(value: V) -> V { vshlq_n_s32::<8>(value) }
    fn shift_right_8(value: V) -> V { vshrq_n_s32::<8>(value) }
    fn rescale_byte(value: V, scale: &Splat) -> V { rescale_low(value, scale) }

    fn rescale_rows(value: V, group: &ScaleGroup, part: usize) -> V {
        let mantissa = load(&group.mantissa.as_chunks().0[part]);
        let even = shifted(
            vget_low_s32(vuzp1q_s32(value, value)),
            vget_low_s32(vuzp1q_s32(mantissa, mantissa)),
            &group.addend[0].as_chunks().0[part],
            &group.shift[0].as_chunks().0[part]
        );
        let odd = shifted(
            vget_low_s32(vuzp2q_s32(value, value)),
            vget_low_s32(vuzp2q_s32(mantissa, mantissa)),
            &group.addend[1].as_chunks().0[part],
            &group.shift[1].as_chunks().0[part]
        );
        vcombine_s32(vzip1_s32(even, odd), vzip2_s32(even, odd))
    }

    fn shifted(value: int32x2_t, mantissa: int32x2_t, addend: &[i64; 2], shift: &[i64; 2]) -> int32x2_t {
        // SAFETY: both references are to 16 readable bytes.
        let (addend, shift) = unsafe { (vld1q_s64(addend.as_ptr()), vld1q_s64(shift.as_ptr())) };
        vmovn_s64(vshlq_s64(vmlal_s32(addend, value, mantissa), vnegq_s64(shift)))
    }

    /// Four rows become the four bytes of each texel, saturated to 0..=255.
    fn store_bytes(rows: [V; 4], texels: &mut [[u8; 4]; LANES]) {
        let low = vcombine_s16(vqmovn_s32(rows[0]), vqmovn_s32(rows[1]));
        let high = vcombine_s16(vqmovn_s32(rows[2]), vqmovn_s32(rows[3]));
        let bytes = vcombine_u8(vqmovun_s16(low), vqmovun_s16(high));
        const BY_TEXEL: [u8; 16] = [0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15];
        // SAFETY: the constant is 16 readable bytes, the reference is to 16 writable bytes.
        unsafe {
            let by_texel = vld1q_u8(BY_TEXEL.as_ptr());
            vst1q_u8(texels.as_flattened_mut().as_mut_ptr(), vqtbl1q_u8(bytes, by_texel));
        }
    }

    fn store_pairs(first: V, second: V, texels: &mut [[i16; 2]; LANES]) {
        let (first, second) = (vmovn_s32(first), vmovn_s32(second));
        let pairs = vcombine_s16(vzip1_s16(first, second), vzip2_s16(first, second));
        // SAFETY: the reference is to 16 writable bytes.
        unsafe { vst1q_s16(texels.as_flattened_mut().as_mut_ptr(), pairs) }
    }

    fn splat_f32(value: f32) -> F { vdupq_n_f32(value) }
    fn multiply_f32(a: F, b: F) -> F { vmulq_f32(a, b) }
    fn add_f32(a: F, b: F) -> F { vaddq_f32(a, b) }
    fn multiply_add(a: F, b: F, sum: F) -> F { vfmaq_f32(sum, a, b) }

    fn load_f32(lanes: &[f32; LANES]) -> F {
        // SAFETY: the reference is to 16 readable bytes.
        unsafe { vld1q_f32(lanes.as_ptr()) }
    }

    fn store_f32(value: F, lanes: &mut [f32; LANES]) {
        // SAFETY: the reference is to 16 writable bytes.
        unsafe { vst1q_f32(lanes.as_mut_ptr(), value) }
    }
}

kernels!(#[target_feature(enable = "neon")]);
row_kernels!(#[target_feature(enable = "neon")]);
bring_kernel!(#[target_feature(enable = "neon")]);
half_kernels!(#[target_feature(enable = "neon")]);
round_kernel!(#[target_feature(enable = "neon")]);
