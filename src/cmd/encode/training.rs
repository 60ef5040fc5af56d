//! What `ntmu encode` does in a build that has the trainer.

use super::Encode;
use crate::Verdict;
use crate::{console, files};
use anyhow::Context as _;
use indicatif::{ProgressBar, ProgressStyle};
use ntmu::decoded::Decoded;
use ntmu::quality::{self, Quality};
use ntmu::texture_set::TextureSet;
use ntmu::trainer::{
    self, Backend, EFFORTS, Precision, Preset, Progress, TrainConfig, TrainError, Trained,
};
use ntmu::training_source::training_source;
use ntmu::{beside, built_in};
use serde_json::json;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

impl Encode {
    pub(crate) fn run(self, json: bool) -> anyhow::Result<Verdict> {
        let config = self.config()?;
        let device = Backend::by_name(&self.backend)?.open()?;
        if let Some(adapter) = device.adapter() {
            console::note(&format!("{}: {adapter}", device.backend().name()));
        }
        let set = match &self.source {
            Some(path) if !self.built_in => TextureSet::read(path)?,
            _ => built_in::source(),
        };
        for skipped in &set.skipped {
            console::note(&format!("left out {}: {}", skipped.file, skipped.reason));
        }
        let checkpoint = self.checkpoint_path();
        self.check_places(&checkpoint)?;
        let source = training_source(&set);
        let started = Instant::now();
        let stop = stop_on_interrupt()?;
        let mut line = Line::new();
        let trained = trainer::train(
            &source,
            &config,
            &device,
            Some(&checkpoint),
            self.resume,
            &stop,
            &mut |progress| line.show(progress),
        );
        line.bar.finish_and_clear();
        let trained = match trained {
            Ok(trained) => trained,
            Err(error @ TrainError::Stopped { .. }) => {
                console::note(&format!(
                    "{error}\nthe same command with --resume continues"
                ));
                return Ok(Verdict::Failed);
            }
            Err(error) => return Err(error.into()),
        };
        files::write(&self.output, &trained.asset.to_bytes())?;
        if checkpoint.exists() {
            std::fs::remove_file(&checkpoint)
                .with_context(|| format!("cannot remove {}", checkpoint.display()))?;
        }
        let reals = Decoded::of(&trained.asset, |_| ()).reals(&trained.asset.shape);
        let quality = Quality::measure(&source.mips, &reals, &quality::maps_of(&trained.asset))?;
        self.report(json, &trained, &quality, started.elapsed())?;
        Ok(Verdict::Fine)
    }

    /// Finds out before the work what would be in the way after it.
    fn check_places(&self, checkpoint: &Path) -> anyhow::Result<()> {
        for path in [self.output.as_path(), checkpoint] {
            beside::file_for(path).with_context(|| format!("cannot write {}", path.display()))?;
            anyhow::ensure!(
                !path.is_dir(),
                "{}: found a folder; allowed: a file",
                path.display()
            );
        }
        let place = checkpoint.display();
        match (self.resume, checkpoint.exists()) {
            (true, false) => anyhow::bail!("--resume: found no checkpoint at {place}"),
            (false, true) => {
                console::note(&format!(
                    "starting anew over {place}; --resume would continue it"
                ));
            }
            (true, true) | (false, false) => {}
        }
        Ok(())
    }

    fn checkpoint_path(&self) -> PathBuf {
        self.checkpoint.clone().unwrap_or_else(|| {
            let mut name = self.output.clone().into_os_string();
            name.push(".checkpoint");
            PathBuf::from(name)
        })
    }

    fn config(&self) -> anyhow::Result<TrainConfig> {
        let mut config = Preset::by_name(&self.preset)?.config();
        let named = EFFORTS
            .iter()
            .find(|(name, _)| *name == self.effort)
            .map(|(_, effort)| *effort);
        let effort = named.or_else(|| self.effort.parse().ok().filter(|&effort| effort <= 100));
        let effort = effort.with_context(|| {
            let names = EFFORTS.map(|(name, _)| name).join(", ");
            format!(
                "effort: found {:?}; allowed: 0 to 100, {names}",
                self.effort
            )
        })?;
        config = config.with_effort(effort);
        config.seed = self.seed;
        if let Some(path) = &self.config {
            config = replaced(&config, path).with_context(|| path.display().to_string())?;
        }
        if let Some(hidden) = &self.hidden {
            config.hidden.clone_from(hidden);
        }
        if let Some(blocks) = self.blocks {
            config.residual_blocks = blocks;
        }
        if let Some(channels) = &self.grids {
            let [first, second] = channels.as_slice() else {
                anyhow::bail!(
                    "grids: found {} numbers; allowed: two, `8,16`",
                    channels.len()
                );
            };
            config.grids[0].channels = *first;
            config.grids[1].channels = *second;
        }
        if let Some(bits) = self.latent_bits {
            config.grids[0].bits = bits;
            config.grids[1].bits = bits;
        }
        if let Some(name) = &self.precision {
            let known = [Precision::Int8, Precision::Fp16];
            let found = known.into_iter().find(|precision| precision.name() == name);
            config.precision = found.with_context(|| {
                let names = known.map(Precision::name).join(", ");
                format!("precision: found {name:?}; allowed: {names}")
            })?;
        }
        if let Some(bits) = self.activation_bits {
            config.activation_bits = bits;
        }
        if let Some(bits) = self.weight_bits {
            config.weight_bits = bits;
        }
        config.validate()?;
        Ok(config)
    }

    fn report(
        &self,
        json: bool,
        trained: &Trained,
        quality: &Quality,
        elapsed: Duration,
    ) -> anyhow::Result<()> {
        let rate = quality::bppc(&trained.asset);
        let report = &trained.report;
        let profile = trained.asset.profile.identity();
        if json {
            return console::print_json(&json!({
                "output": self.output, "quality": quality, "bppc": rate, "training": report,
                "seconds": elapsed.as_secs_f64(), "profile": profile,
            }));
        }
        console::print(&super::super::compare::table(quality));
        console::print(&format!(
            "{:.4} bits per pixel and channel, parameters counted; {} multiplications per texel\n\
             profile {profile}; float network {:.2} dB, deployed {:.2} dB\n\
             {} in {:.0} s",
            rate,
            trained.asset.macs(),
            report.psnr_float,
            quality.overall.psnr,
            self.output.display(),
            elapsed.as_secs_f64()
        ));
        Ok(())
    }
}

/// The configuration with the fields that a TOML file holds.
fn replaced(config: &TrainConfig, path: &Path) -> anyhow::Result<TrainConfig> {
    let fields: serde_json::Map<String, serde_json::Value> =
        toml::from_str(&std::fs::read_to_string(path)?)?;
    let mut value = serde_json::to_value(config)?;
    for (name, field) in fields {
        value[name] = field;
    }
    Ok(serde_json::from_value(value)?)
}

/// The first interrupt asks the trainer to stop, which leaves a checkpoint; a second ends the
/// program at once.
fn stop_on_interrupt() -> anyhow::Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&stop);
    ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::SeqCst) {
            std::process::abort();
        }
        console::note("\nstopping; once more to stop without a checkpoint");
    })
    .context("cannot watch for interrupts")?;
    Ok(stop)
}

/// The progress line: stage, step, loss, PSNR estimate, time left.
///
/// Where stderr is no terminal, a line for every tenth of a stage.
struct Line {
    bar: ProgressBar,
    tenth: (&'static str, u64),
}

impl Line {
    fn new() -> Line {
        let bar = ProgressBar::new(1);
        let template = "{prefix:8} {bar:24} {pos}/{len}  {msg}  {elapsed} + {eta}";
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        Line {
            bar,
            tenth: ("", 0),
        }
    }

    fn show(&mut self, progress: &Progress) {
        if self.bar.is_hidden() {
            self.note_tenth(progress);
            return;
        }
        if self.bar.prefix() != progress.stage.name() {
            // The steps of the stages cost differently: time left is that of the stage under way.
            self.bar.set_prefix(progress.stage.name());
            self.bar.set_length(progress.stage_steps);
            self.bar.reset_eta();
        }
        self.bar.set_position(progress.step);
        let loss = progress.loss;
        self.bar
            .set_message(format!("loss {loss:.2e}  about {:.2} dB", progress.psnr));
    }

    fn note_tenth(&mut self, progress: &Progress) {
        let tenth = (
            progress.stage.name(),
            10 * progress.step / progress.stage_steps.max(1),
        );
        if tenth != self.tenth {
            self.tenth = tenth;
            console::note(&format!(
                "{} {}/{}  loss {:.2e}  about {:.2} dB  {:.0} s",
                progress.stage.name(),
                progress.step,
                progress.stage_steps,
                progress.loss,
                progress.psnr,
                self.bar.elapsed().as_secs_f64()
            ));
        }
    }
}
