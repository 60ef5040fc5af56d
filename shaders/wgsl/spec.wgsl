// Generated from the constants of ntmu-isa by shaders/src/spec.rs. Do not edit: change the
// constant there and refresh with `NTMU_BLESS=1 cargo test -p ntmu-shaders spec`.

// isa::limits
const MAX_CHANNELS: u32 = 16u;
const MAX_LAYERS: u32 = 64u;
const MAX_LEVELS: u32 = 15u;

// isa::position
const PHASE_BITS: u32 = 4u;
const SNAP_CELL: u32 = 0u;
const SNAP_STRIDE: u32 = 1u;
const ADDRESS_WRAP: u32 = 0u;
const ADDRESS_MIRROR: u32 = 1u;
const ADDRESS_CLAMP: u32 = 2u;

// isa::filter
const FILTER_EXACT: u32 = 0u;
const FILTER_FACTORED: u32 = 1u;
const FILTER_SEPARABLE: u32 = 2u;
const FILTER_ALL_ONES: u32 = 3u;

// isa::embed
const WAVES_PER_OCTAVE: u32 = 4u;
const WAVE_TRIANGLE: u32 = 0u;
const WAVE_SAW: u32 = 1u;

// isa::round
const ROUNDING_HALF_UP: u32 = 0u;
const ROUNDING_HALF_EVEN: u32 = 1u;
const ROUNDING_HALF_AWAY: u32 = 2u;
const ROUNDING_FLOOR: u32 = 3u;

// isa::rescale
const REQUANTIZER_SINGLE: u32 = 0u;
const REQUANTIZER_DOUBLE: u32 = 1u;
const REQUANTIZER_HALF_EVEN: u32 = 2u;
const REQUANTIZER_HALF_AWAY: u32 = 3u;
const REQUANTIZER_NARROW: u32 = 4u;

// isa::accumulate
const OVERFLOW_WRAP: u32 = 0u;
const OVERFLOW_SATURATE: u32 = 1u;

// isa::half
const HALF_ONE: u32 = 0x3c00u;
const HALF_MAX: u32 = 0x7bffu;
const FLOAT_SIXTH: u32 = 0x3e2aaaabu;
const SUM_SEQUENTIAL: u32 = 0u;
const SUM_FUSED: u32 = 1u;
const SUM_TREE4: u32 = 2u;
const SUM_TREE8: u32 = 3u;

// isa::activation
const GATE_FRACTION_BITS: u32 = 8u;
const GATE_MIN: i32 = -32768;
const GATE_MAX: i32 = 32767;
const ACTIVATION_IDENTITY: u32 = 0u;
const ACTIVATION_RELU: u32 = 1u;
const ACTIVATION_LEAKY: u32 = 2u;
const ACTIVATION_HARD_GELU: u32 = 3u;
const ACTIVATION_HARD_GELU_3: u32 = 4u;
const ACTIVATION_TABLE: u32 = 5u;

// isa::shape
const SAMPLING_CORNERS: u32 = 0u;
const SAMPLING_INTERPOLATED: u32 = 1u;
const OUTPUT_UNORM8: u32 = 0u;
const OUTPUT_UNORM8_MIN: i32 = 0;
const OUTPUT_UNORM8_MAX: i32 = 255;
const OUTPUT_UNORM16: u32 = 1u;
const OUTPUT_UNORM16_MIN: i32 = 0;
const OUTPUT_UNORM16_MAX: i32 = 65535;
const OUTPUT_SNORM8: u32 = 2u;
const OUTPUT_SNORM8_MIN: i32 = -127;
const OUTPUT_SNORM8_MAX: i32 = 127;
const OUTPUT_FLOAT16: u32 = 3u;
const OUTPUT_FLOAT16_MIN: i32 = 0;
const OUTPUT_FLOAT16_MAX: i32 = 65535;
