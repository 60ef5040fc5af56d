// Float: IEEE 754 binary32 numbers by their bits, computed with integers: WGSL leaves open how its
// own floats round, and drops subnormal ones and signs of zeros.
//
// No infinity and no NaN reaches these functions (isa/src/half.rs says why), and no subnormal
// number: sums and products of an fp16 layer are multiples of 2^-72 at the least. Zeros have signs.

const FLOAT_SIGN: u32 = 0x80000000u;
const FLOAT_FRACTION: u32 = 0x007fffffu;
const FLOAT_BIAS: i32 = 127;
const FLOAT_THREE: u32 = 0x40400000u;
const FLOAT_SIX: u32 = 0x40c00000u;

// A number before it is rounded: significand · 2^(top − 31). The first bit of the significand is
// set, unless the number is zero; the last stands for all the bits that are not there.
struct Unrounded {
    sign: u32, // FLOAT_SIGN or 0
    significand: u32,
    top: i32,
}

// A significand of any size, its first bit brought to the top; `top` is what bit 31 weighs.
fn unrounded(sign: u32, significand: u32, top: i32) -> Unrounded {
    let zeros = countLeadingZeros(significand);
    return Unrounded(sign, significand << (zeros & 31u), top - bitcast<i32>(zeros));
}

fn float_exponent(number: u32) -> u32 {
    return (number >> 23u) & 0xffu;
}

// The 24 bits of the significand; 0 of a zero.
fn float_significand(number: u32) -> u32 {
    return select(
        (number & FLOAT_FRACTION) | (FLOAT_FRACTION + 1u), 0u, float_exponent(number) == 0u,
    );
}

// The number with a significand of 24 bits, the first of them set and of weight 2^top.
fn float_encode(sign: u32, significand: u32, top: i32) -> u32 {
    // The first bit carries into the exponent, and so does a significand that was rounded to 25.
    return sign | ((bitcast<u32>(top + FLOAT_BIAS - 1) << 23u) + significand);
}

// To nearest, ties to even.
fn float_nearest(number: Unrounded) -> u32 {
    if (number.significand == 0u) {
        return number.sign;
    }
    let floor = number.significand >> 8u;
    let up = rounding_up(
        ROUNDING_HALF_EVEN,
        (number.significand & 0x80u) != 0u,
        (number.significand & 0x7fu) != 0u,
        (floor & 1u) != 0u,
        false,
    );
    return float_encode(number.sign, floor + select(0u, 1u, up), number.top);
}

// The sum, with three bits more than either number: enough for one rounding to 24 bits or fewer,
// because a cancellation of more than one bit loses nothing before it.
fn float_sum(a: u32, b: u32) -> Unrounded {
    let a_is_larger = (a & ~FLOAT_SIGN) >= (b & ~FLOAT_SIGN);
    let large = select(b, a, a_is_larger);
    let small = select(a, b, a_is_larger);
    let distance = min(float_exponent(large) - float_exponent(small), 31u);
    let exact = float_significand(small) << 3u;
    let shifted = exact >> distance;
    let aligned = shifted | select(0u, 1u, (shifted << distance) != exact);
    let significand = float_significand(large) << 3u;
    let differ = ((a ^ b) & FLOAT_SIGN) != 0u;
    let sum = select(significand + aligned, significand - aligned, differ);
    // What cancels is +0; zeros of one sign keep it.
    let sign = select(large, a & b, sum == 0u) & FLOAT_SIGN;
    // The first bit of the larger number is bit 26 of the sum.
    return unrounded(sign, sum, bitcast<i32>(float_exponent(large)) - FLOAT_BIAS + 5);
}

fn float_add(a: u32, b: u32) -> u32 {
    return float_nearest(float_sum(a, b));
}

fn float_multiply(a: u32, b: u32) -> u32 {
    // 31 bits times 32: the first bit of the product is bit 30 or 29 of its upper word.
    let product = wide_multiply(
        bitcast<i32>(float_significand(a) << 7u), float_significand(b) << 8u,
    );
    let significand = product.high | select(0u, 1u, product.low != 0u);
    let exponents = bitcast<i32>(float_exponent(a) + float_exponent(b));
    return float_nearest(
        unrounded((a ^ b) & FLOAT_SIGN, significand, exponents - 2 * FLOAT_BIAS + 2),
    );
}

// number · 2^log2, which must be representable.
fn float_scale(number: u32, log2: i32) -> u32 {
    let scaled = number + bitcast<u32>(log2 << 23u);
    return select(scaled, number, float_exponent(number) == 0u);
}

fn float_is_negative(number: u32) -> bool {
    return number > FLOAT_SIGN;
}

// Whether a number is above a positive one.
fn float_is_above(number: u32, limit: u32) -> bool {
    return number < FLOAT_SIGN && number > limit;
}

// number · factor · 2^exponent, rounded once to an integer and saturated to 32 bits. A factor of
// 16 bits makes a product of 40.
fn float_to_integer(mode: u32, number: u32, factor: u32, exponent: i32) -> i32 {
    var product = wide_multiply(bitcast<i32>(float_significand(number)), factor);
    if ((number & FLOAT_SIGN) != 0u) {
        product = wide_negate(product);
    }
    let shift = bitcast<i32>(float_exponent(number)) - FLOAT_BIAS - 23 + exponent;
    if (shift > 0) {
        // 24 bits and 22 more saturate in any case.
        return wide_saturate(wide_shift_left(product, bitcast<u32>(min(shift, 22))));
    }
    // After 62 shifts 40 bits are nearer to 0 than to a half, as they are after more.
    return wide_saturate(rounding_shift_wide(mode, product, bitcast<u32>(min(-shift, 62))));
}
