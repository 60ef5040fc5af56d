//! Rate: a resource that does so much work per cycle, in order, without wasting part of a cycle.

/// A resource with a rate. Its clock counts work, so a cycle may end one item and begin the next.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rate {
    per_cycle: u64,
    /// Everything up to here is done or promised, in units of work since cycle 0.
    position: u64,
}

impl Rate {
    /// A resource that does `per_cycle` ≥ 1 of its work in a cycle.
    pub(super) fn new(per_cycle: u64) -> Rate {
        Rate {
            per_cycle,
            position: 0,
        }
    }

    /// Work in a cycle.
    pub(super) fn per_cycle(&self) -> u64 {
        self.per_cycle
    }

    /// Takes work that is there from cycle `at` on, behind all earlier work. The cycle before which
    /// it is done: ⌈(max(position, at·rate) + work) / rate⌉.
    pub(super) fn serve(&mut self, at: u64, work: u64) -> u64 {
        self.position = self.position.max(at * self.per_cycle) + work;
        self.position.div_ceil(self.per_cycle)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn work_queues_behind_work_and_shares_cycles_with_it() {
        let mut rate = Rate::new(4);
        // Six units from cycle 10: one and a half cycles. The next two fill the other half.
        assert_eq!(rate.serve(10, 6), 12);
        assert_eq!(rate.serve(10, 2), 12);
        assert_eq!(rate.serve(10, 1), 13);
        // Idle until 20.
        assert_eq!(rate.serve(20, 4), 21);
    }
}
