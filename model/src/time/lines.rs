//! Lines: which lines of the latent cache a group's fetches touch, and how they spread over banks.

use super::assemble::{FetchLines, Group};
use super::unit::Unit;
use crate::trace::Fetch;

/// The unit's lines and banks.
#[derive(Clone, Debug)]
pub(super) struct Lines {
    line_log2: u32,
    lookups_per_bank: u32,
    /// Lines of each bank.
    banks: Vec<u32>,
}

impl Lines {
    pub(super) fn new(unit: &Unit) -> Lines {
        Lines {
            line_log2: unit.line_bytes.trailing_zeros(),
            lookups_per_bank: unit.lookups_per_bank,
            banks: vec![0; unit.cache_banks as usize],
        }
    }

    /// Fills in the group's lines: those of the first fetch of all its decodes, then those of the
    /// second, each fetch's lines once. `fetches` holds the decodes' one decode after the other.
    pub(super) fn collect(
        &mut self,
        base: u64,
        decodes: u64,
        fetches: &[Fetch],
        group: &mut Group,
    ) {
        group.lines.clear();
        group.fetches.clear();
        let bytes = |f: &Fetch| 4 * u64::from(f.planes) * u64::from(f.cell_bytes);
        group.corner_bytes = fetches.iter().map(bytes).sum();
        let each = fetches.len().checked_div(decodes as usize).unwrap_or(0);
        for index in 0..each {
            let start = group.lines.len();
            let mut before = None;
            for fetch in fetches.iter().skip(index).step_by(each) {
                // Neighbours mostly lie in the same cells.
                if before != Some(fetch) {
                    before = Some(fetch);
                    self.add(base, fetch, start, &mut group.lines);
                }
            }
            let end = group.lines.len();
            let tag_cycles = self.tag_cycles(&group.lines[start..]);
            group.fetches.push(FetchLines { end, tag_cycles });
        }
    }

    fn add(&self, base: u64, fetch: &Fetch, start: usize, lines: &mut Vec<u64>) {
        for address in fetch.addresses {
            for plane in 0..u64::from(fetch.planes) {
                let first = base + address + plane * fetch.plane_bytes;
                let last = first + u64::from(fetch.cell_bytes.max(1)) - 1;
                for line in first >> self.line_log2..=last >> self.line_log2 {
                    if !lines[start..].contains(&line) {
                        lines.push(line);
                    }
                }
            }
        }
    }

    fn tag_cycles(&mut self, lines: &[u64]) -> u64 {
        self.banks.fill(0);
        let mask = self.banks.len() as u64 - 1;
        for line in lines {
            self.banks[(line & mask) as usize] += 1;
        }
        let most = self.banks.iter().copied().max().unwrap_or(0);
        u64::from(most.div_ceil(self.lookups_per_bank).max(1))
    }
}
