//! A run as tables.

use super::{Behind, Results};
use crate::console;
use comfy_table::CellAlignment;
use ntmu::timing::sampling::Sample;
use ntmu::timing::setup::Identities;
use ntmu::timing::summary::{EnergyRows, LedgerRow, Summary};

pub(super) fn results(results: &Results) {
    let run = &results.run;
    print_identities(&results.identities);
    if let Some(sample) = &results.sample {
        print_sample(sample);
    }
    print_throughput(results);
    print_traffic(run);
    print_ledger("ledger", &run.ledger);
    if let Some(behind) = &results.behind_warm_up {
        print_behind(behind);
    }
    print_bounds(run);
    if let Some(energy) = &results.energy {
        print_energy(energy);
    }
}

fn print_identities(identities: &Identities) {
    let mut text = format!("unit      {}\n", identities.unit);
    for material in &identities.materials {
        let [width, height] = material.size_texels;
        text.push_str(&format!(
            "material  {}, {width} × {height} texels, {} multiplications per texel, {} + {} bytes; \
             profile {}\n",
            material.name,
            material.macs_per_texel,
            material.grid_bytes,
            material.parameter_bytes,
            material.profile
        ));
    }
    if identities.copies > 1 {
        text.push_str(&format!("copies    {}\n", identities.copies));
    }
    text.push_str(&format!("layout    {}\n", identities.layout));
    text.push_str(&format!("access    {}", identities.access));
    if let Some([width, height]) = identities.screen_pixels {
        text.push_str(&format!(" on {width} × {height} pixels"));
    }
    if let Some(interleave) = &identities.interleave {
        text.push_str(&format!(", materials by {interleave}"));
    }
    console::print(&format!("{text}\n"));
}

fn print_sample(sample: &Sample) {
    let mut table = console::table(&["estimate", "mean", "from", "to", "±%"]);
    for (name, estimate) in [
        ("cycles per block", sample.cycles_per_block),
        ("bytes of latents per block", sample.latent_bytes_per_block),
        ("decodes per pixel", sample.decodes_per_pixel),
    ] {
        table.add_row([
            name.to_owned(),
            format!("{:.3}", estimate.mean),
            format!("{:.3}", estimate.low),
            format!("{:.3}", estimate.high),
            format!("{:.2}", estimate.plus_minus_percent),
        ]);
    }
    let check = match &sample.warm_up_check {
        None => "The warm-up could not be checked.".to_owned(),
        Some(check) => format!(
            "A warm-up {} times as long on {} of the segments changes cycles by {:+.2} % and bytes \
             of latents by {:+.2} %; the intervals do not \
             show that. Lines last asked for even earlier come from memory again in each segment, \
             so that bytes from memory err upwards.",
            check.times_as_long,
            check.segments,
            check.cycles_change_percent,
            check.latent_bytes_change_percent
        ),
    };
    console::print(&format!(
        "\nEstimated from {} segments with {} pixels ({:.2} % of the stream) behind {} of warm-up: \
         {}. Intervals hold {} % if the segments are normal. {check} The stream: about {:.0} pixels \
         and {:.0} cycles. All other figures are those of the segments.\n\n{table}",
        sample.segments,
        sample.measured_pixels,
        100.0 * sample.measured_share,
        sample.warm_up_pixels,
        sample.method,
        100.0 * sample.confidence,
        sample.stream_pixels,
        sample.stream_cycles,
    ));
}

fn percent(rate: Option<f64>) -> String {
    rate.map_or("none".to_owned(), |rate| format!("{:.2}", 100.0 * rate))
}

/// The run, and beside it its brackets.
fn print_throughput(results: &Results) {
    let mut runs = vec![("run", &results.run)];
    if let Some(brackets) = &results.brackets {
        runs.push(("no cache", &brackets.no_cache));
        runs.push(("infinite cache", &brackets.infinite_cache));
    }
    let mut header = vec!["", "unit"];
    header.extend(runs.iter().map(|(name, _)| *name));
    let mut table = console::table(&header);
    if let Some(column) = table.column_mut(1) {
        column.set_cell_alignment(CellAlignment::Left);
    }
    let mut row = |name: &str, unit: &str, value: &dyn Fn(&Summary) -> String| {
        let mut cells = vec![name.to_owned(), unit.to_owned()];
        cells.extend(runs.iter().map(|(_, run)| value(run)));
        table.add_row(cells);
    };
    let whole = |number: Option<u64>| number.map_or(String::new(), |number| number.to_string());
    row("cycles", "", &|run| run.totals.cycles.to_string());
    row("pixels", "", &|run| run.totals.pixels.to_string());
    row("texels asked for", "", &|run| run.totals.texels.to_string());
    row("texels decoded", "", &|run| run.totals.decodes.to_string());
    row("per block", "cycles", &|run| {
        format!("{:.3}", run.throughput.cycles_per_block)
    });
    if results.run.block_percentiles.is_some() {
        row("  median job", "cycles", &|run| {
            let jobs = run.block_percentiles;
            jobs.map_or(String::new(), |jobs| format!("{:.3}", jobs.p50_cycles))
        });
        row("  99 % of jobs", "cycles", &|run| {
            let jobs = run.block_percentiles;
            jobs.map_or(String::new(), |jobs| format!("{:.3}", jobs.p99_cycles))
        });
    }
    row("pixels", "per cycle", &|run| {
        format!("{:.4}", run.throughput.pixels_per_cycle)
    });
    row("decodes", "per cycle", &|run| {
        format!("{:.4}", run.throughput.decodes_per_cycle)
    });
    let clock = format!("at {} MHz", results.run.throughput.clock_mhz);
    row("Gpixel/s", &clock, &|run| {
        format!("{:.4}", run.throughput.gigapixels_per_second)
    });
    row("Gtexel/s", &clock, &|run| {
        format!("{:.4}", run.throughput.gigatexels_per_second)
    });
    row("GB/s from outside", &clock, &|run| {
        format!("{:.4}", run.throughput.gigabytes_per_second)
    });
    row("multipliers at work", "%", &|run| {
        format!("{:.2}", 100.0 * run.throughput.mac_utilisation)
    });
    row("hits, latent cache", "%", &|run| {
        percent(run.hit_rates.latent_cache)
    });
    row("hits, second level", "%", &|run| {
        percent(run.hit_rates.second_level)
    });
    row("hits, decoded texels", "%", &|run| {
        percent(run.hit_rates.decoded_cache)
    });
    row("lines from memory", "", &|run| {
        run.totals.fetched_lines.to_string()
    });
    if results.run.totals.distinct_lines.is_some() {
        row("distinct lines", "", &|run| {
            whole(run.totals.distinct_lines)
        });
    }
    row("weight fills", "", &|run| {
        run.totals.weight_fills.to_string()
    });
    row("largest stall", "", &|run| {
        run.largest_stall.unwrap_or("none").to_owned()
    });
    console::print(&format!("\n{table}"));
}

fn print_traffic(run: &Summary) {
    let mut table = console::table(&["bytes from", "all", "per pixel", "per texel", "per block"]);
    for traffic in &run.traffic {
        table.add_row([
            traffic.level.to_owned(),
            traffic.bytes.to_string(),
            format!("{:.3}", traffic.bytes_per_pixel),
            format!("{:.3}", traffic.bytes_per_texel),
            format!("{:.3}", traffic.bytes_per_block),
        ]);
    }
    console::print(&format!("\n{table}"));
}

fn print_ledger(title: &str, ledger: &[LedgerRow]) {
    let mut table = console::table(&[title, "cycles", "%", "meaning"]);
    if let Some(column) = table.column_mut(3) {
        column.set_cell_alignment(CellAlignment::Left);
    }
    let share = |share: u32| format!("{}.{:02}", share / 100, share % 100);
    for row in ledger.iter().filter(|row| row.cycles > 0) {
        table.add_row([
            row.cause.to_owned(),
            row.cycles.to_string(),
            share(row.hundredths_of_percent),
            row.meaning.to_owned(),
        ]);
    }
    let cycles: u64 = ledger.iter().map(|row| row.cycles).sum();
    let shares = ledger.iter().map(|row| row.hundredths_of_percent).sum();
    let sum = [
        "sum".to_owned(),
        cycles.to_string(),
        share(shares),
        String::new(),
    ];
    table.add_row(sum);
    console::print(&format!("\n{table}"));
}

fn print_behind(behind: &Behind) {
    console::print(&format!(
        "\nBehind the first {} pixels: {} pixels in {} cycles, {:.3} cycles per block.",
        behind.warm_up_pixels, behind.pixels, behind.cycles, behind.cycles_per_block
    ));
    print_ledger("ledger behind", &behind.ledger);
}

fn print_bounds(run: &Summary) {
    let bounds = &run.closed_form;
    let is_whole = bounds.critical_path_cycles.is_some();
    let mut header = vec!["resource", "work, cycles", "work per block"];
    if is_whole {
        header.push("bound, cycles");
    }
    let mut table = console::table(&header);
    for row in bounds.resources.iter().filter(|row| row.work_cycles > 0) {
        let mut cells = vec![
            row.resource.to_owned(),
            row.work_cycles.to_string(),
            format!("{:.3}", row.work_cycles_per_block),
        ];
        cells.extend(row.bound_cycles.map(|cycles| cycles.to_string()));
        table.add_row(cells);
    }
    let path = bounds.critical_path_cycles.map_or(String::new(), |cycles| {
        format!(" The critical path takes {cycles} cycles.")
    });
    console::print(&format!(
        "\nAt least {} cycles, {:.3} per block, as {} binds; the unit takes {:.3} times as long.{path}\
         \n\n{table}",
        bounds.cycles, bounds.cycles_per_block, bounds.binds, bounds.measured_over_bound
    ));
}

fn print_energy(energy: &EnergyRows) {
    let mut table = console::table(&["operation", "count", "pJ per block", "%"]);
    for row in energy.operations.iter().filter(|row| row.count > 0) {
        table.add_row([
            row.operation.to_owned(),
            row.count.to_string(),
            format!("{:.2}", row.picojoules_per_block),
            format!("{:.2}", 100.0 * row.share),
        ]);
    }
    table.add_row([
        "sum".to_owned(),
        String::new(),
        format!("{:.2}", energy.picojoules_per_block),
        "100.00".to_owned(),
    ]);
    console::print(&format!(
        "\nOperations at the prices of {}: they rank designs and are no estimate of power.\n\n{table}",
        energy.table
    ));
}
