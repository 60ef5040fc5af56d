//! Table: the instructions.
//!
//! The rows below are the only place that knows the instructions. Encoder, decoder, assembler,
//! disassembler, operand checks, timing classes and the reference manual are read off them; the
//! linker and every executor `match` on [`Instruction`] and stop compiling when a row is added.
//! A row that leaves a bit of the word without a name, or names one twice, does not compile.

use super::class::Class;
use super::operand::{Field, Operand, OperandKind};

/// One row of the instruction table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Row {
    /// Bits 0..8 of the word.
    pub opcode: u8,
    /// Its name in assembly.
    pub mnemonic: &'static str,
    /// The part of the unit that it keeps busy.
    pub class: Class,
    /// Its operands, in the order of assembly.
    pub operands: &'static [Operand],
    /// Bits that belong to nothing and must be zero.
    pub reserved: &'static [Field],
    /// What it does, for the reference manual.
    pub summary: &'static str,
}

/// The bits of the opcode.
pub const OPCODE: Field = Field { low: 0, high: 8 };

impl Row {
    /// The bits that must be zero.
    #[must_use]
    pub const fn reserved_mask(&self) -> u64 {
        let (mut mask, mut at) = (0, 0);
        while at < self.reserved.len() {
            mask |= self.reserved[at].mask();
            at += 1;
        }
        mask
    }

    /// Opcode, operands and reserved bits hold every bit of the word once, and each operand's range
    /// fits its bits.
    const fn is_whole(&self) -> bool {
        let (mut taken, mut at) = (OPCODE.mask(), 0);
        while at < self.operands.len() {
            let operand = self.operands[at];
            let largest = operand.field.mask() >> operand.field.low;
            if taken & operand.field.mask() != 0 || operand.max() as u64 > largest {
                return false;
            }
            taken |= operand.field.mask();
            at += 1;
        }
        let mut at = 0;
        while at < self.reserved.len() {
            if taken & self.reserved[at].mask() != 0 {
                return false;
            }
            taken |= self.reserved[at].mask();
            at += 1;
        }
        taken == u64::MAX
    }
}

/// Every row is whole and no two share an opcode.
const fn is_sound(table: &[Row]) -> bool {
    let mut at = 0;
    while at < table.len() {
        if !table[at].is_whole() {
            return false;
        }
        let mut other = 0;
        while other < at {
            if table[other].opcode == table[at].opcode {
                return false;
            }
            other += 1;
        }
        at += 1;
    }
    true
}

const _: () = assert!(is_sound(TABLE), "a row of the instruction table");

macro_rules! instructions {
    ($(
        #[doc = $summary:literal]
        $variant:ident = $opcode:literal $mnemonic:literal $class:ident {
            $(
                #[doc = $operand_doc:literal]
                $operand:ident : $kind:ident [ $low:literal .. $high:literal ]
            ),* $(,)?
        } reserved $( [ $free_low:literal .. $free_high:literal ] )*;
    )*) => {
        /// One instruction of a microprogram, decoded.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum Instruction {
            $(
                #[doc = $summary]
                $variant { $( #[doc = $operand_doc] $operand: u16 ),* },
            )*
        }

        /// Where each row stands in the table.
        enum Index { $( $variant, )* }

        /// The instruction table.
        pub const TABLE: &[Row] = &[ $(
            Row {
                opcode: $opcode,
                mnemonic: $mnemonic,
                class: Class::$class,
                summary: $summary,
                operands: &[ $( Operand {
                    name: stringify!($operand),
                    kind: OperandKind::$kind,
                    field: Field { low: $low, high: $high },
                    summary: $operand_doc,
                } ),* ],
                reserved: &[ $( Field { low: $free_low, high: $free_high } ),* ],
            },
        )* ];

        impl Instruction {
            /// Its row of the table.
            #[must_use]
            pub const fn row(&self) -> &'static Row {
                let index = match self { $( Instruction::$variant { .. } => Index::$variant, )* };
                &TABLE[index as usize]
            }

            /// Its operands, in the order of the row.
            #[must_use]
            pub fn operands(&self) -> Vec<u16> {
                match *self {
                    $( Instruction::$variant { $( $operand ),* } => vec![ $( $operand ),* ], )*
                }
            }

            /// The instruction with this opcode and these operands in the order of its row, whatever
            /// their numbers.
            ///
            /// `None` when there is no such opcode or the number of operands is another.
            #[must_use]
            pub fn from_operands(opcode: u8, operands: &[u16]) -> Option<Instruction> {
                match (opcode, operands) {
                    $( ($opcode, &[ $( $operand ),* ]) => {
                        Some(Instruction::$variant { $( $operand ),* })
                    } )*
                    _ => None,
                }
            }
        }
    };
}

instructions! {
    /// Grid position of the request's texel, in the level of a grid that serves its mip: first corner, stride and phase per axis.
    Position = 0x01 "position" Position {
        /// The grid.
        grid: Grid [8..9],
    } reserved [9..64];
    /// Read the codes of the four corners of a grid, at its last position.
    Fetch = 0x02 "fetch" Fetch {
        /// The grid.
        grid: Grid [8..9],
    } reserved [9..64];
    /// Unpack the fetched corners of a grid and write them one after the other as inputs.
    Concat = 0x03 "concat" Unpack {
        /// Where the inputs go.
        dst: Vector [16..18],
        /// The first lane written.
        lane: Lane [32..42],
        /// The grid.
        grid: Grid [8..9],
    } reserved [9..16] [18..32] [42..64];
    /// Unpack the fetched corners of a grid, interpolate them and write inputs, rounded as the profile says.
    Lerp = 0x04 "lerp" Interpolate {
        /// Where the inputs go.
        dst: Vector [16..18],
        /// The first lane written.
        lane: Lane [32..42],
        /// The grid.
        grid: Grid [8..9],
    } reserved [9..16] [18..32] [42..64];
    /// Write the triangle waves of the texel: octave by octave, x then y, phase 0 then a quarter.
    Wave = 0x05 "wave" Embed {
        /// Where the inputs go.
        dst: Vector [16..18],
        /// The first lane written.
        lane: Lane [32..42],
        /// How many octaves.
        octaves: Octaves [24..26],
    } reserved [8..16] [18..24] [26..32] [42..64];
    /// Write the normalised mip of the request.
    Level = 0x06 "level" Embed {
        /// Where the input goes.
        dst: Vector [16..18],
        /// The lane written.
        lane: Lane [32..42],
    } reserved [8..16] [18..32] [42..64];
    /// Write the saw waves of the texel, in the order of the triangle waves.
    Saw = 0x07 "saw" Embed {
        /// Where the inputs go.
        dst: Vector [16..18],
        /// The first lane written.
        lane: Lane [32..42],
        /// How many octaves.
        octaves: Octaves [24..26],
    } reserved [8..16] [18..24] [26..32] [42..64];
    /// Write zeros.
    Zero = 0x08 "zero" Embed {
        /// Where the inputs go.
        dst: Vector [16..18],
        /// The first lane written.
        lane: Lane [32..42],
        /// How many lanes.
        lanes: Zeros [24..28],
    } reserved [8..16] [18..24] [28..32] [42..64];
    /// Accumulators of an integer layer: bias, plus weights times vector, k ascending.
    Dense = 0x10 "dense" MultiplyInteger {
        /// The layer.
        layer: Layer [8..14],
        /// The vector multiplied.
        src: Vector [16..18],
        /// Lanes of the vector.
        inputs: Lanes [32..43],
        /// Accumulators made.
        outputs: Lanes [48..59],
    } reserved [14..16] [18..32] [43..48] [59..64];
    /// ReLU on the accumulators.
    Relu = 0x11 "relu" Activate {
        /// Accumulators.
        outputs: Lanes [48..59],
    } reserved [8..48] [59..64];
    /// Leaky ReLU on the accumulators, slope 2^−shift.
    Leaky = 0x12 "leaky" Activate {
        /// n of the slope 2^−n.
        shift: Shift [24..27],
        /// Accumulators.
        outputs: Lanes [48..59],
    } reserved [8..24] [27..48] [59..64];
    /// Hard GELU: accumulators to 8.8 arguments by the layer's scales, then the gate's product.
    Gate = 0x13 "gate" Activate {
        /// The layer.
        layer: Layer [8..14],
        /// Accumulators.
        outputs: Lanes [48..59],
    } reserved [14..48] [59..64];
    /// Accumulators to activations: rescale, add the zero point, saturate to the layer's bits.
    Rescale = 0x14 "rescale" Requantise {
        /// The layer.
        layer: Layer [8..14],
        /// Where the activations go.
        dst: Vector [16..18],
        /// Accumulators.
        outputs: Lanes [48..59],
    } reserved [14..16] [18..48] [59..64];
    /// As rescale, with a rescaled skip vector added before the saturation.
    RescaleSkip = 0x15 "rescale.skip" Requantise {
        /// The layer.
        layer: Layer [8..14],
        /// Where the activations go.
        dst: Vector [16..18],
        /// The skip path's source.
        skip: Vector [18..20],
        /// Accumulators.
        outputs: Lanes [48..59],
    } reserved [14..16] [20..48] [59..64];
    /// Accumulators to channel codes: rescale, saturate to each channel's format, and send.
    Emit = 0x16 "emit" Emit {
        /// The layer.
        layer: Layer [8..14],
        /// Channels.
        outputs: Channels [48..59],
    } reserved [14..48] [59..64];
    /// Replace accumulators by entries of the layer's table; the next rescale only adds to them.
    Table = 0x17 "table" Activate {
        /// The layer.
        layer: Layer [8..14],
        /// Accumulators.
        outputs: Lanes [48..59],
    } reserved [14..48] [59..64];
    /// The texel, or the sample, is done.
    End = 0x1f "end" Control {
    } reserved [8..64];
    /// Sums of an fp16 layer in f32: bias, plus weights times vector read as halves.
    DenseHalf = 0x20 "dense.half" MultiplyHalf {
        /// The layer.
        layer: Layer [8..14],
        /// The vector multiplied.
        src: Vector [16..18],
        /// Lanes of the vector.
        inputs: Lanes [32..43],
        /// Sums made.
        outputs: Lanes [48..59],
    } reserved [14..16] [18..32] [43..48] [59..64];
    /// ReLU on the sums.
    ReluHalf = 0x21 "relu.half" Activate {
        /// Sums.
        outputs: Lanes [48..59],
    } reserved [8..48] [59..64];
    /// Leaky ReLU on the sums, slope 2^−shift.
    LeakyHalf = 0x22 "leaky.half" Activate {
        /// n of the slope 2^−n.
        shift: Shift [24..27],
        /// Sums.
        outputs: Lanes [48..59],
    } reserved [8..24] [27..48] [59..64];
    /// Hard GELU on the sums; of an argument limited to 3 if `clamped` is 1.
    GateHalf = 0x23 "gate.half" Activate {
        /// Whether the argument is limited to 3.
        clamped: Flag [24..25],
        /// Sums.
        outputs: Lanes [48..59],
    } reserved [8..24] [25..48] [59..64];
    /// Add a vector of halves to the sums, in f32.
    SkipHalf = 0x24 "skip.half" Skip {
        /// The skip path's source.
        skip: Vector [18..20],
        /// Sums.
        outputs: Lanes [48..59],
    } reserved [8..18] [20..48] [59..64];
    /// Sums to halves: ties to even, saturated.
    RoundHalf = 0x25 "round.half" Requantise {
        /// Where the halves go.
        dst: Vector [16..18],
        /// Sums.
        outputs: Lanes [48..59],
    } reserved [8..16] [18..48] [59..64];
    /// Sums to integers of the layer's bits, for an integer layer.
    QuantizeHalf = 0x26 "quantize.half" Requantise {
        /// The layer.
        layer: Layer [8..14],
        /// Where the integers go.
        dst: Vector [16..18],
        /// Sums.
        outputs: Lanes [48..59],
    } reserved [14..16] [18..48] [59..64];
    /// Sums to channel codes: to each channel's format, and send.
    EmitHalf = 0x27 "emit.half" Emit {
        /// Channels.
        outputs: Channels [48..59],
    } reserved [8..48] [59..64];
    /// Run the instructions up to `again` so often; a layer l among them is l + step·i in run i.
    Repeat = 0x40 "repeat" Control {
        /// How often.
        times: Times [24..31],
        /// Layers from one run to the next.
        step: Step [8..14],
    } reserved [14..24] [31..64];
    /// The end of what is repeated.
    Again = 0x41 "again" Control {
    } reserved [8..64];
    /// The sample's decodes and their weights, by the sampler's state: each texel or place once.
    Footprint = 0x50 "footprint" Filter {
    } reserved [8..64];
    /// Run the instructions up to `next` for each decode of the footprint; for none where all is border.
    Each = 0x51 "each" Control {
    } reserved [8..64];
    /// The end of what is run for each decode.
    Next = 0x52 "next" Control {
    } reserved [8..64];
    /// As emit, to the filter's buffer, at the place of the decode.
    Collect = 0x53 "collect" Emit {
        /// The layer.
        layer: Layer [8..14],
        /// Channels.
        outputs: Channels [48..59],
    } reserved [14..48] [59..64];
    /// As emit.half, to the filter's buffer, at the place of the decode.
    CollectHalf = 0x54 "collect.half" Emit {
        /// Channels.
        outputs: Channels [48..59],
    } reserved [8..48] [59..64];
    /// Codes of the buffer and their weights to filtered codes, by the profile's filter rule, and send.
    Blend = 0x55 "blend" Filter {
        /// Channels.
        outputs: Channels [48..59],
    } reserved [8..48] [59..64];
}
