//! PNG: a drawing in pixels, two to a unit, edges smooth.
//!
//! A pixel is covered by as much as its centre is inside a shape, from half a pixel outside to half
//! a pixel inside.

use super::{Anchor, Colour, Drawing, Item, Marker, PAPER, RADIUS};
use embedded_graphics::Drawable as _;
use embedded_graphics::Pixel;
use embedded_graphics::draw_target::DrawTarget;
use embedded_graphics::geometry::{OriginDimensions, Point, Size};
use embedded_graphics::mono_font::MonoTextStyle;
use embedded_graphics::mono_font::iso_8859_1::FONT_10X20;
use embedded_graphics::pixelcolor::{Rgb888, RgbColor as _};
use embedded_graphics::text::{Alignment, Text};
use image::codecs::png::PngEncoder;
use image::{ImageError, Rgb, RgbImage};
use std::convert::Infallible;

/// Pixels of a unit.
const SCALE: f64 = 2.0;

impl Drawing {
    /// The file's bytes.
    pub(crate) fn png(&self) -> Result<Vec<u8>, ImageError> {
        let mut bytes = Vec::new();
        self.picture()
            .write_with_encoder(PngEncoder::new(&mut bytes))?;
        Ok(bytes)
    }

    /// The pixels. Letters beyond Latin 1 become question marks.
    pub(crate) fn picture(&self) -> RgbImage {
        let side = |units: u32| (f64::from(units) * SCALE) as u32;
        let paper = RgbImage::from_pixel(side(self.size.0), side(self.size.1), Rgb(PAPER));
        let mut page = Page(paper);
        for item in &self.items {
            page.add(item);
        }
        page.0
    }
}

struct Page(RgbImage);

impl Page {
    fn add(&mut self, item: &Item) {
        let scaled = |(x, y): (f64, f64)| (x * SCALE, y * SCALE);
        match item {
            Item::Path {
                points,
                colour,
                width,
            } => {
                let half = width * SCALE / 2.0;
                for ends in points.windows(2) {
                    let (from, to) = (scaled(ends[0]), scaled(ends[1]));
                    let inside = |at| half - distance(at, from, to);
                    self.shape(&[from, to], half, *colour, inside);
                }
            }
            Item::Mark { at, marker, colour } => {
                let centre = scaled(*at);
                match marker {
                    Marker::Circle => {
                        let radius = RADIUS * SCALE;
                        let inside = |at| radius - distance(at, centre, centre);
                        self.shape(&[centre], radius, *colour, inside);
                    }
                    Marker::Square | Marker::Triangle | Marker::Diamond => {
                        let corners = marker.corners().iter();
                        let corners: Vec<(f64, f64)> =
                            corners.map(|(x, y)| scaled((at.0 + x, at.1 + y))).collect();
                        self.shape(&corners, 0.0, *colour, |at| depth(at, &corners));
                    }
                }
            }
            Item::Box { area, colour } => {
                let [left, top, width, height] = area.map(|units| (units * SCALE).round() as i64);
                for y in top..top + height {
                    for x in left..left + width {
                        self.blend(x, y, *colour, 1.0);
                    }
                }
            }
            Item::Text {
                at,
                text,
                anchor,
                colour,
            } => self.text(scaled(*at), text, *anchor, *colour),
        }
    }

    /// Paints what `inside` says: how many pixels inside a shape a place lies. The shape is within
    /// `margin` of the corners' box.
    fn shape(
        &mut self,
        corners: &[(f64, f64)],
        margin: f64,
        colour: Colour,
        inside: impl Fn((f64, f64)) -> f64,
    ) {
        let range = |along: fn(&(f64, f64)) -> f64| {
            let places = corners.iter().map(along);
            let low = places.clone().fold(f64::INFINITY, f64::min) - margin - 1.0;
            let high = places.fold(f64::NEG_INFINITY, f64::max) + margin + 1.0;
            low.floor() as i64..high.ceil() as i64
        };
        let (columns, rows) = (range(|at| at.0), range(|at| at.1));
        for y in rows {
            for x in columns.clone() {
                let cover = inside((x as f64 + 0.5, y as f64 + 0.5)) + 0.5;
                if cover > 0.0 {
                    self.blend(x, y, colour, cover.min(1.0));
                }
            }
        }
    }

    /// Mixes a colour in; a pixel outside the page is left out.
    fn blend(&mut self, x: i64, y: i64, colour: Colour, cover: f64) {
        let (Ok(x), Ok(y)) = (u32::try_from(x), u32::try_from(y)) else {
            return;
        };
        if let Some(pixel) = self.0.get_pixel_mut_checked(x, y) {
            for (old, new) in pixel.0.iter_mut().zip(colour) {
                let mixed = f64::from(*old) + cover * (f64::from(new) - f64::from(*old));
                *old = mixed.round() as u8;
            }
        }
    }

    fn text(&mut self, at: (f64, f64), text: &str, anchor: Anchor, colour: Colour) {
        let alignment = match anchor {
            Anchor::Start => Alignment::Left,
            Anchor::Middle => Alignment::Center,
            Anchor::End => Alignment::Right,
        };
        let [red, green, blue] = colour;
        let style = MonoTextStyle::new(&FONT_10X20, Rgb888::new(red, green, blue));
        let place = Point::new(at.0.round() as i32, at.1.round() as i32);
        let Ok(_) = Text::with_alignment(text, place, style, alignment).draw(self);
    }
}

impl OriginDimensions for Page {
    fn size(&self) -> Size {
        Size::new(self.0.width(), self.0.height())
    }
}

impl DrawTarget for Page {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I>(&mut self, pixels: I) -> Result<(), Infallible>
    where
        I: IntoIterator<Item = Pixel<Rgb888>>,
    {
        for Pixel(at, colour) in pixels {
            let colour = [colour.r(), colour.g(), colour.b()];
            self.blend(i64::from(at.x), i64::from(at.y), colour, 1.0);
        }
        Ok(())
    }
}

/// From a place to a line between two others.
fn distance(at: (f64, f64), from: (f64, f64), to: (f64, f64)) -> f64 {
    let (along, away) = (
        (to.0 - from.0, to.1 - from.1),
        (at.0 - from.0, at.1 - from.1),
    );
    let length = along.0 * along.0 + along.1 * along.1;
    let share = if length == 0.0 {
        0.0
    } else {
        ((away.0 * along.0 + away.1 * along.1) / length).clamp(0.0, 1.0)
    };
    (away.0 - share * along.0).hypot(away.1 - share * along.1)
}

/// How far inside a convex shape a place lies; its corners go clockwise on a page.
fn depth(at: (f64, f64), corners: &[(f64, f64)]) -> f64 {
    let next = corners.iter().cycle().skip(1);
    let edges = corners.iter().zip(next);
    edges
        .map(|(from, to)| {
            let along = (to.0 - from.0, to.1 - from.1);
            let away = (at.0 - from.0, at.1 - from.1);
            (along.0 * away.1 - along.1 * away.0) / along.0.hypot(along.1)
        })
        .fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::drawing::INK;

    fn drawn(item: Item) -> RgbImage {
        let mut drawing = Drawing::new("test", (20, 20));
        drawing.items.push(item);
        drawing.picture()
    }

    #[test]
    fn a_mark_covers_its_centre_and_not_the_corners_of_its_box() {
        for marker in Marker::ALL {
            let picture = drawn(Item::Mark {
                at: (10.0, 10.0),
                marker,
                colour: INK,
            });
            assert_eq!(picture.get_pixel(20, 20).0, INK, "{marker:?}");
            assert_eq!(picture.get_pixel(20 + 11, 20 - 11).0, PAPER, "{marker:?}");
        }
    }

    #[test]
    fn a_line_is_as_wide_as_it_says() {
        // From x = 4 to 12 units on y = 10, 2 units wide: pixels 18 to 21 of a column.
        let picture = drawn(Item::Path {
            points: vec![(4.0, 10.0), (12.0, 10.0)],
            colour: INK,
            width: 2.0,
        });
        let column: Vec<u32> = (0..40)
            .filter(|y| picture.get_pixel(16, *y).0 == INK)
            .collect();
        assert_eq!(column, [18, 19, 20, 21]);
        assert_eq!(picture.get_pixel(30, 20).0, PAPER);
    }

    #[test]
    fn words_are_drawn_to_the_side_that_their_anchor_says() {
        for (anchor, left, right) in [
            (Anchor::Start, false, true),
            (Anchor::End, true, false),
            (Anchor::Middle, true, true),
        ] {
            let picture = drawn(Item::Text {
                at: (10.0, 12.0),
                text: "HH".to_owned(),
                anchor,
                colour: INK,
            });
            let inked = |columns: std::ops::Range<u32>| {
                columns
                    .flat_map(|x| (0..40).map(move |y| (x, y)))
                    .any(|(x, y)| picture.get_pixel(x, y).0 == INK)
            };
            assert_eq!((inked(0..19), inked(21..40)), (left, right), "{anchor:?}");
        }
    }

    #[test]
    fn what_lies_outside_the_page_is_left_out() {
        let picture = drawn(Item::Box {
            area: [-5.0, -5.0, 50.0, 50.0],
            colour: INK,
        });
        assert!(picture.pixels().all(|pixel| pixel.0 == INK));
    }
}
