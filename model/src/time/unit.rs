//! Unit: one hardware configuration, as data.
//!
//! The table below is the only place that knows the fields: the struct, its limits, [`FIELDS`] and
//! [`Configuration::set`] are read off it. A [`Unit`] is the proof that a configuration can be built.

use super::choice::{CacheKind, Dataflow, Misses, Replacement, Wiring};
use std::fmt;

/// What a field may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Range {
    /// A number, from the smallest to the largest.
    Number {
        /// The smallest.
        low: u32,
        /// The largest.
        high: u32,
    },
    /// One of these names.
    Choice(&'static [&'static str]),
}

/// What a field is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Value {
    /// A number, in the field's unit.
    Number(u32),
    /// A choice, by name.
    Choice(&'static str),
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Value::Number(number) => f.pad_integral(true, "", &number.to_string()),
            Value::Choice(name) => f.pad(name),
        }
    }
}

/// One field of a [`Configuration`]: what it is called, counted in, and limited to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Field {
    /// Its name.
    pub name: &'static str,
    /// What it counts; empty for a choice.
    pub unit: &'static str,
    /// What it may be.
    pub range: Range,
    /// What it means, for tables.
    pub summary: &'static str,
}

macro_rules! configuration {
    (
        numbers { $( $(#[doc = $doc:literal])+ $field:ident [$unit:literal] $low:literal ..= $high:literal, )* }
        choices { $( $(#[doc = $choice_doc:literal])+ $choice:ident : $type:ident, )* }
    ) => {
        /// The numbers and choices of a unit, unchecked.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        pub struct Configuration {
            $( $(#[doc = $doc])+ #[doc = concat!("\n\nIn ", $unit, ", ", $low, " to ", $high, ".")]
               pub $field: u32, )*
            $( $(#[doc = $choice_doc])+ pub $choice: $type, )*
        }

        /// The fields of a [`Configuration`]: the numbers in the order of the texel's journey, then
        /// the choices.
        pub const FIELDS: &[Field] = &[
            $( Field {
                name: stringify!($field),
                unit: $unit,
                range: Range::Number { low: $low, high: $high },
                summary: concat!($( $doc ),+),
            }, )*
            $( Field {
                name: stringify!($choice),
                unit: "",
                range: Range::Choice($type::NAMES),
                summary: concat!($( $choice_doc ),+),
            }, )*
        ];

        impl Configuration {
            /// Every field with its value, in the order of [`FIELDS`].
            #[must_use]
            pub fn fields(&self) -> Vec<(&'static Field, Value)> {
                let numbers = [ $( Value::Number(self.$field) ),* ];
                let choices = [ $( Value::Choice(self.$choice.name()) ),* ];
                FIELDS.iter().zip(numbers.into_iter().chain(choices)).collect()
            }

            /// Gives a number another value, by name.
            ///
            /// # Errors
            /// When there is no such number. The value is checked by [`Unit::new`].
            pub fn set(&mut self, name: &str, value: u32) -> Result<(), UnitError> {
                match name {
                    $( stringify!($field) => self.$field = value, )*
                    _ => return Err(UnitError::Field { found: name.to_owned() }),
                }
                Ok(())
            }

            /// Makes another choice, both by name.
            ///
            /// # Errors
            /// When there is no such choice, or it has no such name.
            pub fn choose(&mut self, field: &str, name: &str) -> Result<(), UnitError> {
                match field {
                    $( stringify!($choice) => match $type::by_name(name) {
                        Some(choice) => self.$choice = choice,
                        None => return Err(UnitError::Choice {
                            field: stringify!($choice),
                            found: name.to_owned(),
                            allowed: $type::NAMES,
                        }),
                    }, )*
                    _ => return Err(UnitError::Field { found: field.to_owned() }),
                }
                Ok(())
            }
        }
    };
}

configuration! {
    numbers {
    /// Clock. It turns cycles into seconds in a report and changes nothing else.
    clock_mhz ["MHz"] 1..=10_000,
    /// Pixels whose demands the shader cores hand over in a cycle.
    requests_per_cycle ["pixels"] 1..=1024,
    /// Successive pixels of one material whose equal texels are decoded once: 1 for none, 4 for a
    /// quad.
    quad_pixels ["pixels"] 1..=16,
    /// Blocks of the decoded-texel cache: what was decoded is kept, and filtered from again. 0 for
    /// none.
    decoded_cache_blocks ["blocks"] 0..=65_536,
    /// Ways of the decoded-texel cache, least recently used replaced first.
    decoded_cache_ways ["ways"] 1..=256,
    /// Texels along the side of a block of the decoded-texel cache, a power of two. A miss decodes
    /// the whole block.
    decoded_block_side ["texels"] 1..=8,
    /// Texels that wait in front of the address generators.
    request_queue_texels ["texels"] 1..=65_536,
    /// Texels that go through the front end together and whose lines are looked up once: 1 for
    /// none, 4 for a quad (Skybox, `dups` in `VX_tex_mem.sv`).
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
    /// Sets of the second-level cache, a power of two; its lines are those of the latent cache. 0
    /// for none.
    level2_sets ["sets"] 0..=1_048_576,
    /// Ways of the second-level cache.
    level2_ways ["ways"] 1..=256,
    /// From a miss to the first byte, for a line that the second level holds; 0 without one.
    level2_latency_cycles ["cycles"] 0..=100_000,
    /// Bytes that the second level delivers in a cycle.
    level2_bytes_per_cycle ["bytes per cycle"] 1..=1_048_576,
    /// From a miss of the last cache to the first byte, with nothing in between.
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
    /// Jobs that are gathered at the same time, each of one material. 1 closes a job whenever the
    /// material changes.
    material_bins ["jobs"] 1..=256,
    /// Bytes of parameters that stay in the unit. Layers that do not fit are streamed for each batch.
    weight_sram_bytes ["bytes"] 0..=268_435_456,
    /// Bytes of parameters that come from outside in a cycle, on a port of their own.
    weight_fill_bytes_per_cycle ["bytes per cycle"] 1..=1_048_576,
    /// From asking for parameters to the first byte.
    weight_latency_cycles ["cycles"] 0..=100_000,
    /// From weight SRAM to the array's shadow registers, for a tile of bytes, and twice as long for
    /// one of halves; hidden behind the pass before it as far as that is as long.
    tile_load_cycles ["cycles"] 1..=4096,
    /// Tiles that the array's registers hold: 2 hides the load of the next behind a pass, 1 does
    /// not.
    tile_buffers ["tiles"] 1..=2,
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
    /// Columns that a column of multipliers stands for where weights have at most 4 bits and values
    /// at most 8: 2 where a multiplier of bytes splits into two (NVIDIA A100: int4 at twice int8).
    narrow_columns ["columns"] 1..=8,
    /// From the last input of a pass to its last accumulator.
    mac_depth_cycles ["cycles"] 0..=1000,
    /// Wide multiplications in a cycle, on accumulators.
    requantizer_lanes ["lanes"] 1..=65_536,
    /// From an accumulator to its activation.
    requantizer_depth_cycles ["cycles"] 0..=1000,
    /// Activations read from the residual store, and rescaled or added, in a cycle.
    skip_lanes ["activations per cycle"] 1..=65_536,
    /// Weighted codes that the filter adds in a cycle; a single texel passes without.
    filter_lanes ["codes per cycle"] 1..=65_536,
    /// From the last code to the filtered one.
    filter_depth_cycles ["cycles"] 0..=1000,
    /// Pixels that wait to leave the unit.
    output_queue_pixels ["pixels"] 1..=1_048_576,
    /// Channels that leave the unit in a cycle.
    output_channels_per_cycle ["channels per cycle"] 1..=65_536,
    }
    choices {
    /// What the latent cache holds; `none` and `infinite` are the brackets of a result.
    cache: CacheKind,
    /// Which line of a set of the latent cache, and of the second level, is replaced.
    replacement: Replacement,
    /// What happens behind a miss of the latent cache.
    misses: Misses,
    /// What stays in the MAC array.
    dataflow: Dataflow,
    /// How operands reach the multipliers.
    wiring: Wiring,
    }
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
    /// A choice has no such name.
    Choice {
        /// The field.
        field: &'static str,
        /// The name found.
        found: String,
        /// The names that it has.
        allowed: &'static [&'static str],
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
            UnitError::Choice {
                field,
                found,
                allowed,
            } => {
                let names = allowed.join(", ");
                write!(f, "unit.{field}: found {found:?}; allowed: {names}")
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
        for (field, value) in c.fields() {
            // A choice is one of its own by its type.
            if let (Range::Number { low, high }, Value::Number(found)) = (field.range, value)
                && !(low..=high).contains(&found)
            {
                return Err(UnitError::Range {
                    field: field.name,
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
            ("decoded_block_side", c.decoded_block_side),
            // None is allowed too.
            ("level2_sets", c.level2_sets.max(1)),
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
                "output_queue_pixels",
                c.output_queue_pixels,
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
            level2_sets: 0,
            weight_latency_cycles: 0,
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

    /// The same unit with queues that hold more than any run puts in them.
    #[must_use]
    pub fn with_unbounded_queues(&self) -> Unit {
        let configuration = Configuration {
            request_queue_texels: 65_536,
            corner_fifo_texels: 1_048_576,
            output_queue_pixels: 1_048_576,
            ..self.configuration
        };
        Unit {
            name: format!("{}, endless queues", self.name),
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
            let Range::Number { low, high } = field.range else {
                continue;
            };
            let refused = [low.checked_sub(1), high.checked_add(1)];
            for found in refused.into_iter().flatten() {
                let mut changed = *Unit::mobile().configuration();
                changed.set(field.name, found).unwrap();
                let expected = UnitError::Range {
                    field: field.name,
                    found,
                    low,
                    high,
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
            refused("output_queue_pixels", 15),
            "unit.output_queue_pixels: found 15; allowed: at least 16, one job"
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
