//! Ledger: every cycle of the unit, charged to exactly one cause.
//!
//! The ledger is the clock: the stepped model advances time only by charging cycles, so the causes
//! add up to the cycles because there is no other count of them.
//!
//! A cycle is judged from the end of the MAC array, the resource that the unit exists for. If a job
//! is in the array, the cause is what the array or the job's current dependence does; if none is,
//! the cause is where the oldest texel that the next job waits for is held up.

use std::fmt;
use std::ops::AddAssign;

macro_rules! causes {
    ($( $(#[doc = $doc:literal])+ $variant:ident = $name:literal, )*) => {
        /// What a cycle was spent on.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Cause {
            $( $(#[doc = $doc])+ $variant, )*
        }

        impl Cause {
            /// Every cause, in the order of the texel's journey backwards from the MAC array.
            pub const ALL: [Cause; [$( $name ),*].len()] = [ $( Cause::$variant ),* ];

            /// The name in tables and JSON.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $( Cause::$variant => $name, )* }
            }

            /// What it means, for tables.
            #[must_use]
            pub const fn summary(self) -> &'static str {
                match self { $( Cause::$variant => concat!($( $doc ),+), )* }
            }
        }
    };
}

causes! {
    /// The MAC array multiplies.
    Compute = "compute",
    /// Operands are on their way through a systolic array, or accumulators on their way out of it.
    ArrayFill = "array-fill",
    /// The MAC array waits for its next tile of weights from the weight SRAM.
    WeightLoad = "weight-load",
    /// Weights come from outside: at the start, when a material's are not held, and for each batch
    /// where they do not fit.
    WeightFill = "weight-fill",
    /// The next layer waits for requantisers or for the skip port.
    Requantize = "requantize",
    /// The next layer waits for the depth of the array's or the requantisers' pipeline.
    Dependency = "dependency",
    /// A finished job waits for the filter.
    Filter = "filter",
    /// A finished job waits for room in the output queue.
    OutputFull = "output-full",
    /// The next job waits for unpacking, interpolation, waves or level.
    Embed = "embed",
    /// The next job waits for its tags to be looked up, or for the latency of a hit.
    Lookup = "lookup",
    /// The next job waits because corners lie in the same bank of the latent cache.
    BankConflict = "bank-conflict",
    /// The next job waits because every miss register is taken.
    MshrFull = "mshr-full",
    /// The next job waits for a line that an unloaded memory would not have delivered yet either.
    LatentMiss = "latent-miss",
    /// The next job waits for a line that is late because of the lines before it.
    MemoryBandwidth = "memory-bandwidth",
    /// The next job waits for grid positions.
    Address = "address",
    /// The next job waits for requests.
    Starved = "starved",
    /// The last job has left the array, and its channels leave the unit.
    Drain = "drain",
}

/// Cycles by cause.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Ledger {
    cycles: [u64; Cause::ALL.len()],
}

impl Ledger {
    /// Charges cycles to a cause; time passes by as many.
    pub(super) fn charge(&mut self, cause: Cause, cycles: u64) {
        self.cycles[cause as usize] += cycles;
    }

    /// Cycles charged to a cause.
    #[must_use]
    pub fn of(&self, cause: Cause) -> u64 {
        self.cycles[cause as usize]
    }

    /// All cycles: the time.
    #[must_use]
    pub fn cycles(&self) -> u64 {
        self.cycles.iter().sum()
    }

    /// What was charged since an earlier state of the same ledger.
    pub(super) fn since(&self, earlier: &Ledger) -> Ledger {
        let mut since = *self;
        for (cycles, before) in since.cycles.iter_mut().zip(earlier.cycles) {
            *cycles -= before;
        }
        since
    }

    /// Every cause with its cycles, in the order of [`Cause::ALL`].
    pub fn entries(&self) -> impl DoubleEndedIterator<Item = (Cause, u64)> + use<> {
        let cycles = self.cycles;
        Cause::ALL
            .into_iter()
            .map(move |cause| (cause, cycles[cause as usize]))
    }

    /// The cause with most cycles in which the array does not multiply; the first of
    /// [`Cause::ALL`] among equals. `None` if there is no such cycle.
    #[must_use]
    pub fn largest_stall(&self) -> Option<Cause> {
        let stalls = self
            .entries()
            .filter(|entry| entry.0 != Cause::Compute && entry.1 > 0);
        let largest = stalls.rev().max_by_key(|entry| entry.1);
        largest.map(|entry| entry.0)
    }

    /// Shares in hundredths of a percent, in the order of [`Cause::ALL`]. They add to 10,000
    /// exactly, unless there are no cycles: rounded down, the rest going to the causes whose
    /// remainders are largest.
    #[must_use]
    pub fn shares(&self) -> [(Cause, u32); Cause::ALL.len()] {
        let total = u128::from(self.cycles());
        let scaled = self.cycles.map(|cycles| u128::from(cycles) * 10_000);
        let mut shares = Cause::ALL.map(|cause| (cause, 0));
        if total == 0 {
            return shares;
        }
        for (share, scaled) in shares.iter_mut().zip(scaled) {
            share.1 = (scaled / total) as u32;
        }
        let missing = 10_000 - shares.iter().map(|share| share.1).sum::<u32>();
        let mut order: Vec<usize> = (0..shares.len()).collect();
        order.sort_by_key(|&index| std::cmp::Reverse(scaled[index] % total));
        for &index in order.iter().take(missing as usize) {
            shares[index].1 += 1;
        }
        shares
    }
}

impl AddAssign for Ledger {
    fn add_assign(&mut self, other: Ledger) {
        for (cycles, more) in self.cycles.iter_mut().zip(other.cycles) {
            *cycles += more;
        }
    }
}

impl fmt::Display for Ledger {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (cause, share) in self.shares() {
            let (whole, part) = (share / 100, share % 100);
            writeln!(
                f,
                "{:<17} {:>14} {whole:>4}.{part:02} %",
                cause.name(),
                self.of(cause)
            )?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_add_to_one_hundred_percent_and_stay_within_one_step_of_the_truth() {
        for seed in 1..101_u64 {
            let mut ledger = Ledger::default();
            for (index, cause) in Cause::ALL.into_iter().enumerate() {
                ledger.charge(cause, seed * (index as u64 + 1) % 101);
            }
            let shares = ledger.shares();
            assert_eq!(shares.iter().map(|share| share.1).sum::<u32>(), 10_000);
            for (cause, share) in shares {
                let low = ledger.of(cause) * 10_000 / ledger.cycles();
                assert!(
                    (low..=low + 1).contains(&u64::from(share)),
                    "{}",
                    cause.name()
                );
            }
        }
        assert!(Ledger::default().shares().iter().all(|share| share.1 == 0));
    }

    #[test]
    fn the_largest_stall_is_the_first_with_most_cycles_and_never_the_array_at_work() {
        let mut ledger = Ledger::default();
        assert_eq!(ledger.largest_stall(), None);
        ledger.charge(Cause::Compute, 9);
        assert_eq!(ledger.largest_stall(), None);
        ledger.charge(Cause::Drain, 4);
        ledger.charge(Cause::Embed, 4);
        assert_eq!(ledger.largest_stall(), Some(Cause::Embed));
        ledger.charge(Cause::Drain, 1);
        assert_eq!(ledger.largest_stall(), Some(Cause::Drain));
        assert_eq!(ledger.cycles(), 18);
    }
}
