//! Unit: one hardware configuration, as data.
//!
//! The table below is the only place that knows the fields: the struct, its limits, [`FIELDS`] and
//! [`Configuration::set`] are read off it. A [`Unit`] is the proof that a configuration can be built.

use std::fmt;

/// One field of a [`Configuration`]: what it is called, counted in, and limited to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// Its name.
    pub name: &'static str,
    /// What it counts.
    pub unit: &'static str,
    /// The smallest value.
    pub low: u32,
    /// The largest value.
    pub high: u32,
    /// What it means, for tables.
    pub summary: &'static str,
}

macro_rules! configuration {
    ($( $(#[doc = $doc:literal])+ $field:ident [$unit:literal] $low:literal ..= $high:literal, )*) => {
        /// The numbers of a unit, unchecked.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub struct Configuration {
            $( $(#[doc = $doc])+ #[doc = concat!("\n\nIn ", $unit, ", ", $low, " to ", $high, ".")]
               pub $field: u32, )*
        }

        /// The fields of a [`Configuration`], in the order of the texel's journey.
        pub const FIELDS: &[Field] = &[ $( Field {
            name: stringify!($field),
            unit: $unit,
            low: $low,
            high: $high,
            summary: concat!($( $doc ),+),
        }, )* ];

        impl Configuration {
            /// Every field with its value, in the order of [`FIELDS`].
            #[must_use]
            pub fn fields(&self) -> Vec<(&'static Field, u32)> {
                FIELDS.iter().zip([ $( self.$field ),* ]).collect()
            }

            /// Gives a field another value, by name.
            ///
            /// # Errors
            /// When there is no such field. The value is checked by [`Unit::new`].
            pub fn set(&mut self, name: &str, value: u32) -> Result<(), UnitError> {
                match name {
                    $( stringify!($field) => self.$field = value, )*
                    _ => return Err(UnitError::Field { found: name.to_owned() }),
                }
                Ok(())
            }
        }
    };
}

configuration! {
    /// Clock. It turns cycles into seconds in a report and changes nothing else.
    clock_mhz ["MHz"] 1..=10_000,
    /// Requests that the shader cores hand over in a cycle.
    requests_per_cycle ["texels"] 1..=1024,
    /// Requests that wait in front of the address generators.
    request_queue_texels ["texels"] 1..=65_536,
    /// Successive requests that go through the front end together and whose lines are looked up
    /// once: 1 for none, 4 for a quad (Skybox, `dups` in `VX_tex_mem.sv`).
    coalesced_texels ["texels"] 1..=64,
    /// Grid positions computed in a cycle; a texel needs one for each grid.
    address_generators ["positions per cycle"] 1..=1024,
    /// Bytes of a line of the latent cache, a power of two.
    line_bytes ["bytes"] 16..=256,
    /// Sets of the latent cache, a power of two.
    cache_sets ["sets"] 1..=65_536,
    /// Ways of the latent cache.
    cache_ways ["ways"] 1..=256,
    /// Banks of the latent cache, a power of two; successive lines lie in successive banks.
    cache_banks ["banks"] 1..=64,
    /// Tags that a bank looks up in a cycle.
    lookups_per_bank ["lines per cycle"] 1..=4096,
    /// From the lookup to the corners, for a line that is there.
    hit_latency_cycles ["cycles"] 0..=1000,
    /// Lines under way from memory. A second miss of a line joins the first.
    mshrs ["lines"] 1..=4096,
    /// From a miss to the first byte, with nothing in between.
    memory_latency_cycles ["cycles"] 0..=100_000,
    /// Bytes of latents that memory delivers in a cycle.
    memory_bytes_per_cycle ["bytes per cycle"] 1..=1_048_576,
    /// The smallest transfer, a power of two; a line is rounded up to it.
    burst_bytes ["bytes"] 1..=256,
    /// Texels that wait in order, behind their tags, for their corners (the fragment FIFO of Igehy,
    /// Eldridge and Proudfoot 1998).
    corner_fifo_texels ["texels"] 1..=1_048_576,
    /// Latents of corners unpacked in a cycle.
    unpack_lanes ["latents per cycle"] 1..=65_536,
    /// Latents interpolated in a cycle, four corners each.
    interpolator_lanes ["latents per cycle"] 1..=65_536,
    /// Waves, levels and zeros written in a cycle.
    embed_lanes ["inputs per cycle"] 1..=65_536,
    /// Texels of a batch: the array holds a tile of weights while they pass through it. 16 is a
    /// texel block.
    batch_texels ["texels"] 1..=1024,
    /// Batches of a job. They take turns at the array, layer by layer, so that one is multiplied
    /// while another is requantised.
    batches_in_flight ["batches"] 1..=16,
    /// Bytes of parameters that stay in the unit. Layers that do not fit are streamed for each batch.
    weight_sram_bytes ["bytes"] 0..=268_435_456,
    /// Bytes of parameters that come from outside in a cycle, on a port of their own.
    weight_fill_bytes_per_cycle ["bytes per cycle"] 1..=1_048_576,
    /// From weight SRAM to the array's shadow registers, for a tile of bytes, and twice as long for
    /// one of halves; hidden behind the pass before it as far as that is as long.
    tile_load_cycles ["cycles"] 1..=4096,
    /// Outputs of a tile of weights.
    mac_rows ["rows"] 1..=1024,
    /// Inputs of a tile of weights.
    mac_columns ["columns"] 1..=1024,
    /// Copies of the array. They hold the same tile and share the texels of a batch.
    mac_arrays ["arrays"] 1..=64,
    /// Passes of the array for integers of more than 8 bits times weights: 2 where a multiplier of
    /// bytes takes such an integer in two halves (Bit Fusion, Sharma et al. 2018).
    wide_passes ["passes"] 1..=64,
    /// Passes of the array for halves: 2 is the published ratio of int8 to fp16 rates of GPU matrix
    /// units (NVIDIA A100: 624 and 312 TOPS); 1 is an array built for fp16.
    half_passes ["passes"] 1..=64,
    /// From the last input of a pass to its last accumulator.
    mac_depth_cycles ["cycles"] 0..=1000,
    /// Wide multiplications in a cycle, on accumulators.
    requantizer_lanes ["lanes"] 1..=65_536,
    /// From an accumulator to its activation.
    requantizer_depth_cycles ["cycles"] 0..=1000,
    /// Activations read from the residual store, and rescaled or added, in a cycle.
    skip_lanes ["activations per cycle"] 1..=65_536,
    /// Decoded texels that wait to leave the unit.
    output_queue_texels ["texels"] 1..=1_048_576,
    /// Channels that leave the unit in a cycle.
    output_channels_per_cycle ["channels per cycle"] 1..=65_536,
}

/// Why a configuration is no unit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum UnitError {
    /// A field is out of its range.
    Range {
        /// The field.
        field: &'static str,
        /// Its value.
        found: u32,
        /// The smallest value.
        low: u32,
        /// The largest value.
        high: u32,
    },
    /// A field is no power of two.
    PowerOfTwo {
        /// The field.
        field: &'static str,
        /// Its value.
        found: u32,
    },
    /// A field is no multiple of another.
    Multiple {
        /// The field.
        field: &'static str,
        /// Its value.
        found: u32,
        /// The other field.
        of: &'static str,
        /// The other's value.
        allowed: u32,
    },
    /// A queue cannot hold the smallest thing that enters it.
    Capacity {
        /// The field.
        field: &'static str,
        /// Its value.
        found: u32,
        /// What enters it.
        holds: &'static str,
        /// The smallest value.
        allowed: u32,
    },
    /// No field has this name.
    Field {
        /// The name.
        found: String,
    },
    /// No preset has this name.
    Preset {
        /// The name.
        found: String,
    },
}

impl fmt::Display for UnitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            UnitError::Range {
                field,
                found,
                low,
                high,
            } => {
                write!(f, "unit.{field}: found {found}; allowed: {low}..={high}")
            }
            UnitError::PowerOfTwo { field, found } => {
                write!(f, "unit.{field}: found {found}; allowed: a power of two")
            }
            UnitError::Multiple {
                field,
                found,
                of,
                allowed,
            } => {
                write!(
                    f,
                    "unit.{field}: found {found}; allowed: a multiple of {allowed}, its {of}"
                )
            }
            UnitError::Capacity {
                field,
                found,
                holds,
                allowed,
            } => {
                write!(
                    f,
                    "unit.{field}: found {found}; allowed: at least {allowed}, {holds}"
                )
            }
            UnitError::Field { found } => {
                let names: Vec<&str> = FIELDS.iter().map(|field| field.name).collect();
                write!(
                    f,
                    "unit field: found {found:?}; allowed: {}",
                    names.join(", ")
                )
            }
            UnitError::Preset { found } => {
                let names = super::presets::NAMES.join(", ");
                write!(f, "unit: found {found:?}; allowed: {names}")
            }
        }
    }
}

impl std::error::Error for UnitError {}

/// One hardware configuration, validated. Its fields are read through it: `unit.mac_rows`.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct Unit {
    name: String,
    configuration: Configuration,
}

impl std::ops::Deref for Unit {
    type Target = Configuration;

    fn deref(&self) -> &Configuration {
        &self.configuration
    }
}

impl Unit {
    /// The configuration, checked.
    ///
    /// # Errors
    /// The first field that is out of range or contradicts another.
    pub fn new(name: impl Into<String>, configuration: Configuration) -> Result<Unit, UnitError> {
        let c = &configuration;
        for (
            &Field {
                name: field,
                low,
                high,
                ..
            },
            found,
        ) in c.fields()
        {
            if !(low..=high).contains(&found) {
                return Err(UnitError::Range {
                    field,
                    found,
                    low,
                    high,
                });
            }
        }
        for (field, found) in [
            ("line_bytes", c.line_bytes),
            ("cache_sets", c.cache_sets),
            ("cache_banks", c.cache_banks),
            ("burst_bytes", c.burst_bytes),
        ] {
            if !found.is_power_of_two() {
                return Err(UnitError::PowerOfTwo { field, found });
            }
        }
        if !c.batch_texels.is_multiple_of(c.coalesced_texels) {
            return Err(UnitError::Multiple {
                field: "batch_texels",
                found: c.batch_texels,
                of: "coalesced_texels",
                allowed: c.coalesced_texels,
            });
        }
        let group = "one coalesced group";
        for (field, found, holds, allowed) in [
            (
                "request_queue_texels",
                c.request_queue_texels,
                group,
                c.coalesced_texels,
            ),
            (
                "corner_fifo_texels",
                c.corner_fifo_texels,
                group,
                c.coalesced_texels,
            ),
            (
                "output_queue_texels",
                c.output_queue_texels,
                "one job",
                c.job_texels(),
            ),
        ] {
            if found < allowed {
                return Err(UnitError::Capacity {
                    field,
                    found,
                    holds,
                    allowed,
                });
            }
        }
        Ok(Unit {
            name: name.into(),
            configuration,
        })
    }

    /// A unit of [`super::presets`], whose tests check it.
    pub(super) fn preset(name: &str, configuration: Configuration) -> Unit {
        Unit {
            name: name.to_owned(),
            configuration,
        }
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Its numbers, for building another unit from them.
    #[must_use]
    pub fn configuration(&self) -> &Configuration {
        &self.configuration
    }

    /// The same unit behind an ideal memory: nothing is ever waited for that comes from outside.
    ///
    /// Precisely: hits and misses have no latency; memory delivers, the banks look up and the miss
    /// registers hold more than one fetch of a coalesced group can ask for in its cycle; the weight
    /// SRAM holds the largest program. What remains is one cycle for each fetch of a group, and the
    /// cycles of the first weight fill at the widest port.
    #[must_use]
    pub fn with_ideal_memory(&self) -> Unit {
        let configuration = Configuration {
            hit_latency_cycles: 0,
            memory_latency_cycles: 0,
            memory_bytes_per_cycle: 1 << 20,
            lookups_per_bank: 1 << 12,
            mshrs: 1 << 12,
            weight_sram_bytes: 1 << 28,
            weight_fill_bytes_per_cycle: 1 << 20,
            ..self.configuration
        };
        Unit {
            name: format!("{}, ideal memory", self.name),
            configuration,
        }
    }
}

impl Configuration {
    /// Texels of a job: the batches that are in the array together.
    #[must_use]
    pub const fn job_texels(&self) -> u32 {
        self.batch_texels * self.batches_in_flight
    }

    /// Bytes of the latent cache.
    #[must_use]
    pub const fn cache_bytes(&self) -> u64 {
        self.line_bytes as u64 * self.cache_sets as u64 * self.cache_ways as u64
    }

    /// Multiplications of bytes that all arrays together do in a cycle.
    #[must_use]
    pub const fn macs_per_cycle(&self) -> u64 {
        self.mac_rows as u64 * self.mac_columns as u64 * self.mac_arrays as u64
    }
}

impl fmt::Display for Unit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", self.name)?;
        for (field, value) in self.fields() {
            writeln!(f, "  {:<28} {value:>10} {}", field.name, field.unit)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_field_is_set_by_name_and_refused_just_outside_its_range() {
        for field in FIELDS {
            let refused = [field.low.checked_sub(1), field.high.checked_add(1)];
            for found in refused.into_iter().flatten() {
                let mut changed = *Unit::mobile().configuration();
                changed.set(field.name, found).unwrap();
                let expected = UnitError::Range {
                    field: field.name,
                    found,
                    low: field.low,
                    high: field.high,
                };
                assert_eq!(Unit::new("x", changed), Err(expected));
            }
        }
        let mut unit = *Unit::mobile().configuration();
        assert!(matches!(
            unit.set("mac_row", 1),
            Err(UnitError::Field { .. })
        ));
    }

    #[test]
    fn fields_that_contradict_each_other_are_refused() {
        let refused = |name: &str, value| {
            let mut changed = *Unit::mobile().configuration();
            changed.set(name, value).unwrap();
            Unit::new("x", changed).unwrap_err().to_string()
        };
        assert_eq!(
            refused("cache_sets", 3),
            "unit.cache_sets: found 3; allowed: a power of two"
        );
        assert_eq!(
            refused("batch_texels", 6),
            "unit.batch_texels: found 6; allowed: a multiple of 4, its coalesced_texels"
        );
        assert_eq!(
            refused("corner_fifo_texels", 3),
            "unit.corner_fifo_texels: found 3; allowed: at least 4, one coalesced group"
        );
        assert_eq!(
            refused("output_queue_texels", 15),
            "unit.output_queue_texels: found 15; allowed: at least 16, one job"
        );
    }

    #[test]
    fn ideal_memory_is_itself_a_unit_and_holds_the_largest_program() {
        use ntmu_isa::limits::{MAX_LANES, MAX_LAYERS};
        let lanes = u64::from(MAX_LANES);
        // Halves are the widest weights; a table and the wide rows of bytes are less.
        let largest = u64::from(MAX_LAYERS) * (lanes * lanes + lanes) * 2;
        for name in super::super::presets::NAMES {
            let ideal = Unit::by_name(name).unwrap().with_ideal_memory();
            assert!(u64::from(ideal.weight_sram_bytes) >= largest);
            assert_eq!(Unit::new(ideal.name(), *ideal.configuration()), Ok(ideal));
        }
    }
}
