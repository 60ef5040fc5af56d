//! The trainer's integers are isa's.

use super::{run, small, source};
use crate::batch::all_texels;
use crate::model::Ground;
use crate::positions::Positions;
use crate::sampler::{Embedding, Numbers, Texel, Window};
use crate::{ActivationKind, Address, Snap, Steps, TrainConfig};
use ntmu_isa::Asset;
use ntmu_isa::activation::{Activation, gate, gate_argument, leak};
use ntmu_isa::embed::{corner_input, lerp_input, level_input, wave_input};
use ntmu_isa::position::{AxisPosition, corner_weights};
use ntmu_isa::profile::Profile;
use ntmu_isa::round::saturate;

/// The inputs of a texel by isa's formulas alone.
fn inputs_by_isa(asset: &Asset, x: u32, y: u32, mip: u8) -> Vec<i32> {
    let shape = &asset.shape;
    let rounding = Profile::NORMATIVE.input;
    let corners = |g: usize| {
        let [px, py] =
            [x, y].map(|t| AxisPosition::of(t, mip, shape.grids[g].scale_log2, shape.snap));
        let (w, h) = shape.grid_size(g);
        let (xs, ys) = (
            px.corners(w, shape.address_mode),
            py.corners(h, shape.address_mode),
        );
        let cells = [(0, 0), (1, 0), (0, 1), (1, 1)]
            .map(|(i, j): (usize, usize)| asset.cell(g, xs[i], ys[j]));
        (cells, corner_weights(px, py))
    };
    let mut out = Vec::new();
    let format = shape.grids[0].format;
    for cell in corners(0).0 {
        out.extend(
            cell.iter()
                .map(|&c| corner_input(format.value(c), format, rounding)),
        );
    }
    let format = shape.grids[1].format;
    let (cells, weights) = corners(1);
    for channel in 0..usize::from(shape.grids[1].channels) {
        let products = weights.iter().zip(cells);
        let sum = products
            .map(|(w, cell)| w * format.value(cell[channel]))
            .sum();
        out.push(lerp_input(sum, format, rounding));
    }
    for octave in 0..shape.octaves {
        for texel in [x, y] {
            out.extend([false, true].map(|quarter| wave_input(texel, mip, octave, quarter)));
        }
    }
    out.push(level_input(mip, shape.mip_count));
    out
}

/// The codes of a texel by isa's formulas alone.
fn decode_by_isa(asset: &Asset, x: u32, y: u32, mip: u8) -> Vec<i32> {
    let profile = Profile::NORMATIVE;
    let mut values = vec![inputs_by_isa(asset, x, y, mip)];
    for (index, layer) in asset.layers.iter().enumerate() {
        let input = &values[index];
        let mut out = Vec::new();
        for (row, &bias) in layer.bias.iter().enumerate() {
            let mut accumulator = bias;
            for (&w, &v) in layer.row(row).iter().zip(input) {
                accumulator += i32::from(w) * v;
            }
            let scale = layer.scales[row];
            let requantize = profile.requantize;
            if index + 1 == asset.layers.len() {
                let (low, high) = asset.shape.outputs[row].range();
                out.push(saturate(
                    profile.output.apply(accumulator, scale).into(),
                    low,
                    high,
                ));
                continue;
            }
            let mut value = match layer.activation {
                Activation::Identity => requantize.apply(accumulator, scale),
                Activation::Relu => requantize.apply(accumulator.max(0), scale),
                Activation::Leaky { shift } => {
                    requantize.apply(leak(accumulator, shift, profile.leak), scale)
                }
                Activation::HardGelu { scale: after } => {
                    requantize.apply(gate(gate_argument(accumulator, scale, requantize)), after)
                }
            };
            if let Some(skip) = layer.skip {
                // values[i + 1] is the output of layer i.
                let at = index - usize::from(skip.span);
                let source = values[at + 1][row] - i32::from(asset.layers[at].zero_point);
                value += profile.skip.apply(source, skip.scale);
            }
            out.push(saturate(
                i64::from(value + i32::from(layer.zero_point)),
                -128,
                127,
            ));
        }
        values.push(out);
    }
    values.pop().unwrap_or_default()
}

#[test]
fn the_sampler_gives_isas_integers_at_every_texel() {
    for (address, snap) in [
        (Address::Wrap, Snap::Stride),
        (Address::Mirror, Snap::Cell),
        (Address::Clamp, Snap::Stride),
    ] {
        let config = TrainConfig {
            address,
            snap,
            ..small()
        };
        let source = source(45, 70, 7);
        let asset = run(
            &source,
            &TrainConfig {
                steps: Some(Steps {
                    encoder: 0,
                    refine: 1,
                    integer: 1,
                }),
                ..config.clone()
            },
        )
        .unwrap()
        .asset;
        let positions = Positions::new(&asset.shape);
        let embedding = Embedding {
            numbers: Numbers::Integer,
            channels: [3, 5],
            bits: [4, 3],
            inputs: config.input_count(),
        };
        let seen = [0, 1].map(|g: usize| -> Vec<f32> {
            let format = asset.shape.grids[g].format;
            asset.grids[g]
                .iter()
                .map(|&c| format.value(c) as f32)
                .collect()
        });
        let windows = [Window::whole(&positions)];
        let mut row = vec![0.0; config.input_count()];
        let sizes: Vec<_> = (0..7).map(|m| asset.shape.mip_size(m)).collect();
        for texel in all_texels(&sizes) {
            embedding.gather(&positions, &windows, texel, [&seen[0], &seen[1]], &mut row);
            let expected = inputs_by_isa(&asset, texel.x, texel.y, texel.mip);
            let found: Vec<i32> = row.iter().map(|&v| v as i32).collect();
            assert_eq!(found, expected, "{texel:?} {address:?} {snap:?}");
        }
    }
}

/// The error that the report states is that of the codes that isa's functions decode from the
/// exported integers: the network that was trained is the network that was exported.
#[test]
fn the_trained_integers_are_those_of_the_asset() {
    for activation in [
        ActivationKind::Relu,
        ActivationKind::Leaky { shift: 3 },
        ActivationKind::HardGelu,
    ] {
        for (weight_bits, layers_per_block) in [(8, 2), (4, 1), (2, 3)] {
            let config = TrainConfig {
                activation,
                weight_bits,
                layers_per_block,
                ..small()
            };
            let source = source(40, 24, 5);
            let trained = run(&source, &config).unwrap();
            let asset = &trained.asset;
            let (mut sum, mut count) = (0.0, 0_u32);
            for (mip, reals) in source.mips.iter().enumerate() {
                let (channels, height, width) = reals.dim();
                for y in 0..height {
                    for x in 0..width {
                        let codes = decode_by_isa(asset, x as u32, y as u32, mip as u8);
                        for c in 0..channels {
                            let high = asset.shape.outputs[c].range().1 as f32;
                            let real = codes[c] as f32 / high;
                            sum += f64::from(real - reals[[c, y, x]]).powi(2);
                            count += 1;
                        }
                    }
                }
            }
            let psnr = -10.0 * (sum / f64::from(count)).log10();
            // The same terms in another order of summation in doubles, and one f32 division that
            // may differ in its last place: one 8-bit code that
            // differs would show at about 1e-5, one 16-bit code at about 2e-7.
            let difference = (psnr - trained.report.psnr_quantised).abs();
            assert!(
                difference < 1e-7,
                "{activation:?} {weight_bits}: {difference:e}"
            );
        }
    }
}

#[test]
fn constant_channels_are_reproduced_exactly_beside_others() {
    let mut source = source(16, 16, 3);
    for mip in &mut source.mips {
        mip.index_axis_mut(ndarray::Axis(0), 0).fill(51.0 / 255.0);
        mip.index_axis_mut(ndarray::Axis(0), 3).fill(1.0);
        mip.index_axis_mut(ndarray::Axis(0), 4).fill(-1.0);
    }
    let config = TrainConfig {
        steps: Some(Steps {
            encoder: 0,
            refine: 20,
            integer: 20,
        }),
        ..small()
    };
    let asset = run(&source, &config).unwrap().asset;
    for texel in all_texels(&[(16, 16), (8, 8), (4, 4)]) {
        let codes = decode_by_isa(&asset, texel.x, texel.y, texel.mip);
        // 0.25 of 255 is 63.75: the nearest code is 64.
        assert_eq!(
            [codes[0], codes[2], codes[3], codes[4]],
            [51, 64, 65_535, -127]
        );
    }
}

#[test]
fn a_texel_is_seen_alike_through_a_crop_and_through_the_whole() {
    let source = source(128, 128, 3);
    let config = small();
    let ground = Ground::new(&config, &source).unwrap();
    let embedding = ground.embedding(Numbers::Real);
    let whole = Window::whole(&ground.positions);
    // A crop of 8×8 encoder positions from (12, 14) on, which wraps: 16 positions an axis.
    let crop = Window {
        origin: [[24, 28], [12, 14]],
        size: [[16, 16], [8, 8]],
        period: [[32, 32], [16, 16]],
        base: [0, 0],
    };
    // Each latent holds its own cell's number, so that equal inputs mean equal cells.
    let fill = |window: &Window, g: usize, channels: usize| -> Vec<f32> {
        let [w, h] = window.size[g];
        let [ox, oy] = window.origin[g];
        let [pw, ph] = window.period[g];
        (0..h)
            .flat_map(|y| (0..w).map(move |x| (x, y)))
            .flat_map(|(x, y)| {
                let cell = ((oy + y) % ph * pw + (ox + x) % pw) as f32;
                vec![cell; channels]
            })
            .collect()
    };
    let [of_whole, of_crop] = [&whole, &crop].map(|w| [fill(w, 0, 3), fill(w, 1, 5)]);
    let mut rows = [
        vec![0.0; config.input_count()],
        vec![0.0; config.input_count()],
    ];
    // Texels whose corners lie inside the crop: one position away from its edges.
    for (x, y) in [(104, 120), (127, 127), (0, 5), (20, 30)] {
        let texel = Texel {
            x,
            y,
            mip: 0,
            window: 0,
        };
        let [a, b] = &mut rows;
        embedding.gather(
            &ground.positions,
            &[whole],
            texel,
            [&of_whole[0], &of_whole[1]],
            a,
        );
        embedding.gather(
            &ground.positions,
            &[crop],
            texel,
            [&of_crop[0], &of_crop[1]],
            b,
        );
        assert_eq!(a, b, "{texel:?}");
    }
}
