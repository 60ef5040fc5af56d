//! Bracket: a unit freed of one kind of wait, to say what that kind costs.
//!
//! A result lies between the same unit without a cache and with an infinite one, and above the same
//! unit behind an ideal memory.

use super::configuration::field;
use super::{Configuration, Range, Unit};
use crate::time::choice::{CacheKind, Misses};

/// The largest value of a number; 0 if there is no such number, as a test excludes.
fn most(name: &str) -> u32 {
    match field(name).map(|field| field.range) {
        Ok(Range::Number { high, .. }) => high,
        Ok(Range::Choice(_)) | Err(_) => 0,
    }
}

impl Unit {
    /// The same unit behind an ideal memory: nothing is ever waited for that comes from outside.
    ///
    /// Precisely: hits, misses and parameters have no latency; there is no second level between the
    /// latent cache and a memory that delivers as much as the widest port allows; the tags look up
    /// under misses, and the banks and miss registers take more than one fetch of a coalesced group
    /// can ask for in its cycle; the weight SRAM holds the largest program. What remains is one
    /// cycle for each fetch of a group, and the cycles of a first weight fill at the widest port.
    /// Queues stay as they are; see [`Unit::with_unbounded_queues`].
    #[must_use]
    pub fn with_ideal_memory(&self) -> Unit {
        let configuration = Configuration {
            lookups_per_bank: most("lookups_per_bank"),
            hit_latency_cycles: 0,
            misses: Misses::HitUnderMiss,
            mshrs: most("mshrs"),
            memory_latency_cycles: 0,
            memory_bytes_per_cycle: most("memory_bytes_per_cycle"),
            weight_sram_bytes: most("weight_sram_bytes"),
            weight_fill_bytes_per_cycle: most("weight_fill_bytes_per_cycle"),
            weight_latency_cycles: 0,
            ..self.configuration.with_one_level()
        };
        self.changed("ideal memory", configuration)
    }

    /// The same unit with the longest queues that a unit may have: between the front and the array,
    /// and behind it.
    #[must_use]
    pub fn with_unbounded_queues(&self) -> Unit {
        let configuration = Configuration {
            request_queue_texels: most("request_queue_texels"),
            corner_fifo_texels: most("corner_fifo_texels"),
            output_queue_pixels: most("output_queue_pixels"),
            ..self.configuration
        };
        self.changed("unbounded queues", configuration)
    }

    /// The same unit without a cache for latents, of either level: every line comes from memory.
    #[must_use]
    pub fn without_cache(&self) -> Unit {
        let configuration = Configuration {
            cache: CacheKind::None,
            ..self.configuration.with_one_level()
        };
        self.changed("no cache", configuration)
    }

    /// The same unit with a latent cache that keeps every line it ever held: a line comes from
    /// memory once. A second level would hold nothing that the first does not, so there is none.
    #[must_use]
    pub fn with_infinite_cache(&self) -> Unit {
        let configuration = Configuration {
            cache: CacheKind::Infinite,
            ..self.configuration.with_one_level()
        };
        self.changed("infinite cache", configuration)
    }
}

impl Configuration {
    /// The same without a second level.
    fn with_one_level(&self) -> Configuration {
        Configuration {
            level2_sets: 0,
            level2_latency_cycles: 0,
            ..*self
        }
    }
}
