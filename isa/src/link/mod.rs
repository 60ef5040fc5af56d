//! Link: whether instructions from elsewhere fit an asset.
//!
//! A program that passes reads nothing before it is written and no operand is out of range, so
//! running it cannot fail, and it ends. What it computes is its author's business.
//!
//! Loops of layers are followed run by run. The loop of a footprint runs as often as the sample has
//! decodes, perhaps not at all: its body is followed until what the unit holds behind it is what it
//! held before, and nothing that it wrote may be read behind it.

mod rules;

use crate::asset::Asset;
use crate::instruction::{VECTOR_COUNT, WordError};
use crate::program::unroll::{Step, Unrolled};
use crate::shape::LaneFormat;
use rules::require;
use std::fmt;

/// Why instructions do not fit an asset.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LinkError {
    /// The instruction, from 0.
    pub at: usize,
    /// What was found there.
    pub found: String,
    /// What is allowed there.
    pub allowed: String,
}

impl fmt::Display for LinkError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "instruction {}: found {}; allowed: {}",
            self.at, self.found, self.allowed
        )
    }
}

impl std::error::Error for LinkError {}

impl LinkError {
    pub(crate) fn new(
        at: usize,
        found: impl Into<String>,
        allowed: impl Into<String>,
    ) -> LinkError {
        LinkError {
            at,
            found: found.into(),
            allowed: allowed.into(),
        }
    }

    /// An operand that the unit does not have.
    pub(crate) fn of_word(at: usize, error: &WordError) -> LinkError {
        match error {
            WordError::Opcode { found } => {
                LinkError::new(at, format!("opcode {found:#04x}"), "one of the table")
            }
            WordError::Reserved { found, .. } => {
                LinkError::new(at, format!("reserved bits {found:#018x}"), "zeros")
            }
            WordError::Operand { operand, found, .. } => {
                let found = format!("{}{found}", operand.kind.prefix());
                LinkError::new(at, found, operand.allowed())
            }
        }
    }
}

/// Follows the steps and checks each against what the unit holds before it.
pub(crate) fn check(asset: &Asset, unrolled: &Unrolled) -> Result<(), LinkError> {
    let mut linker = Linker::new(asset, unrolled.body.is_some());
    let steps = &unrolled.steps;
    match &unrolled.body {
        None => linker.follow(steps)?,
        Some(body) => {
            linker.follow(&steps[..body.start])?;
            linker.follow_loop(&steps[body.clone()])?;
            linker.follow(&steps[body.end..])?;
        }
    }
    if linker.state.sent {
        return Ok(());
    }
    let (wanted, at) = (linker.sender(), steps.last().map_or(0, |step| step.at + 1));
    let (found, allowed) = (
        format!("no {wanted}"),
        format!("a program with one {wanted}, then `end`"),
    );
    Err(LinkError::new(at, found, allowed))
}

/// Runs of a footprint's loop that are followed before its registers count as unsettled. What one run
/// leaves depends on few of the lanes before it; compiled programs settle in the second.
const SETTLING_RUNS: usize = 64;

/// A program being followed.
struct Linker<'a> {
    asset: &'a Asset,
    /// Whether the program has a footprint's loop.
    filters: bool,
    /// Inside that loop, where there is a place to decode.
    has_place: bool,
    /// Behind that loop.
    is_behind: bool,
    state: State,
}

/// What each stage of the unit holds while a program is followed.
#[derive(Clone, Debug, PartialEq)]
struct State {
    positioned: [bool; 2],
    fetched: [bool; 2],
    /// Lanes written of each vector register, from lane 0 without a gap.
    lanes: [u32; VECTOR_COUNT as usize],
    /// What the lanes hold.
    formats: [LaneFormat; VECTOR_COUNT as usize],
    sums: Option<Sums>,
    /// The footprint is known.
    planned: bool,
    /// The decode under way has its codes in the filter's buffer.
    collected: bool,
    /// The codes have left the unit.
    sent: bool,
}

/// The accumulators that are held.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Sums {
    layer: u16,
    rows: u16,
    is_half: bool,
}

impl<'a> Linker<'a> {
    fn new(asset: &'a Asset, filters: bool) -> Linker<'a> {
        Linker {
            asset,
            filters,
            has_place: !filters,
            is_behind: false,
            state: State {
                positioned: [false; 2],
                fetched: [false; 2],
                lanes: [0; VECTOR_COUNT as usize],
                formats: [asset.shape.input_format(); VECTOR_COUNT as usize],
                sums: None,
                planned: false,
                collected: false,
                sent: false,
            },
        }
    }

    fn follow(&mut self, steps: &[Step]) -> Result<(), LinkError> {
        for step in steps {
            self.step(&step.instruction)
                .map_err(|(found, allowed)| LinkError::new(step.at, found, allowed))?;
        }
        Ok(())
    }

    fn follow_loop(&mut self, body: &[Step]) -> Result<(), LinkError> {
        let at = body.last().map_or(0, |next| next.at);
        self.has_place = true;
        for _ in 0..SETTLING_RUNS {
            let before = self.state.clone();
            self.follow(body)?;
            if !std::mem::take(&mut self.state.collected) {
                let allowed = "one `collect` in the loop of a footprint";
                return Err(LinkError::new(at, "no `collect`", allowed));
            }
            if self.state == before {
                self.forget();
                return Ok(());
            }
        }
        let allowed = "a loop whose registers settle";
        Err(LinkError::new(
            at,
            format!("{SETTLING_RUNS} runs that differ"),
            allowed,
        ))
    }

    /// What a loop wrote that may not have run at all.
    fn forget(&mut self) {
        let State { planned, sent, .. } = self.state;
        self.has_place = false;
        self.is_behind = true;
        self.state = Linker::new(self.asset, self.filters).state;
        self.state.planned = planned;
        self.state.sent = sent;
    }

    /// What sends the codes of this program.
    fn sender(&self) -> &'static str {
        if self.filters { "`blend`" } else { "`emit`" }
    }

    /// Whether there is a texel or a place whose position an instruction can ask for.
    fn place(&self, mnemonic: &str) -> Result<(), (String, String)> {
        require(self.has_place, mnemonic, "in the loop of the footprint")
    }
}
