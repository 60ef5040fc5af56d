//! Grids that are a pyramid.

use super::by_isa::corners;
use super::{resumed, run, small, source, stopped_at, usual};
use crate::batch::all_texels;
use crate::engine::{Engine, View};
use crate::evaluate::evaluate;
use crate::export::shape_of;
use crate::latents::Rounding;
use crate::model::{Ground, Model};
use crate::network::Network;
use crate::sampler::{Numbers, Texel, Window};
use crate::{Address, GridSampling, Preset, Pyramid, Snap, TrainConfig, TrainError};
use ntmu_isa::position::AxisPosition;
use ntmu_isa::shape::Shape;
use std::collections::BTreeSet;

fn pyramids() -> [Pyramid; 5] {
    [
        Pyramid::SINGLE,
        Pyramid::NTC,
        Pyramid::EVERY_MIP,
        Pyramid::new(2, 1).unwrap(),
        Pyramid::new(1, 1).unwrap(),
    ]
}

/// Gradients of the latents, in units of their codes, of the loss over these texels with rounded
/// latents and the network in reals.
fn gradients(ground: &Ground<'_>, model: &mut Model, texels: &[Texel]) -> [Vec<f32>; 2] {
    let channels = ground.texels.channels;
    let mut engine = Engine::new(&ground.topology, texels.len(), channels);
    engine.batch.texels.copy_from_slice(texels);
    for latents in &mut model.latents {
        latents.show(Rounding::Nearest);
    }
    let network = Network::real(&ground.topology, &model.parameters, &ground.low);
    let windows = Window::whole(&ground.positions);
    let embedding = ground.embedding(Numbers::Real);
    engine.step(View {
        network: &network,
        embedding,
        positions: &ground.positions,
        windows: &windows,
        seen: [&model.latents[0].seen, &model.latents[1].seen],
        texels: &ground.texels,
    });
    let mut out = [0, 1].map(|g: usize| vec![0.0; model.latents[g].values.len()]);
    let [g0, g1] = &mut out;
    engine.scatter(embedding, [g0, g1]);
    for (gradient, unit) in out.iter_mut().zip(embedding.latent_unit()) {
        for g in gradient {
            *g *= unit;
        }
    }
    out
}

/// The mean squared error of each mip with rounded latents and the network in reals.
fn errors(ground: &Ground<'_>, model: &mut Model) -> Vec<f64> {
    for latents in &mut model.latents {
        latents.show(Rounding::Nearest);
    }
    let network = Network::real(&ground.topology, &model.parameters, &ground.low);
    let windows = Window::whole(&ground.positions);
    let errors = evaluate(
        &ground.topology,
        None,
        View {
            network: &network,
            embedding: ground.embedding(Numbers::Real),
            positions: &ground.positions,
            windows: &windows,
            seen: [&model.latents[0].seen, &model.latents[1].seen],
            texels: &ground.texels,
        },
    );
    let mips = 0..ground.texels.sizes.len();
    mips.map(|mip| errors.mip(mip)).collect()
}

/// What the rounding of floats may leave of a difference, as a share of the largest gradient of a
/// level. It leaves some 10⁻⁵; a wrong corner, weight or level is an error of the order of 1.
const ROUNDING: f64 = 1e-3;

/// How often each texel of a mip of a 64² set is in the batch: together 8 · 768 texels.
const TIMES: [usize; 7] = [1, 1, 2, 4, 8, 16, 64];

/// A network that is linear, with outputs inside their range, so that the loss is a parabola in
/// every latent and a difference of two of its values is its derivative, whatever the distance.
fn make_linear(ground: &Ground<'_>, model: &mut Model) {
    let [first, last] = ground.topology.layers[..] else {
        panic!("two layers");
    };
    for weight in &mut model.parameters[first.weights_at..first.bias_at] {
        *weight *= 0.25;
    }
    for bias in &mut model.parameters[first.bias_at..first.bias_at + first.outputs] {
        *bias = 4.0;
    }
    for weight in &mut model.parameters[last.weights_at..last.bias_at] {
        *weight *= 0.25;
    }
    for o in 0..last.outputs {
        let weights = (0..last.inputs).map(|k| last.weights_at + k * last.columns() + o);
        let sum: f32 = weights.map(|at| model.parameters[at]).sum();
        model.parameters[last.bias_at + o] = 0.5 - 4.0 * sum;
    }
}

#[test]
fn the_gradient_of_a_latent_of_any_level_is_the_difference_of_the_loss() {
    let source = source(64, 64, 7);
    for (pyramid, address) in pyramids().into_iter().zip([
        Address::Wrap,
        Address::Mirror,
        Address::Clamp,
        Address::Wrap,
        Address::Clamp,
    ]) {
        let config = TrainConfig {
            pyramid,
            address,
            hidden: vec![16],
            residual_blocks: 0,
            ..small()
        };
        let ground = Ground::new(&config, &source).unwrap();
        let mut model = Model::new(&ground).unwrap();
        make_linear(&ground, &mut model);
        for latents in &mut model.latents {
            for value in &mut latents.values {
                *value = value.round();
            }
        }
        let sizes = &ground.texels.sizes;
        let texels: Vec<Texel> = all_texels(sizes)
            .flat_map(|t| std::iter::repeat_n(t, TIMES[usize::from(t.mip)]))
            .collect();
        let share = |mip: usize| {
            let (w, h) = sizes[mip];
            (w as usize * h as usize * TIMES[mip]) as f64 / texels.len() as f64
        };
        let analytic = gradients(&ground, &mut model, &texels);
        let loss = |model: &mut Model| -> f64 {
            let errors = errors(&ground, model);
            errors.iter().enumerate().map(|(m, e)| share(m) * e).sum()
        };
        for (g, analytic) in analytic.iter().enumerate() {
            let channels = usize::from(config.grids[g].channels);
            for level in &ground.positions.levels[g] {
                let of_level = level.base * channels..(level.base + level.cells()) * channels;
                let largest = analytic[of_level.clone()]
                    .iter()
                    .fold(0.0_f32, |a, b| a.max(b.abs()));
                assert!(largest > 0.0, "{pyramid:?} grid {g}");
                // All of a coarse level, some of a fine one.
                for at in of_level.clone().step_by(of_level.len().div_ceil(40)) {
                    let value = model.latents[g].values[at];
                    let (low, high) = model.latents[g].limits();
                    let mut at_value = |value: f32| {
                        model.latents[g].values[at] = value;
                        loss(&mut model)
                    };
                    // Newton's divided differences of a parabola.
                    let [y0, y1, y2] = [low, 0.0, high].map(&mut at_value);
                    at_value(value);
                    let [low, high, x] = [low, high, value].map(f64::from);
                    let (first, second) = ((y1 - y0) / (0.0 - low), (y2 - y1) / high);
                    let difference = first + (second - first) / (high - low) * (2.0 * x - low);
                    let error = (difference - f64::from(analytic[at])).abs();
                    assert!(
                        error <= ROUNDING * f64::from(largest),
                        "{pyramid:?} grid {g} latent {at}: {} is not {difference}",
                        analytic[at]
                    );
                }
            }
        }
    }
}

/// The latents of a grid that isa's formulas give the texels of a mip, as far as they count.
fn reached(shape: &Shape, grid: usize, mip: u8) -> BTreeSet<usize> {
    let (width, height) = shape.mip_size(mip);
    let channels = usize::from(shape.grids[grid].channels);
    let mut out = BTreeSet::new();
    for (x, y) in (0..height).flat_map(|y| (0..width).map(move |x| (x, y))) {
        let (starts, [px, py]) = corners(shape, grid, x, y, mip);
        for (corner, start) in starts.into_iter().enumerate() {
            // A second corner of weight zero is read and counts for nothing.
            let weighs = (corner & 1 == 0 || px.phase > 0) && (corner < 2 || py.phase > 0);
            let counts = match GridSampling::from(shape.grids[grid].sampling) {
                GridSampling::Corners => true,
                GridSampling::Interpolated => weighs,
            };
            if counts {
                out.extend(start..start + channels);
            }
        }
    }
    out
}

#[test]
fn a_latent_gets_gradient_from_exactly_the_mips_that_read_it() {
    for (width, height, mips) in [(64, 64, 7), (45, 70, 7)] {
        let source = source(width, height, mips);
        for (pyramid, (address, snap)) in pyramids().into_iter().flat_map(|p| {
            let rules = [
                (Address::Wrap, Snap::Stride),
                (Address::Mirror, Snap::Cell),
                (Address::Clamp, Snap::Stride),
            ];
            rules.map(|r| (p, r))
        }) {
            let config = TrainConfig {
                pyramid,
                address,
                snap,
                ..small()
            };
            let shape = shape_of(&config, &source).unwrap();
            let ground = Ground::new(&config, &source).unwrap();
            let sizes = &ground.texels.sizes;
            let mut engine = Engine::new(&ground.topology, 6144, ground.texels.channels);
            let mut model = Model::new(&ground).unwrap();
            let latents = model.latents.each_mut().map(|l| {
                l.show(Rounding::Nearest);
                &*l.seen
            });
            let network = Network::real(&ground.topology, &model.parameters, &ground.low);
            let windows = Window::whole(&ground.positions);
            let embedding = ground.embedding(Numbers::Real);
            let mut of_levels = [0, 1].map(|_| vec![BTreeSet::new(); shape.level_count().into()]);
            for mip in 0..mips as u8 {
                let texels = all_texels(sizes).filter(|t| t.mip == mip);
                let texels: Vec<Texel> = texels.collect();
                for (place, texel) in engine.batch.texels.iter_mut().zip(texels.iter().cycle()) {
                    *place = *texel;
                }
                engine.step(View {
                    network: &network,
                    embedding,
                    positions: &ground.positions,
                    windows: &windows,
                    seen: latents,
                    texels: &ground.texels,
                });
                // Whatever the network says: every input pulls alike.
                engine.batch.gradient.fill(1.0);
                let mut gradients = [0, 1].map(|g: usize| vec![0.0_f32; latents[g].len()]);
                let [g0, g1] = &mut gradients;
                engine.scatter(embedding, [g0, g1]);
                let level = pyramid.level_of(mip);
                for g in 0..2 {
                    let found: BTreeSet<usize> = (0..gradients[g].len())
                        .filter(|&at| gradients[g][at] != 0.0)
                        .collect();
                    assert_eq!(found, reached(&shape, g, mip), "{pyramid:?} {g} mip {mip}");
                    let base = shape.level_base(g, level) as usize;
                    let end = shape.level_base(g, level + 1) as usize;
                    assert!(found.iter().all(|at| (base..end).contains(at)));
                    of_levels[g][usize::from(level)].extend(found);
                }
            }
            if (width, height) == (64, 64) && address == Address::Wrap {
                for (g, levels) in of_levels.iter().enumerate() {
                    for (level, found) in levels.iter().enumerate() {
                        assert_eq!(
                            found.len() as u64 * idle_factor(&shape, g, level as u8),
                            shape.level_latents(g, level as u8),
                            "{pyramid:?} {g} level {level}"
                        );
                    }
                }
            }
        }
    }
}

/// The latents of a level over those that any mip reads, for sizes that are powers of two: the finest
/// mip of a level strides through it where its texels are wider than the level's cells.
fn idle_factor(shape: &Shape, grid: usize, level: u8) -> u64 {
    let finest = (0..shape.mip_count).find(|&m| shape.pyramid.level_of(m) == level);
    let as_mip = shape.pyramid.mip_in_level(finest.unwrap());
    let scale_log2 = shape.grids[grid].scale_log2;
    let stride = AxisPosition::of(0, as_mip, scale_log2, shape.snap).stride;
    let (width, height) = shape.level_size(grid, level);
    u64::from(stride.min(width) * stride.min(height))
}

#[test]
fn ntc_reads_every_latent_but_those_of_coarse_levels_at_half_resolution() {
    let source = source(64, 64, 7);
    for (name, factors) in [
        ("ntc-0.2", [1, 1]),
        ("ntc-0.5", [1, 1]),
        ("ntc-1.0", [4, 1]),
        ("ntc-2.25", [4, 1]),
    ] {
        let config = Preset::by_name(name).unwrap().config();
        let shape = shape_of(&config, &source).unwrap();
        assert_eq!(shape.pyramid, Pyramid::NTC);
        assert_eq!([0, 1].map(|g| idle_factor(&shape, g, 0)), [1, 1]);
        assert_eq!([0, 1].map(|g| idle_factor(&shape, g, 1)), factors);
    }
}

fn of_every_stage(pyramid: Pyramid) -> TrainConfig {
    TrainConfig {
        pyramid,
        plan: Some(usual([20, 40, 40])),
        ..small()
    }
}

#[test]
fn a_pyramid_stopped_in_every_stage_and_resumed_equals_the_uninterrupted_run() {
    let source = source(80, 72, 6);
    for pyramid in [Pyramid::NTC, Pyramid::EVERY_MIP] {
        let config = of_every_stage(pyramid);
        let whole = run(&source, &config).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.checkpoint");
        for at in [20, 40, 80] {
            let error = stopped_at(&source, &config, &path, at, true);
            assert!(matches!(error, TrainError::Stopped { .. }), "{error}");
        }
        let resumed = resumed(&source, &config, &path).unwrap();
        assert_eq!(resumed.asset, whole.asset);
    }
}

#[test]
fn a_pyramid_has_the_same_bytes_on_any_number_of_threads() {
    let source = source(80, 72, 6);
    let config = of_every_stage(Pyramid::EVERY_MIP);
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads);
        let trained = pool.build().unwrap().install(|| run(&source, &config));
        trained.unwrap().asset
    };
    let one = on(1);
    assert_eq!(one, on(2));
    assert_eq!(one, on(5));
    assert_eq!(one.shape.pyramid, Pyramid::EVERY_MIP);
    assert_eq!(one.shape.level_count(), 3);
}
