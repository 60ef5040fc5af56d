//! `ntmu evaluate`: sets × codecs × rates.

use crate::Verdict;
use crate::console;
use anyhow::Context as _;
use indicatif::ProgressBar;
use ntmu::evaluate::{Evaluation, Event, Plan, Point, Shard, summarise};
use serde_json::json;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

#[derive(clap::Args)]
pub(crate) struct Evaluate {
    /// The plan: a TOML file of sets and curves, such as plans/evaluate/six-sets.toml.
    plan: PathBuf,
    /// The folder of the results. Points that are finished there are not made again.
    #[arg(short, long, value_name = "DIR", default_value = "evaluation")]
    output: PathBuf,
    /// Make only points with this in their label or identity; may be given several times.
    #[arg(long, value_name = "TEXT")]
    only: Vec<String>,
    /// Make every n-th point only, i from 0 to n − 1: for one machine, or one job of an array, of n.
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    /// List the points with their identities and whether they are finished, and do nothing.
    #[arg(long, conflicts_with = "dry_run")]
    list: bool,
    /// Say what would be made and what is missing for it, and make nothing. Exits with 1 where
    /// something is missing.
    #[arg(long)]
    dry_run: bool,
}

impl Evaluate {
    pub(crate) fn run(self, json: bool) -> anyhow::Result<Verdict> {
        let plan = Plan::read(&self.plan)?;
        let evaluation = Evaluation::new(plan, &self.output)?;
        let chosen = evaluation.chosen(&self.only, self.shard);
        if chosen.is_empty() && !self.only.is_empty() {
            anyhow::bail!(
                "--only: found no point with {} in its label",
                self.only.join(" or ")
            );
        }
        if self.list {
            return list(&evaluation, &chosen, json);
        }
        // A damaged result is found before the work.
        let mut open = Vec::new();
        for point in chosen {
            if evaluation.result(point)?.is_none() {
                open.push(point);
            }
        }
        if self.dry_run {
            return dry_run(&evaluation, &open, json);
        }
        let failed = make(&evaluation, &open)?;
        let summary = summarise(&evaluation)?;
        // Jobs of an array would write the same files over and over; the last one, or a run without
        // a shard, does it.
        if self.shard.is_none() || summary.missing.is_empty() {
            summary.write(&evaluation)?;
            let place = self.output.display();
            console::note(&format!("wrote {place}/results.md, {place}/results.json"));
        }
        if json {
            console::print_json(&summary)?;
        } else {
            console::print(&summary.markdown());
        }
        Ok(if failed {
            Verdict::Failed
        } else {
            Verdict::Fine
        })
    }
}

fn list(evaluation: &Evaluation, points: &[&Point], json: bool) -> anyhow::Result<Verdict> {
    let mut table = console::table(&["point", "curve", "identity", "finished"]);
    let mut data = Vec::new();
    for point in points {
        let is_finished = evaluation.result(point)?.is_some();
        let curve = &evaluation.plan.curves[point.curve].name;
        table.add_row([
            point.label.as_str(),
            curve,
            &point.id,
            if is_finished { "yes" } else { "no" },
        ]);
        data.push(json!({
            "point": point.label, "curve": curve, "id": point.id, "finished": is_finished,
            "file": evaluation.place(point).result,
        }));
    }
    if json {
        console::print_json(&data)?;
    } else {
        console::print(&table.to_string());
    }
    Ok(Verdict::Fine)
}

fn dry_run(evaluation: &Evaluation, points: &[&Point], json: bool) -> anyhow::Result<Verdict> {
    let mut is_fine = true;
    let mut data = Vec::new();
    for point in points {
        let problem = evaluation.check(point).err().map(|error| error.to_string());
        is_fine &= problem.is_none();
        data.push(json!({ "point": point.label, "id": point.id, "problem": problem }));
        if !json {
            let problem = problem.map_or(String::new(), |problem| format!(": {problem}"));
            console::print(&format!("{}{problem}", point.label));
        }
    }
    if json {
        console::print_json(&data)?;
    } else {
        console::note(&format!("{} points to make", points.len()));
    }
    Ok(if is_fine {
        Verdict::Fine
    } else {
        Verdict::Failed
    })
}

/// Makes the points; whether one failed or the user stopped the run.
fn make(evaluation: &Evaluation, points: &[&Point]) -> anyhow::Result<bool> {
    let stop = stop_on_interrupt()?;
    let mut failed = false;
    let mut bar = ProgressBar::hidden();
    let mut started = Instant::now();
    evaluation.run(points, &stop, &mut |event| match event {
        Event::Begun {
            index,
            count,
            point,
        } => {
            console::note(&format!("{} of {count}: {} …", index + 1, point.label));
            bar = console::progress(0, "parts of the point");
            started = Instant::now();
        }
        Event::Part { done, total } => {
            bar.set_length(total as u64);
            bar.set_position(done as u64);
        }
        Event::Finished { point, result } => {
            bar.finish_and_clear();
            let psnr = result.psnr.unwrap_or(f64::INFINITY);
            console::note(&format!(
                "{}: {psnr:.2} dB at {:.4} BPPC in {:.1} s",
                point.label,
                result.bppc,
                started.elapsed().as_secs_f64()
            ));
        }
        Event::Failed { point, error } => {
            bar.finish_and_clear();
            failed = true;
            console::note(&format!("{}: {error}", point.label));
        }
    })?;
    Ok(failed || stop.load(Ordering::SeqCst))
}

/// The first interrupt ends the evaluation after the block codec at work, or with a checkpoint of the
/// neural one; a second ends the program at once.
fn stop_on_interrupt() -> anyhow::Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&stop);
    ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::SeqCst) {
            std::process::abort();
        }
        console::note("\nstopping after this point; once more to stop at once");
    })
    .context("cannot watch for interrupts")?;
    Ok(stop)
}
