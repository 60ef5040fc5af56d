//! Random units, materials and demands.

use crate::fixture::{BYTES, Built, Hidden, Kind, Recipe, Sketch};
use ntmu_isa::activation::Activation;
use ntmu_isa::layout::Layout;
use ntmu_isa::profile::Profile;
use ntmu_isa::pyramid::Pyramid;
use ntmu_isa::rescale::Multiplier;
use ntmu_isa::sampler::{Filter, MipFilter, Order as Turns, Sampler};
use ntmu_model::control::Order;
use ntmu_model::sampler::Sampled;
use ntmu_model::stream::{AccessSpec, Interleave, Stream};
use ntmu_model::time::Unit;
use ntmu_model::time::choice::Replacement;
use ntmu_model::time::unit::{Configuration, FIELDS, Range};
use ntmu_model::{Demand, Demands, Place, Request};
use proptest::prelude::*;

/// The largest value that a random unit has in a field. Rates come in two sizes, so that every
/// stage gets to be the bottleneck.
fn ceiling(field: &str, is_wide: bool) -> u32 {
    match field {
        "requests_per_cycle" | "address_generators" | "output_channels_per_cycle" if !is_wide => 2,
        "unpack_lanes" | "interpolator_lanes" | "embed_lanes" | "requantizer_lanes"
        | "skip_lanes" | "filter_lanes" => [8, 2000][usize::from(is_wide)],
        "mac_rows" | "mac_columns" => [8, 100][usize::from(is_wide)],
        "cache_ways" | "lookups_per_bank" | "mac_arrays" | "batches_in_flight" | "wide_passes"
        | "half_passes" => 3,
        "mshrs" | "mac_depth_cycles" | "requantizer_depth_cycles" | "tile_load_cycles" => 9,
        "memory_latency_cycles" | "weight_latency_cycles" | "level2_latency_cycles" => 200,
        "weight_sram_bytes" => [400, 8192][usize::from(is_wide)],
        _ => 40,
    }
}

/// Any choices, any numbers that fit together; every other unit has the shortest queues that it
/// may have and a single miss register.
pub(crate) fn unit() -> impl Strategy<Value = Unit> {
    let raw = prop::collection::vec(any::<(u32, bool)>(), FIELDS.len());
    (raw, any::<bool>()).prop_map(|(raw, is_tight)| {
        let mut c = *Unit::mobile().configuration();
        for (field, (raw, is_wide)) in FIELDS.iter().zip(raw) {
            match field.range {
                Range::Number { low, high } => {
                    let high = ceiling(field.name, is_wide).clamp(low, high);
                    c.set(field.name, low + raw % (high - low + 1)).unwrap();
                }
                Range::Choice(names) => {
                    let name = names[raw as usize % names.len()];
                    c.choose(field.name, name).unwrap();
                }
            }
        }
        fit(&mut c, is_tight);
        Unit::new("random", c).unwrap()
    })
}

/// Makes the numbers fit together.
fn fit(c: &mut Configuration, is_tight: bool) {
    c.coalesced_texels = [1, 2, 4, 8][c.coalesced_texels as usize % 4];
    c.batch_texels = c.batch_texels.next_multiple_of(c.coalesced_texels);
    for power in [
        &mut c.line_bytes,
        &mut c.cache_sets,
        &mut c.cache_banks,
        &mut c.burst_bytes,
    ] {
        *power = power.next_power_of_two().min(64);
    }
    c.level2_sets = [0, 1, 8, 32][c.level2_sets as usize % 4];
    if c.level2_sets == 0 {
        c.level2_latency_cycles = 0;
    }
    if c.replacement == Replacement::TreePlru {
        c.cache_ways = c.cache_ways.next_power_of_two();
        c.level2_ways = c.level2_ways.next_power_of_two();
    }
    c.cache_banks = c.cache_banks.min(c.cache_sets);
    c.decoded_block_side = 1 << (c.decoded_block_side % 4);
    c.decoded_cache_blocks = [0, 1, 8][c.decoded_cache_blocks as usize % 3] * c.decoded_cache_ways;
    c.material_bins = c.material_bins % 4 + 1;
    if is_tight {
        c.request_queue_texels = c.coalesced_texels;
        c.corner_fifo_texels = c.coalesced_texels;
        c.output_queue_pixels = c.job_texels();
        c.mshrs = 1;
    }
    for queue in [&mut c.request_queue_texels, &mut c.corner_fifo_texels] {
        *queue = (*queue).max(c.coalesced_texels);
    }
    c.output_queue_pixels = c.output_queue_pixels.max(c.job_texels());
}

fn hidden() -> impl Strategy<Value = Hidden> {
    let integer = (
        prop_oneof![Just(4), Just(8)],
        prop_oneof![Just(4), Just(8), Just(9), Just(16)],
    );
    let integer = integer.prop_map(|(weight_bits, output_bits)| Kind::Integer {
        weight_bits,
        output_bits,
    });
    let kind = prop_oneof![3 => integer, 2 => Just(Kind::Half)];
    (kind, 1..40_u16, 0..5_u8).prop_map(|(kind, outputs, activation)| {
        let activation = match (activation, kind) {
            (0, _) | (4, Kind::Half) => Activation::Identity,
            (1, _) => Activation::Relu,
            (2, _) => Activation::Leaky { shift: 2 },
            (4, Kind::Integer { .. }) => Activation::Table,
            (_, _) => Activation::HardGelu {
                scale: match kind {
                    Kind::Integer { .. } => Multiplier::power_of_two(8),
                    Kind::Half => Multiplier::power_of_two(0),
                },
                is_clamped: outputs % 2 == 0,
            },
        };
        Hidden {
            kind,
            outputs,
            activation,
            adds: false,
        }
    })
}

fn sketch() -> impl Strategy<Value = Sketch> {
    let hidden = prop::collection::vec((hidden(), any::<bool>()), 0..4);
    let last = prop_oneof![Just(BYTES), Just(Kind::Half)];
    let pyramids = prop::sample::select(vec![
        Pyramid::SINGLE,
        Pyramid::SINGLE,
        Pyramid::NTC,
        Pyramid::EVERY_MIP,
    ]);
    let sizes = (0..=3_u8, 1..9_u16, pyramids);
    (sizes, hidden, last).prop_map(|((octaves, channels, pyramid), hidden, last)| {
        let mut layers: Vec<Hidden> = Vec::new();
        for (mut layer, adds) in hidden {
            if let (Some(before), true) = (layers.last(), adds) {
                // A skip path joins registers of one kind. Halves stay halves only up to an fp16
                // layer, and integers come from any layer before an integer one.
                if layer.kind != Kind::Half || before.kind == Kind::Half {
                    layer.outputs = before.outputs;
                    layer.adds = true;
                }
            }
            layers.push(layer);
        }
        Sketch {
            size: 64,
            // Equal grids, so that every layout is allowed.
            grid_channels: [5, 11],
            pyramid,
            octaves,
            hidden: layers,
            last,
            channels,
        }
    })
}

fn recipe() -> impl Strategy<Value = Recipe> {
    let order = prop::sample::select(vec![
        Order::Rows,
        Order::Blocked { side: 8 },
        Order::Morton { side: 4 },
    ]);
    let layout = prop::sample::select(Layout::named());
    prop_oneof![
        4 => (sketch(), layout).prop_map(|(sketch, layout)| Recipe::Neural(sketch, layout)),
        1 => (1..4_u16, order.clone()).prop_map(|(maps, order)| Recipe::Plain(64, maps, order)),
        1 => (1..4_u16, order).prop_map(|(maps, order)| Recipe::Bc7(64, maps, order)),
    ]
}

/// What is asked of some materials.
pub(crate) struct Asked {
    recipes: Vec<Recipe>,
    pub(crate) built: Vec<Built>,
    pub(crate) demands: Vec<Demand>,
}

/// A failure is read from its recipes; its demands may be many.
impl std::fmt::Debug for Asked {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let few = &self.demands[..self.demands.len().min(4)];
        f.debug_struct("Asked")
            .field("recipes", &self.recipes)
            .field("count", &self.demands.len())
            .field("demands", &few)
            .finish()
    }
}

/// Raw numbers of a pixel: its material, codes weighed beyond its places, and mips and places.
type RawPixel = (u8, u8, Vec<(u8, u16)>);

/// Pixels that need any texels of any material, in squares and out of them.
fn scattered(built: &[Built], raw: &[RawPixel]) -> Vec<Demand> {
    let mut demands = Vec::new();
    for (index, (material, weights, texels)) in raw.iter().enumerate() {
        let material = usize::from(*material) % built.len();
        let shape = built[material].shape();
        let mut places = Vec::new();
        for &(mip, at) in texels {
            let mip = mip % shape.mip_count;
            let (width, height) = shape.mip_size(mip);
            let (x, y) = (u32::from(at) % width, u32::from(at) / 256 % height);
            let place = Place::of(Request::new(shape, x, y, mip).unwrap());
            if !places.contains(&place) {
                places.push(place);
            }
        }
        let (quad, corner) = (index as u32 / 3, index as u32 % 3);
        demands.push(Demand {
            pixel: [2 * quad + corner % 2, corner / 2],
            material: material as u16,
            weights: u32::from(*weights) + places.len() as u32,
            places,
        });
    }
    demands
}

/// The pixels of a scene behind a sampler.
fn scene(built: &[Built], which: (u8, u8, u8), count: usize) -> Vec<Demand> {
    let (scene, sampler, interleave) = which;
    let standard = Sampler::default();
    let sampler = match sampler % 5 {
        0 => standard,
        1 => Sampler {
            filter: Filter::Point,
            mip_filter: MipFilter::Point,
            ..standard
        },
        2 => Sampler {
            mip_filter: MipFilter::Point,
            ..standard
        },
        3 => Sampler {
            max_anisotropy: 4,
            ..standard
        },
        _ => Sampler {
            order: Turns::FilterThenDecode,
            ..standard
        },
    };
    let sampled = |built: &Built| {
        let shape = built.shape().clone();
        Sampled::new(shape, sampler.clone(), Profile::NORMATIVE).unwrap()
    };
    let sampled: Vec<Sampled> = built.iter().map(sampled).collect();
    let scenes = [
        "quad:scale=1.5",
        "plane:pitch=20",
        "sphere:distance=1.6,order=zorder",
    ];
    let interleaves = ["quads", "tiles:4", "random:2:7"];
    let interleave: Interleave = interleaves[usize::from(interleave) % 3].parse().unwrap();
    let AccessSpec::Scene(spec) = scenes[usize::from(scene) % 3].parse().unwrap() else {
        panic!("no scene");
    };
    let stream = Stream::scene(&spec, [17, 16], &sampled, interleave).unwrap();
    all(&mut stream.demands(), count)
}

/// The first demands of a stream.
pub(crate) fn all(
    stream: &mut impl Demands<Error = std::convert::Infallible>,
    count: usize,
) -> Vec<Demand> {
    let (mut demands, mut demand) = (Vec::new(), Demand::default());
    while demands.len() < count && stream.advance(&mut demand).unwrap() {
        demands.push(demand.clone());
    }
    demands
}

/// One to `most` materials, and demands on them: scattered texels, or a scene's samples.
pub(crate) fn asked(most: usize) -> impl Strategy<Value = Asked> {
    let texels = prop::collection::vec(any::<(u8, u16)>(), 0..9);
    let pixels = prop::collection::vec((any::<u8>(), 0..2_u8, texels), 0..60);
    let seen = (any::<(u8, u8, u8)>(), 1..150_usize);
    let order = prop_oneof![
        pixels.prop_map(|pixels| (Some(pixels), None)),
        seen.prop_map(|seen| (None, Some(seen))),
    ];
    let recipes = prop::collection::vec(recipe(), 1..=most);
    (recipes, order).prop_map(|(recipes, order)| {
        let built: Vec<Built> = recipes.iter().map(Recipe::build).collect();
        let demands = match order {
            (Some(pixels), _) => scattered(&built, &pixels),
            (None, Some((which, count))) => scene(&built, which, count),
            (None, None) => Vec::new(),
        };
        Asked {
            recipes,
            built,
            demands,
        }
    })
}

/// The unit with some numbers changed.
pub(crate) fn changed(unit: &Unit, changes: &[(&str, u32)]) -> Unit {
    let mut configuration = *unit.configuration();
    for &(name, value) in changes {
        configuration.set(name, value).unwrap();
    }
    Unit::new("changed", configuration).unwrap()
}
