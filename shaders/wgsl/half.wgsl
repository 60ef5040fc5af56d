// Half: IEEE 754 binary16 numbers by their bits. See isa/src/half.rs.

const HALF_SIGN: u32 = 0x8000u;

fn half_exponent(number: u32) -> u32 {
    return (number >> 10u) & 0x1fu;
}

// The product as binary32, exactly: 11 bits times 11 are fewer than 24.
fn half_product(a: u32, b: u32) -> u32 {
    let a_exponent = half_exponent(a);
    let b_exponent = half_exponent(b);
    let a_significand = (a & 0x3ffu) | select(0x400u, 0u, a_exponent == 0u);
    let b_significand = (b & 0x3ffu) | select(0x400u, 0u, b_exponent == 0u);
    let product = a_significand * b_significand;
    // A subnormal number has the exponent of the smallest normal ones. Bit 31 of a product of
    // exponents 0 would weigh 2^(31 − 50).
    let exponents = bitcast<i32>(max(a_exponent, 1u) + max(b_exponent, 1u));
    let exact = unrounded(((a ^ b) & HALF_SIGN) << 16u, product, exponents - 19);
    if (product == 0u) {
        return exact.sign;
    }
    return float_encode(exact.sign, exact.significand >> 8u, exact.top);
}

fn half_to_float(number: u32) -> u32 {
    return half_product(number, HALF_ONE);
}

// To nearest, ties to even, saturated.
fn half_nearest(number: Unrounded) -> u32 {
    let sign = number.sign >> 16u;
    // What is below half of 2^-24 is zero.
    if (number.significand == 0u || number.top < -25) {
        return sign;
    }
    if (number.top > 15) {
        return sign | HALF_MAX;
    }
    // Eleven bits are kept; of a subnormal number those down to 2^-24.
    let is_subnormal = number.top < -14;
    let drop = bitcast<u32>(select(21, 7 - number.top, is_subnormal));
    let doubled = number.significand >> (drop - 1u);
    let floor = doubled >> 1u;
    let up = rounding_up(
        ROUNDING_HALF_EVEN,
        (doubled & 1u) != 0u,
        (number.significand & ((1u << (drop - 1u)) - 1u)) != 0u,
        (floor & 1u) != 0u,
        false,
    );
    // The first bit carries into the exponent, and so does what is rounded up to twelve bits.
    let exponent = bitcast<u32>(select(number.top + 14, 0, is_subnormal)) << 10u;
    return sign | min(exponent + floor + select(0u, 1u, up), HALF_MAX);
}

// The nearest to a binary32 number.
fn half_round(number: u32) -> u32 {
    return half_nearest(Unrounded(
        number & FLOAT_SIGN,
        float_significand(number) << 8u,
        bitcast<i32>(float_exponent(number)) - FLOAT_BIAS,
    ));
}

// The nearest to value / 2^fraction_bits.
fn half_from_fixed(value: Wide, fraction_bits: u32) -> u32 {
    var magnitude = value;
    if (wide_is_negative(value)) {
        magnitude = wide_negate(value);
    }
    let sign = value.high & FLOAT_SIGN;
    let top = 31 - bitcast<i32>(fraction_bits);
    if (magnitude.high == 0u) {
        return half_nearest(unrounded(sign, magnitude.low, top));
    }
    let zeros = countLeadingZeros(magnitude.high);
    let shifted = wide_shift_left(magnitude, zeros);
    let significand = shifted.high | select(0u, 1u, shifted.low != 0u);
    return half_nearest(Unrounded(sign, significand, top + 32 - bitcast<i32>(zeros)));
}

// a · b + c with one rounding, saturated.
fn half_fused(a: u32, b: u32, c: u32) -> u32 {
    return half_nearest(float_sum(half_product(a, b), half_to_float(c)));
}
