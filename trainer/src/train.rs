//! The run: stage after stage, with checkpoints between steps.

use crate::checkpoint::{self, Position};
use crate::config::{Steps, TrainConfig};
use crate::device::{Backend, TrainingDevice};
use crate::engine::Engine;
use crate::error::TrainError;
use crate::evaluate::decibels;
use crate::export;
use crate::graph::{Graph, Subject};
use crate::model::{Ground, Model};
use crate::quantise::Widths;
use crate::refine::Rates;
use crate::report::{Progress, StageReport, TrainReport, Trained};
use crate::sampler::Numbers;
use crate::schedule::{self, Stage};
use crate::source::Source;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

/// Steps between two calls of the observer.
const OBSERVED: u64 = 20;

/// How much of the smoothed loss a new one replaces.
const SMOOTHING: f64 = 0.02;

/// Trains an asset for `source`.
///
/// The stages in reals run on `device`; what follows them, in the decode's own numbers, and the
/// evaluations run on the processor. With a GPU the state is there only between two of its saves,
/// and a run may be resumed on another device than it began on.
///
/// With `checkpoint`, the state is written there every [`TrainConfig::checkpoint_every`] steps and
/// when `stop` becomes true. With `resume` as well, a run goes on from the file if it exists, and
/// ends with the bytes that the uninterrupted run would have ended with. `observer` hears of every
/// twentieth step and of the last of each stage.
///
/// # Errors
/// When the configuration or the set is refused, the checkpoint is damaged or of another run, the
/// loss is no number, or `stop` became true.
pub fn train(
    source: &Source,
    config: &TrainConfig,
    device: &TrainingDevice,
    checkpoint: Option<&Path>,
    resume: bool,
    stop: &AtomicBool,
    observer: &mut dyn FnMut(&Progress),
) -> Result<Trained, TrainError> {
    config.validate()?;
    source.validate()?;
    let ground = Ground::new(config, source)?;
    let batch = schedule::batch(config, ground.texels.count());
    let steps = schedule::steps(config, ground.texels.count(), batch);
    let identity = checkpoint::identity(&ground)?;
    let mut run = Run {
        model: Model::new(&ground)?,
        position: Position {
            stage: Stage::Encoder,
            step: 0,
            psnr_float: 0.0,
        },
        ground,
        steps,
        identity,
        device,
        checkpoint,
        stop,
        observer,
        stages: Vec::new(),
    };
    if steps.encoder > 0 {
        run.model.start_encoder(&run.ground);
    }
    if let Some(path) = checkpoint.filter(|p| resume && p.exists()) {
        run.position = checkpoint::read(path, run.identity, &mut run.model)?;
    }
    run.all_stages()?;
    run.finish()
}

struct Run<'a> {
    ground: Ground<'a>,
    model: Model,
    position: Position,
    steps: Steps,
    identity: u64,
    device: &'a TrainingDevice,
    checkpoint: Option<&'a Path>,
    stop: &'a AtomicBool,
    observer: &'a mut dyn FnMut(&Progress),
    stages: Vec<StageReport>,
}

impl Run<'_> {
    fn all_stages(&mut self) -> Result<(), TrainError> {
        let batch = schedule::batch(self.ground.config, self.ground.texels.count());
        let channels = self.ground.texels.channels;
        let mut engine = Engine::new(&self.ground.topology, batch, channels);
        for stage in Stage::ALL {
            if stage < self.position.stage {
                continue;
            }
            let start = Instant::now();
            if stage > self.position.stage {
                self.position = Position {
                    stage,
                    step: 0,
                    ..self.position
                };
            }
            if self.position.step == 0 {
                self.enter(stage);
            }
            self.stage(stage, &mut engine)?;
            if stage == Stage::Encoder && self.steps.encoder > 0 {
                self.model.encode_whole(&self.ground)?;
            }
            if stage == Stage::Refine {
                let errors = self.model.evaluate(&self.ground, Numbers::Real);
                self.position.psnr_float = decibels(errors.overall());
            }
            let seconds = start.elapsed().as_secs_f64();
            self.stages.push(StageReport {
                stage,
                steps: self.steps.of(stage),
                seconds,
            });
        }
        Ok(())
    }

    /// What happens once, before the first step of a stage.
    fn enter(&mut self, stage: Stage) {
        match stage {
            Stage::Encoder => {}
            Stage::Refine => self.model.forget_moments(),
            Stage::Integer => {
                self.model.forget_moments();
                self.model.calibrate(&self.ground);
            }
        }
    }

    fn stage(&mut self, stage: Stage, engine: &mut Engine) -> Result<(), TrainError> {
        let steps = self.steps.of(stage);
        let before: u64 = Stage::ALL
            .iter()
            .filter(|&&s| s < stage)
            .map(|&s| self.steps.of(s))
            .sum();
        let mut smooth = None;
        let mut graph = self.graph(stage);
        let batch = engine.batch.texels.len();
        while self.position.step < steps {
            if self.stop.load(Ordering::Relaxed) {
                self.save(graph.as_ref())?;
                return Err(TrainError::Stopped {
                    stage: stage.name(),
                    step: self.position.step,
                    checkpoint: self.checkpoint.map(Path::to_owned),
                });
            }
            let step = self.position.step + 1;
            let saves = step.is_multiple_of(self.ground.config.checkpoint_every);
            let observed = step.is_multiple_of(OBSERVED) || step == steps;
            let losses = match &mut graph {
                None => vec![self.step(stage, engine)?],
                Some(graph) => {
                    let rates = self.rates(stage, step - 1);
                    graph.step(&self.ground, (stage, step - 1, batch), rates);
                    // Reading a loss waits for the device.
                    if observed || saves {
                        graph.losses()?
                    } else {
                        Vec::new()
                    }
                }
            };
            for (at, &loss) in losses.iter().enumerate() {
                if !loss.is_finite() {
                    return Err(TrainError::Diverged {
                        stage: stage.name(),
                        step: step - (losses.len() - at) as u64,
                        loss,
                    });
                }
                let old = smooth.unwrap_or(loss);
                smooth = Some(old + SMOOTHING * (loss - old));
            }
            self.position.step = step;
            if let Some(loss) = smooth.filter(|_| observed) {
                (self.observer)(&Progress {
                    stage,
                    step,
                    stage_steps: steps,
                    done: before + step,
                    total: self.steps.total(),
                    loss,
                    psnr: decibels(loss),
                });
            }
            if saves {
                self.save(graph.as_ref())?;
            }
        }
        match graph {
            Some(graph) => graph.write_to(&mut self.model),
            None => Ok(()),
        }
    }

    /// The state of a stage in reals on a device other than the processor, whose own kernels are
    /// faster than burn's.
    fn graph(&self, stage: Stage) -> Option<Graph> {
        if self.device.backend() == Backend::Flex || stage == Stage::Integer {
            return None;
        }
        let (subject, device) = (Subject::of(stage), self.device.tensors());
        Some(Graph::new(&self.ground, &self.model, subject, device))
    }

    /// The next step on the processor.
    fn step(&mut self, stage: Stage, engine: &mut Engine) -> Result<f64, TrainError> {
        let step = self.position.step;
        let (encoder, rates) = self.rates(stage, step);
        match stage {
            Stage::Encoder => {
                let rates = [encoder, rates.synthesizer];
                self.model.encoder_step(&self.ground, engine, step, rates)
            }
            Stage::Refine | Stage::Integer => {
                Ok(self.model.step(&self.ground, engine, stage, step, rates))
            }
        }
    }

    /// The learning rates of a step: that of the encoder, and those of what the stages on the whole
    /// set train.
    fn rates(&self, stage: Stage, step: u64) -> (f64, Rates) {
        let config = self.ground.config;
        let factor = match stage {
            Stage::Encoder | Stage::Refine => schedule::factor(step, self.steps.of(stage)),
            Stage::Integer => config.integer_rate * schedule::factor(step, self.steps.integer),
        };
        let rates = Rates {
            latents: factor * config.latent_rate,
            synthesizer: factor * config.synthesizer_rate,
        };
        (factor * config.encoder_rate, rates)
    }

    fn save(&mut self, graph: Option<&Graph>) -> Result<(), TrainError> {
        let Some(path) = self.checkpoint else {
            return Ok(());
        };
        if let Some(graph) = graph {
            graph.write_to(&mut self.model)?;
        }
        checkpoint::write(path, self.identity, self.position, &self.model)
    }

    fn finish(mut self) -> Result<Trained, TrainError> {
        let errors = self.model.evaluate(&self.ground, Numbers::Integer);
        let Run {
            ground,
            model,
            position,
            steps,
            stages,
            device,
            ..
        } = self;
        let psnr_quantised = decibels(errors.overall());
        let quantised = model.quantised(&ground);
        let widths = Widths::of(ground.config);
        let layers = export::layers(&quantised.network, &model.ranges, widths)?;
        let codes = [model.latents[0].codes(), model.latents[1].codes()];
        let batch = schedule::batch(ground.config, ground.texels.count());
        let record = record(
            ground.config,
            &steps,
            batch,
            position.psnr_float,
            psnr_quantised,
            device,
        );
        let asset = export::asset(ground.config, ground.source, layers, codes, record)?;
        let (width, height) = ground.texels.sizes[0];
        let texels = f64::from(width) * f64::from(height);
        let bits = (asset.grid_bits() + asset.parameter_bits()) as f64;
        let report = TrainReport {
            psnr_float: position.psnr_float,
            psnr_quantised,
            psnr_channels: (0..ground.texels.channels)
                .map(|c| decibels(errors.channel(c)))
                .collect(),
            psnr_mips: (0..ground.texels.sizes.len())
                .map(|m| decibels(errors.mip(m)))
                .collect(),
            bits_per_texel_channel: bits / (texels * ground.texels.channels as f64),
            macs: ground.topology.macs(),
            steps,
            seed: ground.config.seed,
            backend: device.backend(),
            adapter: device.adapter().map(str::to_owned),
            stages,
            config: ground.config.clone(),
        };
        Ok(Trained { asset, report })
    }
}

/// The training record of the asset: what made it, nothing that differs between two equal runs. A
/// device is named where it decides bytes.
fn record(
    config: &TrainConfig,
    steps: &Steps,
    batch: usize,
    psnr_float: f64,
    psnr_quantised: f64,
    device: &TrainingDevice,
) -> Vec<(String, String)> {
    let grids = config
        .grids
        .map(|g| format!("{}ch@{}bit/{}", g.channels, g.bits, 1 << g.scale_log2));
    let entries = [
        ("trainer", env!("CARGO_PKG_VERSION").to_owned()),
        ("grids", grids.join(" ")),
        ("hidden", format!("{:?}", config.hidden)),
        (
            "blocks",
            format!("{}x{}", config.residual_blocks, config.layers_per_block),
        ),
        ("effort", config.effort.to_string()),
        (
            "steps",
            format!("{}+{}+{}", steps.encoder, steps.refine, steps.integer),
        ),
        ("batch", batch.to_string()),
        ("seed", config.seed.to_string()),
        ("psnr_float", format!("{psnr_float:.3}")),
        ("psnr_quantised", format!("{psnr_quantised:.3}")),
    ];
    let device = match device.backend() {
        Backend::Flex => None,
        Backend::Wgpu | Backend::Vulkan | Backend::Cuda => Some(("backend", device.name())),
    };
    let entries = entries.into_iter().chain(device);
    entries
        .map(|(key, value)| (key.to_owned(), value))
        .collect()
}
