use ntmu_isa::profile::Profile;
use ntmu_isa::sampler::Footprint;
use ntmu_isa::sampler::coordinate::LINE_BITS;
use ntmu_isa::sampler::footprint::{LOWEST, log2};

fn of(x: [f32; 2], y: [f32; 2], size: [u32; 2], max: u8) -> Footprint {
    let bits = |gradient: [f32; 2]| gradient.map(f32::to_bits);
    Footprint::of(bits(x), bits(y), size, max, &Profile::NORMATIVE)
}

#[test]
fn the_logarithm_is_the_floor_of_the_real_one() {
    for bits in 0..=15 {
        let unit = f64::from(1_u32 << bits);
        for number in (1..3000_u128).map(|n| n << 70) {
            let real = (number as f64).log2() * unit;
            let found = f64::from(log2(number, bits));
            // f64 has 2^−46 at this size, in units of at most 2^−15: far from half a unit.
            let slack = 1e-7;
            assert!(
                found <= real + slack && found > real - 1.0 - slack,
                "{number} {bits}"
            );
            let is_power = number.is_power_of_two();
            assert!(!is_power || found == real, "{number} {bits}");
        }
    }
}

#[test]
fn square_footprints_of_powers_of_two_have_whole_levels() {
    for level in -10..=10 {
        let texels = 2_f32.powi(level);
        let footprint = of([texels / 64.0, 0.0], [0.0, texels / 32.0], [64, 32], 16);
        assert_eq!((footprint.probes, footprint.lod), (1, level << 16));
    }
}

#[test]
fn probes_are_the_smallest_number_that_reaches_the_minor_axis() {
    for major in 1..=200_u32 {
        let length = |texels: u32| texels as f32 / 256.0;
        for minor in 1..=major {
            let footprint = of([length(major), 0.0], [0.0, length(minor)], [256, 256], 16);
            let probes = major.div_ceil(minor).min(16);
            assert_eq!(u32::from(footprint.probes), probes, "{major} by {minor}");
            let real = (f64::from(major) / f64::from(probes)).log2() * 65_536.0;
            let level = f64::from(footprint.lod);
            assert!(level <= real + 1e-6 && level > real - 1.0 - 1e-6);
        }
    }
}

#[test]
fn the_line_is_the_longer_gradient_and_y_where_they_are_equal() {
    let quarter = 1 << (LINE_BITS - 2);
    let longer_x = of([0.25, 0.0], [0.0, 0.2], [16, 16], 8);
    assert_eq!(longer_x.line, [quarter, 0]);
    let equal = of([0.25, 0.0], [0.0, -0.25], [16, 16], 8);
    assert_eq!(equal.line, [0, -quarter]);
    // Longer in texels, not in textures.
    let wide = of([0.25, 0.0], [0.0, 0.5], [64, 16], 8);
    assert_eq!(wide.line, [quarter, 0]);
}

#[test]
fn gradients_that_are_no_numbers_or_too_large_have_a_footprint() {
    let nan = of([f32::NAN; 2], [f32::NAN; 2], [16, 16], 8);
    assert_eq!((nan.probes, nan.line, nan.lod), (1, [0, 0], LOWEST));
    let infinite = of([f32::INFINITY, 0.0], [0.0; 2], [16, 16], 8);
    assert_eq!((infinite.probes, infinite.line), (8, [i32::MAX, 0]));
    assert_eq!(infinite.lod, (24 - 3) << 16);
    let negative = of([f32::NEG_INFINITY; 2], [f32::MAX; 2], [16_384; 2], 16);
    assert_eq!((negative.probes, negative.line), (1, [i32::MAX; 2]));
}
