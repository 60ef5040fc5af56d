//! Cost: how long each stage of a unit takes for one thing of its size.
//!
//! Three sizes: a *group* of coalesced texels goes through the front end together, a *batch* passes
//! the MAC array under one tile of weights, a *job* is the batches that are in the array together.
//! The stepped model puts these costs one after the other; the closed form sums them.

use super::unit::Unit;
use super::work::{Operands, Work};

/// The MAC array's cycles for one row of tiles and one batch, by what the array does in them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct RowCycles {
    /// Texels pass.
    pub(super) compute: u64,
    /// The next tile is not in the shadow registers yet.
    pub(super) load: u64,
    /// The weights are not in the unit yet.
    pub(super) fill: u64,
}

impl RowCycles {
    pub(super) fn total(self) -> u64 {
        self.compute + self.load + self.fill
    }
}

/// One layer on one unit.
#[derive(Clone, Copy, Debug)]
pub(super) struct LayerCost {
    /// Rows of tiles.
    pub(super) row_tiles: u64,
    /// Columns of tiles.
    pub(super) column_tiles: u64,
    outputs: u64,
    rows: u64,
    /// Passes of the array for a product.
    passes: u64,
    /// Cycles in which a tile of its weights comes to the shadow registers.
    tile_load: u64,
    /// Requantiser slots of an output.
    slots: u64,
    /// Skip reads of an output.
    skips: u64,
    /// Cycles in which the weights of a full and of the last row of tiles come from outside; 0
    /// where they stay in the unit.
    fill: [u64; 2],
    /// Bytes that come from outside for each batch.
    pub(super) streamed_bytes: u64,
}

impl LayerCost {
    /// Outputs of a row of tiles.
    pub(super) fn outputs_of(&self, row_tile: u64) -> u64 {
        self.rows.min(self.outputs - row_tile * self.rows)
    }

    /// Outputs of a row of tiles and all after it.
    pub(super) fn outputs_from(&self, row_tile: u64) -> u64 {
        self.outputs - row_tile * self.rows
    }

    /// Requantiser slots of so many outputs of one texel.
    pub(super) fn slots(&self, outputs: u64) -> u64 {
        outputs * self.slots
    }

    /// Skip reads of so many outputs of one texel.
    pub(super) fn skips(&self, outputs: u64) -> u64 {
        outputs * self.skips
    }
}

/// Bytes of a weight on its way to the array. Narrow ones take a byte each.
const fn weight_bytes(operands: Operands) -> u64 {
    match operands {
        Operands::Bytes | Operands::Wide => 1,
        Operands::Half => 2,
    }
}

/// A program of so many texels on one unit.
#[derive(Clone, Debug)]
pub(super) struct Cost<'a> {
    pub(super) unit: &'a Unit,
    pub(super) work: &'a Work,
    pub(super) texels: u64,
    /// Groups of coalesced texels.
    pub(super) groups: u64,
    pub(super) groups_per_job: u64,
    pub(super) jobs: u64,
    pub(super) layers: Vec<LayerCost>,
    /// Bytes of the layers that stay in the unit.
    pub(super) resident_bytes: u64,
    /// Bytes that come from outside for each batch.
    pub(super) streamed_bytes: u64,
}

impl<'a> Cost<'a> {
    pub(super) fn new(unit: &'a Unit, work: &'a Work, texels: u64) -> Cost<'a> {
        let mut resident: Vec<(u16, bool)> = Vec::new();
        let mut resident_bytes = 0;
        let mut layers = Vec::new();
        for dense in &work.dense {
            // First come, first kept: the program's order is known when it is loaded.
            let stays = match resident.iter().find(|(layer, _)| *layer == dense.layer) {
                Some(&(_, stays)) => stays,
                None => {
                    let sram = u64::from(unit.weight_sram_bytes);
                    let stays = resident_bytes + dense.parameter_bytes <= sram;
                    resident_bytes += if stays { dense.parameter_bytes } else { 0 };
                    resident.push((dense.layer, stays));
                    stays
                }
            };
            let (outputs, rows) = (u64::from(dense.outputs), u64::from(unit.mac_rows));
            let row_tiles = outputs.div_ceil(rows);
            let last = outputs - (row_tiles - 1) * rows;
            let fill = |rows: u64| {
                let bytes = (dense.parameter_bytes * rows).div_ceil(outputs);
                bytes.div_ceil(u64::from(unit.weight_fill_bytes_per_cycle))
            };
            layers.push(LayerCost {
                row_tiles,
                column_tiles: u64::from(dense.inputs).div_ceil(u64::from(unit.mac_columns)),
                outputs,
                rows,
                passes: u64::from(match dense.operands {
                    Operands::Bytes => 1,
                    Operands::Wide => unit.wide_passes,
                    Operands::Half => unit.half_passes,
                }),
                tile_load: u64::from(unit.tile_load_cycles) * weight_bytes(dense.operands),
                slots: u64::from(dense.requantizer_slots) / outputs,
                skips: u64::from(dense.skip_reads) / outputs,
                fill: if stays {
                    [0, 0]
                } else {
                    [fill(rows.min(outputs)), fill(last)]
                },
                streamed_bytes: if stays { 0 } else { dense.parameter_bytes },
            });
        }
        let job_texels = u64::from(unit.job_texels());
        Cost {
            unit,
            work,
            texels,
            groups: texels.div_ceil(u64::from(unit.coalesced_texels)),
            groups_per_job: job_texels / u64::from(unit.coalesced_texels),
            jobs: texels.div_ceil(job_texels),
            streamed_bytes: layers.iter().map(|layer| layer.streamed_bytes).sum(),
            layers,
            resident_bytes,
        }
    }

    /// Texels of a group: full, except perhaps the last.
    pub(super) fn texels_of_group(&self, group: u64) -> u64 {
        let full = u64::from(self.unit.coalesced_texels);
        full.min(self.texels - group * full)
    }

    /// Texels of a job: full, except perhaps the last.
    pub(super) fn texels_of_job(&self, job: u64) -> u64 {
        let full = u64::from(self.unit.job_texels());
        full.min(self.texels - job * full)
    }

    /// Texels of each batch of a job of so many texels.
    pub(super) fn batches(&self, job_texels: u64) -> impl Iterator<Item = u64> + use<> {
        let full = u64::from(self.unit.batch_texels);
        (0..job_texels.div_ceil(full)).map(move |batch| full.min(job_texels - batch * full))
    }

    /// Cycles in which a group's requests come in.
    pub(super) fn request(&self, texels: u64) -> u64 {
        texels.div_ceil(u64::from(self.unit.requests_per_cycle))
    }

    /// Cycles of the address generators for a group.
    pub(super) fn address(&self, texels: u64) -> u64 {
        let positions = texels * u64::from(self.work.positions);
        positions
            .div_ceil(u64::from(self.unit.address_generators))
            .max(1)
    }

    /// The fewest cycles of the tags for a group: one for each fetch, without conflicts.
    pub(super) fn lookup(&self) -> u64 {
        u64::from(self.work.fetches).max(1)
    }

    /// Cycles of unpacking, interpolation, waves and level for a group; they work side by side.
    pub(super) fn embed(&self, texels: u64) -> u64 {
        let (unit, work) = (self.unit, self.work);
        let cycles = [
            (work.unpacked, unit.unpack_lanes),
            (work.interpolated, unit.interpolator_lanes),
            (work.embedded, unit.embed_lanes),
        ]
        .map(|(inputs, lanes)| (texels * u64::from(inputs)).div_ceil(u64::from(lanes)));
        cycles.into_iter().fold(1, u64::max)
    }

    /// Cycles in which a job's channels leave the unit.
    pub(super) fn output(&self, texels: u64) -> u64 {
        let channels = texels * u64::from(self.work.channels);
        channels
            .div_ceil(u64::from(self.unit.output_channels_per_cycle))
            .max(1)
    }

    /// Cycles in which the weights that stay come in, before the first request.
    pub(super) fn weight_fill(&self) -> u64 {
        self.resident_bytes
            .div_ceil(u64::from(self.unit.weight_fill_bytes_per_cycle))
    }

    /// The array's cycles for one row of tiles of a layer and a batch of so many texels: a pass for
    /// each column of tiles, of as many cycles as an array has texels, or a multiple where operands
    /// are wider than bytes.
    pub(super) fn row(&self, layer: usize, row_tile: u64, texels: u64) -> RowCycles {
        let cost = &self.layers[layer];
        let pass = texels.div_ceil(u64::from(self.unit.mac_arrays)) * cost.passes;
        let loaded = pass.max(cost.tile_load);
        let compute = cost.column_tiles * pass;
        let load = cost.column_tiles * (loaded - pass);
        let is_last = row_tile + 1 == cost.row_tiles;
        let fill = cost.fill[usize::from(is_last)].saturating_sub(compute + load);
        RowCycles {
            compute,
            load,
            fill,
        }
    }
}
