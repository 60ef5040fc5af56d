//! Colour: numbers as colours of equal steps to the eye.

/// Viridis (S. van der Walt, N. Smith, 2015, CC0) at ten places, in sRGB.
const VIRIDIS: [[u8; 3]; 10] = [
    [68, 1, 84],
    [72, 40, 120],
    [62, 74, 137],
    [49, 104, 142],
    [38, 130, 142],
    [31, 158, 137],
    [53, 183, 121],
    [110, 206, 88],
    [181, 222, 43],
    [253, 231, 37],
];

/// The colour of a number from 0 to 1.
pub(crate) fn of(value: f64) -> [u8; 3] {
    let place = value.clamp(0.0, 1.0) * (VIRIDIS.len() - 1) as f64;
    let index = (place as usize).min(VIRIDIS.len() - 2);
    let fraction = place - index as f64;
    let (low, high) = (VIRIDIS[index], VIRIDIS[index + 1]);
    std::array::from_fn(|channel| {
        let (low, high) = (f64::from(low[channel]), f64::from(high[channel]));
        (low + (high - low) * fraction).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_is_lighter_from_end_to_end() {
        assert_eq!([of(0.0), of(1.0)], [VIRIDIS[0], VIRIDIS[9]]);
        let light = |value| {
            let [red, green, blue] = of(value).map(f64::from);
            0.2126 * red + 0.7152 * green + 0.0722 * blue
        };
        for step in 0..100 {
            let value = f64::from(step) / 100.0;
            assert!(light(value) < light(value + 0.01), "{value}");
        }
    }
}
