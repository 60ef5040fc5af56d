//! Cycles that the MAC array holds dense layers, each alone: what a simulator of systolic arrays counts.
//! `cargo run --release --example gemm_cycles [FILE.json]`, or with the list on standard input
//!
//! The list has objects `{"rows", "columns", "dataflow", "texels", "inputs", "outputs",
//! "tile_load_cycles"}`. Each is printed again with `cycles`, those in which the array multiplies, fills,
//! drains and loads its tiles, and with `seconds`, the time that the whole unit took to be simulated.
#![allow(clippy::print_stdout, reason = "an example shows its result")]

use ntmu::model::time::work::{Dense, Operands, Work};
use ntmu::model::time::{Cause, Unit, simulate};
use ntmu::model::trace::{Addresses, Fetch};
use ntmu::model::{Demand, Material, Place, Request};
use serde::{Deserialize, Serialize};
use std::error::Error;
use std::io::Read;
use std::time::Instant;

/// A layer on an array.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Layer {
    pub(crate) rows: u32,
    pub(crate) columns: u32,
    /// `weight-stationary` or `output-stationary`.
    pub(crate) dataflow: String,
    /// All of them are one batch: 1..=1024.
    pub(crate) texels: u32,
    pub(crate) inputs: u32,
    pub(crate) outputs: u32,
    pub(crate) tile_load_cycles: u32,
}

#[derive(Serialize)]
struct Counted {
    #[serde(flatten)]
    layer: Layer,
    cycles: u64,
    seconds: f64,
}

/// A texel that reads no latents.
struct Nowhere;

impl Addresses for Nowhere {
    fn fetches(&self, _place: &Place, _fetches: &mut Vec<Fetch>) {}

    fn bytes(&self) -> u64 {
        0
    }

    fn mip_size(&self, _mip: u8) -> (u32, u32) {
        (1, 1)
    }
}

/// A systolic array with one set of tile registers, behind a front end that it never waits for.
fn unit(layer: &Layer) -> Result<Unit, Box<dyn Error>> {
    let mut configuration = *Unit::mobile().configuration();
    for (name, value) in [
        ("requests_per_cycle", 1024),
        // Every pixel decodes a texel of its own, whichever it is.
        ("quad_pixels", 1),
        ("coalesced_texels", 1),
        ("weight_sram_bytes", 1 << 28),
        ("weight_fill_bytes_per_cycle", 1 << 20),
        ("weight_latency_cycles", 0),
        ("batch_texels", layer.texels),
        ("batches_in_flight", 1),
        ("tile_load_cycles", layer.tile_load_cycles),
        ("tile_buffers", 1),
        ("mac_rows", layer.rows),
        ("mac_columns", layer.columns),
        ("mac_arrays", 1),
        ("mac_depth_cycles", 0),
        ("requantizer_lanes", 65_536),
        ("requantizer_depth_cycles", 0),
        ("output_queue_pixels", 1024),
        ("output_channels_per_cycle", 65_536),
    ] {
        configuration.set(name, value)?;
    }
    configuration.choose("dataflow", &layer.dataflow)?;
    configuration.choose("wiring", "systolic")?;
    Ok(Unit::new("one array", configuration)?)
}

/// Cycles that the array holds the layer, and seconds of their simulation. Every pixel decodes `place`.
pub(crate) fn cycles(layer: &Layer, place: Place) -> Result<(u64, f64), Box<dyn Error>> {
    if layer.inputs == 0 || layer.outputs == 0 || layer.texels == 0 {
        return Err("a layer has at least one texel, one input and one output".into());
    }
    let dense = Dense {
        layer: 0,
        operands: Operands::Bytes,
        inputs: layer.inputs,
        outputs: layer.outputs,
        requantizer_slots: layer.outputs,
        skip_reads: 0,
        parameter_bytes: u64::from(layer.inputs) * u64::from(layer.outputs),
    };
    let work = Work {
        dense: vec![dense],
        channels: 1,
        ..Work::default()
    };
    let materials = [Material::with_addresses("layer", work, Nowhere)];
    let mut demands = (0..layer.texels).map(|pixel| Demand {
        pixel: [pixel, 0],
        material: 0,
        places: vec![place],
        weights: 1,
    });
    let unit = unit(layer)?;
    let start = Instant::now();
    let timing =
        simulate(&unit, &materials, &mut demands, &mut ()).unwrap_or_else(|never| match never {});
    let seconds = start.elapsed().as_secs_f64();
    let held = [Cause::Compute, Cause::ArrayFill, Cause::WeightLoad];
    let held = held.map(|cause| timing.ledger.of(cause));
    Ok((held.iter().sum(), seconds))
}

pub(crate) fn main() -> Result<(), Box<dyn Error>> {
    let mut text = String::new();
    match std::env::args().nth(1) {
        Some(path) => text = std::fs::read_to_string(path)?,
        None => {
            std::io::stdin().read_to_string(&mut text)?;
        }
    }
    let layers: Vec<Layer> = serde_json::from_str(&text)?;
    let place = Place::of(Request::new(&ntmu::built_in::asset()?.shape, 0, 0, 0)?);
    let mut counted = Vec::new();
    for layer in layers {
        let (cycles, seconds) = cycles(&layer, place)?;
        counted.push(Counted {
            layer,
            cycles,
            seconds,
        });
    }
    println!("{}", serde_json::to_string(&counted)?);
    Ok(())
}
