//! Counts: what a run did as numbers that add up, so that parts of runs can be joined.

use crate::model::time::energy::Operations;
use crate::model::time::{Ledger, Resource, Timing, Unit};
use std::ops::AddAssign;

macro_rules! counts {
    ( $( $(#[doc = $doc:literal])+ $field:ident, )+ ) => {
        /// What a run, or part of one, did.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
        pub struct Counts {
            $( $(#[doc = $doc])+ pub $field: u64, )+
            /// Cycles by cause; they add up to `cycles`.
            pub ledger: Ledger,
            /// What was done, for an energy table.
            pub operations: Operations,
            /// Cycles in which each resource works at least, in the order of [`Resource::ALL`].
            pub work: [u64; Resource::ALL.len()],
        }

        impl Counts {
            /// What `self` did more of than another. Its cycles are left as they are: they are
            /// measured, and not a difference.
            #[must_use]
            pub fn beyond(&self, other: &Counts) -> Counts {
                let mut work = self.work;
                for (cycles, before) in work.iter_mut().zip(other.work) {
                    *cycles = cycles.saturating_sub(before);
                }
                Counts {
                    $( $field: self.$field.saturating_sub(other.$field), )+
                    ledger: self.ledger,
                    operations: self.operations.beyond(&other.operations),
                    work,
                }
                .with_time(self)
            }
        }

        impl AddAssign<&Counts> for Counts {
            fn add_assign(&mut self, other: &Counts) {
                $( self.$field += other.$field; )+
                self.ledger += other.ledger;
                self.operations += other.operations;
                for (cycles, more) in self.work.iter_mut().zip(other.work) {
                    *cycles += more;
                }
            }
        }
    };
}

counts! {
    /// Cycles.
    cycles,
    /// Pixels that left in those cycles.
    timed_pixels,
    /// Pixels asked for.
    pixels,
    /// Texels, or places between them, that they asked for.
    texels,
    /// Texels that another pixel of the quad asked for too.
    shared_texels,
    /// Texels that the decoded-texel cache held.
    held_texels,
    /// Texels that went through the synthesizer.
    decodes,
    /// Bytes of latents from memory, lines rounded up to bursts.
    latent_bytes,
    /// Bytes of parameters from outside.
    weight_bytes,
    /// Lines looked up in the latent cache.
    lookups,
    /// Lookups of lines that were there.
    hits,
    /// Lookups of lines that were on their way.
    merges,
    /// Lookups of lines that had to be asked for.
    misses,
    /// Misses that the second level held.
    level2_hits,
    /// Lines asked of memory.
    fetched_lines,
    /// Times that a material's parameters came in.
    weight_fills,
    /// Jobs of the array.
    jobs,
    /// Multiplications.
    macs,
    /// Cycles of one multiplier that they took.
    multiplier_cycles,
}

impl Counts {
    /// The counts of a whole run of a unit.
    #[must_use]
    pub fn of(timing: &Timing, unit: &Unit) -> Counts {
        let available = timing.cycles as f64 * unit.macs_per_cycle() as f64;
        let mut work = [0; Resource::ALL.len()];
        for (cycles, bound) in work.iter_mut().zip(&timing.closed_form.bounds) {
            *cycles = bound.work;
        }
        Counts {
            cycles: timing.cycles,
            timed_pixels: timing.pixels,
            pixels: timing.pixels,
            texels: timing.texels,
            shared_texels: timing.shared_texels,
            held_texels: timing.held_texels,
            decodes: timing.decodes,
            latent_bytes: timing.latent_bytes,
            weight_bytes: timing.weight_bytes,
            lookups: timing.lookups,
            hits: timing.hits,
            merges: timing.merges,
            misses: timing.misses,
            level2_hits: timing.level2_hits,
            fetched_lines: timing.fetched_lines,
            weight_fills: timing.weight_fills,
            jobs: timing.jobs,
            macs: timing.macs,
            multiplier_cycles: (timing.mac_utilisation * available).round() as u64,
            ledger: timing.ledger,
            operations: timing.operations,
            work,
        }
    }

    /// The same with another part's time.
    #[must_use]
    fn with_time(self, other: &Counts) -> Counts {
        Counts {
            cycles: other.cycles,
            timed_pixels: other.timed_pixels,
            ledger: other.ledger,
            ..self
        }
    }

    /// The same with the time that was measured behind a warm-up.
    #[must_use]
    pub fn behind_warm_up(self, timing: &Timing) -> Counts {
        Counts {
            cycles: timing.measured.ledger.cycles(),
            timed_pixels: timing.measured.pixels,
            ledger: timing.measured.ledger,
            ..self
        }
    }
}
