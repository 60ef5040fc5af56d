// Taps: every intermediate value, kept. Linked in place of no_taps.wgsl where they are asked for.

@group(0) @binding(7) var<storage, read_write> taps: array<i32>;

var<private> tap_start: u32;

fn tap_texel(texel: u32) {
    tap_start = texel * header.tap_words;
}

fn tap(offset: u32, value: i32) {
    taps[tap_start + offset] = value;
}
