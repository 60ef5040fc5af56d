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

fn gate_argument(accumulator: i32, mantissa: u32, shift: u32, requantizer: u32) -> i32 {
    return clamp(requantizer_apply(requantizer, accumulator, mantissa, shift), GATE_MIN, GATE_MAX);
}

// The accumulator after the layer's activation; a hard GELU's is the gate's product.
fn activate(layer: Layer, row: Row, accumulator: i32) -> i32 {
    switch layer.activation {
        case ACTIVATION_RELU: {
            return max(accumulator, 0);
        }
        case ACTIVATION_LEAKY: {
            return leak(accumulator, layer.leak_shift, PROFILE_LEAK);
        }
        case ACTIVATION_HARD_GELU: {
            return gate(gate_argument(accumulator, row.mantissa, row.shift, PROFILE_REQUANTIZE));
        }
        default: { // ACTIVATION_IDENTITY
            return accumulator;
        }
    }
}
