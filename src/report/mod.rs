//! Report: a study as one HTML file that needs nothing else.
//!
//! The file has no script and loads nothing: pictures are PNG in data URIs, charts are SVG in the
//! page, colours follow the reader's light or dark setting. The same study gives the same bytes.
//! Every text that comes from data is escaped by the template engine.

mod claims;
mod curves;
mod energy;
mod exactness;
mod experiments;
mod heat;
mod in_between;
mod lines;
mod maps;
mod misses;
mod number;
mod overview;
mod picture;
mod precision;
mod quality;
mod roofs;
mod stacks;
mod svg;
#[cfg(test)]
mod tests;
mod timing;
mod variants;

pub(crate) use curves::logarithmic_ticks;
pub(crate) use svg::{Axis, px, shortened};

use crate::study::Study;
use maud::{DOCTYPE, PreEscaped, html as markup};
use ndarray::ArrayView3;

/// One map to show beside its reconstruction.
#[derive(Clone, Copy, Debug)]
pub struct MapPicture<'a> {
    /// The map's name, as in [`crate::quality::MapQuality`].
    pub map: &'a str,
    /// Mip 0 of the source, \[channel, row, column\], 0..=1, where there is one.
    pub source: Option<ArrayView3<'a, f32>>,
    /// Mip 0 of the reconstruction, \[channel, row, column\], 0..=1; values outside are clipped.
    pub decoded: ArrayView3<'a, f32>,
}

/// Why a study cannot be drawn.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A map has no texel.
    #[error("map {map:?}: found shape {found:?}; allowed: at least 1 along each axis")]
    Empty {
        /// The map.
        map: String,
        /// Channels, rows, columns.
        found: (usize, usize, usize),
    },
    /// Source and reconstruction of a map differ in shape.
    #[error("map {map:?}: found a source of shape {found:?}; allowed: the decoded {allowed:?}")]
    Shape {
        /// The map.
        map: String,
        /// Channels, rows, columns of the source.
        found: (usize, usize, usize),
        /// Channels, rows, columns of the reconstruction.
        allowed: (usize, usize, usize),
    },
    /// A ledger does not charge every cycle exactly once.
    #[error(
        "ledger of {unit:?} with {layout:?}: found {found} cycles; allowed: the run's {allowed}"
    )]
    Ledger {
        /// The unit.
        unit: String,
        /// The layout.
        layout: String,
        /// The sum of the charges.
        found: u128,
        /// The cycles of the run.
        allowed: u64,
    },
    /// A map cannot be written as PNG.
    #[error("map {map:?}: {source}")]
    Png {
        /// The map.
        map: String,
        /// What the encoder found.
        source: image::ImageError,
    },
}

/// The study as one HTML file: what it is of, whether it holds, its maps, its quality, how exact
/// it is, what it costs in cycles, and what fewer bits would cost. `pictures` are shown in their
/// order.
///
/// # Errors
/// When a picture is empty or unlike its source, or a ledger does not add up.
pub fn html(study: &Study, pictures: &[MapPicture<'_>]) -> Result<String, ReportError> {
    let maps = maps::section(study, pictures)?;
    let timing = timing::section(&study.timing)?;
    let experiments = match &study.lab {
        None => markup! {},
        Some(lab) => experiments::section(lab)?,
    };
    let page = markup! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (study.asset.name) " · ntmu study" }
                style { (PreEscaped(include_str!("style.css"))) }
            }
            body {
                (stacks::hatch())
                header { (overview::section(study)) }
                main {
                    (maps)
                    (quality::section(study))
                    (exactness::section(&study.oracle))
                    (claims::section(&study.claims, &study.engine))
                    (timing)
                    (experiments)
                    (precision::section(study))
                    (in_between::section(study))
                    (variants::section(study))
                }
            }
        }
    };
    Ok(page.into_string())
}
