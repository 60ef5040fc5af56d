//! Configuration: the fields of a unit, unchecked.
//!
//! The table below is the only place that knows the fields: the struct, its limits, [`FIELDS`] and
//! [`Configuration::set`] are read off it.

use super::UnitError;
use crate::time::choice::{CacheKind, Dataflow, Misses, Replacement, Wiring};
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
            /// The smallest numbers and the first choices: where reading a complete file starts.
            pub(super) const LOWEST: Configuration = Configuration {
                $( $field: $low, )*
                $( $choice: $type::ALL[0], )*
            };

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
            /// When there is no such number. The value is checked by
            /// [`Unit::new`](super::Unit::new).
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
    /// Multiply-adds of the address generators in a cycle; a grid position takes as many as a corner
    /// of the layout has steps ([`ntmu_isa::layout::Layout::address_steps`]), 2 in rows or tiles.
    address_generators ["multiply-adds per cycle"] 1..=1024,
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

/// A field by its name.
pub(super) fn field(name: &str) -> Result<&'static Field, UnitError> {
    let found = FIELDS.iter().find(|field| field.name == name);
    found.ok_or_else(|| UnitError::Field {
        found: name.to_owned(),
    })
}

impl Configuration {
    /// The value of a field of [`FIELDS`].
    pub(super) fn value(&self, field: &Field) -> Option<Value> {
        let mut fields = self.fields().into_iter();
        fields.find(|(f, _)| f.name == field.name).map(|(_, v)| v)
    }

    /// Bytes of the second-level cache; 0 without one.
    #[must_use]
    pub const fn level2_bytes(&self) -> u64 {
        self.line_bytes as u64 * self.level2_sets as u64 * self.level2_ways as u64
    }

    /// Texels that the decoded-texel cache holds; 0 without one.
    #[must_use]
    pub const fn decoded_cache_texels(&self) -> u64 {
        let side = self.decoded_block_side as u64;
        self.decoded_cache_blocks as u64 * side * side
    }
}
