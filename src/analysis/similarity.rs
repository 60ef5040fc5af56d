//! Similarity: the levels of a grid's pyramid against each other.

use super::cka::{by_chance, linear_cka};
use super::level::level_reals;
use super::resample::{Alignment, examples};
use ntmu_isa::Asset;
use serde::Serialize;

/// A level of a grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct LevelSize {
    /// Cells along x.
    pub columns: u32,
    /// Cells along y.
    pub rows: u32,
}

/// The figures of two levels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Alike {
    /// Linear CKA, 0 to 1; none where all latents of a level are one number.
    pub cka: Option<f64>,
    /// What independent noise would have; see [`super::cka::by_chance`].
    pub by_chance: f64,
    /// Places that were compared.
    pub places: usize,
}

/// The levels of a grid against each other.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Similarity {
    /// The grid, 0 or 1.
    pub grid: usize,
    /// How levels were brought to common places.
    pub alignment: Alignment,
    /// The levels, finest first.
    pub levels: Vec<LevelSize>,
    /// \[level\]\[level\], symmetric.
    pub alike: Vec<Vec<Alike>>,
}

/// Why levels cannot be compared.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum SimilarityError {
    /// There is nothing to compare with.
    #[error(
        "levels: found {found}, one pair of grids for every mip as in CNTC; allowed: at least 2, \
         as in a feature pyramid (NTC)"
    )]
    OneLevel {
        /// Levels of each grid.
        found: u8,
    },
    /// An asset has two grids.
    #[error("grid: found {found}; allowed: 0 and 1")]
    Grid {
        /// The grid asked for.
        found: usize,
    },
}

/// CKA of every pair of levels of a grid: the paper's `CKA_i(k, l)`.
///
/// # Errors
/// When the asset has one level, or no such grid.
pub fn similarity(
    asset: &Asset,
    grid: usize,
    alignment: Alignment,
) -> Result<Similarity, SimilarityError> {
    let shape = &asset.shape;
    let count = shape.level_count();
    if count < 2 {
        return Err(SimilarityError::OneLevel { found: count });
    }
    let features: Option<Vec<_>> = (0..count)
        .map(|level| level_reals(asset, grid, level))
        .collect();
    let features = features.ok_or(SimilarityError::Grid { found: grid })?;
    let alike = |a: u8, b: u8| {
        let (fine, coarse) = (a.min(b), a.max(b));
        let halvings = shape.pyramid.reduction_log2(coarse) - shape.pyramid.reduction_log2(fine);
        let levels = [fine, coarse].map(|level| features[usize::from(level)].view());
        let [x, y] = examples(
            levels[0],
            levels[1],
            halvings,
            alignment,
            shape.address_mode,
        );
        Alike {
            cka: linear_cka(x.view(), y.view()),
            by_chance: by_chance(x.nrows(), [x.ncols(), y.ncols()]),
            places: x.nrows(),
        }
    };
    let size = |level: u8| {
        let (columns, rows) = shape.level_size(grid, level);
        LevelSize { columns, rows }
    };
    Ok(Similarity {
        grid,
        alignment,
        levels: (0..count).map(size).collect(),
        alike: (0..count)
            .map(|a| (0..count).map(|b| alike(a, b)).collect())
            .collect(),
    })
}

impl Similarity {
    /// The matrix as Markdown; what chance alone would give stands in brackets.
    #[must_use]
    pub fn markdown(&self) -> String {
        let heads: Vec<String> = self.levels.iter().enumerate().map(head).collect();
        let mut text = format!("| CKA of grid {} | {} |\n", self.grid, heads.join(" | "));
        text += &format!("|---|{}\n", "---:|".repeat(heads.len()));
        for (level, row) in self.alike.iter().enumerate() {
            let cells: Vec<String> = row
                .iter()
                .map(|alike| match alike.cka {
                    None => "—".to_owned(),
                    Some(cka) => format!("{cka:.3} ({:.3})", alike.by_chance),
                })
                .collect();
            text += &format!("| {} | {} |\n", heads[level], cells.join(" | "));
        }
        text
    }
}

fn head((level, size): (usize, &LevelSize)) -> String {
    format!("level {level}, {}×{}", size.columns, size.rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analysis::{FourierError, fourier};
    use ntmu_isa::pyramid::Pyramid;

    /// The built-in asset with a level a mip behind mip 3. Every cell of a level is 2 × 2 equal ones
    /// in the level before, in both grids.
    fn pyramid() -> Asset {
        let mut parts = crate::built_in::asset().unwrap().into_parts();
        parts.shape.pyramid = Pyramid::EVERY_MIP;
        let shape = &parts.shape;
        let last = shape.level_count() - 1;
        for grid in 0..2 {
            let channels = usize::from(shape.grids[grid].channels);
            let max = usize::from(shape.grids[grid].format.max_code());
            parts.grids[grid] = (0..=last)
                .flat_map(|level| {
                    let (columns, rows) = shape.level_size(grid, level);
                    let shift = last - level;
                    let cells = (0..rows).flat_map(move |y| (0..columns).map(move |x| (x, y)));
                    cells.flat_map(move |(x, y)| {
                        let (x, y) = ((x >> shift) as usize, (y >> shift) as usize);
                        (0..channels)
                            .map(move |c| ((5 * x + 3 * y + x * y * (c + 1)) % (max + 1)) as u8)
                    })
                })
                .collect();
        }
        Asset::new(parts).unwrap()
    }

    #[test]
    fn levels_that_are_means_of_each_other_are_wholly_alike() {
        let asset = pyramid();
        for grid in 0..2 {
            let found = similarity(&asset, grid, Alignment::Pool).unwrap();
            assert_eq!(found.levels.len(), usize::from(asset.shape.level_count()));
            // The mean of equal latents is exact, so both sides are the same numbers.
            assert!(
                found
                    .alike
                    .iter()
                    .flatten()
                    .all(|alike| alike.cka == Some(1.0))
            );
            let places: Vec<usize> = found.alike[0].iter().map(|alike| alike.places).collect();
            let cells = found
                .levels
                .iter()
                .map(|level| (level.columns * level.rows) as usize);
            assert_eq!(places, cells.collect::<Vec<_>>());
        }
    }

    #[test]
    fn both_alignments_are_symmetric_and_from_zero_to_one() {
        let asset = pyramid();
        for alignment in [Alignment::Pool, Alignment::Bilinear] {
            let found = similarity(&asset, 1, alignment).unwrap().alike;
            for (a, row) in found.iter().enumerate() {
                assert_eq!(row[a].cka, Some(1.0), "a level beside itself");
                for (b, alike) in row.iter().enumerate() {
                    assert_eq!(*alike, found[b][a]);
                    // By Cauchy and Schwarz, up to the roundings of a sum over the places.
                    let cka = alike.cka.unwrap();
                    assert!((0.0..=1.0 + alike.places as f64 * f64::EPSILON).contains(&cka));
                }
            }
        }
    }

    #[test]
    fn one_level_has_nothing_to_be_compared_with() {
        let asset = crate::built_in::asset().unwrap();
        let error = similarity(&asset, 0, Alignment::Pool).unwrap_err();
        assert_eq!(error, SimilarityError::OneLevel { found: 1 });
        assert!(error.to_string().contains("allowed: at least 2"));
        let error = similarity(&pyramid(), 2, Alignment::Pool).unwrap_err();
        assert_eq!(error, SimilarityError::Grid { found: 2 });
    }

    #[test]
    fn every_level_of_both_grids_has_a_transform() {
        let asset = pyramid();
        for grid in 0..2 {
            for level in 0..asset.shape.level_count() {
                let found = fourier(&asset, grid, level, None).unwrap();
                assert_eq!(
                    found.channels.len(),
                    usize::from(asset.shape.grids[grid].channels)
                );
                let (columns, rows) = asset.shape.level_size(grid, level);
                assert_eq!(found.summary().size, (columns as usize, rows as usize));
            }
        }
        let one = fourier(&asset, 0, 0, Some(&[1])).unwrap();
        assert_eq!(one.channels[0].spectrum, one.mean);
    }

    #[test]
    fn channels_and_levels_that_do_not_exist_are_refused() {
        let asset = crate::built_in::asset().unwrap();
        let allowed = usize::from(asset.shape.grids[0].channels);
        let error = fourier(&asset, 0, 0, Some(&[allowed])).unwrap_err();
        assert_eq!(
            error,
            FourierError::Channel {
                grid: 0,
                found: allowed,
                allowed
            }
        );
        let error = fourier(&asset, 1, 1, None).unwrap_err();
        assert!(
            error
                .to_string()
                .contains("level 1 of grid 1: allowed: levels 0 to 0")
        );
        assert_eq!(
            fourier(&asset, 0, 0, Some(&[])),
            Err(FourierError::None { grid: 0 })
        );
    }
}
