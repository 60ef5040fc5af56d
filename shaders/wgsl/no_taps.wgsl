// No taps: what taps.wgsl keeps is dropped, and the compiler drops what led to it.

fn tap_texel(texel: u32) {
}

fn tap(offset: u32, value: i32) {
}
