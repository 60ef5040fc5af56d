//! Digits: numbers in a picture, in letters of 3×5 dots.

use image::{Rgb, RgbImage};

/// Pixels along the side of a dot.
const DOT: u32 = 2;
/// Pixels from a letter to the next.
const ADVANCE: u32 = 4 * DOT;
/// Pixels of a letter's height.
pub(super) const HEIGHT: u32 = 5 * DOT;

/// Rows of three dots, the left one the highest bit.
fn dots(letter: char) -> [u8; 5] {
    match letter {
        '0' => [7, 5, 5, 5, 7],
        '1' => [2, 6, 2, 2, 7],
        '2' => [7, 1, 7, 4, 7],
        '3' => [7, 1, 7, 1, 7],
        '4' => [5, 5, 7, 1, 1],
        '5' => [7, 4, 7, 1, 7],
        '6' => [7, 4, 7, 5, 7],
        '7' => [7, 1, 1, 1, 1],
        '8' => [7, 5, 7, 5, 7],
        '9' => [7, 5, 7, 1, 7],
        '.' => [0, 0, 0, 0, 2],
        '%' => [5, 1, 2, 4, 5],
        _ => [0; 5],
    }
}

/// Pixels of a text's width.
pub(super) fn width(text: &str) -> u32 {
    ADVANCE * text.len() as u32
}

/// Draws digits, points and percent signs; what lies outside the picture is not drawn.
pub(super) fn draw(picture: &mut RgbImage, text: &str, left: u32, top: u32) {
    for (index, letter) in text.chars().enumerate() {
        for (row, dots) in dots(letter).into_iter().enumerate() {
            for column in (0..3).filter(|column| dots >> (2 - column) & 1 == 1) {
                let x = left + ADVANCE * index as u32 + DOT * column;
                let y = top + DOT * row as u32;
                for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                    if let Some(pixel) = picture.get_pixel_mut_checked(x + dx, y + dy) {
                        *pixel = Rgb([0; 3]);
                    }
                }
            }
        }
    }
}
