// Accumulators: the sums of an integer layer, in their width. See isa/src/accumulate.rs.

// The smallest and the largest signed number of `bits` bits, 1..=32.
fn signed_range(bits: u32) -> vec2<i32> {
    let high = bitcast<i32>(0x7fffffffu >> (32u - bits));
    return vec2<i32>(-high - 1, high);
}

// The signed number in the low `bits` bits, 1..=32.
fn accumulator_wrap(value: i32, bits: u32) -> i32 {
    let unused = 32u - bits;
    return (value << unused) >> unused;
}

// The sum of an accumulator and a product, in the accumulator's width.
fn accumulator_add(overflow: u32, bits: u32, sum: i32, product: i32) -> i32 {
    if (overflow == OVERFLOW_WRAP) {
        return accumulator_wrap(sum + product, bits);
    }
    let range = signed_range(bits);
    return clamp(saturating_add(sum, product), range.x, range.y);
}
