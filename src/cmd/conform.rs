//! `ntmu conform`: conformance vectors on a device.

use crate::Verdict;
use crate::console;
use anyhow::Context as _;
use clap::{Subcommand, ValueEnum};
use ntmu::conformance::runner::{Outcome, Progress};
use ntmu::conformance::vector::VectorFile;
use ntmu::conformance::{Device, ModelDevice, Summary, emit, run, suite};
use std::path::PathBuf;

#[derive(clap::Args)]
pub(crate) struct Conform {
    #[command(subcommand)]
    action: Action,
}

#[derive(Subcommand)]
enum Action {
    /// Run vectors and say which cases fail, at which stage. Exit code 1 if any does.
    Run(Run),
}

#[derive(clap::Args)]
struct Run {
    /// Vector files; the built-in suites without any.
    vectors: Vec<PathBuf>,
    /// The device under test.
    #[arg(long, value_enum, default_value = "model")]
    on: On,
}

#[derive(Clone, Copy, ValueEnum)]
enum On {
    /// The bit-exact model.
    Model,
    /// The WGSL twin on a GPU, or on a Vulkan driver for the CPU.
    Gpu,
}

impl Conform {
    pub(crate) fn run(self, json: bool) -> anyhow::Result<Verdict> {
        let Action::Run(arguments) = self.action;
        let files = read(&arguments.vectors)?;
        let mut device = open(arguments.on)?;
        let cases: usize = files.iter().map(|file| file.cases.len()).sum();
        let bar = console::progress(cases as u64, "vectors");
        let summary = run(&files, device.as_mut(), &mut |_: Progress<'_>| bar.inc(1));
        bar.finish_and_clear();
        if json {
            console::print_json(&summary)?;
        } else {
            print(&summary);
        }
        Ok(if summary.conforms() {
            Verdict::Fine
        } else {
            Verdict::Failed
        })
    }
}

fn read(paths: &[PathBuf]) -> anyhow::Result<Vec<VectorFile>> {
    if paths.is_empty() {
        return Ok(suite::all()?);
    }
    paths
        .iter()
        .map(|path| {
            let found = || path.display().to_string();
            let text = std::fs::read_to_string(path).with_context(found)?;
            emit::from_json(&text).with_context(found)
        })
        .collect()
}

#[cfg(feature = "gpu")]
fn open(on: On) -> anyhow::Result<Box<dyn Device>> {
    Ok(match on {
        On::Model => Box::new(ModelDevice),
        On::Gpu => Box::new(ntmu::twin_device::TwinDevice::open()?),
    })
}

#[cfg(not(feature = "gpu"))]
fn open(on: On) -> anyhow::Result<Box<dyn Device>> {
    match on {
        On::Model => Ok(Box::new(ModelDevice)),
        On::Gpu => anyhow::bail!(
            "this build has no twin. It comes with\n  cargo run --release --features gpu -- conform \
             run --on gpu"
        ),
    }
}

/// Failed cases that are shown one by one.
const SHOWN_FAILURES: usize = 10;

fn print(summary: &Summary) {
    let mut table = console::table(&["suite", "passed", "failed", "not offered", "profiles"]);
    for suite in &summary.suites {
        table.add_row([
            suite.suite.clone(),
            suite.passed.to_string(),
            suite.failed.to_string(),
            suite.unsupported.to_string(),
            suite.profiles.len().to_string(),
        ]);
    }
    console::print(&format!("device: {}", summary.device));
    console::print(&table.to_string());
    let mut shown = 0;
    for case in summary.suites.iter().flat_map(|suite| &suite.cases) {
        let Outcome::Fail {
            reason, divergence, ..
        } = &case.outcome
        else {
            continue;
        };
        shown += 1;
        if shown > SHOWN_FAILURES {
            continue;
        }
        let stage = divergence.as_ref().map_or(String::new(), |d| {
            format!(
                "; first differs at {} lane {}: expected {:?}, found {:?}",
                d.stage, d.lane, d.expected, d.found
            )
        });
        let flags = case.flags.join(", ");
        console::print(&format!(
            "FAILED {} ({}) [{flags}]: {reason}{stage}",
            case.id, case.comment
        ));
    }
    if shown > SHOWN_FAILURES {
        console::print(&format!(
            "… and {} more; --json has them all",
            shown - SHOWN_FAILURES
        ));
    }
}
