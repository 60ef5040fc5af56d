//! Memory: what lies behind the latent cache, and the miss registers in front of it.

use super::rate::Rate;
use super::unit::Configuration;
use std::collections::VecDeque;

/// When a line is there.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Arrival {
    /// The cycle from which it is there.
    pub(super) at: u64,
    /// The cycle from which it would be there if no line came before it.
    pub(super) unloaded: u64,
}

/// A pipe of fixed latency and limited bandwidth, with a limited number of lines under way.
///
/// Lines come in order: the latency is the same for all of them.
#[derive(Clone, Debug)]
pub(super) struct Memory {
    bus: Rate,
    latency: u64,
    /// Bytes moved for a line: the line, rounded up to whole bursts.
    transfer_bytes: u64,
    /// Cycles of the bus for a line alone.
    transfer_cycles: u64,
    registers: usize,
    /// Line and arrival of each register in use, in order of arrival.
    pending: VecDeque<(u64, Arrival)>,
    /// Bytes moved so far.
    pub(super) bytes: u64,
}

/// Bytes moved for one line.
pub(super) fn transfer_bytes(unit: &Configuration) -> u64 {
    u64::from(unit.line_bytes.next_multiple_of(unit.burst_bytes))
}

/// Cycles from the request for a line to the cycle from which it is there, with an idle bus.
pub(super) fn unloaded_cycles(unit: &Configuration) -> u64 {
    let bus = transfer_bytes(unit).div_ceil(u64::from(unit.memory_bytes_per_cycle));
    bus + u64::from(unit.memory_latency_cycles)
}

impl Memory {
    pub(super) fn new(unit: &Configuration) -> Memory {
        Memory {
            bus: Rate::new(u64::from(unit.memory_bytes_per_cycle)),
            latency: u64::from(unit.memory_latency_cycles),
            transfer_bytes: transfer_bytes(unit),
            transfer_cycles: unloaded_cycles(unit),
            registers: unit.mshrs as usize,
            pending: VecDeque::new(),
            bytes: 0,
        }
    }

    /// Frees the registers whose lines are there at `now`.
    pub(super) fn retire(&mut self, now: u64) {
        while self
            .pending
            .front()
            .is_some_and(|(_, arrival)| arrival.at <= now)
        {
            self.pending.pop_front();
        }
    }

    /// The arrival of a line under way.
    pub(super) fn pending(&self, line: u64) -> Option<Arrival> {
        self.pending
            .iter()
            .find(|(held, _)| *held == line)
            .map(|(_, arrival)| *arrival)
    }

    /// Asks for a line that is not under way.
    ///
    /// # Errors
    /// When every register is in use: the cycle from which one is free.
    pub(super) fn request(&mut self, line: u64, now: u64) -> Result<Arrival, u64> {
        if self.pending.len() == self.registers
            && let Some((_, first)) = self.pending.front()
        {
            return Err(first.at);
        }
        self.bytes += self.transfer_bytes;
        let at = self.bus.serve(now, self.transfer_bytes) + self.latency;
        let arrival = Arrival {
            at,
            unloaded: now + self.transfer_cycles,
        };
        self.pending.push_back((line, arrival));
        Ok(arrival)
    }
}

#[cfg(test)]
mod tests {
    use super::super::unit::Unit;
    use super::*;

    fn memory() -> Memory {
        let mut unit = *Unit::mobile().configuration();
        unit.line_bytes = 64;
        unit.burst_bytes = 32;
        unit.memory_bytes_per_cycle = 16;
        unit.memory_latency_cycles = 10;
        unit.mshrs = 2;
        Memory::new(&unit)
    }

    #[test]
    fn a_second_line_waits_for_the_bus_and_a_third_for_a_register() {
        let mut memory = memory();
        // Four cycles of bus, ten of latency.
        assert_eq!(
            memory.request(7, 100),
            Ok(Arrival {
                at: 114,
                unloaded: 114
            })
        );
        assert_eq!(
            memory.request(8, 101),
            Ok(Arrival {
                at: 118,
                unloaded: 115
            })
        );
        assert_eq!(memory.request(9, 102), Err(114));
        assert_eq!(
            memory.pending(8),
            Some(Arrival {
                at: 118,
                unloaded: 115
            })
        );
        memory.retire(113);
        assert_eq!(memory.request(9, 113), Err(114));
        memory.retire(114);
        assert_eq!(memory.pending(7), None);
        assert_eq!(
            memory.request(9, 114),
            Ok(Arrival {
                at: 128,
                unloaded: 128
            })
        );
        assert_eq!(memory.bytes, 192);
    }
}
