//! The rate: what a texture set costs in bits.

/// Bits per pixel per channel: (`grid_bits` + `parameter_bits`) / (`width` · `height` ·
/// `channels`), with the size of mip 0.
///
/// The paper does not say whether the texels of the other mips count. Mip 0 alone reproduces every
/// rate it prints (0.18, 0.39, 0.73 for 9 channels, 0.20, 0.44, 0.82 for 8, cut after two
/// digits); the whole chain gives 0.13, 0.29, 0.55. Bits of all mips are in the numerator all the
/// same: one pair of grids serves the chain.
#[must_use]
pub fn bppc(grid_bits: u64, parameter_bits: u64, width: u32, height: u32, channels: usize) -> f64 {
    (grid_bits + parameter_bits) as f64 / (f64::from(width) * f64::from(height) * channels as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bppc_reproduces_the_rates_of_the_paper() {
        // Grids (N/2, N) at 4 bits and 1/8 resolution; MLP of 4·c0 + c1 + 12 + 1 inputs, four
        // residual blocks of two square layers, one output a channel, 16-bit parameters.
        let percent = |n: u64, hidden: u64, channels: u64| {
            let grid_bits = 4 * (n / 2 + n) * (2048 / 8) * (2048 / 8);
            let inputs = 4 * (n / 2) + n + 12 + 1;
            let parameters =
                (inputs + 1) * hidden + 8 * (hidden + 1) * hidden + (hidden + 1) * channels;
            let rate = bppc(grid_bits, 16 * parameters, 2048, 2048, channels as usize);
            (100.0 * rate).floor()
        };
        assert_eq!(
            [percent(16, 64, 9), percent(32, 128, 9), percent(64, 128, 9)],
            [18., 39., 73.]
        );
        assert_eq!(
            [percent(16, 64, 8), percent(32, 128, 8), percent(64, 128, 8)],
            [20., 44., 82.]
        );
    }
}
