//! Misses: where on the screen lines are looked up and missed, as pictures.

use super::ReportError;
use super::number::{decimal, integer, percent};
use super::picture::uri;
use crate::timing::lab::MissMap;
use image::ExtendedColorType;
use maud::{Markup, html};

/// From least to most: dark blue, green, yellow.
const RAMP: [[f64; 3]; 3] = [
    [26.0, 28.0, 74.0],
    [33.0, 145.0, 140.0],
    [250.0, 230.0, 84.0],
];

fn colour(share: f64) -> [u8; 3] {
    let place = share.clamp(0.0, 1.0) * 2.0;
    let first = usize::from(place >= 1.0);
    let rest = place - first as f64;
    [0, 1, 2].map(|i| (RAMP[first][i] + rest * (RAMP[first + 1][i] - RAMP[first][i])).round() as u8)
}

/// Nothing is black; the rest by its share of the largest.
fn draw(map: &MissMap, values: &[Option<f64>], most: f64) -> Result<String, ReportError> {
    let scale = if most > 0.0 { most } else { 1.0 };
    let codes: Vec<u8> = values
        .iter()
        .flat_map(|value| value.map_or([0; 3], |value| colour(value / scale)))
        .collect();
    let encoded = uri(&codes, map.columns, map.rows, ExtendedColorType::Rgb8);
    encoded.map_err(|source| ReportError::Png {
        map: "misses".to_owned(),
        source,
    })
}

/// What of a cell is shown, if anything was looked up for it.
fn each(map: &MissMap, of: impl Fn(f64, f64) -> f64) -> Vec<Option<f64>> {
    map.lookups
        .iter()
        .zip(&map.misses)
        .map(|(&lookups, &misses)| (lookups > 0).then(|| of(lookups as f64, misses as f64)))
        .collect()
}

/// Three pictures: lookups, misses, and their quotient.
///
/// # Errors
/// When a picture cannot be written as PNG.
pub(super) fn pictures(map: &MissMap) -> Result<Markup, ReportError> {
    let pixels = f64::from(map.cell_pixels) * f64::from(map.cell_pixels);
    let most = |values: &[Option<f64>]| values.iter().flatten().copied().fold(0.0, f64::max);
    let lines = |most: f64| format!("yellow: {} a pixel", decimal(most, 2));
    let mut figures = Vec::new();
    for (name, values, is_share) in [
        (
            "Lines looked up",
            each(map, |lookups, _| lookups / pixels),
            false,
        ),
        (
            "Lines missed",
            each(map, |_, misses| misses / pixels),
            false,
        ),
        (
            "Missed / looked up",
            each(map, |lookups, misses| misses / lookups),
            true,
        ),
    ] {
        let most = most(&values);
        let scale = if is_share {
            format!("yellow: {}", percent(most))
        } else {
            lines(most)
        };
        figures.push((name, scale, draw(map, &values, most)?));
    }
    let (lookups, misses) = (map.lookups.iter().sum(), map.misses.iter().sum());
    Ok(html! {
        div.strip {
            @for (name, scale, uri) in &figures {
                figure {
                    img.pixels src=(uri) width=(map.columns) height=(map.rows) alt={ (name) " over the screen" };
                    figcaption { (name) "; " (scale) }
                }
            }
        }
        p.caption {
            "A pixel of a picture is a tile of " (map.cell_pixels) " × " (map.cell_pixels)
            " pixels of the screen; dark blue is none, black the sky. " (integer(misses)) " misses in "
            (integer(lookups)) " lookups. " (map.scene) "; " (map.layout) "; " (map.unit) "."
        }
    })
}
