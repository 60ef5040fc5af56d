// No halves: linked in place of float.wgsl, half.wgsl and half_layer.wgsl where an asset has none, so
// that no compiler spends its time on them. Nothing here is ever called.

fn half_from_fixed(value: Wide, fraction_bits: u32) -> u32 {
    return 0u;
}

fn dense_half(layer: Layer, source: u32, row: u32) -> vec4<u32> {
    return vec4<u32>(0u, 0u, 0u, 0u);
}

fn finish_half(layer: Layer, index: u32, row: u32, sum: u32) {
}

fn output_code_half(format: u32, sum: u32) -> i32 {
    return 0;
}
