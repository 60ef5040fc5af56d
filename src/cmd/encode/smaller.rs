//! Smaller: grids with fewer channels or bits, until the asset fits.

use crate::console;
use ntmu::trainer::{Source, TrainConfig, TrainError, TrainingDevice, asset_bytes};

/// The configuration with as many channels of its grids as fit `most` bytes, in the proportion that
/// they had; with fewer bits only where a single channel of the configured ones is too much.
pub(super) fn fitted(
    source: &Source,
    config: TrainConfig,
    device: &TrainingDevice,
    most: u64,
) -> anyhow::Result<TrainConfig> {
    let [first, second] = config.grids.map(|grid| grid.channels);
    let widest = first.max(second);
    let bits = config.grids.map(|grid| grid.bits);
    let mut smallest = u64::MAX;
    for fewer in 0..bits[0].max(bits[1]) {
        let with = |share: u16| {
            let mut config = config.clone();
            for grid in &mut config.grids {
                let channels = u32::from(grid.channels) * u32::from(share);
                grid.channels = channels.div_ceil(u32::from(widest)) as u16;
                grid.bits = grid.bits.saturating_sub(fewer).max(1);
            }
            config
        };
        let bytes = |share: u16| -> Result<u64, TrainError> {
            Ok(asset_bytes(source, &with(share), device)? as u64)
        };
        smallest = smallest.min(bytes(1)?);
        // More channels are never smaller: the most that fit lie just below the first that do not.
        let (mut fits, mut too_many) = (0, widest + 1);
        while too_many - fits > 1 {
            let share = fits + (too_many - fits) / 2;
            if bytes(share)? <= most {
                fits = share;
            } else {
                too_many = share;
            }
        }
        if fits > 0 {
            let found = with(fits);
            if found != config {
                let grids = found.grids;
                console::note(&format!(
                    "--max-bytes: grids of {} and {} channels of {} and {} bits",
                    grids[0].channels, grids[1].channels, grids[0].bits, grids[1].bits
                ));
            }
            return Ok(found);
        }
    }
    anyhow::bail!(
        "--max-bytes: found {most}; allowed: at least {smallest}, which is the size with one channel \
         of one bit in each grid; a synthesizer with fewer or narrower layers (--blocks, --hidden) \
         takes less"
    )
}
