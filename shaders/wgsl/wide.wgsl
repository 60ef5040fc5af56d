// Wide: a signed 64-bit integer as two 32-bit words. WGSL has none, and the products of a
// requantiser need it.

struct Wide {
    low: u32,
    high: u32, // two's complement: its top bit is the sign
}

fn wide(value: i32) -> Wide {
    return Wide(bitcast<u32>(value), bitcast<u32>(value >> 31u));
}

fn wide_add(a: Wide, b: Wide) -> Wide {
    let low = a.low + b.low;
    let carry = select(0u, 1u, low < a.low);
    return Wide(low, a.high + b.high + carry);
}

fn wide_is_negative(value: Wide) -> bool {
    return bitcast<i32>(value.high) < 0;
}

fn wide_negate(value: Wide) -> Wide {
    return wide_add(Wide(~value.low, ~value.high), Wide(1u, 0u));
}

// value · factor. The unsigned product counts a negative value 2^32 too high, so the factor is
// taken off the upper word. The four partial products are of 16-bit halves; no sum of them here
// reaches 2^32.
fn wide_multiply(value: i32, factor: u32) -> Wide {
    let a = bitcast<u32>(value);
    let a0 = a & 0xffffu;
    let a1 = a >> 16u;
    let b0 = factor & 0xffffu;
    let b1 = factor >> 16u;
    let first = a1 * b0 + ((a0 * b0) >> 16u);
    let second = a0 * b1 + (first & 0xffffu);
    let high = a1 * b1 + (first >> 16u) + (second >> 16u);
    return Wide(a * factor, high - select(0u, factor, value < 0));
}

// value · 2^shift, 0 ≤ shift < 32.
fn wide_shift_left(value: Wide, shift: u32) -> Wide {
    if (shift == 0u) {
        return value;
    }
    return Wide(value.low << shift, (value.high << shift) | (value.low >> (32u - shift)));
}

// ⌊value / 2^shift⌋, 0 ≤ shift < 64. A WGSL shift takes fewer than 32, hence the cases.
fn wide_shift_floor(value: Wide, shift: u32) -> Wide {
    let high = bitcast<i32>(value.high);
    if (shift >= 32u) {
        return wide(high >> (shift - 32u));
    }
    if (shift == 0u) {
        return value;
    }
    let low = (value.low >> shift) | (value.high << (32u - shift));
    return Wide(low, bitcast<u32>(high >> shift));
}

// Whether any of the lowest `count` bits is set, 0 ≤ count < 64.
fn wide_any_below(value: Wide, count: u32) -> bool {
    if (count >= 32u) {
        return value.low != 0u || (value.high & ((1u << (count - 32u)) - 1u)) != 0u;
    }
    return (value.low & ((1u << count) - 1u)) != 0u;
}

// The nearest i32.
fn wide_saturate(value: Wide) -> i32 {
    let low = bitcast<i32>(value.low);
    let fits = value.high == bitcast<u32>(low >> 31u);
    let limit = select(0x7fffffffu, 0x80000000u, wide_is_negative(value));
    return select(bitcast<i32>(limit), low, fits);
}
