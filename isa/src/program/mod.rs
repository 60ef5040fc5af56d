//! Program: a microprogram that fits an asset, and the compiler that makes one.

mod bounds;
mod compile;
mod fold;
pub(crate) mod unroll;

pub use bounds::SumBound;

use crate::asset::Asset;
use crate::instruction::{Class, Instruction};
use crate::layout::Layout;
use crate::link::{self, LinkError};
use compile::Purpose;
use std::ops::Range;
use unroll::Unrolled;

/// A microprogram that is known to fit one asset: every operand is in range, nothing is read
/// before it is written, and it ends.
///
/// It decodes one texel, or, with a footprint's loop, one sample.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Program {
    layout: Layout,
    instructions: Vec<Instruction>,
    steps: Vec<Instruction>,
    body: Option<Range<usize>>,
}

impl Program {
    /// The program that decodes one texel of an asset.
    #[must_use]
    pub fn compile(asset: &Asset, layout: Layout) -> Program {
        Program::unchecked(layout, compile::compile(asset, Purpose::Texel))
    }

    /// The program that decodes a sample's footprint and filters it. It serves every sampler: in
    /// which order latents are filtered and decoded is the footprint's business.
    #[must_use]
    pub fn compile_sample(asset: &Asset, layout: Layout) -> Program {
        Program::unchecked(layout, compile::compile(asset, Purpose::Sample))
    }

    /// Instructions from elsewhere, checked against the asset that they are to decode.
    ///
    /// # Errors
    /// The first instruction that does not fit: a register, grid, layer or number that is not there,
    /// in any run of a loop; something read before it is written; a program that does not end, ends
    /// twice or sends other than once.
    pub fn link(
        asset: &Asset,
        layout: Layout,
        instructions: Vec<Instruction>,
    ) -> Result<Program, LinkError> {
        let unrolled = unroll::unroll(&instructions)?;
        link::check(asset, &unrolled)?;
        Ok(Program::of(layout, instructions, unrolled))
    }

    /// What the compiler made of a validated asset always unrolls; tests link it.
    fn unchecked(layout: Layout, instructions: Vec<Instruction>) -> Program {
        let unrolled = unroll::unroll(&instructions).unwrap_or(Unrolled {
            steps: Vec::new(),
            body: None,
        });
        Program::of(layout, instructions, unrolled)
    }

    fn of(layout: Layout, instructions: Vec<Instruction>, unrolled: Unrolled) -> Program {
        let steps = unrolled.steps.iter().map(|step| step.instruction);
        Program {
            layout,
            instructions,
            steps: steps.collect(),
            body: unrolled.body,
        }
    }

    /// Where the unit's memory keeps the grids.
    #[must_use]
    pub fn layout(&self) -> Layout {
        self.layout
    }

    /// The instructions as they are stored, `end` last.
    #[must_use]
    pub fn instructions(&self) -> &[Instruction] {
        &self.instructions
    }

    /// The instructions as they are executed: loops of layers unrolled, every layer that of its run.
    /// `repeat` is there once and `again` once a run, for they take an issue slot. The body of a
    /// footprint's loop is there once; it runs once for every decode of the sample.
    #[must_use]
    pub fn steps(&self) -> &[Instruction] {
        &self.steps
    }

    /// The steps behind `each`, up to and with `next`, of a program that filters: what runs for every
    /// decode of a sample.
    #[must_use]
    pub fn footprint_loop(&self) -> Option<Range<usize>> {
        self.body.clone()
    }

    /// Steps of each class, in the order of [`Class::ALL`].
    #[must_use]
    pub fn counts(&self) -> [(Class, usize); Class::ALL.len()] {
        Class::ALL.map(|class| {
            let of_class = |step: &&Instruction| step.row().class == class;
            (class, self.steps.iter().filter(of_class).count())
        })
    }
}
