//! Cost: how long each stage of a unit takes for one thing of its size, for one material.
//!
//! Three sizes: a *group* of texels goes through the front end together, a *batch* passes the MAC
//! array under one tile of weights, a *job* is the batches that are in the array together. The
//! stepped model puts these costs one after the other; the lower bounds sum them.

use super::assemble::Group;
use super::choice::{Dataflow, Wiring};
use super::unit::Unit;
use super::work::{Dense, Operands, Work};
use crate::material::Material;

/// The MAC array's cycles for one row of tiles and one batch, by what the array does in them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct RowCycles {
    /// Texels or inputs pass.
    pub(super) compute: u64,
    /// Operands are on their way through a systolic array.
    pub(super) skew: u64,
    /// The next tile is not in the array's registers yet.
    pub(super) load: u64,
    /// The weights are not in the unit yet.
    pub(super) fill: u64,
}

impl RowCycles {
    pub(super) fn total(self) -> u64 {
        self.compute + self.skew + self.load + self.fill
    }
}

/// One layer on one unit.
#[derive(Clone, Copy, Debug)]
pub(super) struct LayerCost {
    /// Rows of tiles.
    pub(super) row_tiles: u64,
    /// Columns of tiles, where weights stay in the array.
    pub(super) column_tiles: u64,
    inputs: u64,
    outputs: u64,
    rows: u64,
    /// Passes of the array for a product.
    passes: u64,
    /// Products of a multiplier in a pass.
    products: u64,
    /// Cycles in which a tile of its weights comes to the array's registers.
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
    /// Bits of a weight in the weight SRAM.
    weight_bits: u64,
    pub(super) operands: Operands,
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

    /// Multiplications of one texel.
    pub(super) fn macs(&self) -> u64 {
        self.inputs * self.outputs
    }

    /// Bytes that the weight SRAM gives the array for one batch.
    pub(super) fn weight_bytes_per_batch(&self) -> u64 {
        (self.inputs * self.outputs * self.weight_bits).div_ceil(8)
    }

    /// Bytes of activations that the array reads, and that are written back, for one texel.
    pub(super) fn activation_bytes(&self) -> u64 {
        let bytes = match self.operands {
            Operands::Narrow | Operands::Bytes => 1,
            Operands::Wide | Operands::Half => 2,
        };
        (self.inputs * self.row_tiles + self.outputs) * bytes
    }
}

/// Bits of a weight on its way to the array.
const fn weight_bits(operands: Operands) -> u64 {
    match operands {
        Operands::Narrow => 4,
        Operands::Bytes | Operands::Wide => 8,
        Operands::Half => 16,
    }
}

/// One material on one unit.
#[derive(Clone, Debug)]
pub(super) struct Cost<'a> {
    pub(super) unit: &'a Unit,
    pub(super) material: &'a Material<'a>,
    pub(super) work: &'a Work,
    /// Where its latents start in memory.
    pub(super) base: u64,
    pub(super) layers: Vec<LayerCost>,
    /// Bytes of the layers that stay in the unit.
    pub(super) resident_bytes: u64,
    /// Bytes that come from outside for each batch.
    pub(super) streamed_bytes: u64,
}

/// Where the next material's latents may start: a page.
const MATERIAL_ALIGNMENT: u64 = 4096;

impl<'a> Cost<'a> {
    /// Every material on a unit, their latents one after the other in memory.
    pub(super) fn all(unit: &'a Unit, materials: &'a [Material<'a>]) -> Vec<Cost<'a>> {
        let mut base = 0;
        let place = |material| {
            let cost = Cost::new(unit, material, base);
            base += cost
                .material
                .addresses()
                .bytes()
                .next_multiple_of(MATERIAL_ALIGNMENT);
            cost
        };
        materials.iter().map(place).collect()
    }

    fn new(unit: &'a Unit, material: &'a Material<'a>, base: u64) -> Cost<'a> {
        let work = material.work();
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
            layers.push(layer_cost(unit, dense, stays));
        }
        Cost {
            unit,
            material,
            work,
            base,
            streamed_bytes: layers.iter().map(|layer| layer.streamed_bytes).sum(),
            layers,
            resident_bytes,
        }
    }

    /// Texels of each batch of a job of so many texels.
    pub(super) fn batches(&self, job_texels: u64) -> impl Iterator<Item = u64> + use<> {
        let full = u64::from(self.unit.batch_texels);
        (0..job_texels.div_ceil(full)).map(move |batch| full.min(job_texels - batch * full))
    }

    /// Cycles in which a group's requests come in.
    pub(super) fn request(&self, group: &Group) -> u64 {
        let cycles = group
            .pixels
            .div_ceil(u64::from(self.unit.requests_per_cycle));
        cycles.max(1)
    }

    /// Cycles of the address generators for a group.
    pub(super) fn address(&self, group: &Group) -> u64 {
        let steps = group.decodes * u64::from(self.work.address_steps);
        let cycles = steps.div_ceil(u64::from(self.unit.address_generators));
        cycles.max(1)
    }

    /// Cycles of unpacking, interpolation, waves and level for a group; they work side by side.
    pub(super) fn embed(&self, group: &Group) -> u64 {
        let (unit, work) = (self.unit, self.work);
        let cycles = [
            (work.unpacked, unit.unpack_lanes),
            (work.interpolated, unit.interpolator_lanes),
            (work.embedded, unit.embed_lanes),
        ]
        .map(|(inputs, lanes)| (group.decodes * u64::from(inputs)).div_ceil(u64::from(lanes)));
        cycles.into_iter().fold(1, u64::max)
    }

    /// Cycles of the filter for so many weighted codes of each channel.
    pub(super) fn filter(&self, weighted: u64) -> u64 {
        if weighted == 0 {
            return 0;
        }
        let codes = weighted * u64::from(self.work.channels);
        codes.div_ceil(u64::from(self.unit.filter_lanes)) + u64::from(self.unit.filter_depth_cycles)
    }

    /// Cycles in which the channels of so many pixels leave the unit.
    pub(super) fn output(&self, pixels: u64) -> u64 {
        let channels = pixels * u64::from(self.work.channels);
        let cycles = channels.div_ceil(u64::from(self.unit.output_channels_per_cycle));
        cycles.max(u64::from(pixels > 0))
    }

    /// Cycles in which so many bytes of parameters come in, without the latency.
    pub(super) fn fill(&self, bytes: u64) -> u64 {
        bytes.div_ceil(u64::from(self.unit.weight_fill_bytes_per_cycle))
    }

    /// Cycles in which the weights that stay come in, before the first request.
    pub(super) fn first_fill(&self) -> u64 {
        if self.resident_bytes == 0 {
            return 0;
        }
        u64::from(self.unit.weight_latency_cycles) + self.fill(self.resident_bytes)
    }

    /// The array's cycles for one row of tiles of a layer and a batch of so many texels.
    ///
    /// Weight-stationary: a pass for each column of tiles, of as many cycles as an array has texels.
    /// Output-stationary: a pass for each `columns` texels of an array, of as many cycles as there are
    /// inputs. Both a multiple of that where operands are wider than bytes.
    pub(super) fn row(&self, layer: usize, row_tile: u64, texels: u64) -> RowCycles {
        let (cost, unit) = (&self.layers[layer], self.unit);
        let texels = texels.div_ceil(u64::from(unit.mac_arrays));
        let columns = u64::from(unit.mac_columns);
        let skew = match unit.wiring {
            Wiring::Broadcast => 0,
            Wiring::Systolic => u64::from(unit.mac_rows) + columns - 2,
        };
        let (passes, compute, skew, load) = match unit.dataflow {
            Dataflow::WeightStationary => {
                let pass = texels * cost.passes;
                let load = if unit.tile_buffers > 1 {
                    cost.tile_load.saturating_sub(pass + skew)
                } else {
                    cost.tile_load
                };
                (cost.column_tiles, pass, skew, load)
            }
            Dataflow::OutputStationary => {
                let pass = cost.inputs.div_ceil(cost.products) * cost.passes;
                let drain = match unit.wiring {
                    Wiring::Broadcast => 0,
                    Wiring::Systolic => u64::from(unit.mac_rows),
                };
                (texels.div_ceil(columns), pass, skew + drain, 0)
            }
        };
        let mut row = RowCycles {
            compute: passes * compute,
            skew: passes * skew,
            load: passes * load,
            fill: 0,
        };
        let is_last = row_tile + 1 == cost.row_tiles;
        row.fill = cost.fill[usize::from(is_last)].saturating_sub(row.total());
        row
    }
}

fn layer_cost(unit: &Unit, dense: &Dense, stays: bool) -> LayerCost {
    let (inputs, outputs) = (u64::from(dense.inputs), u64::from(dense.outputs));
    let rows = u64::from(unit.mac_rows);
    let row_tiles = outputs.div_ceil(rows);
    let last = outputs - (row_tiles - 1) * rows;
    let fill = |rows: u64| {
        let bytes = (dense.parameter_bytes * rows).div_ceil(outputs);
        bytes.div_ceil(u64::from(unit.weight_fill_bytes_per_cycle))
    };
    let products = match dense.operands {
        Operands::Narrow => u64::from(unit.narrow_columns),
        Operands::Bytes | Operands::Wide | Operands::Half => 1,
    };
    let passes = match dense.operands {
        Operands::Narrow | Operands::Bytes => 1,
        Operands::Wide => unit.wide_passes,
        Operands::Half => unit.half_passes,
    };
    // A tile comes in at bytes a multiplier; narrow ones fill their multiplier with all they hold.
    let tile_load = match dense.operands {
        Operands::Narrow | Operands::Bytes | Operands::Wide => 1,
        Operands::Half => 2,
    };
    LayerCost {
        row_tiles,
        column_tiles: inputs.div_ceil(u64::from(unit.mac_columns) * products),
        inputs,
        outputs,
        rows,
        passes: u64::from(passes),
        products,
        tile_load: u64::from(unit.tile_load_cycles) * tile_load,
        slots: u64::from(dense.requantizer_slots) / outputs,
        skips: u64::from(dense.skip_reads) / outputs,
        fill: if stays {
            [0, 0]
        } else {
            [fill(rows.min(outputs)), fill(last)]
        },
        streamed_bytes: if stays { 0 } else { dense.parameter_bytes },
        weight_bits: weight_bits(dense.operands),
        operands: dense.operands,
    }
}
