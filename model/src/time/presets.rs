//! Presets: three units worth comparing.
//!
//! No product is described. Where published numbers exist they are used, and named:
//!
//! - *Skybox*: Vortex GPU, `VX_config.vh`: texture cache 8 KiB, 2 ways, 1 bank, 16 miss registers;
//!   duplicate lookups of a quad merged.
//! - *ATTILA*: `bGPU.ini`: texture cache 16 KiB in 4 ways, access queue of 64.
//! - *GPGPU-Sim*: texture cache `N:4:128:256` (128 KiB in lines of 128 bytes) for a QV100, and a
//!   fragment FIFO of 512.
//! - *NVIDIA A100*: int8 twice as fast as fp16, which is two passes for halves in every preset.
//! - *Hakura and Gupta 1997*: working sets of at most 16 KiB.
//!
//! The rest is chosen, by one rule each, given beside the number: the arrays so that a 64-wide
//! layer is a whole number of tiles, and every other stage so that it keeps up with the array on a
//! synthesizer of about 10,000 multiplications per texel, the hardware-sized shapes.

use super::choice::{CacheKind, Dataflow, Misses, Replacement, Wiring};
use super::unit::{Configuration, Unit, UnitError};

/// The names of the presets, smallest unit first.
pub const NAMES: [&str; 3] = ["mobile", "console", "desktop"];

/// A small unit: 256 multiplications a cycle, 8 KiB of latents.
const MOBILE: Configuration = Configuration {
    // A clock that mobile GPUs are run at.
    clock_mhz: 800,
    // A quad of pixels a cycle.
    requests_per_cycle: 4,
    quad_pixels: 4,
    decoded_cache_blocks: 0,
    decoded_cache_ways: 4,
    decoded_block_side: 4,
    // Four texel blocks: ATTILA's access queue.
    request_queue_texels: 64,
    // A quad, as in Skybox.
    coalesced_texels: 4,
    // A quad in four cycles; the array needs about 40 cycles for each texel.
    address_generators: 2,
    // Skybox: 8 KiB in 2 ways. 64 bytes are 16 cells of 8 four-bit latents.
    line_bytes: 64,
    cache_sets: 64,
    cache_ways: 2,
    // Skybox.
    cache_banks: 1,
    lookups_per_bank: 1,
    // The depth of a small SRAM with its tag compare and alignment.
    hit_latency_cycles: 4,
    // Skybox.
    mshrs: 16,
    level2_sets: 0,
    level2_ways: 16,
    level2_latency_cycles: 0,
    level2_bytes_per_cycle: 64,
    // 188 ns: a system-level cache that misses to LPDDR.
    memory_latency_cycles: 150,
    // 6.4 GB/s: an eighth of a 51.2 GB/s LPDDR5 interface, for one of eight units.
    memory_bytes_per_cycle: 8,
    // The burst of a 16-bit LPDDR5 channel: 16 beats.
    burst_bytes: 32,
    // ATTILA's access queue again.
    corner_fifo_texels: 64,
    // One quad of a 64-lane input vector in 16 cycles.
    unpack_lanes: 16,
    interpolator_lanes: 8,
    embed_lanes: 4,
    // A texel block.
    batch_texels: 16,
    // One: the requantisers' tail shows, the accumulators are half as many.
    batches_in_flight: 1,
    material_bins: 1,
    // Holds every hidden width up to 64 with four blocks: 37,000 weights and their rows are 42 KiB.
    weight_sram_bytes: 48 * 1024,
    weight_fill_bytes_per_cycle: 16,
    weight_latency_cycles: 0,
    // A row of weights a cycle: one tile in the time that a texel block passes.
    tile_load_cycles: 16,
    tile_buffers: 2,
    // A 64-wide layer is four tiles by four.
    mac_rows: 16,
    mac_columns: 16,
    mac_arrays: 1,
    wide_passes: 2,
    half_passes: 2,
    narrow_columns: 1,
    // Multiplier, four levels of adders, accumulator.
    mac_depth_cycles: 6,
    // One row of tiles a cycle: keeps up with a layer of a single column of tiles.
    requantizer_lanes: 16,
    // Wide multiplier, rounding shift, zero point, saturation.
    requantizer_depth_cycles: 4,
    skip_lanes: 16,
    // Two jobs.
    filter_lanes: 64,
    filter_depth_cycles: 4,
    output_queue_pixels: 32,
    // An RGBA texel a cycle, like a bilinear filter.
    output_channels_per_cycle: 4,
    cache: CacheKind::Finite,
    replacement: Replacement::Lru,
    misses: Misses::HitUnderMiss,
    dataflow: Dataflow::WeightStationary,
    wiring: Wiring::Broadcast,
};

/// A middle unit: 1024 multiplications a cycle, 16 KiB of latents.
const CONSOLE: Configuration = Configuration {
    // A clock that console GPUs are run at.
    clock_mhz: 1_800,
    requests_per_cycle: 4,
    quad_pixels: 4,
    decoded_cache_blocks: 0,
    decoded_cache_ways: 4,
    decoded_block_side: 4,
    request_queue_texels: 128,
    coalesced_texels: 4,
    // A quad in two cycles.
    address_generators: 4,
    // ATTILA's 16 KiB in 4 ways, which is Hakura and Gupta's working set.
    line_bytes: 64,
    cache_sets: 64,
    cache_ways: 4,
    // The four corners of a texel lie in two rows of lines: four banks keep most apart.
    cache_banks: 4,
    lookups_per_bank: 1,
    hit_latency_cycles: 8,
    mshrs: 32,
    level2_sets: 0,
    level2_ways: 16,
    level2_latency_cycles: 0,
    level2_bytes_per_cycle: 64,
    // 139 ns: a level 2 that misses to GDDR.
    memory_latency_cycles: 250,
    // 57.6 GB/s: half of what a level 2 with 64 bytes per cycle gives one client.
    memory_bytes_per_cycle: 32,
    // The burst of a 16-bit GDDR6 channel: 16 beats.
    burst_bytes: 32,
    // GPGPU-Sim's fragment FIFO, halved with the latency.
    corner_fifo_texels: 256,
    unpack_lanes: 32,
    interpolator_lanes: 16,
    embed_lanes: 8,
    batch_texels: 32,
    // Two: one is requantised while the other is multiplied.
    batches_in_flight: 2,
    material_bins: 1,
    // Holds the 64-wide CNTC shape and its successor while one replaces the other; a 128-wide one
    // is streamed.
    weight_sram_bytes: 128 * 1024,
    weight_fill_bytes_per_cycle: 32,
    weight_latency_cycles: 0,
    // A row of weights a cycle: one tile in the time of a batch.
    tile_load_cycles: 32,
    tile_buffers: 2,
    // A 64-wide layer is two tiles by two.
    mac_rows: 32,
    mac_columns: 32,
    mac_arrays: 1,
    wide_passes: 2,
    half_passes: 2,
    narrow_columns: 1,
    // One level of adders more than with 16 columns.
    mac_depth_cycles: 7,
    requantizer_lanes: 32,
    requantizer_depth_cycles: 4,
    skip_lanes: 32,
    // Two jobs.
    filter_lanes: 64,
    filter_depth_cycles: 4,
    output_queue_pixels: 128,
    output_channels_per_cycle: 8,
    cache: CacheKind::Finite,
    replacement: Replacement::Lru,
    misses: Misses::HitUnderMiss,
    dataflow: Dataflow::WeightStationary,
    wiring: Wiring::Broadcast,
};

/// A large unit: 4096 multiplications a cycle, 128 KiB of latents.
const DESKTOP: Configuration = Configuration {
    // A clock that desktop GPUs are run at.
    clock_mhz: 2_500,
    // Two quads a cycle.
    requests_per_cycle: 8,
    quad_pixels: 4,
    decoded_cache_blocks: 0,
    decoded_cache_ways: 4,
    decoded_block_side: 4,
    request_queue_texels: 256,
    coalesced_texels: 4,
    // A quad a cycle.
    address_generators: 8,
    // GPGPU-Sim's 128 KiB in lines of 128 bytes, less associative than its 256 ways.
    line_bytes: 128,
    cache_sets: 64,
    cache_ways: 16,
    cache_banks: 4,
    lookups_per_bank: 1,
    hit_latency_cycles: 20,
    mshrs: 64,
    level2_sets: 0,
    level2_ways: 16,
    level2_latency_cycles: 0,
    level2_bytes_per_cycle: 64,
    // 160 ns: a level 2 that misses to GDDR.
    memory_latency_cycles: 400,
    // 160 GB/s: a level 2 with 64 bytes per cycle for each client.
    memory_bytes_per_cycle: 64,
    burst_bytes: 64,
    // GPGPU-Sim's fragment FIFO.
    corner_fifo_texels: 512,
    unpack_lanes: 128,
    interpolator_lanes: 64,
    embed_lanes: 32,
    batch_texels: 64,
    batches_in_flight: 2,
    material_bins: 1,
    // Holds the 128-wide CNTC shapes (158,000 weights and their rows).
    weight_sram_bytes: 256 * 1024,
    weight_fill_bytes_per_cycle: 64,
    weight_latency_cycles: 0,
    // Two rows of weights a cycle: one tile in the 16 cycles in which 64 texels pass four arrays.
    tile_load_cycles: 16,
    tile_buffers: 2,
    // A 64-wide layer is two tiles by two; four arrays share the texels.
    mac_rows: 32,
    mac_columns: 32,
    mac_arrays: 4,
    wide_passes: 2,
    half_passes: 2,
    narrow_columns: 1,
    mac_depth_cycles: 7,
    // Four arrays of 32 rows.
    requantizer_lanes: 128,
    requantizer_depth_cycles: 4,
    skip_lanes: 128,
    // Two jobs.
    filter_lanes: 64,
    filter_depth_cycles: 4,
    output_queue_pixels: 256,
    // Two texels of eight channels.
    output_channels_per_cycle: 16,
    cache: CacheKind::Finite,
    replacement: Replacement::Lru,
    misses: Misses::HitUnderMiss,
    dataflow: Dataflow::WeightStationary,
    wiring: Wiring::Broadcast,
};

impl Unit {
    /// A small unit: 256 multiplications a cycle, 8 KiB of latents.
    #[must_use]
    pub fn mobile() -> Unit {
        Unit::preset(NAMES[0], MOBILE)
    }

    /// A middle unit: 1024 multiplications a cycle, 16 KiB of latents.
    #[must_use]
    pub fn console() -> Unit {
        Unit::preset(NAMES[1], CONSOLE)
    }

    /// A large unit: 4096 multiplications a cycle, 128 KiB of latents.
    #[must_use]
    pub fn desktop() -> Unit {
        Unit::preset(NAMES[2], DESKTOP)
    }

    /// The presets, smallest first.
    #[must_use]
    pub fn presets() -> [Unit; 3] {
        [Unit::mobile(), Unit::console(), Unit::desktop()]
    }

    /// The preset with this name.
    ///
    /// # Errors
    /// When there is none.
    pub fn by_name(name: &str) -> Result<Unit, UnitError> {
        let found = Unit::presets().into_iter().find(|unit| unit.name() == name);
        found.ok_or_else(|| UnitError::Preset {
            found: name.to_owned(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_preset_is_a_unit_with_a_name() {
        for (unit, name) in Unit::presets().iter().zip(NAMES) {
            assert_eq!(Unit::new(name, *unit.configuration()).as_ref(), Ok(unit));
            assert_eq!(Unit::by_name(name).as_ref(), Ok(unit));
        }
        let message = Unit::by_name("phone").unwrap_err().to_string();
        assert_eq!(
            message,
            "unit: found \"phone\"; allowed: mobile, console, desktop"
        );
    }

    #[test]
    fn the_summaries_of_the_presets_hold() {
        let sizes = Unit::presets().map(|unit| (unit.macs_per_cycle(), unit.cache_bytes() / 1024));
        assert_eq!(sizes, [(256, 8), (1024, 16), (4096, 128)]);
    }
}
