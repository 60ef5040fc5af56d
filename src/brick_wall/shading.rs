//! Normals and occlusion of a height field that repeats in both directions.

use ndarray::Array2;

/// Height 1 in tiles: how deep the relief is compared with its extent.
const RELIEF: f64 = 0.034;

/// Neighbour of a row or column index, around the border.
fn around(index: usize, offset: isize, size: usize) -> usize {
    (index as isize + offset).rem_euclid(size as isize) as usize
}

/// Unit normal (right, up, out of the wall) at a texel, from central differences.
pub(super) fn normal(height: &Array2<f64>, row: usize, column: usize) -> [f64; 3] {
    let size = height.nrows();
    let across = height[[row, around(column, 1, size)]] - height[[row, around(column, -1, size)]];
    let down = height[[around(row, 1, size), column]] - height[[around(row, -1, size), column]];
    let slope = RELIEF * size as f64 / 2.0;
    let (x, y) = (-across * slope, down * slope);
    let length = (x * x + y * y + 1.0).sqrt();
    [x / length, y / length, 1.0 / length]
}

/// Part of the sky a texel sees, 0 to 1, weighted by the cosine: in each of 16 directions the
/// highest horizon *s* = sin(angle) hides s² of the light.
pub(super) fn occlusion(height: &Array2<f64>, row: usize, column: usize) -> f64 {
    const DIRECTIONS: [(isize, isize); 16] = [
        (4, 0),
        (4, 2),
        (3, 3),
        (2, 4),
        (0, 4),
        (-2, 4),
        (-3, 3),
        (-4, 2),
        (-4, 0),
        (-4, -2),
        (-3, -3),
        (-2, -4),
        (0, -4),
        (2, -4),
        (3, -3),
        (4, -2),
    ];
    // In quarters of a direction's length; together about 1/12 tile.
    const STEPS: [isize; 6] = [1, 2, 4, 8, 14, 20];
    // Crevices of real masonry are deeper than the relief that displacement is given.
    const DEPTH: f64 = 2.2;
    let size = height.nrows();
    let here = height[[row, column]];
    let mut hidden = 0.0;
    for (dx, dy) in DIRECTIONS {
        let mut steepest = 0.0_f64;
        for step in STEPS {
            let reach = |direction: isize| direction * step * size as isize / (4 * 256);
            let (ox, oy) = (reach(dx), reach(dy));
            let distance = ((ox * ox + oy * oy) as f64).sqrt() / size as f64;
            if distance > 0.0 {
                let there = height[[around(row, oy, size), around(column, ox, size)]];
                steepest = steepest.max((there - here) * RELIEF * DEPTH / distance);
            }
        }
        hidden += steepest * steepest / (1.0 + steepest * steepest);
    }
    1.0 - hidden / DIRECTIONS.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flat_field_faces_out_and_sees_the_whole_sky() {
        let flat = Array2::from_elem((8, 8), 0.5);
        assert_eq!(normal(&flat, 0, 7), [0.0, 0.0, 1.0]);
        assert_eq!(occlusion(&flat, 0, 7), 1.0);
    }

    #[test]
    fn green_points_up_the_image() {
        // Height grows downwards, so the surface faces up.
        let ramp = Array2::from_shape_fn((8, 8), |(row, _)| row as f64 / 8.0);
        let [x, y, _] = normal(&ramp, 3, 3);
        assert_eq!(x, 0.0);
        assert!(y > 0.0);
    }

    #[test]
    fn borders_are_like_any_other_place() {
        // The field moved around by (5, 11) has the same shading, moved around.
        let (size, (dy, dx)) = (32, (5, 11));
        let at = |row: usize, column: usize| ((row * 7 + column * 13) % 32) as f64 / 32.0;
        let field = Array2::from_shape_fn((size, size), |(row, column)| at(row, column));
        let moved = Array2::from_shape_fn((size, size), |(row, column)| {
            field[[(row + dy) % size, (column + dx) % size]]
        });
        for row in 0..size {
            for column in 0..size {
                let (there_row, there_column) = ((row + dy) % size, (column + dx) % size);
                let there = normal(&field, there_row, there_column);
                assert_eq!(normal(&moved, row, column), there);
                let there = occlusion(&field, there_row, there_column);
                assert_eq!(occlusion(&moved, row, column), there);
            }
        }
    }
}
