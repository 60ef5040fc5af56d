//! Result: what a finished run says.

use super::{Encode, resident};
use crate::console;
use ntmu::quality::{self, Quality};
use ntmu::trainer::{Memory, Trained};
use serde_json::json;
use std::time::Duration;

/// Bytes of a mebibyte.
const MEBIBYTE: f64 = 1_048_576.0;

impl Encode {
    pub(super) fn report(
        &self,
        json: bool,
        trained: &Trained,
        quality: &Quality,
        memory: Memory,
        elapsed: Duration,
    ) -> anyhow::Result<()> {
        let rate = quality::bppc(&trained.asset);
        let report = &trained.report;
        let profile = trained.asset.profile.identity();
        let peak = resident::peak();
        if json {
            return console::print_json(&json!({
                "output": self.output, "quality": quality, "bppc": rate, "training": report,
                "seconds": elapsed.as_secs_f64(), "profile": profile,
                "memory": { "estimate": memory, "peak_resident": peak },
            }));
        }
        console::print(&super::super::compare::table(quality));
        if self.mask.is_some() {
            console::print(&format!(
                "masked texels are in the table; without them the asset has {:.2} dB",
                report.psnr_quantised
            ));
        }
        let peak = peak.map_or(String::new(), |peak| {
            format!(", {:.0} MiB of memory", peak as f64 / MEBIBYTE)
        });
        console::print(&format!(
            "{:.4} bits per pixel and channel, parameters counted; {} multiplications per texel\n\
             profile {profile}; float network {:.2} dB, deployed {:.2} dB\n\
             {} in {:.0} s{peak}",
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
