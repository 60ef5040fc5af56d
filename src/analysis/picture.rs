//! Pictures: latents, spectra and matrices of similarity.

use super::similarity::Similarity;
use super::spectrum::Spectrum;
use crate::drawing::{Anchor, Drawing, INK, Item, PAPER, SOFT};
use crate::timing::heat::colour;
use image::codecs::png::PngEncoder;
use image::{ImageError, Rgb, RgbImage};
use ndarray::{Array2, ArrayView2};

/// Pixels that a small plane is enlarged towards, in whole steps.
const WANTED: usize = 512;

/// A plane \[row, column\] as a PNG, `low` dark and `high` yellow (viridis); a cell is a square.
fn plane_png(plane: ArrayView2<'_, f64>, low: f64, high: f64) -> Result<Vec<u8>, ImageError> {
    let (rows, columns) = plane.dim();
    let scale = (WANTED / rows.max(columns).max(1)).max(1);
    let (width, height) = ((columns * scale) as u32, (rows * scale) as u32);
    let range = high - low;
    let picture = RgbImage::from_fn(width, height, |x, y| {
        let value = plane[[y as usize / scale, x as usize / scale]];
        let share = if range > 0.0 {
            (value - low) / range
        } else {
            0.0
        };
        Rgb(colour::of(share))
    });
    let mut bytes = Vec::new();
    picture.write_with_encoder(PngEncoder::new(&mut bytes))?;
    Ok(bytes)
}

/// The latents of a channel as a PNG, −½ dark and ½ yellow: the range of the format.
///
/// # Errors
/// When the encoder fails.
pub fn latents_png(latents: ArrayView2<'_, f64>) -> Result<Vec<u8>, ImageError> {
    plane_png(latents, -0.5, 0.5)
}

/// log10 of the magnitude of a spectrum, frequency 0 in the middle, as a PNG. The brightest is the
/// largest magnitude but the mean's, the darkest a thousandth of it; what is beyond is clipped.
///
/// # Errors
/// When the encoder fails.
pub fn spectrum_png(spectrum: &Spectrum) -> Result<Vec<u8>, ImageError> {
    let logs: Array2<f64> = spectrum.centred().mapv(|power| power.log10() / 2.0);
    let others = spectrum.power().iter().skip(1).copied().collect::<Vec<_>>();
    let most = others.into_iter().fold(0.0, f64::max).log10() / 2.0;
    if most.is_finite() {
        plane_png(logs.view(), most - 3.0, most)
    } else {
        // No frequency but 0 has any power.
        plane_png(logs.view(), f64::INFINITY, f64::INFINITY)
    }
}

impl Similarity {
    /// The matrix as an SVG that needs nothing else.
    #[must_use]
    pub fn svg(&self) -> String {
        self.drawing().svg()
    }

    /// The matrix as a PNG.
    ///
    /// # Errors
    /// When the encoder fails.
    pub fn png(&self) -> Result<Vec<u8>, ImageError> {
        self.drawing().png()
    }

    fn drawing(&self) -> Drawing {
        const CELL: f64 = 64.0;
        const LEFT: f64 = 96.0;
        const TOP: f64 = 48.0;
        let count = self.levels.len() as f64;
        let size = (
            (LEFT + CELL * count + 16.0).max(280.0) as u32,
            (TOP + CELL * count + 40.0) as u32,
        );
        let title = format!(
            "CKA of the levels of grid {} ({})",
            self.grid,
            self.alignment.name()
        );
        let mut drawing = Drawing::new(title.clone(), size);
        drawing.text((8.0, 20.0), title, Anchor::Start, INK);
        for (row, (cells, level)) in self.alike.iter().zip(&self.levels).enumerate() {
            let top = TOP + CELL * row as f64;
            let middle = top + CELL / 2.0;
            drawing.text(
                (LEFT - 8.0, middle - 2.0),
                format!("level {row}"),
                Anchor::End,
                INK,
            );
            let cells_of = format!("{}×{}", level.columns, level.rows);
            drawing.text((LEFT - 8.0, middle + 11.0), cells_of, Anchor::End, SOFT);
            let below = TOP + CELL * count + 16.0;
            let along = LEFT + CELL * (row as f64 + 0.5);
            drawing.text((along, below), format!("level {row}"), Anchor::Middle, INK);
            for (column, alike) in cells.iter().enumerate() {
                let left = LEFT + CELL * column as f64;
                let shade = alike.cka.map_or([221; 3], colour::of);
                drawing.items.push(Item::Box {
                    area: [left, top, CELL - 1.0, CELL - 1.0],
                    colour: shade,
                });
                // Viridis is light above some three fifths.
                let ink = match alike.cka {
                    Some(cka) if cka < 0.6 => PAPER,
                    Some(_) | None => INK,
                };
                let text = alike.cka.map_or("-".to_owned(), |cka| format!("{cka:.2}"));
                drawing.text((left + CELL / 2.0, middle + 3.0), text, Anchor::Middle, ink);
            }
        }
        drawing
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_is_enlarged_in_whole_steps_and_never_shrunk() {
        for ((rows, columns), (width, height)) in [
            ((1, 1), (512, 512)),
            ((100, 30), (150, 500)),
            ((3, 700), (700, 3)),
        ] {
            let png = latents_png(Array2::zeros((rows, columns)).view()).unwrap();
            let picture = image::load_from_memory(&png).unwrap();
            assert_eq!((picture.width(), picture.height()), (width, height));
        }
    }

    #[test]
    fn the_middle_of_a_spectrum_of_a_constant_and_a_wave_is_bright() {
        let plane = Array2::from_shape_fn((8, 8), |(_, x)| if x % 2 == 0 { 1.0 } else { 0.0 });
        let bytes = spectrum_png(&Spectrum::of(plane.view())).unwrap();
        let picture = image::load_from_memory(&bytes).unwrap().to_rgb8();
        let cell = |column: u32, row: u32| picture.get_pixel(64 * column, 64 * row).0;
        assert_eq!(cell(4, 4), colour::of(1.0), "the mean");
        assert_eq!(cell(0, 4), colour::of(1.0), "Nyquist's frequency along x");
        assert_eq!(cell(2, 2), colour::of(0.0));
    }
}
