// Output: the last layer's sums become channel codes. See isa/src/shape.rs, `OutputFormat`.

// Of the formats that hold integers.
fn output_range(format: u32) -> vec2<i32> {
    switch format {
        case OUTPUT_UNORM16: {
            return vec2<i32>(OUTPUT_UNORM16_MIN, OUTPUT_UNORM16_MAX);
        }
        case OUTPUT_SNORM8: {
            return vec2<i32>(OUTPUT_SNORM8_MIN, OUTPUT_SNORM8_MAX);
        }
        default: { // OUTPUT_UNORM8
            return vec2<i32>(OUTPUT_UNORM8_MIN, OUTPUT_UNORM8_MAX);
        }
    }
}

fn output_code(format: u32, row: Row, accumulator: i32) -> i32 {
    if (HAS_FLOAT_OUTPUT && format == OUTPUT_FLOAT16) {
        // One rounding of the exact product.
        let product = wide_multiply(accumulator, row.mantissa);
        return bitcast<i32>(half_from_fixed(product, row.shift));
    }
    let range = output_range(format);
    let rescaled = requantizer_apply(PROFILE_OUTPUT, accumulator, row.mantissa, row.shift);
    return clamp(rescaled, range.x, range.y);
}

// One row of the last layer: the code of a texel's channel.
fn emit(layer: Layer, texel: u32, channel: u32, accumulator: i32) {
    let format = header.outputs[channel >> 2u][channel & 3u];
    var code = 0i;
    if (is_half(layer)) {
        code = output_code_half(format, bitcast<u32>(accumulator));
    } else {
        code = output_code(format, rows[layer.row + channel], accumulator);
    }
    codes[texel * header.channels + channel] = code;
    tap(layer.tap + channel, accumulator);
    tap(layer.tap + layer.outputs + channel, accumulator);
    tap(header.tap_codes + channel, code);
}
