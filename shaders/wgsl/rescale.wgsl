// Requantisation: an accumulator becomes a value of another scale. See isa/src/rescale.rs.

// value · mantissa / 2^shift, rounded to an integer and saturated to 32 bits.
fn requantizer_apply(requantizer: u32, value: i32, mantissa: u32, shift: u32) -> i32 {
    switch requantizer {
        case REQUANTIZER_DOUBLE: {
            return wide_saturate(rescale_double(value, mantissa, shift));
        }
        case REQUANTIZER_HALF_EVEN: {
            return wide_saturate(rescale_once(ROUNDING_HALF_EVEN, value, mantissa, shift));
        }
        case REQUANTIZER_HALF_AWAY: {
            return wide_saturate(rescale_once(ROUNDING_HALF_AWAY, value, mantissa, shift));
        }
        case REQUANTIZER_NARROW: {
            return wide_saturate(rescale_narrow(value, mantissa, shift));
        }
        default: { // REQUANTIZER_SINGLE
            return wide_saturate(rescale_once(ROUNDING_HALF_UP, value, mantissa, shift));
        }
    }
}

// One rounding of the full product.
fn rescale_once(mode: u32, value: i32, mantissa: u32, shift: u32) -> Wide {
    return rounding_shift_wide(mode, wide_multiply(value, mantissa), shift);
}

// Two roundings where the shift exceeds 31: half of 2^31 is added first, away from zero.
fn rescale_double(value: i32, mantissa: u32, shift: u32) -> Wide {
    var product = wide_multiply(value, mantissa);
    if (shift > 31u) {
        let half = 1i << 30u;
        product = wide_add(product, wide(select(half, -half, value < 0)));
    }
    return rounding_shift_wide(ROUNDING_HALF_UP, product, shift);
}

// A 16-bit multiplier: the mantissa's upper half, rounded and saturated to 15 bits.
fn rescale_narrow(value: i32, mantissa: u32, shift: u32) -> Wide {
    let upper = min((mantissa + 0x8000u) >> 16u, 0x7fffu);
    let product = wide_multiply(value, upper);
    if (shift > 16u) {
        return rounding_shift_wide(ROUNDING_HALF_UP, product, shift - 16u);
    }
    return wide_shift_left(product, 16u - shift);
}
