//! Picture: the map as a PNG, with a legend below.

use super::{Counts, HeatValue, MissMap, colour, digits};
use image::codecs::png::PngEncoder;
use image::{Rgb, RgbImage};
use std::io::{self, Write};

/// Pixels that a small map is enlarged towards.
const WANTED: u32 = 512;
/// The narrowest legend.
const LEGEND_WIDTH: u32 = 256;
/// Pixels of the strip of colours, and of the gaps around it.
const STRIP: u32 = 12;
const GAP: u32 = 4;
/// Where nothing was looked up.
const NOTHING: Rgb<u8> = Rgb([221; 3]);
const PAPER: Rgb<u8> = Rgb([255; 3]);

impl HeatValue {
    fn of(self, counts: &Counts) -> f64 {
        match self {
            HeatValue::Misses => counts.misses as f64,
            HeatValue::Lookups => counts.lookups as f64,
            HeatValue::MissRate => counts.misses as f64 / counts.lookups as f64,
        }
    }

    /// What stands at the legend's right end.
    fn text(self, value: f64) -> String {
        match self {
            HeatValue::Misses | HeatValue::Lookups => format!("{value:.0}"),
            HeatValue::MissRate => format!("{:.1}%", value * 100.0),
        }
    }
}

impl MissMap {
    /// Draws the map: dark is 0, yellow the most of a cell, light grey where nothing was looked up.
    /// The legend below has both ends in numbers. A cell is a square of 1 to 16 pixels.
    #[must_use]
    pub fn picture(&self, value: HeatValue) -> RgbImage {
        let (columns, rows) = (self.columns as u32, self.rows() as u32);
        let scale = (WANTED / columns.max(rows).max(1)).clamp(1, 16);
        let width = (columns * scale).max(LEGEND_WIDTH);
        let legend = rows * scale + GAP;
        let height = legend + STRIP + GAP + digits::HEIGHT + GAP;
        let mut picture = RgbImage::from_pixel(width, height, PAPER);
        let looked_up = self.lines().flatten().filter(|counts| counts.lookups > 0);
        let most = looked_up.map(|counts| value.of(counts)).fold(0.0, f64::max);
        for (row, line) in self.lines().enumerate() {
            for (column, counts) in line.iter().enumerate() {
                let shade = if counts.lookups == 0 {
                    NOTHING
                } else if most == 0.0 {
                    Rgb(colour::of(0.0))
                } else {
                    Rgb(colour::of(value.of(counts) / most))
                };
                for pixel in 0..scale * scale {
                    let x = column as u32 * scale + pixel % scale;
                    let y = row as u32 * scale + pixel / scale;
                    picture.put_pixel(x, y, shade);
                }
            }
        }
        for x in 0..width {
            let shade = Rgb(colour::of(f64::from(x) / f64::from(width - 1)));
            for y in legend..legend + STRIP {
                picture.put_pixel(x, y, shade);
            }
        }
        let (low, high) = (value.text(0.0), value.text(most));
        let top = legend + STRIP + GAP;
        digits::draw(&mut picture, &low, 0, top);
        let right = width.saturating_sub(digits::width(&high));
        digits::draw(&mut picture, &high, right, top);
        picture
    }

    /// Writes [`MissMap::picture`] as a PNG.
    ///
    /// # Errors
    /// When the writer fails.
    pub fn write_png(&self, mut writer: impl Write, value: HeatValue) -> io::Result<()> {
        let picture = self.picture(value);
        let mut file = Vec::new();
        let encoded = picture.write_with_encoder(PngEncoder::new(&mut file));
        encoded.map_err(io::Error::other)?;
        writer.write_all(&file)?;
        writer.flush()
    }
}
