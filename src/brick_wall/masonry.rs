//! Where the bricks are: a running bond, and the distance of a place to its brick's edge.

use super::noise::{fractal, gradient, hash, unit};

/// Courses on the tile; even, so that the half-brick offset of every other course meets itself.
pub(super) const COURSES: i64 = 8;
/// Bricks in one course.
const BRICKS: i64 = 3;
/// Length of a brick with its joint, in course heights.
const LENGTH: f64 = COURSES as f64 / BRICKS as f64;
/// Half the thickness of a joint, in course heights.
const HALF_JOINT: f64 = 0.055;

/// A place on the wall in terms of the nearest brick. Lengths are in course heights.
#[derive(Debug, Clone, Copy)]
pub(super) struct Place {
    /// Hash that is the brick's identity.
    pub(super) brick: u64,
    /// Offset from the brick's centre, to the right.
    pub(super) x: f64,
    /// Offset from the brick's centre, downwards.
    pub(super) y: f64,
    /// Position along the brick, −1 at its left end, 1 at its right.
    pub(super) along: f64,
    /// Distance to the chipped edge: negative on the brick, positive in the joint.
    pub(super) edge: f64,
}

/// The place at (`u`, `v`), both in tiles, `v` downwards.
pub(super) fn locate(seed: u64, u: f64, v: f64) -> Place {
    // Courses are laid by hand: nothing is quite straight.
    let u = u + 0.004 * gradient(seed ^ 0x11, u * 6.0, v * 6.0, Some((6, 6)));
    let v = v + 0.005 * gradient(seed ^ 0x12, u * 5.0, v * 5.0, Some((5, 5)));
    let down = v * COURSES as f64;
    let course = down.floor() as i64;
    let row = course.rem_euclid(COURSES);
    let shift = 0.5 * (row % 2) as f64 + 0.12 * (unit(hash(seed ^ 0x13, row, 0), 0) - 0.5);
    let across = u * BRICKS as f64 - shift;
    let column = across.floor() as i64;
    let brick = hash(seed ^ 0x14, column.rem_euclid(BRICKS), row);

    let shape = hash(brick, 1, 0);
    let signed = |lane: u32| 2.0 * unit(shape, lane) - 1.0;
    let x = (across - column as f64 - 0.5) * LENGTH - 0.03 * signed(0);
    let y = down - course as f64 - 0.5 - 0.012 * signed(1);
    let turn = 0.012 * signed(2);
    let (x, y) = (x + turn * y, y - turn * x);
    let half_length = LENGTH / 2.0 - HALF_JOINT - 0.035 * (1.0 + signed(3)) / 2.0;
    let half_height = 0.5 - HALF_JOINT - 0.02 * unit(hash(brick, 2, 0), 0);
    Place {
        brick,
        x,
        y,
        along: x / half_length,
        edge: edge(brick, x, y, half_length, half_height),
    }
}

/// Signed distance to a rectangle with one radius for each corner, worn by use.
fn edge(brick: u64, x: f64, y: f64, half_length: f64, half_height: f64) -> f64 {
    let lane = u32::from(x > 0.0) + 2 * u32::from(y > 0.0);
    let wear = unit(hash(brick, 3, 0), lane);
    let radius = 0.04 + 0.16 * wear * wear * wear;
    let (dx, dy) = (
        x.abs() - half_length + radius,
        y.abs() - half_height + radius,
    );
    let (ox, oy) = (dx.max(0.0), dy.max(0.0));
    let distance = (ox * ox + oy * oy).sqrt() + dx.max(dy).min(0.0) - radius;
    let wobble = 0.036 * fractal(hash(brick, 4, 0), x * 3.0, y * 3.0, None, 4);
    let chip = gradient(hash(brick, 5, 0), x * 2.6, y * 2.6, None);
    let notch = gradient(hash(brick, 6, 0), x * 7.0, y * 7.0, None);
    distance + wobble + 0.45 * (chip - 0.38).max(0.0) + 0.20 * (notch - 0.38).max(0.0)
}
