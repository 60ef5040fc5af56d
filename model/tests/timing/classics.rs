//! What the literature on texture caches found, on plain textures: a control of the front end.
//!
//! Hakura and Gupta 1997 (ISCA, "The design and analysis of a cache architecture for texture mapping"):
//! working sets of at most 16 KiB where textures are stored in blocks and pixels come in tiles, and 3
//! to 15 times less bandwidth than without a cache. Igehy, Eldridge and Proudfoot 1998 (Graphics
//! Hardware, "Prefetching in a texture cache architecture"): with a FIFO of fragments between tags and
//! data at least 97 % of the speed behind a memory of no latency. Their scenes are not to be had; these
//! are others, so what is reproduced is the shape.

use crate::any::changed;
use crate::fixture::{Built, Recipe, materials};
use ntmu_isa::profile::Profile;
use ntmu_isa::sampler::Sampler;
use ntmu_model::control::Order;
use ntmu_model::sampler::Sampled;
use ntmu_model::stream::{AccessSpec, Interleave, Stream};
use ntmu_model::time::{Timing, Unit, simulate_behind};

/// What is seen: magnified and minified, along the texture and across it, near and far.
const SCENES: [&str; 5] = [
    "quad:scale=0.7",
    "quad:scale=1.5",
    "plane:pitch=10",
    "plane:pitch=40",
    "sphere:distance=1.5",
];

/// The run of a unit for a scene of trilinear samples, `side` pixels square; measured behind the first
/// eighth of them.
pub(crate) fn run(unit: &Unit, built: &[Built], scene: &str, order: &str, side: u32) -> Timing {
    let sampled = |built: &Built| {
        let shape = built.shape().clone();
        Sampled::new(shape, Sampler::default(), Profile::NORMATIVE).unwrap()
    };
    let sampled: Vec<Sampled> = built.iter().map(sampled).collect();
    let AccessSpec::Scene(spec) = format!("{scene},order={order}").parse().unwrap() else {
        panic!("{scene} is no scene");
    };
    let stream = Stream::scene(&spec, [side; 2], &sampled, Interleave::QUADS).unwrap();
    let warm_up = u64::from(side * side / 8);
    simulate_behind(unit, &materials(built), &mut stream.demands(), warm_up).unwrap()
}

/// The unit of the papers: a pixel a cycle, whose eight texels are looked up at once; nothing behind
/// the corner FIFO ever waits.
fn papers(changes: &[(&str, u32)]) -> Unit {
    let base = [
        ("requests_per_cycle", 1),
        ("quad_pixels", 1),
        ("coalesced_texels", 8),
        ("request_queue_texels", 64),
        ("address_generators", 1024),
        ("cache_banks", 1),
        ("lookups_per_bank", 64),
        ("hit_latency_cycles", 0),
        ("mshrs", 512),
        ("level2_sets", 0),
        ("level2_latency_cycles", 0),
        ("unpack_lanes", 65_536),
        ("batch_texels", 8),
        ("batches_in_flight", 1),
        ("filter_lanes", 65_536),
        ("filter_depth_cycles", 0),
        ("output_queue_pixels", 1024),
        ("output_channels_per_cycle", 65_536),
    ];
    let changes: Vec<(&str, u32)> = base.into_iter().chain(changes.iter().copied()).collect();
    changed(&Unit::desktop(), &changes)
}

fn plain(order: Order) -> [Built; 1] {
    [Recipe::Plain(1024, 1, order).build()]
}

/// Of each scene: the run, and how often a line is fetched on average of those that are fetched.
fn fetched(order: Order, pixels: &str, kibibytes: u32) -> Vec<(Timing, f64)> {
    let built = plain(order);
    // Lines of 128 bytes in two ways.
    let lines = [
        ("line_bytes", 128),
        ("cache_ways", 2),
        ("cache_sets", 4 * kibibytes),
    ];
    let unit = papers(&lines);
    let of = |scene: &&str| {
        let timing = run(&unit, &built, scene, pixels, 256);
        let again = timing.fetched_lines as f64 / timing.distinct_lines as f64;
        (timing, again)
    };
    SCENES.iter().map(of).collect()
}

fn most(scenes: &[(Timing, f64)]) -> f64 {
    scenes.iter().map(|scene| scene.1).fold(0.0, f64::max)
}

const BLOCKED: Order = Order::Blocked { side: 8 };

/// How often a line may be fetched, on average, by a cache that is said to hold the working set.
const HELD: f64 = 1.75;

#[test]
fn the_working_set_of_plain_textures_is_16_kib_in_blocks_and_tiles_and_more_without() {
    let blocked = fetched(BLOCKED, "tiles:8", 16);
    assert!(most(&blocked) <= HELD, "{}", most(&blocked));
    // The knee: a cache of a quarter fetches lines more than three times.
    let quarter = most(&fetched(BLOCKED, "tiles:8", 4));
    assert!(quarter > 3.0, "{quarter}");
    // In rows of texels the worst scene needs more, in rows of pixels and in tiles.
    for pixels in ["raster", "tiles:8"] {
        let rows = most(&fetched(Order::Rows, pixels, 16));
        assert!(rows > 2.0, "{pixels}: {rows}");
    }
    // Three to fifteen times less bandwidth than without a cache, over all scenes.
    let texels: u64 = blocked.iter().map(|(timing, _)| 4 * timing.texels).sum();
    let bytes: u64 = blocked.iter().map(|(timing, _)| timing.latent_bytes).sum();
    assert!(
        (3 * bytes..=15 * bytes).contains(&texels),
        "{texels} / {bytes}"
    );
}

/// Bytes that memory delivers in a cycle: enough for each of the scenes at a pixel a cycle.
const BANDWIDTH: u32 = 16;

#[test]
fn a_deep_fragment_fifo_hides_the_latency_of_memory_and_a_shallow_one_does_not() {
    let textures = [
        [Recipe::Plain(1024, 1, Order::Blocked { side: 4 }).build()],
        [Recipe::Bc7(1024, 1, Order::Blocked { side: 2 }).build()],
    ];
    for built in &textures {
        for scene in ["quad:scale=1.5", "plane:pitch=40", "sphere:distance=1.5"] {
            let measured = |latency: u32, pixels: u32| {
                let unit = papers(&[
                    ("line_bytes", 64),
                    ("cache_ways", 2),
                    ("cache_sets", 128),
                    ("memory_bytes_per_cycle", BANDWIDTH),
                    ("memory_latency_cycles", latency),
                    ("corner_fifo_texels", 8 * pixels),
                ]);
                run(&unit, built, scene, "tiles:8", 128).measured
            };
            let none = measured(0, 1 << 17);
            for latency in [50, 250, 500] {
                // Little's law: as many pixels wait as come in while a line is under way.
                let waiting = (u64::from(latency) * none.pixels).div_ceil(none.cycles) as u32;
                let share = |pixels| {
                    let cycles = measured(latency, pixels).cycles;
                    none.cycles as f64 / cycles as f64
                };
                let (deep, shallow) = (share(2 * waiting), share(waiting.div_ceil(4)));
                let context = format!("{scene}, {latency} cycles: {deep}, {shallow}");
                assert!(deep >= 0.97, "{context}");
                assert!(shallow < 0.97, "{context}");
            }
        }
    }
}
