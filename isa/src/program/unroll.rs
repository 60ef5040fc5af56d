//! Unroll: the instructions as they are executed, and whether there is an end to them.

use crate::instruction::{Instruction, OperandKind};
use crate::limits::{MAX_INSTRUCTIONS, MAX_LAYERS, MAX_STEPS};
use crate::link::LinkError;
use std::ops::Range;

/// An instruction as it is executed: its layer is that of the run of its loop.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Step {
    /// The instruction as stored, from 0.
    pub(crate) at: usize,
    pub(crate) instruction: Instruction,
}

/// Instructions that end.
#[derive(Clone, Debug)]
pub(crate) struct Unrolled {
    pub(crate) steps: Vec<Step>,
    /// The steps behind `each`, up to and with `next`, if there is a footprint's loop.
    pub(crate) body: Option<Range<usize>>,
}

/// The `repeat` that is open.
struct Open {
    at: usize,
    times: u16,
    step: u16,
    /// The first step of its body.
    start: usize,
}

/// Checks the shape of a program: operands in range, loops matched and not nested, `end` last and
/// nowhere else, few enough instructions and steps. Then follows it.
pub(crate) fn unroll(instructions: &[Instruction]) -> Result<Unrolled, LinkError> {
    if instructions.len() > MAX_INSTRUCTIONS as usize {
        let found = format!("{} instructions", instructions.len());
        let allowed = format!("at most {MAX_INSTRUCTIONS}");
        return Err(LinkError::new(MAX_INSTRUCTIONS as usize, found, allowed));
    }
    let mut steps: Vec<Step> = Vec::new();
    let mut open: Option<Open> = None;
    // The `each` that is open, and the first step of its body.
    let mut each: Option<(usize, usize)> = None;
    let mut body = None;
    for (at, instruction) in instructions.iter().enumerate() {
        let mnemonic = instruction.row().mnemonic;
        let refuse = |allowed: &str| Err(LinkError::new(at, mnemonic, allowed));
        instruction
            .check_operands()
            .map_err(|error| LinkError::of_word(at, &error))?;
        let is_last = at + 1 == instructions.len();
        if matches!(instruction, Instruction::End {}) != is_last {
            return refuse("`end` as the last instruction and nowhere else");
        }
        steps.push(Step {
            at,
            instruction: *instruction,
        });
        match *instruction {
            Instruction::Repeat { times, step } => {
                if open.is_some() {
                    return refuse("no loop inside `repeat`");
                }
                open = Some(Open {
                    at,
                    times,
                    step,
                    start: steps.len(),
                });
            }
            Instruction::Again {} => match open.take() {
                None => return refuse("`again` behind a `repeat`"),
                Some(open) => repeat(&open, &mut steps)?,
            },
            Instruction::Each {} => {
                if open.is_some() {
                    return refuse("no loop inside `repeat`");
                }
                if each.is_some() || body.is_some() {
                    return refuse("one `each` in a program");
                }
                each = Some((at, steps.len()));
            }
            Instruction::Next {} => match each.take() {
                None => return refuse("`next` behind an `each`"),
                Some(_) if open.is_some() => return refuse("`again` before `next`"),
                Some((_, start)) => body = Some(start..steps.len()),
            },
            Instruction::End {}
            | Instruction::Footprint {}
            | Instruction::Blend { .. }
            | Instruction::Collect { .. }
            | Instruction::CollectHalf { .. }
            | Instruction::Position { .. }
            | Instruction::Fetch { .. }
            | Instruction::Concat { .. }
            | Instruction::Lerp { .. }
            | Instruction::Wave { .. }
            | Instruction::Level { .. }
            | Instruction::Saw { .. }
            | Instruction::Zero { .. }
            | Instruction::Dense { .. }
            | Instruction::Relu { .. }
            | Instruction::Leaky { .. }
            | Instruction::Gate { .. }
            | Instruction::Rescale { .. }
            | Instruction::RescaleSkip { .. }
            | Instruction::Emit { .. }
            | Instruction::Table { .. }
            | Instruction::DenseHalf { .. }
            | Instruction::ReluHalf { .. }
            | Instruction::LeakyHalf { .. }
            | Instruction::GateHalf { .. }
            | Instruction::SkipHalf { .. }
            | Instruction::RoundHalf { .. }
            | Instruction::QuantizeHalf { .. }
            | Instruction::EmitHalf { .. } => {}
        }
        check_length(at, steps.len())?;
    }
    let opened = open.map(|open| open.at).or(each.map(|(at, _)| at));
    if let Some(at) = opened {
        let mnemonic = instructions[at].row().mnemonic;
        return Err(LinkError::new(at, mnemonic, "a loop with an end"));
    }
    if instructions.is_empty() {
        return Err(LinkError::new(0, "no instruction", "a program that ends"));
    }
    Ok(Unrolled { steps, body })
}

/// Puts the runs of a loop behind its first: the last step is its `again`, which every run has.
fn repeat(open: &Open, steps: &mut Vec<Step>) -> Result<(), LinkError> {
    let body = steps[open.start..].to_vec();
    check_length(
        open.at,
        steps.len() + body.len() * (usize::from(open.times) - 1),
    )?;
    for run in 1..open.times {
        for step in &body {
            let instruction = match step.instruction.layer() {
                None => step.instruction,
                Some(layer) => {
                    let moved = layer + run * open.step;
                    let (_, last) = OperandKind::Layer.range();
                    if moved > last {
                        let found = format!("l{moved} in run {run} of the loop");
                        let allowed = format!("l0 to l{}", MAX_LAYERS - 1);
                        return Err(LinkError::new(step.at, found, allowed));
                    }
                    step.instruction.with_layer(moved)
                }
            };
            steps.push(Step {
                at: step.at,
                instruction,
            });
        }
    }
    Ok(())
}

fn check_length(at: usize, steps: usize) -> Result<(), LinkError> {
    if steps <= MAX_STEPS as usize {
        return Ok(());
    }
    let allowed = format!("at most {MAX_STEPS}, loops unrolled");
    Err(LinkError::new(at, format!("{steps} steps"), allowed))
}
