// Activations: what happens to an accumulator between two layers. See isa/src/activation.rs.

fn leak(accumulator: i32, shift: u32, mode: u32) -> i32 {
    if (accumulator >= 0) {
        return accumulator;
    }
    return rounding_shift(mode, accumulator, shift);
}

// argument · 6·clamp(x/3 + 1/2, 0, 1) with x = argument / 2^8.
fn gate(argument: i32) -> i32 {
    let one = 6i << GATE_FRACTION_BITS;
    return argument * clamp(2 * argument + one / 2, 0, one);
}

fn gate_argument(
    accumulator: i32, mantissa: u32, shift: u32, requantizer: u32, is_clamped: bool,
) -> i32 {
    let high = select(GATE_MAX, 3i << GATE_FRACTION_BITS, is_clamped);
    return clamp(requantizer_apply(requantizer, accumulator, mantissa, shift), GATE_MIN, high);
}

// From entry 0 for -128 on.
fn table_index(accumulator: i32, mantissa: u32, shift: u32, requantizer: u32) -> u32 {
    let byte = clamp(requantizer_apply(requantizer, accumulator, mantissa, shift), -128, 127);
    return bitcast<u32>(byte + 128);
}

// Entries have 16 bits, eight in an element.
fn table_entry(layer: Layer, index: u32) -> i32 {
    let word = bitcast<i32>(weights[layer.table + (index >> 3u)][(index >> 1u) & 3u]);
    return extractBits(word, (index & 1u) * 16u, 16u);
}

// Whether a layer has an activation. `HAS_ACTIVATION` has a bit for each that occurs in the asset,
// so that no device computes another.
fn has_activation(layer: Layer, activation: u32) -> bool {
    return ((HAS_ACTIVATION >> activation) & 1u) != 0u && layer.activation == activation;
}

fn is_gated(layer: Layer) -> bool {
    return has_activation(layer, ACTIVATION_HARD_GELU)
        || has_activation(layer, ACTIVATION_HARD_GELU_3);
}

// The accumulator after the layer's activation; a hard GELU's is the gate's product, a table's the
// entry.
fn activate(layer: Layer, row: Row, accumulator: i32) -> i32 {
    if (has_activation(layer, ACTIVATION_RELU)) {
        return max(accumulator, 0);
    }
    if (has_activation(layer, ACTIVATION_LEAKY)) {
        return leak(accumulator, layer.leak_shift, PROFILE_LEAK);
    }
    if (is_gated(layer)) {
        let is_clamped = has_activation(layer, ACTIVATION_HARD_GELU_3);
        return gate(
            gate_argument(accumulator, row.mantissa, row.shift, PROFILE_REQUANTIZE, is_clamped),
        );
    }
    if (has_activation(layer, ACTIVATION_TABLE)) {
        return table_entry(
            layer, table_index(accumulator, row.mantissa, row.shift, PROFILE_REQUANTIZE),
        );
    }
    return accumulator;
}
