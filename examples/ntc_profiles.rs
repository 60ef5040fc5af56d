//! Makes the table of `docs/src/ntc_profiles.md`: the four profiles of the NTC paper on units that
//! differ in a few numbers, beside the decode times that the paper reports.
//!
//! `cargo run --release --example ntc_profiles`

use ntmu::conformance::synthetic::{self, Spec, SpecPrecision};
use ntmu::isa::layout::Layout;
use ntmu::isa::preset::Preset;
use ntmu::isa::profile::Profile;
use ntmu::isa::sampler::{Filter, MipFilter, Sampler};
use ntmu::isa::{Asset, Program};
use ntmu::model::Material;
use ntmu::model::sampler::Sampled;
use ntmu::model::stream::{AccessSpec, Interleave, Stream};
use ntmu::model::time::{self, Timing, Unit};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::error::Error;

/// The profiles and their published decode times in milliseconds, fastest first.
const PROFILES: [(&str, f64); 4] = [
    ("ntc-0.2", 1.15),
    ("ntc-1.0", 1.33),
    ("ntc-0.5", 1.46),
    ("ntc-2.25", 1.92),
];
/// Half of the last digit of a published time.
const ROUNDING: f64 = 0.005;
/// Channels of the published set.
const CHANNELS: u16 = 8;
/// Texels of the set: columns of the published one, and rows of the part of the screen. Addresses
/// within these rows are those of a set of 4096 rows.
const TEXELS: [u32; 2] = [4096, SCREEN[1]];
/// Pixels: whole rows of the published 3840×2160, one texel each.
const SCREEN: [u32; 2] = [3840, 64];
/// Eight by eight pixels after eight by eight.
const ACCESS: &str = "quad:scale=1,order=tiles:8";
/// The document, and what stands around the table in it.
const DOCUMENT: &str = "docs/src/ntc_profiles.md";
const BEGIN: &str = "<!-- made by `cargo run --release --example ntc_profiles` -->\n";
const END: &str = "<!-- end of what was made -->";

/// Fields of a unit and their values.
type Changes = &'static [(&'static str, &'static str)];

/// A unit to compare: what it shows, the layout, and what the console unit is changed to, the first
/// changes before the second.
struct Variant(&'static str, &'static str, Group, Changes);

/// Changes that several units share, by name.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Group(&'static str, Changes);

const NONE: Group = Group("", &[]);

/// Requantisers that never bind.
const ARRAY: Group = Group("array", &[("requantizer_lanes", "2048")]);

/// Between memory and the output nothing binds but the array, which is 32 times as fast in halves.
const FRONT: Group = Group(
    "front",
    &[
        ("address_generators", "1024"),
        ("corner_fifo_texels", "4096"),
        ("embed_lanes", "4096"),
        ("half_passes", "1"),
        ("interpolator_lanes", "4096"),
        ("mac_arrays", "16"),
        ("mshrs", "4096"),
        ("output_channels_per_cycle", "1024"),
        ("requantizer_lanes", "8192"),
        ("requests_per_cycle", "64"),
        ("tile_load_cycles", "1"),
        ("unpack_lanes", "8192"),
    ],
);

/// An array whose cycles are the inputs of the layers, beside a memory of a byte a cycle.
const BOTH: Group = Group(
    "both",
    &[
        ("dataflow", "output-stationary"),
        ("embed_lanes", "128"),
        ("half_passes", "1"),
        ("interpolator_lanes", "256"),
        ("mac_rows", "64"),
        ("memory_bytes_per_cycle", "1"),
        ("output_queue_pixels", "256"),
        ("requantizer_lanes", "2048"),
        ("unpack_lanes", "512"),
    ],
);

/// The units compared.
const VARIANTS: [Variant; 24] = [
    Variant("the unit as it is", "tiles-4", NONE, &[]),
    Variant(
        "array: tiles of 16 inputs",
        "tiles-4",
        ARRAY,
        &[("mac_rows", "64"), ("mac_columns", "16")],
    ),
    Variant(
        "array: tiles of 8 inputs",
        "tiles-4",
        ARRAY,
        &[
            ("mac_rows", "64"),
            ("mac_columns", "8"),
            ("mac_arrays", "2"),
            ("tile_load_cycles", "1"),
        ],
    ),
    Variant(
        "array: tiles of one input",
        "tiles-4",
        ARRAY,
        &[
            ("mac_rows", "64"),
            ("mac_columns", "1"),
            ("mac_arrays", "16"),
            ("tile_load_cycles", "1"),
        ],
    ),
    Variant(
        "array: accumulators stay",
        "tiles-4",
        ARRAY,
        &[("dataflow", "output-stationary")],
    ),
    Variant(
        "front, unpacking: 8 latents a cycle",
        "tiles-4",
        FRONT,
        &[("unpack_lanes", "8")],
    ),
    Variant(
        "front, memory: 1 byte a cycle",
        "tiles-4",
        FRONT,
        &[("memory_bytes_per_cycle", "1")],
    ),
    Variant(
        "front, memory: 1 byte a cycle",
        "linear",
        FRONT,
        &[("memory_bytes_per_cycle", "1")],
    ),
    Variant(
        "front, memory: 1 byte a cycle, 1 MiB of cache",
        "tiles-4",
        FRONT,
        &[("memory_bytes_per_cycle", "1"), ("cache_sets", "4096")],
    ),
    Variant(
        "front, no cache: lines of 16 bytes",
        "tiles-4",
        FRONT,
        &[
            ("cache", "none"),
            ("line_bytes", "16"),
            ("burst_bytes", "16"),
            ("memory_bytes_per_cycle", "8"),
        ],
    ),
    Variant(
        "front, no cache: lines of 16 bytes",
        "linear",
        FRONT,
        &[
            ("cache", "none"),
            ("line_bytes", "16"),
            ("burst_bytes", "16"),
            ("memory_bytes_per_cycle", "8"),
        ],
    ),
    Variant(
        "front, no cache: lines of 64 bytes",
        "tiles-4",
        FRONT,
        &[("cache", "none"), ("memory_bytes_per_cycle", "8")],
    ),
    Variant(
        "front, no cache: lines of 64 bytes",
        "linear",
        FRONT,
        &[("cache", "none"), ("memory_bytes_per_cycle", "8")],
    ),
    Variant(
        "front, no cache: lines of 128 bytes",
        "tiles-4",
        FRONT,
        &[
            ("cache", "none"),
            ("line_bytes", "128"),
            ("memory_bytes_per_cycle", "8"),
        ],
    ),
    Variant(
        "front, tags: 1 line of 16 bytes a cycle",
        "tiles-4",
        FRONT,
        &[
            ("cache_banks", "1"),
            ("line_bytes", "16"),
            ("memory_bytes_per_cycle", "1024"),
        ],
    ),
    Variant(
        "front, tags: 1 line of 16 bytes a cycle",
        "linear",
        FRONT,
        &[
            ("cache_banks", "1"),
            ("line_bytes", "16"),
            ("memory_bytes_per_cycle", "1024"),
        ],
    ),
    Variant(
        "front, tags: 1 line of 32 bytes a cycle",
        "tiles-4",
        FRONT,
        &[
            ("cache_banks", "1"),
            ("line_bytes", "32"),
            ("memory_bytes_per_cycle", "1024"),
        ],
    ),
    Variant(
        "front, latency: 4 miss registers",
        "tiles-4",
        FRONT,
        &[("mshrs", "4")],
    ),
    Variant(
        "both: 48 texels at once",
        "tiles-4",
        BOTH,
        &[("mac_columns", "48"), ("batch_texels", "48")],
    ),
    Variant(
        "both: 56 texels at once",
        "tiles-4",
        BOTH,
        &[("mac_columns", "56"), ("batch_texels", "56")],
    ),
    Variant(
        "both: 64 texels at once",
        "tiles-4",
        BOTH,
        &[("mac_columns", "64"), ("batch_texels", "64")],
    ),
    Variant(
        "both: 80 texels at once",
        "linear",
        BOTH,
        &[("mac_columns", "80"), ("batch_texels", "80")],
    ),
    Variant(
        "both: 84 texels at once",
        "linear",
        BOTH,
        &[("mac_columns", "84"), ("batch_texels", "84")],
    ),
    Variant(
        "both: 88 texels at once",
        "linear",
        BOTH,
        &[("mac_columns", "88"), ("batch_texels", "88")],
    ),
];

/// A set in a profile's shape, with the program for a layout.
fn set(preset: &Preset, layout: Layout) -> Result<(Asset, Program), Box<dyn Error + Send + Sync>> {
    let [width, height] = TEXELS;
    let spec = Spec::of_preset(preset, width, height, CHANNELS, 1, SpecPrecision::Fp16);
    let asset = synthetic::asset(&spec, 1)?;
    let program = Program::compile(&asset, layout);
    Ok((asset, program))
}

fn main() -> Result<(), Box<dyn Error + Send + Sync>> {
    let document = std::fs::read_to_string(DOCUMENT)?;
    let (before, _, after) = parts(&document).ok_or("the document has no place for the table")?;
    std::fs::write(
        DOCUMENT,
        format!("{before}{BEGIN}\n{}\n{END}{after}", table()?),
    )?;
    Ok(())
}

/// What stands before the table, the table, and what stands after it.
pub(crate) fn parts(document: &str) -> Option<(&str, &str, &str)> {
    let (before, rest) = document.split_once(BEGIN)?;
    let (table, after) = rest.split_once(END)?;
    Some((before, table.trim(), after))
}

/// The table, in Markdown.
pub(crate) fn table() -> Result<String, Box<dyn Error + Send + Sync>> {
    let presets: Vec<Preset> = PROFILES
        .iter()
        .filter_map(|(name, _)| Preset::by_name(name))
        .collect();
    let layouts = [Layout::TILED, Layout::LINEAR];
    let pairs: Vec<(Layout, Preset)> = layouts
        .iter()
        .flat_map(|&l| presets.iter().map(move |&p| (l, p)))
        .collect();
    let sets = pairs
        .par_iter()
        .map(|(layout, preset)| set(preset, *layout))
        .collect::<Result<Vec<_>, _>>()?;
    let sampler = Sampler {
        filter: Filter::Point,
        mip_filter: MipFilter::Base,
        ..Sampler::default()
    };
    let sampled = [Sampled::new(
        sets[0].0.shape.clone(),
        sampler,
        Profile::NORMATIVE,
    )?];
    let stream = match ACCESS.parse()? {
        AccessSpec::Texels(spec) => Stream::texels(&spec, &sampled)?,
        AccessSpec::Scene(spec) => Stream::scene(&spec, SCREEN, &sampled, Interleave::QUADS)?,
        AccessSpec::File(path) => {
            return Err(format!("{} is no generated stream", path.display()).into());
        }
    };
    let mut rows = vec![
        "| console with | unit | layout | 0.2 | 1.0 | 0.5 | 2.25 | relative to 0.2 | order | rises | 0.5 fits | 2.25 fits | most cycles |".to_owned(),
        "|---|---|---|--:|--:|--:|--:|---|---|---|---|---|---|".to_owned(),
        row("published, milliseconds", "RTX 4090", "", PROFILES.map(|p| p.1), ""),
    ];
    let made = VARIANTS
        .par_iter()
        .map(|Variant(what, layout, Group(_, first), changes)| {
            let unit = Unit::console().with(first)?.with(changes)?;
            let layout: Layout = layout.parse()?;
            let first = layouts.iter().position(|l| *l == layout).unwrap_or(0) * presets.len();
            let timings: Vec<Timing> = sets[first..first + presets.len()]
                .iter()
                .map(|(asset, program)| {
                    let materials = [Material::new("set", asset, program)];
                    let run = time::simulate(&unit, &materials, &mut stream.demands(), &mut ());
                    run.unwrap_or_else(|never| match never {})
                })
                .collect();
            let times = [0, 1, 2, 3].map(|p| timings[p].cycles as f64 / timings[p].pixels as f64);
            Ok(row(
                what,
                &unit.hash(),
                &layout.to_string(),
                times,
                &most(&timings),
            ))
        })
        .collect::<Result<Vec<String>, Box<dyn Error + Send + Sync>>>()?;
    rows.extend(made);
    rows.push(
        "\nThe units are the console unit (".to_owned()
            + &Unit::console().identity()
            + ") with the changes of their rows, made after those of the group that their names begin with (`array`, `front`, `both`):\n",
    );
    let mut items = Vec::new();
    for Variant(_, _, Group(name, changes), _) in &VARIANTS {
        items.push(item(name, changes));
    }
    for Variant(what, _, _, changes) in &VARIANTS {
        items.push(item(what, changes));
    }
    // Units with two layouts, and the group and the unit of nothing.
    items.retain(|item| !item.is_empty());
    let mut seen = BTreeSet::new();
    items.retain(|item| seen.insert(item.clone()));
    rows.extend(items);
    Ok(rows.join("\n"))
}

/// Bounds of a quotient of two differences of published times, whose last digits are rounded.
fn published(numerator: usize) -> (f64, f64) {
    let difference = |profile: usize| PROFILES[profile].1 - PROFILES[0].1;
    let (over, under) = (difference(numerator), difference(1));
    let both = 2.0 * ROUNDING;
    (
        (over - both) / (under + both),
        (over + both) / (under - both),
    )
}

/// A row of the table: times of the profiles in the order of [`PROFILES`], in any unit. They are
/// ordered if they are as printed.
fn row(what: &str, unit: &str, layout: &str, times: [f64; 4], most: &str) -> String {
    let rise = |profile: usize| times[profile] - times[0];
    let [second, third] = [2, 3].map(|profile| rise(profile) / rise(1));
    let hundredths = times.map(|time| (100.0 * time).round() as u64);
    let ordered = hundredths.is_sorted_by(|a, b| a < b);
    let cells = times.map(|time| format!("{time:.2}"));
    let fits = |found: f64, profile| {
        let (low, high) = published(profile);
        if ordered && (low..=high).contains(&found) {
            "yes"
        } else {
            "no"
        }
    };
    let rises = if ordered {
        format!("1 : {second:.2} : {third:.2}")
    } else {
        "–".to_owned()
    };
    let order = if ordered { "yes" } else { "no" };
    let relative: Vec<String> = times
        .iter()
        .skip(1)
        .map(|t| format!("{:.2}", t / times[0]))
        .collect();
    let cells = cells.join(" | ");
    format!(
        "| {what} | {unit} | {layout} | {cells} | 1 : {} | {order} | {rises} | {} | {} | {most} |",
        relative.join(" : "),
        fits(second, 2),
        fits(third, 3),
    )
}

/// An item of the list of changes; nothing without any.
fn item(what: &str, changes: Changes) -> String {
    if changes.is_empty() {
        return String::new();
    }
    let fields = changes
        .iter()
        .map(|(field, value)| format!("`{field}={value}`"));
    format!("- {what}: {}", fields.collect::<Vec<_>>().join(" "))
}

/// The cause of most cycles of each profile, in the order of [`PROFILES`]; once where it is the same
/// for all.
fn most(timings: &[Timing]) -> String {
    let cause = |timing: &Timing| {
        // The last of the largest is the first in the ledger's order.
        let largest = timing.ledger.entries().rev().max_by_key(|entry| entry.1);
        largest.map_or("", |entry| entry.0.name())
    };
    let mut names: Vec<&str> = timings.iter().map(cause).collect();
    if names.iter().all(|name| *name == names[0]) {
        names.truncate(1);
    }
    names.join(", ")
}
