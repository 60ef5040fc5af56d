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

fn emit_channel(layer: Layer, texel: u32, channel: u32, accumulator: i32) {
    if (channel >= header.channels) {
        return;
    }
    let row = rows[layer.row + channel];
    let range = output_range(header.outputs[channel >> 2u][channel & 3u]);
    let rescaled = requantizer_apply(PROFILE_OUTPUT, accumulator, row.mantissa, row.shift);
    let code = clamp(rescaled, range.x, range.y);
    tap(layer.tap + channel, accumulator);
    tap(layer.tap + layer.outputs + channel, accumulator);
    tap(header.tap_codes + channel, code);
    codes[texel * header.channels + channel] = code;
}

// The last layer: vector `index` to the channel codes of a texel.
fn emit(index: u32, texel: u32) {
    let layer = header.layers[index];
    for (var row = 0u; row < layer.outputs; row += 4u) {
        let sums = dense(layer, index, row);
        emit_channel(layer, texel, row, sums.x);
        emit_channel(layer, texel, row + 1u, sums.y);
        emit_channel(layer, texel, row + 2u, sums.z);
        emit_channel(layer, texel, row + 3u, sums.w);
    }
}
