//! Noise that is the same to the bit on every platform: integer hashes, and of floating point
//! only + − × ÷, square root and rounding, which IEEE 754 defines exactly.

/// A well-mixed word for a lattice point. The finaliser is that of SplitMix64 (Steele et al.
/// 2014).
pub(super) fn hash(seed: u64, x: i64, y: i64) -> u64 {
    let mut word = seed
        .wrapping_add((x as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15))
        .wrapping_add((y as u64).wrapping_mul(0xc2b2_ae3d_27d4_eb4f));
    word = (word ^ (word >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    word = (word ^ (word >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    word ^ (word >> 31)
}

/// The word as a number in 0..1; different `lane`s (0..=3) of one word are independent.
pub(super) fn unit(word: u64, lane: u32) -> f64 {
    ((word >> (16 * lane)) & 0xffff) as f64 / 65536.0
}

/// 0 below 0, 1 above 1, and 3x² − 2x³ between.
pub(super) fn smooth(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * (3.0 - 2.0 * x)
}

/// `a` at `t` = 0, `b` at `t` = 1.
pub(super) fn mix(a: f64, b: f64, t: f64) -> f64 {
    a + (b - a) * t
}

/// Number of lattice cells after which noise repeats, along x and y; `None` never does.
pub(super) type Period = Option<(i64, i64)>;

fn wrapped(x: i64, y: i64, period: Period) -> (i64, i64) {
    period.map_or((x, y), |(px, py)| (x.rem_euclid(px), y.rem_euclid(py)))
}

/// Gradient noise (Perlin 1985, with the quintic fade of 2002), about −1 to 1, one feature for
/// each lattice cell.
pub(super) fn gradient(seed: u64, x: f64, y: f64, period: Period) -> f64 {
    let (left, top) = (x.floor(), y.floor());
    let (fx, fy) = (x - left, y - top);
    let corner = |dx: i64, dy: i64| {
        let (cx, cy) = wrapped(left as i64 + dx, top as i64 + dy, period);
        let word = hash(seed, cx, cy);
        let (gx, gy) = (2.0 * unit(word, 0) - 1.0, 2.0 * unit(word, 1) - 1.0);
        gx * (fx - dx as f64) + gy * (fy - dy as f64)
    };
    let fade = |t: f64| t * t * t * (t * (t * 6.0 - 15.0) + 10.0);
    let (wx, wy) = (fade(fx), fade(fy));
    let upper = mix(corner(0, 0), corner(1, 0), wx);
    let lower = mix(corner(0, 1), corner(1, 1), wx);
    1.6 * mix(upper, lower, wy)
}

/// `octaves` layers of [`gradient`], each of half the size and half the strength of the one
/// before, scaled to about −1 to 1.
pub(super) fn fractal(seed: u64, x: f64, y: f64, period: Period, octaves: u32) -> f64 {
    let (mut sum, mut strength, mut total, mut scale) = (0.0, 1.0, 0.0, 1_i64);
    for octave in 0..octaves {
        let period = period.map(|(px, py)| (px * scale, py * scale));
        let zoom = scale as f64;
        sum += strength * gradient(seed ^ u64::from(octave) << 40, x * zoom, y * zoom, period);
        total += strength;
        strength *= 0.5;
        scale *= 2;
    }
    if octaves == 0 { 0.0 } else { 1.5 * sum / total }
}

/// What cellular noise knows about a place.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cell {
    /// Distance to the nearest feature point, in lattice cells.
    pub(super) nearest: f64,
    /// Distance to the second nearest.
    pub(super) second: f64,
    /// Hash of the nearest point.
    pub(super) word: u64,
}

/// Cellular noise (Worley 1996): one feature point somewhere in each lattice cell.
pub(super) fn cellular(seed: u64, x: f64, y: f64, period: Period) -> Cell {
    let (left, top) = (x.floor(), y.floor());
    let mut found = Cell {
        nearest: 8.0,
        second: 8.0,
        word: 0,
    };
    for dy in -1..=1 {
        for dx in -1..=1 {
            let (cx, cy) = wrapped(left as i64 + dx, top as i64 + dy, period);
            let word = hash(seed, cx, cy);
            let px = left + dx as f64 + unit(word, 0) - x;
            let py = top + dy as f64 + unit(word, 1) - y;
            let distance = px * px + py * py;
            if distance < found.nearest {
                found = Cell {
                    nearest: distance,
                    second: found.nearest,
                    word,
                };
            } else if distance < found.second {
                found.second = distance;
            }
        }
    }
    Cell {
        nearest: found.nearest.sqrt(),
        second: found.second.sqrt(),
        word: found.word,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn noise_repeats_after_its_period() {
        // All coordinates are multiples of 1/16, so moving them by a period is exact.
        for step in 0..256 {
            let (x, y) = (f64::from(step) / 16.0, f64::from(step * 7 % 256) / 16.0);
            let period = Some((4, 8));
            let here = fractal(3, x, y, period, 3);
            assert_eq!(here, fractal(3, x + 4.0, y - 8.0, period, 3));
            let (here, there) = (
                cellular(3, x, y, period),
                cellular(3, x - 4.0, y + 8.0, period),
            );
            assert_eq!((here.nearest, here.word), (there.nearest, there.word));
        }
    }

    #[test]
    fn noise_is_zero_at_lattice_points() {
        assert_eq!(gradient(9, 3.0, -2.0, None), 0.0);
    }
}
