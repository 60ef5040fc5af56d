// What the host hands over: the layout of every buffer. `pack.rs` writes them in the same order.

// A texel to decode.
struct Request {
    x: u32,
    y: u32,
    mip: u32,
}

// Grid 0 or 1 of the asset.
struct Grid {
    width: u32, // cells
    height: u32, // cells
    channels: u32,
    bits: u32, // of a latent
    scale_log2: u32,
    cell_bytes: u32,
    tap: u32, // where its taps start
    reserved: u32,
}

// One layer. Its input is vector `index`, its output vector `index + 1`.
struct Layer {
    steps: u32, // vec4 words of its input
    outputs: u32,
    row: u32, // the first of its rows in `rows`
    weight: u32, // the first of its words in `weights`
    activation: u32,
    leak_shift: u32,
    gate_mantissa: u32,
    gate_shift: u32,
    zero_point: i32,
    skip_span: u32, // 0: no skip path
    skip_mantissa: u32,
    skip_shift: u32,
    skip_zero_point: i32, // of the path's source
    tap: u32, // where its taps start
    reserved_0: u32,
    reserved_1: u32,
}

struct Header {
    mip_count: u32,
    octaves: u32,
    snap: u32,
    address_mode: u32,
    channels: u32,
    layers_count: u32,
    tap_inputs: u32, // where the inputs' taps start
    tap_codes: u32, // where the channel codes' taps start
    tap_words: u32, // words of one texel's taps
    reserved_0: u32,
    reserved_1: u32,
    reserved_2: u32,
    grids: array<Grid, 2>,
    outputs: array<vec4<u32>, MAX_CHANNELS / 4u>, // output format codes
    layers: array<Layer, MAX_LAYERS>,
}

// Bias and multiplier of one row.
struct Row {
    bias: i32,
    mantissa: u32,
    shift: u32,
}

// The layers that this dispatch runs; the first dispatch also embeds, the last also emits.
struct Part {
    first_layer: u32,
    end_layer: u32, // exclusive
    reserved_0: u32,
    reserved_1: u32,
}

@group(0) @binding(0) var<uniform> header: Header;
@group(0) @binding(1) var<storage, read> requests: array<Request>;
// Cells row after row, each with its channels' codes from the least significant bit, padded to a byte.
@group(0) @binding(2) var<storage, read> grid0: array<u32>;
@group(0) @binding(3) var<storage, read> grid1: array<u32>;
@group(0) @binding(4) var<storage, read> rows: array<Row>;
// Four rows at a time: step by step, and of each step row by row, sixteen weights.
@group(0) @binding(5) var<storage, read> weights: array<vec4<u32>>;
// The channel codes: texel after texel.
@group(0) @binding(6) var<storage, read_write> codes: array<i32>;
// Binding 7 is in taps.wgsl.
@group(0) @binding(8) var<uniform> part: Part;
// See vector.wgsl: sixteen lanes an element, the lane in the lowest bits first.
@group(0) @binding(9) var<storage, read_write> vectors: array<vec4<u32>>;
