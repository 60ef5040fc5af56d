//! Crops and their latents, level by level.

use super::*;
use crate::choices::{Address, Pyramid};
use crate::config::{GridConfig, TrainConfig};
use crate::source::Source;
use ntmu_isa::shape::OutputFormat;

fn config(pyramid: Pyramid, address: Address) -> TrainConfig {
    let grid = |scale_log2| GridConfig {
        channels: 2,
        bits: 4,
        scale_log2,
    };
    TrainConfig {
        grids: [grid(1), grid(3)],
        pyramid,
        address,
        crop: 64,
        crops: 3,
        encoder_width: 4,
        hidden: vec![8],
        residual_blocks: 0,
        ..TrainConfig::default()
    }
}

/// An encoder stage.
fn stage(ground: &Ground<'_>) -> Stage {
    let plan = ground.config.usual_plan([1, 0, 0]);
    let config = TrainConfig {
        plan: Some(plan),
        ..ground.config.clone()
    };
    let stages = config.stages(&ground.texels.sizes);
    Stage {
        mips: Mips::Corners,
        ..stages.unwrap()[0]
    }
}

fn source(width: usize, height: usize, mips: usize) -> Source {
    let mips = (0..mips).map(|m| {
        let size = (1, (height >> m).max(1), (width >> m).max(1));
        // Away from the limits of the output, where an error may be cut off.
        let value = |(_, y, x)| 0.25 + ((3 * x + 5 * y) % 8) as f32 / 16.0;
        ndarray::Array3::from_shape_fn(size, value)
    });
    Source {
        name: "test".into(),
        mips: mips.collect(),
        outputs: vec![OutputFormat::Unorm8],
        maps: Vec::new(),
        mask: None,
    }
}

fn pyramids() -> [Pyramid; 5] {
    [
        Pyramid::SINGLE,
        Pyramid::NTC,
        Pyramid::EVERY_MIP,
        Pyramid::new(1, 1).unwrap(),
        Pyramid::new(3, 2).unwrap(),
    ]
}

/// The cell of its level at which a latent's window and place in it point.
fn cell(window: &Window, g: usize, latent: usize, channels: usize) -> [u32; 2] {
    let at = latent / channels - window.base[g];
    let [w, h] = window.size[g];
    let inside = [at as u32 % w, at as u32 / w];
    assert!(inside[1] < h);
    [0, 1].map(|axis| (window.origin[g][axis] + inside[axis]) % window.period[g][axis])
}

#[test]
fn a_crop_holds_the_cells_of_every_level_where_the_whole_set_has_them() {
    for (size, address) in [
        ((256, 256), Address::Wrap),
        ((256, 192), Address::Clamp),
        ((200, 320), Address::Wrap),
        ((64, 200), Address::Mirror),
    ] {
        let source = source(size.0, size.1, 6);
        for pyramid in pyramids() {
            let config = config(pyramid, address);
            let ground = Ground::new(&config, &source).unwrap();
            let levels = ground.positions.level_count();
            let embedding = ground.embedding(Numbers::Real);
            let whole = Window::whole(&ground.positions);
            let mut compared = vec![0; levels];
            for step in 0..20 {
                let crops = Crops::draw(&ground, &stage(&ground), step);
                let windows = crops.windows(&ground);
                let stream = Stream::new(1, Purpose::Batch, step);
                for index in 0..768 {
                    let texel = crops.texel(&ground, stream, index, 768);
                    let level = ground.positions.level_of(texel.mip);
                    let here = usize::from(texel.window) * levels + level;
                    let (in_crop, _) = embedding.corners(&ground.positions, &windows, texel);
                    let alone = Texel { window: 0, ..texel };
                    let (in_whole, _) = embedding.corners(&ground.positions, &whole, alone);
                    for (g, corner) in (0..2).flat_map(|g| (0..4).map(move |c| (g, c))) {
                        let expected = cell(&whole[level], g, in_whole[g][corner], 2);
                        let window = &windows[here];
                        let is_inside = (0..2).all(|axis| {
                            let period = window.period[g][axis];
                            let from = (expected[axis] + period - window.origin[g][axis]) % period;
                            from < window.size[g][axis]
                        });
                        let found = cell(window, g, in_crop[g][corner], 2);
                        if is_inside {
                            assert_eq!(found, expected, "{pyramid:?} {texel:?}");
                            compared[level] += 1;
                        }
                    }
                }
            }
            let trained = ground
                .positions
                .level_of(Crops::draw(&ground, &stage(&ground), 0).mips - 1);
            assert!(compared[..=trained].iter().all(|&n| n > 0), "{compared:?}");
        }
    }
}

#[test]
fn a_latent_is_the_average_of_the_positions_in_its_cell() {
    for (width, height) in [(256, 256), (200, 72), (9, 33)] {
        let source = source(width, height, 4);
        for pyramid in pyramids() {
            let config = config(pyramid, Address::Wrap);
            let ground = Ground::new(&config, &source).unwrap();
            let constructors = constructors(&ground);
            let windows = Window::whole(&ground.positions);
            let extent = [width, height].map(|n| n.div_ceil(POSITION as usize));
            for (g, constructors) in constructors.iter().enumerate() {
                // Piece by piece as one piece, margins left out.
                let mut shares = vec![0.0_f32; ground.positions.cells(g) * 2];
                let mut positions = vec![0_u32; shares.len()];
                for origin in [[0, 0], [0, 1], [1, 0], [1, 1]] {
                    // Four pieces, cut after the first row and column.
                    let inner = [0, 1].map(|axis: usize| {
                        if origin[axis] == 0 {
                            1
                        } else {
                            extent[axis] - 1
                        }
                    });
                    if inner.contains(&0) {
                        continue;
                    }
                    let piece = Piece {
                        tensor: (1, inner[1] + 4, inner[0] + 4),
                        margin: 2,
                        origin,
                        extent,
                    };
                    constructors.for_latents(piece, g, &windows, |_, to, share| {
                        shares[to] += share;
                        positions[to] += 1;
                    });
                }
                for (at, (share, positions)) in shares.iter().zip(&positions).enumerate() {
                    // At most 2^8 equal shares, each off by 2^−24 of itself.
                    assert!((share - 1.0).abs() < 1e-4, "{pyramid:?} {g} {at}: {share}");
                    assert!(*positions > 0);
                }
                for (level, window) in windows.iter().enumerate() {
                    let pool = 1_usize << constructors.pool_log2(level);
                    let first = positions[window.base[g] * 2];
                    let expected: usize = extent.iter().map(|&n| n.min(pool)).product();
                    assert_eq!(first as usize, expected, "{pyramid:?} {g} level {level}");
                }
            }
        }
    }
}

#[test]
fn the_cells_of_a_position_follow_in_reading_order_within_a_channel() {
    let source = source(24, 16, 1);
    let config = config(Pyramid::SINGLE, Address::Wrap);
    let ground = Ground::new(&config, &source).unwrap();
    let windows = Window::whole(&ground.positions);
    let (rows, columns) = (2, 3);
    let piece = Piece {
        tensor: (1, rows, columns),
        margin: 0,
        origin: [0; 2],
        extent: [columns, rows],
    };
    // Grid 0 has 4 × 4 cells in a position, grid 1 has one.
    for (g, side) in [(0, 4), (1, 1)] {
        let mut from_tensor = vec![None; 2 * side * side * rows * columns];
        constructors(&ground)[g].for_latents(piece, g, &windows, |from, to, share| {
            assert_eq!(share, 1.0);
            assert_eq!(from_tensor[from].replace(to), None);
        });
        for (from, to) in from_tensor.into_iter().enumerate() {
            let (plane, position) = (from / (rows * columns), from % (rows * columns));
            let (channel, sub) = (plane / (side * side), plane % (side * side));
            let y = position / columns * side + sub / side;
            let x = position % columns * side + sub % side;
            assert_eq!(to, Some((y * columns * side + x) * 2 + channel));
        }
    }
}

#[test]
fn every_projection_moves_exactly_when_a_mip_of_its_level_is_trained() {
    let source = source(128, 128, 8);
    for (pyramid, crop) in pyramids().into_iter().flat_map(|p| [(p, 64), (p, 128)]) {
        let config = TrainConfig {
            crop,
            uniform_mips: 1.0,
            ..config(pyramid, Address::Wrap)
        };
        let ground = Ground::new(&config, &source).unwrap();
        let mut model = Model::new(&ground).unwrap();
        model.start_encoder(&ground);
        let mut engine = Engine::new(&ground.topology, 1536, 1);
        let before = model.encoder.clone();
        let rates = Rates {
            encoder: 1e-3,
            latents: 0.0,
            synthesizer: 1e-3,
        };
        model
            .encoder_step(&ground, &mut engine, &stage(&ground), 0, rates)
            .unwrap();
        let moved: Vec<bool> = model
            .encoder
            .iter()
            .zip(&before)
            .map(|(a, b)| a != b)
            .collect();
        // The biases of grid 1's projections come last, two a level: it is at 1/8.
        let levels = ground.positions.level_count();
        let biases = &moved[moved.len() - 2 * levels..];
        let last = ground
            .positions
            .level_of(Crops::draw(&ground, &stage(&ground), 0).mips - 1);
        for (level, biases) in biases.chunks(2).enumerate() {
            assert_eq!(biases, [level <= last; 2], "{pyramid:?} {crop} {level}");
        }
    }
}
