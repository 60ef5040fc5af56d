// What the host hands over: the layout of every buffer. `pack.rs` writes them in the same order.

// A texel to decode.
struct Request {
    x: u32,
    y: u32,
    mip: u32,
}

// Grid 0 or 1 of the asset.
struct Grid {
    channels: u32,
    bits: u32, // of a latent
    scale_log2: u32, // of level 0
    cell_bytes: u32,
    tap: u32, // where its taps start
    reserved: u32, // these, up to a multiple of sixteen bytes
    reserved_too: u32,
    reserved_last: u32,
    levels: array<vec4<u32>, MAX_LEVELS>, // columns, rows, cells of the levels before; nothing
}

// One layer. Its input is vector `index`, its output vector `index + 1`.
struct Layer {
    inputs: u32,
    outputs: u32,
    arithmetic: u32,
    steps: u32, // elements of a row's weights
    row: u32, // the first of its rows in `rows`
    weight: u32, // the first of its elements in `weights`
    table: u32, // as `weight`, of its table
    tap: u32, // where its taps start
    input_lanes: u32,
    input_bits: u32, // of integers, and what follows
    input_zero_point: i32,
    activation: u32,
    leak_shift: u32,
    gate_mantissa: u32,
    gate_shift: u32,
    output_lanes: u32,
    output_bits: u32, // of integers, and what follows
    zero_point: i32,
    quantize_exponent: i32, // of an fp16 layer that gives integers
    skip_span: u32, // 0: no skip path
    skip_lanes: u32, // of the path's source, and what follows
    skip_zero_point: i32,
    skip_mantissa: u32,
    skip_shift: u32,
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
    wave: u32,
    padding: u32,
    pyramid: u32, // mips of level 0 << 4 | mips of every further level; 0: a single level
    grids: array<Grid, 2>,
    outputs: array<vec4<u32>, MAX_CHANNELS / 4u>, // output format codes
    layers: array<Layer, MAX_LAYERS>,
}

// Bias and multiplier of one row; of an fp16 layer only the bias, a half.
struct Row {
    bias: i32,
    mantissa: u32,
    shift: u32,
}

// What this dispatch runs: some layers, or some rows of one. The first dispatch also embeds, the
// last also emits.
struct Part {
    first_layer: u32,
    end_layer: u32, // exclusive
    first_row: u32, // of each of these layers; a multiple of four
    end_row: u32, // exclusive; rows past a layer's last are not there
}

@group(0) @binding(0) var<uniform> header: Header;
@group(0) @binding(1) var<storage, read> requests: array<Request>;
// Levels one after the other, of cells row after row, each with its channels' codes from the least
// significant bit, padded to a byte.
@group(0) @binding(2) var<storage, read> grid0: array<u32>;
@group(0) @binding(3) var<storage, read> grid1: array<u32>;
@group(0) @binding(4) var<storage, read> rows: array<Row>;
// Four rows at a time: step by step, and of each step row by row, sixteen weights of a byte or
// eight halves. After a layer's weights comes its table, if it has one.
@group(0) @binding(5) var<storage, read> weights: array<vec4<u32>>;
// The channel codes: texel after texel.
@group(0) @binding(6) var<storage, read_write> codes: array<i32>;
// Binding 7 is in taps.wgsl.
@group(0) @binding(8) var<uniform> part: Part;
// See vector.wgsl: sixteen or eight lanes an element.
@group(0) @binding(9) var<storage, read_write> vectors: array<vec4<u32>>;
