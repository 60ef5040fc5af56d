// Output: the last layer's accumulators become channel codes. See isa/src/shape.rs, `OutputFormat`.

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

// One row of the last layer: the code of a texel's channel.
fn emit(layer: Layer, texel: u32, channel: u32, accumulator: i32) {
    let row = rows[layer.row + channel];
    let range = output_range(header.outputs[channel >> 2u][channel & 3u]);
    let rescaled = requantizer_apply(PROFILE_OUTPUT, accumulator, row.mantissa, row.shift);
    let code = clamp(rescaled, range.x, range.y);
    codes[texel * header.channels + channel] = code;
    tap(layer.tap + channel, accumulator);
    tap(layer.tap + layer.outputs + channel, accumulator);
    tap(header.tap_codes + channel, code);
}
