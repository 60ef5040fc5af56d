//! Claims about whole runs, and what they share.

mod by_isa;
mod integers;
mod loss;
mod ntc;
mod plans;
mod pyramids;
mod runs;
mod safety;
mod settling;

use crate::{GridConfig, Plan, Source, TrainConfig, TrainError, Trained, TrainingDevice, train};
use ndarray::Array3;
use ntmu_isa::asset::{Encoding, Map};
use ntmu_isa::shape::OutputFormat;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

/// A set with a gradient, a checkerboard, a constant channel and one of sixteen bits.
pub(crate) fn source(width: usize, height: usize, mips: usize) -> Source {
    let outputs = vec![
        OutputFormat::Unorm8,
        OutputFormat::Unorm8,
        OutputFormat::Unorm8,
        OutputFormat::Unorm16,
        OutputFormat::Snorm8,
    ];
    let value = |channel: usize, y: usize, x: usize, h: usize, w: usize| match channel {
        0 => x as f32 / w as f32,
        1 => ((x / 2 + y / 2) % 2) as f32,
        2 => 0.25,
        3 => y as f32 / h as f32,
        _ => (x as f32 * 0.7).sin() * (y as f32 * 0.3).cos(),
    };
    let mips = (0..mips).map(|m| {
        let (h, w) = ((height >> m).max(1), (width >> m).max(1));
        Array3::from_shape_fn((outputs.len(), h, w), |(c, y, x)| value(c, y, x, h, w))
    });
    let mips = mips.collect();
    let maps = vec![Map {
        name: "all".into(),
        first_channel: 0,
        channel_count: outputs.len() as u16,
        encoding: Encoding::Linear,
        bit_depth: 8,
    }];
    Source {
        name: "test".into(),
        mips,
        outputs,
        maps,
        mask: None,
    }
}

/// The plan of an effort, with these steps.
fn usual(steps: [u64; 3]) -> Plan {
    TrainConfig::default().usual_plan(steps)
}

pub(crate) fn small() -> TrainConfig {
    TrainConfig {
        grids: [
            GridConfig {
                channels: 3,
                bits: 4,
                scale_log2: 2,
            },
            GridConfig {
                channels: 5,
                bits: 3,
                scale_log2: 3,
            },
        ],
        hidden: vec![20, 16],
        residual_blocks: 2,
        batch: 768,
        // Runs of a few hundred steps need a high one.
        synthesizer_rate: 0.02,
        encoder_width: 8,
        crop: 64,
        crops: 2,
        plan: Some(usual([2, 30, 30])),
        ..TrainConfig::default()
    }
}

fn run(source: &Source, config: &TrainConfig) -> Result<Trained, TrainError> {
    run_with(source, config, None, false)
}

/// A run with its checkpoints at `path`, from the one that is there.
fn resumed(source: &Source, config: &TrainConfig, path: &Path) -> Result<Trained, TrainError> {
    run_with(source, config, Some(path), true)
}

/// A run on the processor with its checkpoints at `path`.
fn run_with(
    source: &Source,
    config: &TrainConfig,
    path: Option<&Path>,
    resume: bool,
) -> Result<Trained, TrainError> {
    train(
        source,
        config,
        &TrainingDevice::flex(),
        path,
        resume,
        &AtomicBool::new(false),
        &mut |_| {},
    )
}

/// Why a run ends that is stopped after `at` steps.
fn stopped_at(
    source: &Source,
    config: &TrainConfig,
    path: &Path,
    at: u64,
    resume: bool,
) -> TrainError {
    let stop = AtomicBool::new(false);
    let mut observer = |p: &crate::Progress| {
        stop.store(p.done >= at, Ordering::Relaxed);
    };
    train(
        source,
        config,
        &TrainingDevice::flex(),
        Some(path),
        resume,
        &stop,
        &mut observer,
    )
    .unwrap_err()
}
