//! Record: what the asset's metadata say of its making, nothing that differs between two equal runs.

use crate::config::TrainConfig;
use crate::device::{Backend, TrainingDevice};
use crate::schedule::USUAL;
use crate::stage::Stage;

/// Steps of each stage of the plan, 0 for one that was left out: with them and the plan the run can
/// be repeated, whatever fixed them.
pub(crate) fn steps(config: &TrainConfig, stages: &[Stage]) -> Vec<u64> {
    let last = stages.last().map_or(0, |s| s.index as usize);
    let count = config.plan.as_ref().map_or(last + 1, |p| p.stage.len());
    let mut steps = vec![0; count];
    for stage in stages {
        steps[stage.index as usize] = stage.steps;
    }
    steps
}

/// The entries of the record; decibels of the network in reals and of the asset. A device is named
/// where it decides bytes.
pub(crate) fn of(
    config: &TrainConfig,
    stages: &[Stage],
    rounds: usize,
    device: &TrainingDevice,
    psnrs: [f64; 2],
) -> Vec<(String, String)> {
    let grids = config
        .grids
        .map(|g| format!("{}ch@{}bit/{}", g.channels, g.bits, 1 << g.scale_log2));
    let schedule = match &config.plan {
        Some(plan) if plan.name != USUAL => ("plan", plan.name.clone()),
        Some(_) | None => ("effort", config.effort.to_string()),
    };
    let mut batches: Vec<String> = stages
        .iter()
        .filter(|stage| stage.steps > 0)
        .map(|stage| stage.batch.to_string())
        .collect();
    batches.dedup();
    let steps: Vec<String> = steps(config, stages).iter().map(u64::to_string).collect();
    let mut entries = vec![
        ("trainer", env!("CARGO_PKG_VERSION").to_owned()),
        ("grids", grids.join(" ")),
        ("hidden", format!("{:?}", config.hidden)),
        (
            "blocks",
            format!("{}x{}", config.residual_blocks, config.layers_per_block),
        ),
        schedule,
        ("steps", steps.join("+")),
        ("batch", batches.join("+")),
        ("settle", rounds.to_string()),
        ("seed", config.seed.to_string()),
        ("psnr_float", format!("{:.3}", psnrs[0])),
        ("psnr_quantised", format!("{:.3}", psnrs[1])),
    ];
    match device.backend() {
        Backend::Flex => {}
        Backend::Wgpu | Backend::Vulkan | Backend::Cuda => {
            entries.push(("backend", device.name()));
        }
    }
    if !config.weights.is_empty() {
        let weights = config.weights.iter().map(|(map, w)| format!("{map}={w}"));
        entries.push(("weights", weights.collect::<Vec<_>>().join(" ")));
    }
    if config.rate_factor != 1.0 {
        entries.push(("rate_factor", config.rate_factor.to_string()));
    }
    if let Some(target) = config.target_psnr {
        entries.push(("target_psnr", target.to_string()));
    }
    let owned = entries
        .into_iter()
        .map(|(key, value)| (key.to_owned(), value));
    owned.collect()
}
