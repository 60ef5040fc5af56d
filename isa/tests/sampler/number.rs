use ntmu_isa::sampler::number::{FIXED_BITS, Fixed, Number};

#[test]
fn bits_are_the_numbers_that_they_are() {
    for high in 0..=u16::MAX {
        let bits = u32::from(high) << 16 | 0x1234;
        let number = Number::from_bits(bits);
        let float = f64::from(f32::from_bits(bits));
        if float.is_nan() {
            assert_eq!(number.significand, 0);
        } else {
            let real = number.significand as f64 * 2_f64.powi(number.exponent);
            assert_eq!(real, float);
        }
    }
    let of = |x: f32| Number::from_bits(x.to_bits());
    let beyond = of(f32::INFINITY).times(3);
    assert!(beyond.value > 1 << 100);
    assert_eq!(of(f32::NEG_INFINITY).times(3), Fixed::exact(-beyond.value));
    assert_eq!(of(f32::MAX).times(1), beyond);
    assert_eq!(of(1.5).times(3), Fixed::exact(9 << (FIXED_BITS - 1)));
    let smallest = Fixed {
        value: 0,
        is_between: true,
    };
    assert_eq!(of(f32::from_bits(1)).times(1 << 20), smallest);
    assert_eq!(of(-f32::from_bits(1)).times(1 << 20).value, -1);
    assert_eq!(of(-0.0).times(7), Fixed::exact(0));
}
