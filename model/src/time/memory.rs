//! Memory: what lies behind the latent cache, and the miss registers in front of it.

use super::cache::Tags;
use super::rate::Rate;
use super::unit::Configuration;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// When a line is there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Arrival {
    /// The cycle from which it is there.
    pub(super) at: u64,
    /// The cycle from which it would be there if no line came before it.
    pub(super) unloaded: u64,
}

impl Arrival {
    /// There from the start.
    pub(super) const THERE: Arrival = Arrival { at: 0, unloaded: 0 };
}

/// An optional second-level cache and a memory, each a pipe of fixed latency and limited bandwidth,
/// with a limited number of lines under way.
///
/// A line from memory passes the second level's latency and port too.
#[derive(Clone, Debug)]
pub(super) struct Memory {
    level2: Option<Level2>,
    bus: Rate,
    latency: u64,
    /// Bytes moved for a line: the line, rounded up to whole bursts.
    transfer_bytes: u64,
    line_bytes: u64,
    registers: usize,
    /// Arrival and line of each register in use, the first to arrive on top.
    pending: BinaryHeap<Reverse<(u64, u64, u64)>>,
    /// Bytes moved from memory so far.
    pub(super) bytes: u64,
    /// Lines that the second level held.
    pub(super) level2_hits: u64,
    /// Lines asked of memory.
    pub(super) fetched: u64,
}

#[derive(Clone, Debug)]
struct Level2 {
    tags: Tags,
    port: Rate,
    latency: u64,
}

/// Bytes moved for one line.
pub(super) fn transfer_bytes(unit: &Configuration) -> u64 {
    u64::from(unit.line_bytes.next_multiple_of(unit.burst_bytes))
}

/// Cycles from the request for a line to the cycle from which it is there, if it comes from memory
/// and nothing comes before it.
pub(super) fn unloaded_cycles(unit: &Configuration) -> u64 {
    let bus = transfer_bytes(unit).div_ceil(u64::from(unit.memory_bytes_per_cycle));
    let port = u64::from(unit.line_bytes).div_ceil(u64::from(unit.level2_bytes_per_cycle));
    let port = if unit.level2_sets > 0 { port } else { 0 };
    bus.max(port) + latency_cycles(unit)
}

/// The latency of a line from memory.
pub(super) fn latency_cycles(unit: &Configuration) -> u64 {
    let level2 = if unit.level2_sets > 0 {
        u64::from(unit.level2_latency_cycles)
    } else {
        0
    };
    level2 + u64::from(unit.memory_latency_cycles)
}

impl Memory {
    pub(super) fn new(unit: &Configuration) -> Memory {
        let level2 = (unit.level2_sets > 0).then(|| Level2 {
            tags: Tags::new(unit.level2_sets, unit.level2_ways, unit.replacement),
            port: Rate::new(u64::from(unit.level2_bytes_per_cycle)),
            latency: u64::from(unit.level2_latency_cycles),
        });
        Memory {
            level2,
            bus: Rate::new(u64::from(unit.memory_bytes_per_cycle)),
            latency: latency_cycles(unit),
            transfer_bytes: transfer_bytes(unit),
            line_bytes: u64::from(unit.line_bytes),
            registers: unit.mshrs as usize,
            pending: BinaryHeap::new(),
            bytes: 0,
            level2_hits: 0,
            fetched: 0,
        }
    }

    /// Lines under way.
    pub(super) fn under_way(&self) -> usize {
        self.pending.len()
    }

    /// When the last line under way is there.
    pub(super) fn last(&self) -> Option<u64> {
        self.pending.iter().map(|Reverse((at, ..))| *at).max()
    }

    /// Frees the registers whose lines are there at `now`. `freed` gets the cycle from which each is
    /// free, and how many are still in use then.
    pub(super) fn retire(&mut self, now: u64, mut freed: impl FnMut(u64, usize)) {
        while let Some(&Reverse((at, ..))) = self.pending.peek()
            && at <= now
        {
            self.pending.pop();
            freed(at, self.pending.len());
        }
    }

    /// The arrival of a line under way.
    pub(super) fn pending(&self, line: u64) -> Option<Arrival> {
        let mut lines = self.pending.iter();
        let found = lines.find(|Reverse((_, held, _))| *held == line);
        found.map(|&Reverse((at, _, unloaded))| Arrival { at, unloaded })
    }

    /// Asks for a line. Whether it came from memory, and when it is there.
    ///
    /// # Errors
    /// When every register is in use: the cycle from which one is free.
    pub(super) fn request(&mut self, line: u64, now: u64) -> Result<(bool, Arrival), u64> {
        if self.pending.len() == self.registers
            && let Some(Reverse((first, ..))) = self.pending.peek()
        {
            return Err(*first);
        }
        let (is_fetched, arrival) = self.find(line, now);
        self.pending
            .push(Reverse((arrival.at, line, arrival.unloaded)));
        Ok((is_fetched, arrival))
    }

    fn find(&mut self, line: u64, now: u64) -> (bool, Arrival) {
        let mut through_port = (now, now);
        if let Some(level2) = self.level2.as_mut() {
            let alone = self.line_bytes.div_ceil(level2.port.per_cycle());
            through_port = (level2.port.serve(now, self.line_bytes), now + alone);
            if let Some(held) = level2.tags.touch(line) {
                self.level2_hits += 1;
                // It may be on its way there itself.
                let arrival = Arrival {
                    at: (through_port.0 + level2.latency).max(held.at),
                    unloaded: (through_port.1 + level2.latency).max(held.unloaded),
                };
                return (false, arrival);
            }
        }
        self.bytes += self.transfer_bytes;
        self.fetched += 1;
        let alone = self.transfer_bytes.div_ceil(self.bus.per_cycle());
        let served = self.bus.serve(now, self.transfer_bytes);
        let arrival = Arrival {
            at: served.max(through_port.0) + self.latency,
            unloaded: (now + alone).max(through_port.1) + self.latency,
        };
        if let Some(level2) = self.level2.as_mut() {
            level2.tags.install(line, arrival);
        }
        (true, arrival)
    }
}

#[cfg(test)]
mod tests {
    use super::super::unit::Unit;
    use super::*;

    fn configuration() -> Configuration {
        Configuration {
            line_bytes: 64,
            burst_bytes: 32,
            memory_bytes_per_cycle: 16,
            memory_latency_cycles: 10,
            mshrs: 2,
            level2_sets: 0,
            ..*Unit::mobile().configuration()
        }
    }

    #[test]
    fn a_second_line_waits_for_the_bus_and_a_third_for_a_register() {
        let mut memory = Memory::new(&configuration());
        let came = |at, unloaded| Ok((true, Arrival { at, unloaded }));
        // Four cycles of bus, ten of latency.
        assert_eq!(memory.request(7, 100), came(114, 114));
        assert_eq!(memory.request(8, 101), came(118, 115));
        assert_eq!(memory.request(9, 102), Err(114));
        assert_eq!(memory.pending(8).map(|arrival| arrival.at), Some(118));
        memory.retire(113, |_, _| {});
        assert_eq!(memory.request(9, 113), Err(114));
        memory.retire(114, |_, _| {});
        assert_eq!(memory.pending(7), None);
        assert_eq!(memory.request(9, 114), came(128, 128));
        assert_eq!((memory.bytes, memory.fetched), (192, 3));
    }

    #[test]
    fn the_second_level_gives_a_line_again_after_its_own_latency() {
        let unit = Configuration {
            level2_sets: 4,
            level2_ways: 1,
            level2_latency_cycles: 5,
            level2_bytes_per_cycle: 32,
            ..configuration()
        };
        let mut memory = Memory::new(&unit);
        // Four cycles of bus, behind which the port's two hide, and 5 + 10 of latency.
        assert_eq!(
            memory.request(7, 100),
            Ok((
                true,
                Arrival {
                    at: 119,
                    unloaded: 119
                }
            ))
        );
        assert_eq!(unloaded_cycles(&unit), 19);
        memory.retire(200, |_, _| {});
        assert_eq!(
            memory.request(7, 200),
            Ok((
                false,
                Arrival {
                    at: 207,
                    unloaded: 207
                }
            ))
        );
        // Wanted again while it is on its way to the second level.
        assert_eq!(
            memory.request(8, 200),
            Ok((
                true,
                Arrival {
                    at: 219,
                    unloaded: 219
                }
            ))
        );
        memory.retire(207, |_, _| {});
        assert_eq!(
            memory.request(8, 207),
            Ok((
                false,
                Arrival {
                    at: 219,
                    unloaded: 219
                }
            ))
        );
        assert_eq!(
            (memory.bytes, memory.fetched, memory.level2_hits),
            (128, 2, 2)
        );
    }
}
