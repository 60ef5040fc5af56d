//! What a study found, as tables on stdout.

use crate::console;
use ntmu::study::{Findings, InBetween, Study as Results, TwinStudy, VariantOutcome, Variants};

pub(super) fn results(results: &Results) {
    let asset = &results.asset;
    console::print(&format!(
        "{}: {} × {} texels, {} mips, {} channels; {} multiplications per texel; {:.4} bits per \
         pixel and channel; {}; profile {}",
        asset.name,
        asset.size.0,
        asset.size.1,
        asset.mips,
        asset.channels,
        asset.macs_per_texel,
        asset.bppc,
        asset.precision,
        asset.profile
    ));
    if let Some(quality) = &results.quality {
        console::print(&crate::cmd::compare::table(quality));
    }
    print_oracle(results);
    let engine = &results.engine;
    console::print(&format!(
        "engine ({}) against the reference: {} of {} texels differ",
        engine.path, engine.differing, engine.texels
    ));
    print_claims(&results.claims);
    match &results.twin {
        TwinStudy::Ran {
            adapter,
            codes,
            differing: 0,
            ..
        } => {
            console::print(&format!("model = twin on all {codes} codes ({adapter})"));
        }
        TwinStudy::Ran {
            adapter,
            codes,
            differing,
            first,
        } => console::print(&format!(
            "MODEL AND TWIN DIFFER on {differing} of {codes} codes ({adapter}); the first, as \
             (mip, channel, row, column, model, twin): {first:?}"
        )),
        TwinStudy::Failed { reason } => console::print(&format!("THE TWIN FAILED: {reason}")),
        TwinStudy::Skipped { reason } => console::print(&format!("twin skipped: {reason}")),
    }
    print_timing(results);
    if !results.sweep.is_empty() {
        let mut table = console::table(&["latent bits", "weight bits", "PSNR, dB", "BPPC"]);
        for point in &results.sweep {
            table.add_row([
                point.latent_bits.to_string(),
                point.weight_bits.to_string(),
                format!("{:.2}", point.psnr),
                format!("{:.4}", point.bppc),
            ]);
        }
        console::print("precision sweep, the same training rounded to fewer bits:");
        console::print(&table.to_string());
    }
    print_in_between(&results.in_between);
    print_variants(&results.variants);
}

/// One row a way, PSNR over the levels with the same fraction.
fn print_in_between(points: &[InBetween]) {
    if points.is_empty() {
        return;
    }
    let mut lods: Vec<f64> = points.iter().map(|point| point.lod).collect();
    lods.dedup();
    let header: Vec<String> = lods.iter().map(|lod| format!("{lod}")).collect();
    let mut columns = vec!["PSNR in dB at level of detail", "decodes"];
    columns.extend(header.iter().map(String::as_str));
    let mut table = console::table(&columns);
    let ways = points.iter().take_while(|point| point.lod == lods[0]);
    for way in ways.map(|point| point.way) {
        let own = || points.iter().filter(|point| point.way == way);
        let most = own().map(|point| point.decodes).fold(0.0, f64::max);
        let mut row = vec![way.to_owned(), format!("{most:.0}")];
        row.extend(own().map(|point| format!("{:.2}", point.psnr)));
        table.add_row(row);
    }
    console::print("between mips, against the source filtered to the level of detail:");
    console::print(&table.to_string());
}

fn print_variants(variants: &Variants) {
    let mut table = console::table(&[
        "instead of the asset's own",
        "codes that differ",
        "at most",
        "PSNR, dB",
    ]);
    for variant in &variants.tried {
        let name = variant.name.clone();
        match &variant.outcome {
            VariantOutcome::Decoded {
                differing,
                codes,
                largest,
                psnr,
                ..
            } => table.add_row([
                name,
                format!("{:.2} %", 100.0 * *differing as f64 / *codes as f64),
                largest.to_string(),
                psnr.map_or(String::new(), |psnr| format!("{psnr:.2}")),
            ]),
            VariantOutcome::Impossible { reason } => {
                table.add_row([name, reason.clone(), String::new(), String::new()])
            }
        };
    }
    let own = variants.psnr;
    console::print(&format!(
        "the same training in other numbers and under other profiles, at {} texels{}:",
        variants.texels,
        own.map_or(String::new(), |psnr| format!(" with {psnr:.2} dB as it is"))
    ));
    console::print(&table.to_string());
}

/// Differences up to this one have a row of their own; study.json has them all.
const SHOWN_DIFFERENCE: u64 = 8;

fn print_oracle(results: &Results) {
    let oracle = &results.oracle;
    let mut table = console::table(&["model − oracle, LSB", "codes"]);
    let (shown, beyond): (Vec<_>, Vec<_>) = oracle
        .histogram
        .iter()
        .partition(|(difference, _)| difference.unsigned_abs() <= SHOWN_DIFFERENCE);
    for (difference, count) in shown {
        table.add_row([format!("{difference:+}"), count.to_string()]);
    }
    if !beyond.is_empty() {
        let count: u64 = beyond.iter().map(|(_, count)| count).sum();
        table.add_row([format!("beyond ±{SHOWN_DIFFERENCE}"), count.to_string()]);
    }
    console::print(&table.to_string());
    console::print(&format!(
        "largest |model − oracle| {:.3} LSB (proven bound {:.1}); root mean square {:.3} (predicted {:.3})",
        oracle.max, oracle.bound, oracle.rms, oracle.typical
    ));
}

fn print_claims(found: &Findings) {
    let mut table = console::table(&["stage", "|value − real| at most", "its bound"]);
    for (stage, distance) in &found.stages {
        table.add_row([
            stage.clone(),
            format!("{:.6}", distance.found),
            format!("{:.6}", distance.bound),
        ]);
    }
    console::print(&format!(
        "{} texels, value by value: {} differ from the naive evaluation of the specification; stage \
         by stage, each on its own input:",
        found.texels, found.not_naive
    ));
    console::print(&table.to_string());
    let mut table = console::table(&["channel", "largest", "worst case", "rms", "predicted"]);
    for (index, channel) in found.channels.iter().enumerate() {
        table.add_row([
            index.to_string(),
            format!("{:.3}", channel.observed_max),
            format!("{:.1}", channel.worst),
            format!("{:.3}", channel.observed_rms),
            format!("{:.3}", channel.predicted_rms),
        ]);
    }
    console::print("end to end, |model − oracle| in LSB:");
    console::print(&table.to_string());
}

fn print_timing(results: &Results) {
    let mut table = console::table(&[
        "access",
        "unit",
        "layout",
        "cycles/block",
        "at least",
        "bytes/block",
        "hits",
        "MACs busy",
        "Mtexel/s",
        "bottleneck",
    ]);
    for row in &results.timing {
        table.add_row([
            row.access.clone(),
            row.unit.clone(),
            row.layout.clone(),
            format!("{:.1}", row.cycles_per_block),
            format!("{:.1}", row.closed_form_per_block),
            format!("{:.1}", row.bytes_per_block),
            format!("{:.1} %", 100.0 * row.hit_rate),
            format!("{:.1} %", 100.0 * row.mac_utilisation),
            format!("{:.1}", row.mtexels_per_second),
            row.bottleneck.clone(),
        ]);
    }
    console::print(&table.to_string());
    for row in &results.timing {
        let charges: Vec<String> = row
            .ledger
            .iter()
            .filter(|charge| 1000 * charge.cycles >= row.cycles)
            .map(|c| {
                format!(
                    "{} {:.1} %",
                    c.cause,
                    100.0 * c.cycles as f64 / row.cycles as f64
                )
            })
            .collect();
        console::print(&format!(
            "{}, {} {}: {}",
            row.access,
            row.unit,
            row.layout,
            charges.join(", ")
        ));
    }
}
