// Unpack: the code in a bit field, and the value that it stands for. See isa/src/latent.rs.

// `bits` bits (1..=8) from bit `offset` (0..32) of two words, the lower first.
fn unpack(low: u32, high: u32, offset: u32, bits: u32) -> u32 {
    var field = low >> offset;
    // Where the offset is 0 the whole field is in the lower word, and `high << 32` is no shift.
    if (offset != 0u) {
        field |= high << (32u - offset);
    }
    return field & ((1u << bits) - 1u);
}

fn latent_value(code: u32, bits: u32) -> i32 {
    let zero_point = (1i << (bits - 1u)) - 1;
    return bitcast<i32>(code) - zero_point;
}
