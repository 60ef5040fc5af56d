//! Table: a summary as Markdown.

use super::summary::{Change, Mean, MeanDelta, SetSummary, Summary};
use std::fmt::Write as _;

/// Writing to a string cannot fail, so the result is dropped.
macro_rules! line {
    ($text:expr, $($argument:tt)*) => {
        let _ = writeln!($text, $($argument)*);
    };
}

pub(super) fn markdown(summary: &Summary) -> String {
    let mut text = String::new();
    line!(text, "# {}\n", summary.plan);
    line!(
        text,
        "Seed {}; put together {}.",
        summary.seed,
        summary.made
    );
    for machine in &summary.machines {
        let (cpu, cores, system) = (&machine.cpu, machine.cores, &machine.system);
        line!(text, "Machine: {cpu}, {cores} cores, {system}.");
    }
    line!(text, "Encoders: {}.", summary.encoders.join("; "));
    if !summary.missing.is_empty() {
        let missing = summary.missing.join(", ");
        line!(text, "\nNot finished: {missing}.");
    }
    line!(
        text,
        "\nBPPC counts all that is stored, of all mips, network included, over the texels of mip 0 and \
         the channels; \"mip 0\" beside it is that of the blocks of mip 0 alone. PSNR and SSIM are over \
         all mips and channels; a map's PSNR is that of mip 0. Seconds are those of encoding."
    );
    for set in &summary.sets {
        of_set(&mut text, set);
    }
    if let Some(mean) = &summary.mean {
        of_mean(&mut text, mean, summary.sets.len());
    }
    text
}

fn of_set(text: &mut String, set: &SetSummary) {
    line!(text, "\n## {}\n", set.set);
    let Some(first) = set.rows.first() else {
        line!(text, "No point is finished.");
        return;
    };
    let known = &first.result.set;
    line!(
        text,
        "{} × {} texels, {} channels, {} mips.\n",
        known.width,
        known.height,
        known.channels,
        known.mips
    );
    let maps: Vec<&str> = first
        .result
        .maps
        .iter()
        .map(|map| map.name.as_str())
        .collect();
    let mut header = vec!["curve", "point", "BPPC", "mip 0", "PSNR, dB", "SSIM"];
    let are_changes = set.rows.iter().any(|row| row.change.is_some());
    if are_changes {
        header.extend(CHANGES);
    }
    header.extend(&maps);
    header.push("seconds");
    let rows = set.rows.iter().map(|row| {
        let result = &row.result;
        let mut cells = vec![
            row.curve.clone(),
            result.label.clone(),
            format!("{:.4}", result.bppc),
            result
                .bppc_mip0
                .map_or("".to_owned(), |rate| format!("{rate:.4}")),
            decibels(result.psnr),
            format!("{:.4}", result.ssim),
        ];
        if are_changes {
            cells.extend(changes(row.change));
        }
        cells.extend(result.maps.iter().map(|map| decibels(map.psnr)));
        cells.push(format!("{:.1}", result.encode_seconds));
        cells
    });
    table(text, &header, rows);
    line!(text, "\n![]({})\n", format!("plots/{}.psnr.svg", set.set));
    if let Some(matrix) = &set.bd {
        line!(text, "{}", matrix.markdown().trim_end());
    }
}

fn of_mean(text: &mut String, mean: &Mean, sets: usize) {
    line!(text, "\n## Mean of {sets} sets\n");
    let mut header = vec!["curve", "point", "BPPC", "PSNR, dB", "SSIM", "seconds"];
    let are_changes = mean.curves.iter().any(|curve| curve.change.is_some());
    if are_changes {
        header.extend(CHANGES);
    }
    let rows = mean.curves.iter().flat_map(|curve| {
        curve.points.iter().map(move |point| {
            let mut cells = vec![
                curve.curve.clone(),
                point.label.clone(),
                format!("{:.4}", point.bppc),
                format!("{:.2}", point.psnr),
                format!("{:.4}", point.ssim),
                format!("{:.1}", point.encode_seconds),
            ];
            if are_changes {
                cells.extend(changes(curve.change));
            }
            cells
        })
    });
    table(text, &header, rows);
    line!(text, "\n![](plots/mean.psnr.svg)");
    let are_deltas = mean.bd_rate.iter().flatten().any(|delta| delta.sets > 0);
    if !are_deltas {
        return;
    }
    for (name, deltas) in [
        ("BD-rate, %", &mean.bd_rate),
        ("BD-PSNR, dB", &mean.bd_psnr),
    ] {
        line!(
            text,
            "\n{name}: the mean over the sets that have one, and in brackets how many where not all do.\n"
        );
        let names: Vec<&str> = mean
            .curves
            .iter()
            .map(|curve| curve.curve.as_str())
            .collect();
        let mut header = vec!["anchor \\ test"];
        header.extend(&names);
        let rows = names.iter().zip(deltas).map(|(name, row)| {
            let mut cells = vec![(*name).to_owned()];
            cells.extend(row.iter().map(|delta| mean_delta(*delta, sets)));
            cells
        });
        table(text, &header, rows);
    }
}

/// The columns of changes against a plan's first point.
const CHANGES: [&str; 2] = ["rate", "PSNR"];

fn changes(change: Option<Change>) -> [String; 2] {
    change.map_or_else(Default::default, |Change { rate, psnr }| {
        [format!("{rate:+.1} %"), format!("{psnr:+.2} dB")]
    })
}

fn mean_delta(delta: MeanDelta, sets: usize) -> String {
    match delta.value {
        None => "none".to_owned(),
        Some(value) if delta.sets == sets => format!("{value:+.2}"),
        Some(value) => format!("{value:+.2} ({})", delta.sets),
    }
}

fn decibels(psnr: Option<f64>) -> String {
    psnr.map_or("equal".to_owned(), |psnr| format!("{psnr:.2}"))
}

fn table(text: &mut String, header: &[&str], rows: impl Iterator<Item = Vec<String>>) {
    line!(text, "| {} |", header.join(" | "));
    let rule = header.iter().enumerate();
    let rule = rule.map(|(index, _)| if index < 2 { "---" } else { "---:" });
    line!(text, "|{}|", rule.collect::<Vec<_>>().join("|"));
    for row in rows {
        line!(text, "| {} |", row.join(" | "));
    }
}
