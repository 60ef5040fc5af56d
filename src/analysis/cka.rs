//! CKA: how alike two sets of features of the same examples are.

use ndarray::{Array2, ArrayView2, Axis};

/// Linear centred kernel alignment of features x \[example, feature\] and y, which have the same
/// examples: ‖YᵀX‖² / (‖XᵀX‖ ‖YᵀY‖) with centred columns and Frobenius norms (Kornblith et al.,
/// ICML 2019, equation 5 and table 1). 1 where one is the other turned, scaled and shifted; 0 where
/// no feature of one is correlated with any of the other.
///
/// `None` where the numbers of examples differ or features of either are all constant.
#[must_use]
pub fn linear_cka(x: ArrayView2<'_, f64>, y: ArrayView2<'_, f64>) -> Option<f64> {
    if x.nrows() != y.nrows() {
        return None;
    }
    let (x, y) = (centred(x)?, centred(y)?);
    let square = |a: &Array2<f64>, b: &Array2<f64>| -> f64 {
        a.t().dot(b).iter().map(|value| value * value).sum()
    };
    let (own_x, own_y) = (square(&x, &x), square(&y, &y));
    if own_x == 0.0 || own_y == 0.0 {
        return None;
    }
    // One root: of features beside themselves it is exact.
    Some(square(&y, &x) / (own_x * own_y).sqrt())
}

fn centred(features: ArrayView2<'_, f64>) -> Option<Array2<f64>> {
    let means = features.mean_axis(Axis(0))?;
    Some(&features - &means)
}

/// What independent white Gaussian features would have: the ratio of the expectations of numerator
/// and denominator, √(p·q / ((m + p + 1)(m + q + 1))) for p and q features and m + 1 examples. A
/// small level has few examples, and CKA is far above 0 there by chance alone. Neighbouring cells
/// that depend on each other, and interpolated ones always do, count as fewer: for those this is
/// too low.
#[must_use]
pub fn by_chance(examples: usize, features: [usize; 2]) -> f64 {
    let free = examples.saturating_sub(1) as f64;
    let [p, q] = features.map(|count| count as f64);
    (p * q / ((free + p + 1.0) * (free + q + 1.0))).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Uniform in −½..½, by splitmix64.
    fn noise(examples: usize, features: usize, seed: u64) -> Array2<f64> {
        let mut state = seed;
        Array2::from_shape_fn((examples, features), |_| {
            state = state.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let mut z = state;
            z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
        })
    }

    #[test]
    fn features_are_wholly_like_themselves() {
        for (examples, features) in [(2, 1), (50, 3), (9, 20)] {
            let x = noise(examples, features, 1);
            assert_eq!(linear_cka(x.view(), x.view()), Some(1.0));
        }
    }

    #[test]
    fn turning_scaling_and_shifting_changes_nothing() {
        // A turn of 3-4-5 in the first two features, and an exchange of the last two.
        let x = noise(200, 4, 2);
        let turn = ndarray::array![
            [0.6, -0.8, 0.0, 0.0],
            [0.8, 0.6, 0.0, 0.0],
            [0.0, 0.0, 0.0, 1.0],
            [0.0, 0.0, 1.0, 0.0]
        ];
        let turned = x.dot(&turn) * 3.0 + 7.0;
        let found = linear_cka(x.view(), turned.view()).unwrap();
        // Sums of 200 products of numbers up to 10 (the shift) that cancel to some 1/12 · 9.
        let bound = 200.0 * 4.0 * 100.0 * f64::EPSILON;
        assert!((found - 1.0).abs() < bound, "{found}");
        // A turn that is no turn of all features: less than 1.
        let stretched = &x * &ndarray::array![10.0, 1.0, 1.0, 1.0];
        assert!(linear_cka(x.view(), stretched.view()).unwrap() < 0.9);
    }

    #[test]
    fn independent_noise_has_next_to_nothing_in_common() {
        let (examples, p, q) = (1 << 14, 2_usize, 3_usize);
        let (x, y) = (noise(examples, p, 3), noise(examples, q, 4));
        // Of independent features with variance 1/12 the numerator has the mean m·p·q/12², and by
        // Markov's inequality more than a thousand times that once in a thousand. ‖XᵀX‖ is at
        // least trace/√p, and the trace is the centred sum of squares.
        let sum = |a: &Array2<f64>| -> f64 {
            let centred = centred(a.view()).unwrap();
            centred.iter().map(|v| v * v).sum()
        };
        let (free, pq) = ((examples - 1) as f64, (p * q) as f64);
        let bound = 1000.0 * free * pq / 144.0 * pq.sqrt() / (sum(&x) * sum(&y));
        assert!(bound < 0.2, "{bound}");
        let found = linear_cka(x.view(), y.view()).unwrap();
        assert!(found < bound, "{found} {bound}");
        assert!(by_chance(examples, [p, q]) < bound);
    }

    #[test]
    fn uncorrelated_features_have_nothing_in_common() {
        // Columns of a Hadamard matrix: sums of products are integers, exactly 0.
        let x = ndarray::array![[1.0], [1.0], [-1.0], [-1.0]];
        let y = ndarray::array![[1.0], [-1.0], [1.0], [-1.0]];
        assert_eq!(linear_cka(x.view(), y.view()), Some(0.0));
    }

    #[test]
    fn constant_features_and_other_examples_have_no_alignment() {
        let x = noise(10, 2, 5);
        assert_eq!(linear_cka(x.view(), Array2::ones((10, 2)).view()), None);
        assert_eq!(linear_cka(x.view(), noise(9, 2, 6).view()), None);
        let none = Array2::zeros((0, 2));
        assert_eq!(linear_cka(none.view(), none.view()), None);
    }
}
