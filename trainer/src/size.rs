//! Size: how large an asset will be, before it is trained.

use crate::config::TrainConfig;
use crate::device::TrainingDevice;
use crate::error::TrainError;
use crate::export;
use crate::quantise::{Range, quantise};
use crate::record;
use crate::source::Source;
use crate::topology::Topology;

/// Where a register's zero lies does not change how many bytes it takes.
const RANGE: Range = Range {
    scale: 1.0 / 64.0,
    zero_point: 0,
};

/// No smaller than what a run can end with, and as long as what it can print.
const LONG: f64 = -1000.0;

/// More steps than any stage may have have no more digits.
const MOST_STEPS: u64 = 100_000_000;

/// The bytes that the asset of this configuration, trained on `device`, has, or a few more: how many
/// digits its record takes is not known before.
///
/// # Errors
/// When the configuration or the set is refused.
pub fn asset_bytes(
    source: &Source,
    config: &TrainConfig,
    device: &TrainingDevice,
) -> Result<usize, TrainError> {
    config.validate()?;
    let topology = Topology::new(config, source.outputs.len());
    let ranges: Vec<Range> = (0..topology.layers.len().saturating_sub(1))
        .map(|layer| {
            if topology.writes_halves(layer) {
                Range::HALVES
            } else {
                RANGE
            }
        })
        .collect();
    let parameters = vec![0.0; topology.parameters];
    let quantised = quantise(&topology, &parameters, &ranges, config, &source.outputs);
    let layers = export::layers(&quantised.network, &ranges, config)?;
    let mut stages = config.stages(&source.sizes())?;
    for stage in &mut stages {
        stage.steps = stage.steps.max(MOST_STEPS);
    }
    let record = record::of(config, &stages, usize::MAX, device, [LONG; 2]);
    let shape = export::shape_of(config, source)?;
    let grids = [0, 1].map(|grid| vec![0; shape.grid_latents(grid) as usize]);
    let asset = export::asset(config, source, layers, grids, record)?;
    Ok(asset.to_bytes().len())
}
