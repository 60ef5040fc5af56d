//! Where neural latents depart from plain textures: the tables of `docs/src/belief.md`.

use crate::any::changed;
use crate::classics::run;
use crate::fixture::{Built, Recipe, Sketch};
use ntmu_isa::layout::Layout;
use ntmu_model::control::Order;
use ntmu_model::time::Unit;
use std::fmt::Write as _;

const PAGE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/src/belief.md");
/// About a texel a pixel, and about eight along each axis.
const SCENES: [&str; 2] = ["quad:scale=1.5", "plane:pitch=40"];
const SIZE: u32 = 1024;
const SIDE: u32 = 128;

/// A set of nine channels in each form.
fn sets() -> [(&'static str, Built); 4] {
    let neural = |sketch| Recipe::Neural(sketch, Layout::TILED).build();
    [
        (
            "RGBA8, 3 maps",
            Recipe::Plain(SIZE, 3, Order::Blocked { side: 8 }).build(),
        ),
        (
            "BC7, 3 maps",
            Recipe::Bc7(SIZE, 3, Order::Blocked { side: 2 }).build(),
        ),
        ("CNTC-16, int8", neural(Sketch::cntc_16(SIZE))),
        (
            "its grids, one layer of 16",
            neural(Sketch::plain(SIZE, [8, 16], &[16])),
        ),
    ]
}

/// Kibibytes of cache from which a line is fetched at most 1.75 times on average.
fn working_set(built: &[Built], scene: &str) -> u32 {
    let holds = |kibibytes: &u32| {
        // Lines of 64 bytes in four ways, all looked up at once: only the number of sets changes.
        let changes = [
            ("line_bytes", 64),
            ("cache_ways", 4),
            ("cache_banks", 1),
            ("lookups_per_bank", 64),
            ("cache_sets", 4 * kibibytes),
            ("level2_sets", 0),
            ("level2_latency_cycles", 0),
        ];
        let unit = changed(&Unit::desktop(), &changes);
        let timing = run(&unit, built, scene, "tiles:8", SIDE);
        100 * timing.fetched_lines <= 175 * timing.distinct_lines
    };
    let sizes = [1, 2, 4, 8, 16, 32, 64, 128, 256, 512];
    sizes.into_iter().find(holds).unwrap_or(1024)
}

/// Texels of the smallest corner FIFO, a power of two, that reaches 97 % of the endless one without
/// latency behind a latency of 400 cycles; and how many pixels a thousand cycles answer without.
fn depth(built: &[Built], scene: &str) -> (u32, u64) {
    let measured = |latency: u32, texels: u32| {
        let changes = [
            ("level2_sets", 0),
            ("level2_latency_cycles", 0),
            ("memory_latency_cycles", latency),
            ("memory_bytes_per_cycle", 64),
            ("mshrs", 512),
            ("corner_fifo_texels", texels),
        ];
        let unit = changed(&Unit::desktop(), &changes);
        run(&unit, built, scene, "tiles:8", SIDE).measured
    };
    let none = measured(0, 1 << 20);
    let reaches = |texels: &u32| 97 * measured(400, *texels).cycles <= 100 * none.cycles;
    let depths = (2..20).map(|log2| 1 << log2);
    let least = depths.into_iter().find(reaches).unwrap_or(1 << 20);
    (least, 1000 * none.pixels / none.cycles)
}

fn footprint() -> String {
    let mut table = String::from(
        "| scene | set | bytes in memory per texel | bytes fetched per pixel | working set, KiB | pixels per 1000 cycles | FIFO for 97 %, texels |\n\
         |---|---|---:|---:|---:|---:|---:|\n",
    );
    let sets = sets().map(|(name, built)| (name, [built]));
    for scene in SCENES {
        for (name, built) in &sets {
            let bytes = built[0].material().addresses().bytes();
            let memory = bytes as f64 / f64::from(SIZE * SIZE);
            let timing = run(&Unit::desktop(), built, scene, "tiles:8", SIDE);
            let fetched = timing.latent_bytes as f64 / timing.pixels as f64;
            let (texels, rate) = depth(built, scene);
            let held = working_set(built, scene);
            writeln!(
                table,
                "| {scene} | {name} | {memory:.2} | {fetched:.2} | {held} | {rate} | {texels} |"
            )
            .unwrap();
        }
    }
    table
}

fn fills() -> String {
    let mut table = String::from(
        "| bins | weight SRAM, KiB | fills | latent bytes per pixel | parameter bytes per pixel | cycles per pixel |\n\
         |---:|---:|---:|---:|---:|---:|\n",
    );
    let built = [0; 4].map(|_| Recipe::Neural(Sketch::cntc_16(SIZE), Layout::TILED).build());
    for (bins, kibibytes) in [(1, 64), (4, 64), (1, 256), (4, 256)] {
        let changes = [
            ("material_bins", bins),
            ("weight_sram_bytes", kibibytes << 10),
        ];
        let unit = changed(&Unit::desktop(), &changes);
        let timing = run(&unit, &built, SCENES[0], "tiles:8", SIDE);
        let each = |count: u64| count as f64 / timing.pixels as f64;
        let (latents, parameters) = (each(timing.latent_bytes), each(timing.weight_bytes));
        let (fills, cycles) = (timing.weight_fills, each(timing.cycles));
        writeln!(
            table,
            "| {bins} | {kibibytes} | {fills} | {latents:.2} | {parameters:.1} | {cycles:.1} |"
        )
        .unwrap();
    }
    table
}

/// The page with a table between its marks.
fn with_table(page: &str, name: &str, table: &str) -> String {
    let (begin, end) = (
        format!("<!-- {name} -->\n"),
        format!("<!-- end of {name} -->"),
    );
    let (before, rest) = page.split_once(&begin).unwrap();
    let (_, after) = rest.split_once(&end).unwrap();
    format!("{before}{begin}\n{table}\n{end}{after}")
}

/// `NTMU_BLESS=1` writes the tables instead.
#[test]
fn the_tables_of_the_page_are_what_the_model_says() {
    let page = std::fs::read_to_string(PAGE).unwrap();
    let made = with_table(&page, "footprint", &footprint());
    let made = with_table(&made, "fills", &fills());
    if std::env::var_os("NTMU_BLESS").is_some_and(|bless| bless == "1") {
        std::fs::write(PAGE, made).unwrap();
    } else {
        assert_eq!(page, made);
    }
}
