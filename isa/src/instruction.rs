//! Instruction: one 64-bit word of a microprogram.
//!
//! The table below is the only place that knows the instructions. Encoder, decoder, assembler,
//! disassembler and reference manual are read off it; an executor `match`es on [`Instruction`] and
//! stops compiling when a row is added.

use std::fmt;

/// What an operand names. It decides how the operand is written in assembly.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum OperandKind {
    /// A grid, `g0` or `g1`.
    Grid,
    /// A vector register of 16-bit lanes, integers or halves, `v0`..`v3`.
    Vector,
    /// A layer's parameters, `l0`..`l63`.
    Layer,
    /// A number.
    Immediate,
}

impl OperandKind {
    /// What stands before the number in assembly.
    #[must_use]
    pub const fn prefix(self) -> &'static str {
        match self {
            OperandKind::Grid => "g",
            OperandKind::Vector => "v",
            OperandKind::Layer => "l",
            OperandKind::Immediate => "",
        }
    }
}

/// One operand of an instruction: its name, kind, and bits of the word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Operand {
    /// Its name in assembly and in [`Instruction`].
    pub name: &'static str,
    /// What it names.
    pub kind: OperandKind,
    /// Its lowest bit in the word.
    pub low: u8,
    /// The bit above its highest.
    pub high: u8,
}

/// One row of the instruction table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Row {
    /// Bits 0..8 of the word.
    pub opcode: u8,
    /// Its name in assembly.
    pub mnemonic: &'static str,
    /// Its operands, in the order of assembly.
    pub operands: &'static [Operand],
    /// What it does, for the reference manual.
    pub summary: &'static str,
}

/// Vector registers of a unit.
pub const VECTOR_COUNT: u16 = 4;

macro_rules! instructions {
    ($(
        #[doc = $summary:literal]
        $variant:ident = $opcode:literal $mnemonic:literal {
            $( #[doc = $operand_doc:literal] $operand:ident : $kind:ident [ $low:literal .. $high:literal ] ),* $(,)?
        }
    )*) => {
        /// One instruction of a microprogram, decoded.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub enum Instruction {
            $(
                #[doc = $summary]
                $variant { $( #[doc = $operand_doc] $operand: u16 ),* },
            )*
        }

        /// The instruction table, in the order of the opcodes.
        pub const TABLE: &[Row] = &[ $(
            Row {
                opcode: $opcode,
                mnemonic: $mnemonic,
                summary: $summary,
                operands: &[ $( Operand {
                    name: stringify!($operand),
                    kind: OperandKind::$kind,
                    low: $low,
                    high: $high,
                } ),* ],
            },
        )* ];

        impl Instruction {
            /// Its row of the table.
            #[must_use]
            pub fn row(&self) -> &'static Row {
                let opcode: u8 = match self { $( Instruction::$variant { .. } => $opcode, )* };
                TABLE.iter().find(|row| row.opcode == opcode).unwrap_or(&TABLE[0])
            }

            /// Its operands, in the order of the row.
            #[must_use]
            pub fn operands(&self) -> Vec<u16> {
                match *self { $( Instruction::$variant { $( $operand ),* } => vec![ $( $operand ),* ], )* }
            }

            /// The instruction with this opcode and these operands in the order of its row.
            ///
            /// `None` when there is no such opcode or the number of operands is another.
            #[must_use]
            pub fn from_operands(opcode: u8, operands: &[u16]) -> Option<Instruction> {
                match (opcode, operands) {
                    $( ($opcode, &[ $( $operand ),* ]) => Some(Instruction::$variant { $( $operand ),* }), )*
                    _ => None,
                }
            }
        }
    };
}

instructions! {
    /// Grid position of the request's texel in a grid: first corner, stride and phase per axis.
    Position = 0x01 "position" {
        /// The grid.
        grid: Grid [8..9],
    }
    /// Read the codes of the four corners of a grid, at its last position.
    Fetch = 0x02 "fetch" {
        /// The grid.
        grid: Grid [8..9],
    }
    /// Unpack the fetched corners of a grid and write them one after the other as inputs.
    Concat = 0x03 "concat" {
        /// Where the inputs go.
        dst: Vector [16..18],
        /// The first lane written.
        lane: Immediate [32..42],
        /// The grid.
        grid: Grid [8..9],
    }
    /// Unpack the fetched corners of a grid, interpolate them and write inputs, rounded as the profile says.
    Lerp = 0x04 "lerp" {
        /// Where the inputs go.
        dst: Vector [16..18],
        /// The first lane written.
        lane: Immediate [32..42],
        /// The grid.
        grid: Grid [8..9],
    }
    /// Write the triangle waves of the texel: octave by octave, x then y, phase 0 then a quarter.
    Wave = 0x05 "wave" {
        /// Where the inputs go.
        dst: Vector [16..18],
        /// The first lane written.
        lane: Immediate [32..42],
        /// How many octaves.
        octaves: Immediate [24..26],
    }
    /// Write the normalised mip of the request.
    Level = 0x06 "level" {
        /// Where the input goes.
        dst: Vector [16..18],
        /// The lane written.
        lane: Immediate [32..42],
    }
    /// Write the saw waves of the texel, in the order of the triangle waves.
    Saw = 0x07 "saw" {
        /// Where the inputs go.
        dst: Vector [16..18],
        /// The first lane written.
        lane: Immediate [32..42],
        /// How many octaves.
        octaves: Immediate [24..26],
    }
    /// Write zeros.
    Zero = 0x08 "zero" {
        /// Where the inputs go.
        dst: Vector [16..18],
        /// The first lane written.
        lane: Immediate [32..42],
        /// How many lanes.
        lanes: Immediate [24..28],
    }
    /// Accumulators of an integer layer: bias, plus weights times vector, k ascending.
    Dense = 0x10 "dense" {
        /// The layer.
        layer: Layer [8..14],
        /// The vector multiplied.
        src: Vector [16..18],
        /// Lanes of the vector.
        inputs: Immediate [32..43],
        /// Accumulators made.
        outputs: Immediate [48..59],
    }
    /// ReLU on the accumulators.
    Relu = 0x11 "relu" {
        /// Accumulators.
        outputs: Immediate [48..59],
    }
    /// Leaky ReLU on the accumulators, slope 2^−shift.
    Leaky = 0x12 "leaky" {
        /// n of the slope 2^−n.
        shift: Immediate [24..27],
        /// Accumulators.
        outputs: Immediate [48..59],
    }
    /// Hard GELU: accumulators to 8.8 arguments by the layer's scales, then the gate's product.
    Gate = 0x13 "gate" {
        /// The layer.
        layer: Layer [8..14],
        /// Accumulators.
        outputs: Immediate [48..59],
    }
    /// Accumulators to activations: rescale, add the zero point, saturate to the layer's bits.
    Rescale = 0x14 "rescale" {
        /// The layer.
        layer: Layer [8..14],
        /// Where the activations go.
        dst: Vector [16..18],
        /// Accumulators.
        outputs: Immediate [48..59],
    }
    /// As rescale, with a rescaled skip vector added before the saturation.
    RescaleSkip = 0x15 "rescale.skip" {
        /// The layer.
        layer: Layer [8..14],
        /// Where the activations go.
        dst: Vector [16..18],
        /// The skip path's source.
        skip: Vector [18..20],
        /// Accumulators.
        outputs: Immediate [48..59],
    }
    /// Accumulators to channel codes: rescale, saturate to each channel's format, and send.
    Emit = 0x16 "emit" {
        /// The layer.
        layer: Layer [8..14],
        /// Channels.
        outputs: Immediate [48..59],
    }
    /// Replace accumulators by entries of the layer's table; the next rescale only adds to them.
    Table = 0x17 "table" {
        /// The layer.
        layer: Layer [8..14],
        /// Accumulators.
        outputs: Immediate [48..59],
    }
    /// The texel is done.
    End = 0x1f "end" {
    }
    /// Sums of an fp16 layer in f32: bias, plus weights times vector read as halves.
    DenseHalf = 0x20 "dense.half" {
        /// The layer.
        layer: Layer [8..14],
        /// The vector multiplied.
        src: Vector [16..18],
        /// Lanes of the vector.
        inputs: Immediate [32..43],
        /// Sums made.
        outputs: Immediate [48..59],
    }
    /// ReLU on the sums.
    ReluHalf = 0x21 "relu.half" {
        /// Sums.
        outputs: Immediate [48..59],
    }
    /// Leaky ReLU on the sums, slope 2^−shift.
    LeakyHalf = 0x22 "leaky.half" {
        /// n of the slope 2^−n.
        shift: Immediate [24..27],
        /// Sums.
        outputs: Immediate [48..59],
    }
    /// Hard GELU on the sums; of an argument limited to 3 if `clamped` is 1.
    GateHalf = 0x23 "gate.half" {
        /// Whether the argument is limited to 3.
        clamped: Immediate [24..25],
        /// Sums.
        outputs: Immediate [48..59],
    }
    /// Add a vector of halves to the sums, in f32.
    SkipHalf = 0x24 "skip.half" {
        /// The skip path's source.
        skip: Vector [18..20],
        /// Sums.
        outputs: Immediate [48..59],
    }
    /// Sums to halves: ties to even, saturated.
    RoundHalf = 0x25 "round.half" {
        /// Where the halves go.
        dst: Vector [16..18],
        /// Sums.
        outputs: Immediate [48..59],
    }
    /// Sums to integers of the layer's bits, for an integer layer.
    QuantizeHalf = 0x26 "quantize.half" {
        /// The layer.
        layer: Layer [8..14],
        /// Where the integers go.
        dst: Vector [16..18],
        /// Sums.
        outputs: Immediate [48..59],
    }
    /// Sums to channel codes: to each channel's format, and send.
    EmitHalf = 0x27 "emit.half" {
        /// Channels.
        outputs: Immediate [48..59],
    }
}

/// Why a word is no instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WordError {
    /// No row has this opcode.
    Opcode {
        /// Bits 0..8 of the word.
        found: u8,
    },
    /// Bits are set that belong to no operand of the row.
    Reserved {
        /// The instruction's mnemonic.
        mnemonic: &'static str,
        /// The set bits that must be zero.
        found: u64,
    },
}

impl fmt::Display for WordError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            WordError::Opcode { found } => {
                let known: Vec<String> = TABLE
                    .iter()
                    .map(|row| format!("{:#04x}", row.opcode))
                    .collect();
                write!(f, "opcode {found:#04x}; allowed: {}", known.join(", "))
            }
            WordError::Reserved { mnemonic, found } => {
                write!(
                    f,
                    "{mnemonic}: reserved bits {found:#018x} are set; they must be zero"
                )
            }
        }
    }
}

impl std::error::Error for WordError {}

impl Row {
    /// The bits of the word that belong to the opcode or to an operand.
    #[must_use]
    pub fn mask(&self) -> u64 {
        self.operands
            .iter()
            .fold(0xff, |mask, operand| mask | operand.mask())
    }
}

impl Operand {
    /// Its bits of the word.
    #[must_use]
    pub const fn mask(&self) -> u64 {
        ((1 << (self.high - self.low)) - 1) << self.low
    }

    /// The largest number that it holds.
    #[must_use]
    pub const fn max(&self) -> u16 {
        ((1_u32 << (self.high - self.low)) - 1) as u16
    }
}

impl Instruction {
    /// The 64-bit word. Operands are cut to their fields; a [`Program`](crate::Program) holds none
    /// that would be cut.
    #[must_use]
    pub fn encode(&self) -> u64 {
        let row = self.row();
        row.operands
            .iter()
            .zip(self.operands())
            .fold(u64::from(row.opcode), |word, (field, n)| {
                word | (u64::from(n) << field.low) & field.mask()
            })
    }

    /// The instruction of a word.
    ///
    /// # Errors
    /// When the opcode is unknown or reserved bits are set.
    pub fn decode(word: u64) -> Result<Instruction, WordError> {
        let opcode = (word & 0xff) as u8;
        let row = TABLE
            .iter()
            .find(|row| row.opcode == opcode)
            .ok_or(WordError::Opcode { found: opcode })?;
        let reserved = word & !row.mask();
        if reserved != 0 {
            return Err(WordError::Reserved {
                mnemonic: row.mnemonic,
                found: reserved,
            });
        }
        let operands: Vec<u16> = row
            .operands
            .iter()
            .map(|field| ((word & field.mask()) >> field.low) as u16)
            .collect();
        Instruction::from_operands(opcode, &operands).ok_or(WordError::Opcode { found: opcode })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_rows_share_an_opcode_or_a_mnemonic_and_no_operands_overlap() {
        for (index, row) in TABLE.iter().enumerate() {
            for other in &TABLE[..index] {
                assert!(row.opcode != other.opcode && row.mnemonic != other.mnemonic);
            }
            let mut taken = 0xff_u64;
            for operand in row.operands {
                assert_eq!(
                    taken & operand.mask(),
                    0,
                    "{} {}",
                    row.mnemonic,
                    operand.name
                );
                taken |= operand.mask();
            }
        }
    }

    #[test]
    fn every_single_operand_value_returns_from_its_word() {
        for row in TABLE {
            for (position, operand) in row.operands.iter().enumerate() {
                for value in 0..=operand.max() {
                    let mut operands: Vec<u16> = row.operands.iter().map(Operand::max).collect();
                    operands[position] = value;
                    let instruction = Instruction::from_operands(row.opcode, &operands).unwrap();
                    assert_eq!(Instruction::decode(instruction.encode()), Ok(instruction));
                }
            }
        }
    }

    #[test]
    fn a_reserved_bit_or_an_unknown_opcode_is_refused() {
        for row in TABLE {
            for bit in 8..64 {
                let word = u64::from(row.opcode) | 1 << bit;
                assert_eq!(
                    Instruction::decode(word).is_ok(),
                    row.mask() >> bit & 1 == 1
                );
            }
        }
        for opcode in 0..=255_u8 {
            let known = TABLE.iter().any(|row| row.opcode == opcode);
            assert_eq!(Instruction::decode(u64::from(opcode)).is_ok(), known);
        }
    }
}
