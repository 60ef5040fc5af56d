// Generated from the constants of ntmu-isa by shaders/src/spec.rs. Do not edit: change the
// constant there and refresh with `NTMU_BLESS=1 cargo test -p ntmu-shaders spec`.

// isa::limits
const MAX_CHANNELS: u32 = 16u;
const MAX_LAYERS: u32 = 64u;

// isa::position
const PHASE_BITS: u32 = 4u;
const SNAP_CELL: u32 = 0u;
const SNAP_STRIDE: u32 = 1u;
const ADDRESS_WRAP: u32 = 0u;
const ADDRESS_MIRROR: u32 = 1u;
const ADDRESS_CLAMP: u32 = 2u;

// isa::embed
const INPUT_FRACTION_BITS: u32 = 7u;
const WAVES_PER_OCTAVE: u32 = 4u;
const ACTIVATION_MIN: i32 = -128;
const ACTIVATION_MAX: i32 = 127;

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

// isa::activation
const GATE_FRACTION_BITS: u32 = 8u;
const GATE_MIN: i32 = -32768;
const GATE_MAX: i32 = 32767;
const ACTIVATION_IDENTITY: u32 = 0u;
const ACTIVATION_RELU: u32 = 1u;
const ACTIVATION_LEAKY: u32 = 2u;
const ACTIVATION_HARD_GELU: u32 = 3u;

// isa::shape
const OUTPUT_UNORM8: u32 = 0u;
const OUTPUT_UNORM8_MIN: i32 = 0;
const OUTPUT_UNORM8_MAX: i32 = 255;
const OUTPUT_UNORM16: u32 = 1u;
const OUTPUT_UNORM16_MIN: i32 = 0;
const OUTPUT_UNORM16_MAX: i32 = 65535;
const OUTPUT_SNORM8: u32 = 2u;
const OUTPUT_SNORM8_MIN: i32 = -127;
const OUTPUT_SNORM8_MAX: i32 = 127;
