//! Progress: stage, step, loss, quality, its curve, time left.

use super::curve::Curve;
use crate::console;
use indicatif::{ProgressBar, ProgressStyle};
use ntmu::trainer::{Progress, Round};

/// The progress line.
///
/// Where stderr is no terminal, a line for every tenth of a stage.
pub(super) struct Line {
    bar: ProgressBar,
    curve: Curve,
    /// The stage that the bar shows.
    shown: Option<u32>,
    tenth: Option<(u32, u64)>,
}

impl Line {
    pub(super) fn new() -> Line {
        let bar = ProgressBar::new(1);
        let template = "{prefix:8} {bar:24} {pos}/{len}  {msg}  {elapsed} + {eta}";
        if let Ok(style) = ProgressStyle::with_template(template) {
            bar.set_style(style);
        }
        Line {
            bar,
            curve: Curve::new(),
            shown: None,
            tenth: None,
        }
    }

    pub(super) fn show(&mut self, progress: &Progress) {
        self.curve.push(progress.psnr);
        if self.bar.is_hidden() {
            self.note_tenth(progress);
            return;
        }
        if self.shown != Some(progress.stage.index) {
            // The steps of the stages cost differently: time left is that of the stage under way.
            self.shown = Some(progress.stage.index);
            self.bar.set_prefix(progress.stage.name());
            self.bar.set_length(progress.stage_steps);
            self.bar.reset_eta();
        }
        self.bar.set_position(progress.step);
        self.bar
            .set_message(format!("{}  {}", figures(progress), self.curve.text()));
    }

    pub(super) fn show_round(&self, round: &Round) {
        let Round { moved, psnr } = round;
        let text = format!("settling  {moved} latents moved  deployed {psnr:.2} dB");
        if self.bar.is_hidden() {
            console::note(&text);
        } else {
            self.bar.set_message(text);
        }
    }

    pub(super) fn finish(&self) {
        self.bar.finish_and_clear();
    }

    fn note_tenth(&mut self, progress: &Progress) {
        let tenth = 10 * progress.step / progress.stage_steps.max(1);
        let tenth = Some((progress.stage.index, tenth));
        if tenth != self.tenth || progress.deployed_psnr.is_some() {
            self.tenth = tenth;
            console::note(&format!(
                "{} {}/{}  {}  {:.0} s",
                progress.stage.name(),
                progress.step,
                progress.stage_steps,
                figures(progress),
                progress.seconds
            ));
        }
    }
}

fn figures(progress: &Progress) -> String {
    let mut text = format!("loss {:.2e}  about {:.2} dB", progress.loss, progress.psnr);
    if let Some(deployed) = progress.deployed_psnr {
        text.push_str(&format!("  deployed {deployed:.2} dB"));
    }
    text
}
