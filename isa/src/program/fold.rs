//! Fold: equal blocks of instructions, one after the other, become a loop.
//!
//! Two blocks are equal if they differ in their layers alone, and all layers of the second are the
//! same number of layers further on. A loop starts where a layer starts, so that a reader finds
//! layers in it and not the halves of two.

use crate::instruction::{Class, Instruction};
use crate::limits::MAX_REPEATS;

/// A run of equal blocks.
#[derive(Clone, Copy)]
struct Run {
    /// Instructions of a block.
    length: usize,
    /// Blocks, at least two.
    times: usize,
    /// Layers from a block to the next.
    step: u16,
}

impl Run {
    /// Instructions that a loop of two more saves.
    fn saved(self) -> usize {
        ((self.times - 1) * self.length).saturating_sub(2)
    }
}

/// The instructions, none of which is control, with runs of equal blocks as loops: from the first
/// instruction on, always the loop that saves most, the shortest block among equals.
pub(super) fn fold(instructions: &[Instruction]) -> Vec<Instruction> {
    let mut folded = Vec::new();
    let mut at = 0;
    while let Some(instruction) = instructions.get(at) {
        match best_run(&instructions[at..]) {
            Some(run) => {
                folded.push(Instruction::Repeat {
                    times: run.times as u16,
                    step: run.step,
                });
                folded.extend_from_slice(&instructions[at..at + run.length]);
                folded.push(Instruction::Again {});
                at += run.times * run.length;
            }
            None => {
                folded.push(*instruction);
                at += 1;
            }
        }
    }
    folded
}

fn best_run(rest: &[Instruction]) -> Option<Run> {
    let starts_a_layer = |instruction: &Instruction| {
        let class = instruction.row().class;
        class == Class::MultiplyInteger || class == Class::MultiplyHalf
    };
    if !rest.first().is_some_and(starts_a_layer) {
        return None;
    }
    (1..=rest.len() / 2)
        .filter_map(|length| run(rest, length))
        .filter(|run| run.saved() > 0)
        .fold(None, |best: Option<Run>, run| match best {
            Some(best) if best.saved() >= run.saved() => Some(best),
            Some(_) | None => Some(run),
        })
}

/// The run of blocks of `length` instructions at the start of `rest`, if there are two.
fn run(rest: &[Instruction], length: usize) -> Option<Run> {
    let block = &rest[..length];
    let step = step(block, &rest[length..])?;
    let equal = rest
        .chunks_exact(length)
        .enumerate()
        .take(usize::from(MAX_REPEATS))
        .take_while(|(index, other)| {
            block.iter().zip(*other).all(|(first, other)| {
                let moved = match first.layer() {
                    Some(layer) => first.with_layer(layer + step * *index as u16),
                    None => *first,
                };
                moved == *other
            })
        });
    let times = equal.count();
    (times > 1).then_some(Run {
        length,
        times,
        step,
    })
}

/// The distance of the first layers of two blocks.
fn step(block: &[Instruction], next: &[Instruction]) -> Option<u16> {
    let layers = block.iter().zip(next);
    let mut distances = layers.filter_map(|(first, other)| Some((first.layer()?, other.layer()?)));
    distances
        .next()
        .and_then(|(first, other)| other.checked_sub(first))
}

#[cfg(test)]
mod tests {
    use super::super::unroll::unroll;
    use super::*;

    fn plain(folded: &[Instruction]) -> Vec<Instruction> {
        let end = [folded, &[Instruction::End {}]].concat();
        let steps = unroll(&end).unwrap().steps;
        let without_control = steps
            .into_iter()
            .filter(|step| step.instruction.row().class != Class::Control);
        without_control.map(|step| step.instruction).collect()
    }

    /// A layer of `inputs` to `outputs` from one register to another.
    fn layer(layer: u16, (src, dst): (u16, u16), inputs: u16) -> Vec<Instruction> {
        let outputs = 8;
        vec![
            Instruction::Dense {
                layer,
                src,
                inputs,
                outputs,
            },
            Instruction::Relu { outputs },
            Instruction::Rescale {
                layer,
                dst,
                outputs,
            },
        ]
    }

    #[test]
    fn every_chain_of_layers_returns_from_its_loops() {
        // Layers of two widths in every order, register to register.
        for count in 1..=9_u16 {
            for widths in 0..1_u16 << count {
                let flat: Vec<Instruction> = (0..count)
                    .flat_map(|l| layer(l, (l % 2, 1 - l % 2), 8 + (widths >> l & 1)))
                    .collect();
                let folded = fold(&flat);
                assert_eq!(plain(&folded), flat);
                assert!(folded.len() <= flat.len());
            }
        }
    }

    #[test]
    fn equal_layers_are_one_loop_of_two_as_they_take_turns_with_two_registers() {
        let flat: Vec<Instruction> = (0..7)
            .flat_map(|l| layer(l, (l % 2, 1 - l % 2), 8))
            .collect();
        let folded = fold(&flat);
        assert_eq!(folded[0], Instruction::Repeat { times: 3, step: 2 });
        assert_eq!(folded[1..7], flat[..6]);
        assert_eq!(folded[7], Instruction::Again {});
        assert_eq!(folded[8..], flat[18..]);
    }

    #[test]
    fn more_blocks_than_a_loop_has_runs_are_joined_in_pairs() {
        let one = Instruction::Dense {
            layer: 0,
            src: 0,
            inputs: 8,
            outputs: 8,
        };
        let flat = vec![one; 70];
        let folded = fold(&flat);
        assert_eq!(folded[0], Instruction::Repeat { times: 35, step: 0 });
        assert_eq!(plain(&folded), flat);
    }

    #[test]
    fn what_saves_nothing_stays_as_it_is() {
        let twice: Vec<Instruction> = [layer(0, (0, 1), 8), layer(3, (0, 1), 8)].concat();
        assert_eq!(fold(&twice).len(), 5, "three instructions and two");
        let short = vec![twice[0], twice[0]];
        assert_eq!(fold(&short), short);
    }
}
