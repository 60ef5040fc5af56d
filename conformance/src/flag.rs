//! Flag: why a case is in the suite. A failure's flags name the rule that was likely broken.

/// One flag and what it means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Flag {
    /// Its name in a case.
    pub name: &'static str,
    /// The family of mistakes that it points at.
    pub kind: &'static str,
    /// What a device that fails here is likely to do.
    pub description: &'static str,
}

macro_rules! flags {
    ($( $constant:ident = $name:literal, $kind:literal, $description:literal; )*) => {
        $(
            #[doc = $description]
            pub const $constant: Flag =
                Flag { name: $name, kind: $kind, description: $description };
        )*

        /// Every flag.
        pub const ALL: &[Flag] = &[$($constant),*];
    };
}

flags! {
    TIE = "Tie", "rounding",
        "The result lies exactly between two integers: the tie rule decides.";
    NEGATIVE_TIE = "NegativeTie", "rounding",
        "A tie below zero: ties up, ties away from zero and ties to even part here.";
    NEAR_TIE = "NearTie", "rounding",
        "One unit of the value beside a tie: a device that adds a wrong half fails here.";
    DOUBLE_TIE = "DoubleTie", "rounding",
        "A tie of the second of two roundings only: single and double rounding part here.";
    NARROW_TIE = "NarrowTie", "rounding",
        "A tie of the product with the 16-bit multiplier.";
    NARROW_MANTISSA = "NarrowMantissa", "rounding",
        "The mantissa lies between two 16-bit multipliers, or above the largest.";
    SMALL_SHIFT = "SmallShift", "overflow",
        "The shift is below 17: a 16-bit multiplier is shifted left, large values overflow 32 bits.";
    LARGE_SHIFT = "LargeShift", "overflow",
        "The shift is above 56: the added half needs the upper bits of a 64-bit sum.";
    SATURATION = "Saturation", "overflow",
        "The result is at the edge of 32 bits or beyond it and must saturate.";
    KNOWN_ANSWER = "KnownAnswer", "rounding",
        "The published example of tensorflow issue 25087: single rounding gives 11, double 12.";
    PLAIN = "Plain", "basic",
        "Nothing special: a device that fails here fails everywhere.";
    DEEP_MIP = "DeepMip", "position",
        "A mip coarser than the grid: corners are a stride of several cells apart.";
    COARSE_LEVEL = "CoarseLevel", "position",
        "A level of the grids beyond level 0 serves the mip: it has a size and latents of its own.";
    DROPPED_FRACTION = "DroppedFraction", "position",
        "The position has more than four fractional bits: the phase is floored, not rounded.";
    SNAP = "Snap", "position",
        "The first corner differs between the two snapping rules.";
    SEAM = "Seam", "position",
        "A corner lies outside the grid: the address mode decides which cell it means.";
    NON_POWER_OF_TWO = "NonPowerOfTwo", "position",
        "The grid's size is no power of two: an address computed with a mask is wrong.";
    LATTICE = "Lattice", "position",
        "The texel centre lies on a cell centre: the phase is 0.";
    IMAGE_CORNER = "ImageCorner", "position",
        "A corner texel of its mip.";
    SKIP_PATH = "SkipPath", "layer",
        "The synthesizer has residual blocks: the skip path has its own scale and zero point.";
    GATE = "Gate", "layer",
        "The synthesizer uses a hard GELU: its argument is rescaled before the gate.";
    LEAK = "Leak", "layer",
        "The synthesizer uses a leaky ReLU: what is negative is rounded on the accumulator.";
    CLAMPED_GATE = "ClampedGate", "layer",
        "The synthesizer uses a hard GELU whose argument is limited to 3.";
    TABLE_LOOKUP = "TableLookup", "layer",
        "The synthesizer uses a table: its entry replaces the accumulator and is not rescaled.";
    WEIGHT_BITS = "WeightBits", "layer",
        "Layers have weights of different widths.";
    LANE_BITS = "LaneBits", "layer",
        "Activations have fewer or more than eight bits.";
    HALF_LAYER = "HalfLayer", "layer",
        "The synthesizer has fp16 layers: products in f32, one rounding to fp16 at the end.";
    MIXED_LAYERS = "MixedLayers", "layer",
        "Integer and fp16 layers follow each other: integers are read as halves, sums become integers.";
    SUM_ORDER = "SumOrder", "profile",
        "The profile sums an fp16 layer in another order than product by product in f32.";
    CONVERT = "Convert", "rounding",
        "f32 sums become integers by another rule than ties to even.";
    HALF_SATURATION = "HalfSaturation", "overflow",
        "Numbers beyond 65504 occur: they saturate and do not become infinite.";
    FLOAT_OUTPUT = "FloatOutput", "layer",
        "A channel is fp16: its code is the number's bits.";
    NARROW_ACCUMULATOR = "NarrowAccumulator", "profile",
        "Accumulators of integer layers have fewer than 32 bits.";
    OVERFLOW = "Overflow", "overflow",
        "An accumulator goes beyond its width at this texel and wraps or saturates, product by product.";
    NARROW_RESIDUAL = "NarrowResidual", "overflow",
        "A rescaled skip term has fewer than 32 bits and saturates before it is added.";
    SAW = "Saw", "embed",
        "The waves are saws and not triangles.";
    PADDING = "Padding", "embed",
        "Zeros follow the level up to the width of the first layer.";
    SAMPLING = "Sampling", "embed",
        "Grid 0 is interpolated or the corners of grid 1 are concatenated.";
    INPUT_BITS = "InputBits", "embed",
        "Inputs have fewer or more than eight bits.";
    INTERPOLATION_RULE = "InterpolationRule", "embed",
        "Corners are interpolated by another rule than exact products of weights.";
    TIES_EVERYWHERE = "TiesEverywhere", "rounding",
        "All scales are powers of two, so that most rescalings meet ties.";
    SEPARATING = "Separating", "profile",
        "One rule of the profile replaced by another gives other codes here.";
    ALTERNATE_PROFILE = "AlternateProfile", "profile",
        "The asset's profile is not the normative one.";
    EIGHT_BIT_LATENT = "EightBitLatent", "embed",
        "Corners of eight bits lose one, with the profile's input rounding.";
    ONE_TEXEL = "OneTexel", "basic",
        "The texture set is one texel: every corner is the same cell.";
    CONTROL = "Control", "basic",
        "A file that must be accepted: a device that refuses everything fails here.";
    TRUNCATED = "Truncated", "file",
        "The file ends too early.";
    OVERLONG = "Overlong", "file",
        "There are bytes after the end of the file.";
    MAGIC = "Magic", "file",
        "The first eight bytes are another format's, or were changed in transfer.";
    VERSION = "Version", "file",
        "The major version is another, or the version is newer than this one.";
    BIT_FLIP = "BitFlip", "file",
        "One bit of the file is flipped: a CRC-32 or a reserved field shows it.";
    TABLE = "Table", "file",
        "The table of sections does not describe the file; all CRC-32 are right.";
    RESERVED = "Reserved", "file",
        "A bit that must be zero is set; all CRC-32 are right.";
    FIELD_RANGE = "FieldRange", "file",
        "A field is outside its range; all CRC-32 are right.";
    CONTRADICTION = "Contradiction", "file",
        "Two fields contradict each other; all CRC-32 are right.";
}
