//! First latents: those of a grid start at the principal components of the texels under its cells.
//!
//! A cell of a grid at 1/s of the resolution lies over a block of s × s texels. The blocks of mip 0
//! are vectors of s·s·channels reals, less the channels' means. They have as many principal
//! components as the grid has latents, and a block's coefficients are its cell's latents, each
//! brought to the same deviation. Grids whose blocks are of one size share the components: grid 0 has
//! the first, since it gives the synthesizer every corner, and grid 1 those of what is left. Grids of
//! different blocks have the components of their own.
//!
//! The levels of a pyramid serve the mips as level 0 serves mip 0, and one synthesizer reads them
//! all, so they take the components of level 0.
//!
//! What the synthesizer makes of them is learnt; this saves it the steps in which latents drawn at
//! random would come to mean anything.

use crate::latents::Latents;
use crate::model::Ground;
use crate::random::{Purpose, Stream};
use ndarray::{Array2, ArrayView1, Axis};
use rayon::prelude::*;

/// Blocks that the components are taken from, at most.
const SAMPLES: usize = 8192;

/// Blocks of one task.
const TASK: usize = 512;

/// Steps of the orthogonal iteration. Which of two nearly equal components comes first, or how they
/// mix, does not matter here.
const ROUNDS: usize = 12;

/// The standard deviation of a latent, of the range of its codes.
const DEVIATION: f32 = 0.15;

/// A component with a smaller deviation, in reals, is none: its latents keep their random start.
const LEAST_DEVIATION: f32 = 1e-5;

/// Sets the latents of both grids.
pub(crate) fn set(ground: &Ground<'_>, latents: &mut [Latents; 2]) {
    let [of_0, of_1] = ground.config.grids.map(|grid| grid.scale_log2);
    let all = |grid| Blocks {
        ground,
        grid,
        less: None,
    };
    let first = Components::of(&all(0));
    first.set(&all(0), &mut latents[0]);
    let second = Blocks {
        less: (of_0 == of_1).then_some(&first),
        ..all(1)
    };
    Components::of(&second).set(&second, &mut latents[1]);
}

/// The blocks under a grid's cells, less what some components hold of them.
struct Blocks<'a> {
    ground: &'a Ground<'a>,
    grid: usize,
    less: Option<&'a Components>,
}

impl Blocks<'_> {
    /// The blocks of these cells of a level: cells × reals of a block.
    fn of(&self, level: usize, cells: impl ExactSizeIterator<Item = usize>) -> Array2<f32> {
        let whole = self.whole(level, cells);
        match self.less {
            Some(Components { basis, .. }) => &whole - &whole.dot(&basis.t()).dot(basis),
            None => whole,
        }
    }

    /// The blocks with nothing taken away but the means. Beyond an edge the last texel goes on.
    fn whole(&self, level: usize, cells: impl ExactSizeIterator<Item = usize>) -> Array2<f32> {
        let texels = &self.ground.texels;
        let mip = self.ground.positions.mip_under(level);
        let (width, height) = texels.sizes[usize::from(mip)];
        let columns = self.ground.positions.levels[self.grid][level].size[0] as usize;
        let side = 1_u32 << self.ground.config.grids[self.grid].scale_log2;
        let channels: Vec<_> = (0..texels.channels)
            .map(|channel| (texels.mean(channel), texels.weights[channel].sqrt()))
            .collect();
        let rows = cells.len();
        let mut out = Vec::with_capacity(rows * (side * side) as usize * channels.len());
        for cell in cells {
            let corner = [cell % columns, cell / columns].map(|at| at as u32 * side);
            for (y, x) in (0..side).flat_map(|y| (0..side).map(move |x| (y, x))) {
                let x = (corner[0] + x).min(width - 1);
                let y = (corner[1] + y).min(height - 1);
                if texels.is_covered(x, y, mip) {
                    let texel = texels.texel(x, y, mip).iter().zip(&channels);
                    out.extend(texel.map(|(value, (mean, weight))| (value - mean) * weight));
                } else {
                    out.extend(channels.iter().map(|_| 0.0));
                }
            }
        }
        matrix(rows, out)
    }
}

/// `rows` equal rows; the caller has as many numbers in each.
fn matrix(rows: usize, values: Vec<f32>) -> Array2<f32> {
    let columns = values.len() / rows.max(1);
    Array2::from_shape_vec((rows, columns), values).unwrap_or_default()
}

/// The principal components of a grid's blocks.
struct Components {
    /// Components × reals of a block, orthonormal; the first have the largest deviations.
    basis: Array2<f32>,
    /// The standard deviation of each one's coefficient.
    deviations: Vec<f32>,
}

impl Components {
    /// As many components as the grid has latents, or as a block has reals.
    fn of(blocks: &Blocks<'_>) -> Components {
        let ground = blocks.ground;
        let cells = ground.positions.levels[blocks.grid][0].cells();
        // An odd step visits all columns of a grid whose rows have a power of two.
        let step = cells.div_ceil(SAMPLES);
        let step = if step > 1 { step | 1 } else { step };
        let sample = blocks.of(0, (0..cells).step_by(step));
        let covariance = sample.t().dot(&sample) / sample.nrows() as f32;
        let reals = covariance.nrows();
        let count = usize::from(ground.config.grids[blocks.grid].channels).min(reals);
        let stream = Stream::new(ground.config.seed, Purpose::Components, blocks.grid as u64);
        let mut basis = Array2::from_shape_fn((count, reals), |(row, column)| {
            stream.signed((row * reals + column) as u64)
        });
        orthonormalise(&mut basis);
        for _ in 0..ROUNDS {
            basis = basis.dot(&covariance);
            orthonormalise(&mut basis);
        }
        let variance = |row: ArrayView1<'_, f32>| row.dot(&covariance.dot(&row));
        let deviations = basis.outer_iter().map(|row| variance(row).max(0.0).sqrt());
        Components {
            deviations: deviations.collect(),
            basis,
        }
    }

    /// Sets the latents of every level to the coefficients of their blocks.
    fn set(&self, blocks: &Blocks<'_>, latents: &mut Latents) {
        let ground = blocks.ground;
        for level in 0..ground.positions.level_count() {
            // A pyramid may have a level whose first mips the chain does not have.
            if usize::from(ground.positions.mip_under(level)) < ground.texels.sizes.len() {
                self.set_level(blocks, level, latents);
            }
        }
    }

    fn set_level(&self, blocks: &Blocks<'_>, level: usize, latents: &mut Latents) {
        let place = blocks.ground.positions.levels[blocks.grid][level];
        let channels = usize::from(blocks.ground.config.grids[blocks.grid].channels);
        let (low, high) = latents.limits();
        let level_values = place.base * channels..(place.base + place.cells()) * channels;
        let tasks = latents.values[level_values].par_chunks_mut(TASK * channels);
        tasks.enumerate().for_each(|(task, values)| {
            let cells = task * TASK..task * TASK + values.len() / channels;
            let coefficients = blocks.of(level, cells).dot(&self.basis.t());
            let cells = values.chunks_exact_mut(channels);
            for (values, coefficients) in cells.zip(coefficients.outer_iter()) {
                let pairs = coefficients.into_iter().zip(&self.deviations);
                for (value, (coefficient, &deviation)) in values.iter_mut().zip(pairs) {
                    if deviation > LEAST_DEVIATION {
                        let code = coefficient / deviation * DEVIATION * (high - low);
                        *value = code.clamp(low, high);
                    }
                }
            }
        });
    }
}

/// Makes the rows orthonormal, in their order (Gram and Schmidt, twice for its rounding errors). A
/// row that depends on those before it becomes zero.
fn orthonormalise(rows: &mut Array2<f32>) {
    for at in 0..rows.nrows() {
        let (before, mut rest) = rows.view_mut().split_at(Axis(0), at);
        let mut row = rest.row_mut(0);
        let size = row.dot(&row).sqrt();
        for _ in 0..2 {
            for other in before.outer_iter() {
                let along = other.dot(&row);
                row.scaled_add(-along, &other);
            }
        }
        let left = row.dot(&row).sqrt();
        // What is left of a dependent row is rounding errors.
        let scale = if left > 1e-5 * size {
            left.recip()
        } else {
            0.0
        };
        row *= scale;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Model;
    use crate::tests::{small, source};
    use crate::{GridConfig, TrainConfig};

    fn config(channels: [u16; 2], scales: [u8; 2]) -> TrainConfig {
        let grid = |g: usize| GridConfig {
            channels: channels[g],
            bits: 8,
            scale_log2: scales[g],
        };
        TrainConfig {
            grids: [grid(0), grid(1)],
            ..small()
        }
    }

    /// What is left of all blocks of a grid, of what is there: shares of their energy.
    fn left(ground: &Ground<'_>, blocks: &Blocks<'_>, components: &Components) -> f32 {
        let cells = ground.positions.levels[blocks.grid][0].cells();
        let energy = |m: &Array2<f32>| m.iter().map(|v| v * v).sum::<f32>();
        let all = blocks.of(0, 0..cells);
        let rest = &all - &all.dot(&components.basis.t()).dot(&components.basis);
        energy(&rest) / energy(&all)
    }

    #[test]
    fn components_are_orthonormal_and_ordered_and_more_of_them_leave_less() {
        let source = source(96, 80, 5);
        let mut before = 1.0;
        for count in [2, 4, 6] {
            let config = config([count, 4], [2, 3]);
            let ground = Ground::new(&config, &source).unwrap();
            let blocks = Blocks {
                ground: &ground,
                grid: 0,
                less: None,
            };
            let components = Components::of(&blocks);
            let products = components.basis.dot(&components.basis.t());
            for ((i, j), product) in products.indexed_iter() {
                let expected = if i == j { 1.0 } else { 0.0 };
                assert!((product - expected).abs() < 1e-4, "{i} {j}: {product}");
            }
            let first = components.deviations[0];
            let last = components.deviations[usize::from(count) - 1];
            assert!(first > last && last > 0.0);
            let left = left(&ground, &blocks, &components);
            assert!(left < before, "{count}: {left}");
            before = left;
        }
    }

    /// A block of 2 × 2 × 5 reals has twenty components, of which the set has fewer.
    #[test]
    fn components_that_are_not_there_leave_their_latents_alone() {
        let config = config([24, 4], [1, 3]);
        let source = source(96, 80, 5);
        let ground = Ground::new(&config, &source).unwrap();
        let mut model = Model::new(&ground).unwrap();
        let before = model.latents[0].values.clone();
        set(&ground, &mut model.latents);
        let after = &model.latents[0].values;
        assert!(after.iter().all(|v| v.is_finite()));
        let moved = |channel: usize| {
            let pairs = before.iter().zip(after).skip(channel).step_by(24);
            pairs.filter(|(before, after)| before != after).count()
        };
        assert!(moved(0) > 0);
        assert_eq!((20..24).map(moved).sum::<usize>(), 0);
    }

    #[test]
    fn the_second_of_two_like_grids_holds_nothing_of_the_first() {
        let source = source(96, 80, 5);
        let config = config([6, 6], [3, 3]);
        let ground = Ground::new(&config, &source).unwrap();
        let all = |grid, less| Blocks {
            ground: &ground,
            grid,
            less,
        };
        let first = Components::of(&all(0, None));
        let cells = ground.positions.levels[1][0].cells();
        let whole = all(1, None).of(0, 0..cells);
        let left = all(1, Some(&first)).of(0, 0..cells);
        let energy = |m: &Array2<f32>| m.iter().map(|v| v * v).sum::<f32>();
        assert!(energy(&left) < 0.9 * energy(&whole));
        assert!(energy(&left.dot(&first.basis.t())) < 1e-6 * energy(&whole));
    }

    #[test]
    fn latents_have_one_deviation_at_every_level_and_a_constant_set_keeps_its_random_start() {
        let config = TrainConfig {
            pyramid: crate::Pyramid::NTC,
            ..config([4, 4], [2, 3])
        };
        let varied = source(128, 128, 5);
        let ground = Ground::new(&config, &varied).unwrap();
        let mut model = Model::new(&ground).unwrap();
        set(&ground, &mut model.latents);
        for (grid, latents) in model.latents.iter().enumerate() {
            let (low, high) = latents.limits();
            let level = ground.positions.levels[grid][0];
            for channel in 0..4 {
                let values = latents.values[..level.cells() * 4].iter();
                let values: Vec<f32> = values.skip(channel).step_by(4).copied().collect();
                let square = values.iter().map(|v| v * v).sum::<f32>() / values.len() as f32;
                let deviation = square.sqrt() / (high - low);
                assert!((deviation / DEVIATION - 1.0).abs() < 0.05, "{deviation}");
            }
        }
        let mut constant = source(64, 64, 5);
        for mip in &mut constant.mips {
            mip.fill(0.25);
        }
        let ground = Ground::new(&config, &constant).unwrap();
        let mut model = Model::new(&ground).unwrap();
        let before = model.latents.clone();
        set(&ground, &mut model.latents);
        for (before, after) in before.iter().zip(&model.latents) {
            assert_eq!(before.values, after.values);
        }
    }
}
