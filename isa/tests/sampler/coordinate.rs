use ntmu_isa::profile::{PointSnap, Profile};
use ntmu_isa::round::Rounding;
use ntmu_isa::sampler::Address;
use ntmu_isa::sampler::coordinate::{LINE_BITS, Pair, Scaled, Step};
use proptest::prelude::*;

/// 1 in the naive numbers: fractions of 2^−64.
const ONE: i128 = 1 << 64;

/// An f32 in 1/2^64. Below 2^−40 it is taken as ±2^−64: nothing that small lies on a tie, and all of
/// it lies on the same side of one.
fn naive(float: f32) -> i128 {
    assert!(float.is_finite() && float.abs() < 16_777_216.0);
    let real = f64::from(float);
    if real == 0.0 {
        0
    } else if real.abs() < 2_f64.powi(-40) {
        real.signum() as i128
    } else {
        (real * 2_f64.powi(64)) as i128
    }
}

/// Section 7.18.6 on exact numbers.
fn reduced(float: f32, address: Address) -> i128 {
    let is_large = !float.is_nan() && float.abs() >= 16_777_216.0;
    let float = if float.is_nan() { 0.0 } else { float };
    match address {
        // What is larger is an even integer, or infinite.
        Address::Wrap | Address::Mirror if is_large => 0,
        Address::Wrap => naive(float).rem_euclid(ONE),
        Address::Mirror => naive(float) % (2 * ONE),
        Address::MirrorOnce | Address::Clamp | Address::Border => {
            if float <= -10.0 {
                -10 * ONE
            } else if float >= 10.0 {
                10 * ONE
            } else {
                naive(float)
            }
        }
    }
}

/// `numerator / denominator` to the nearest integer by comparing distances.
fn rounded(numerator: i128, denominator: i128, rounding: Rounding) -> i64 {
    let below = numerator.div_euclid(denominator);
    let left = numerator - below * denominator;
    let right = denominator - left;
    let up = match rounding {
        Rounding::Floor => false,
        _ if left != right => left > right,
        Rounding::HalfUp => true,
        Rounding::HalfEven => below % 2 != 0,
        Rounding::HalfAway => numerator > 0,
    };
    (below + i128::from(up)) as i64
}

fn profile(subtexel_bits: u8, coordinate: Rounding, point_snap: PointSnap) -> Profile {
    Profile {
        subtexel_bits,
        coordinate,
        point_snap,
        ..Profile::NORMATIVE
    }
}

fn check(bits: u32, address: Address, size: u32, profile: &Profile) {
    let float = f32::from_bits(bits);
    let scaled = Scaled::of(bits, address, Step::CENTRE, size);
    let exact = reduced(float, address) * i128::from(size);
    let unit = ONE >> profile.subtexel_bits;
    let linear = rounded(exact - ONE / 2, unit, profile.coordinate);
    let one = 1_i64 << profile.subtexel_bits;
    let pair = Pair {
        first: linear.div_euclid(one),
        fraction: linear.rem_euclid(one) as u32,
    };
    let context = || format!("{float:e} {} {size} {profile:?}", address.name());
    assert_eq!(scaled.pair(profile), pair, "{}", context());
    let texel = match profile.point_snap {
        PointSnap::Fixed => rounded(exact, unit, profile.coordinate).div_euclid(one),
        PointSnap::Floor => exact.div_euclid(ONE) as i64,
    };
    assert_eq!(scaled.texel(profile), texel, "{}", context());
}

/// Every upper half of an f32, with the lower half zero and with one that changes.
fn patterns() -> impl Iterator<Item = u32> {
    (0..=u16::MAX).flat_map(|high| {
        let high = u32::from(high);
        [high << 16, high << 16 | high.wrapping_mul(40_503) & 0xffff]
    })
}

#[test]
fn every_truncated_f32_in_every_mode_lies_where_exact_numbers_say() {
    for address in Address::ALL {
        for (bits, subtexel) in patterns().flat_map(|p| (4..=12).map(move |s| (p, s))) {
            for (size, snap) in [(1, PointSnap::Fixed), (37, PointSnap::Floor)] {
                check(
                    bits,
                    address,
                    size,
                    &profile(subtexel, Rounding::HalfEven, snap),
                );
            }
        }
    }
}

#[test]
fn every_rounding_and_size_lies_where_exact_numbers_say() {
    for address in Address::ALL {
        for (bits, rounding) in patterns().flat_map(|p| Rounding::ALL.map(|r| (p, r))) {
            for (size, snap) in [(6, PointSnap::Fixed), (16_384, PointSnap::Floor)] {
                check(bits, address, size, &profile(8, rounding, snap));
            }
        }
    }
}

#[test]
fn ties_go_where_the_rounding_says() {
    // s = 2.5 + 1/32, 2 and a half sixteenth less half a texel, at 4 bits: 2 + 0.5/16.
    let u = (2.5 + 1.0 / 32.0) / 4.0_f32;
    let fraction = |sign: f32, rounding| {
        let profile = profile(4, rounding, PointSnap::Fixed);
        let pair = Scaled::of((sign * u).to_bits(), Address::Clamp, Step::CENTRE, 4).pair(&profile);
        pair.first * 16 + i64::from(pair.fraction)
    };
    assert_eq!(
        Rounding::ALL.map(|r| fraction(1.0, r)),
        [33, 32, 33, 32],
        "half-up, half-even, half-away, floor"
    );
    // −3 − 0.5/16.
    assert_eq!(
        Rounding::ALL.map(|r| fraction(-1.0, r)),
        [-48, -48, -49, -49]
    );
}

#[test]
fn numbers_that_are_none_and_infinities_have_a_place() {
    let at = |float: f32, address| {
        let scaled = Scaled::of(float.to_bits(), address, Step::CENTRE, 4);
        scaled.texel(&Profile::NORMATIVE)
    };
    for address in Address::ALL {
        assert_eq!(at(f32::NAN, address), 0);
    }
    for address in [Address::Wrap, Address::Mirror] {
        assert_eq!(
            [f32::INFINITY, f32::NEG_INFINITY].map(|u| at(u, address)),
            [0, 0]
        );
    }
    for address in [Address::MirrorOnce, Address::Clamp, Address::Border] {
        assert_eq!(
            [f32::INFINITY, f32::NEG_INFINITY].map(|u| at(u, address)),
            [40, -40]
        );
        assert_eq!([f32::MAX, f32::MIN].map(|u| at(u, address)), [40, -40]);
    }
}

#[test]
fn a_number_just_below_zero_wraps_to_the_first_texel_and_by_floor_to_the_last() {
    for bits in [0x8000_0001, (-1e-20_f32).to_bits()] {
        let texel = |rounding, snap| {
            let scaled = Scaled::of(bits, Address::Wrap, Step::CENTRE, 8);
            scaled.texel(&profile(8, rounding, snap))
        };
        // Texel 8 is texel 0 after the address mode.
        assert_eq!(texel(Rounding::HalfEven, PointSnap::Fixed), 8);
        assert_eq!(texel(Rounding::Floor, PointSnap::Fixed), 7);
        assert_eq!(texel(Rounding::HalfEven, PointSnap::Floor), 7);
    }
}

/// The conversion as a chain of f32 operations, each rounded to nearest even.
fn by_f32(u: f32, address: Address, size: u32) -> i64 {
    let reduced = match address {
        Address::Wrap => u - u.floor(),
        Address::Mirror => (u / 2.0 - (u / 2.0).trunc()) * 2.0,
        Address::MirrorOnce | Address::Clamp | Address::Border => u.clamp(-10.0, 10.0),
    };
    ((reduced * size as f32 - 0.5) * 256.0).round_ties_even() as i64
}

#[test]
fn a_chain_of_f32_departs_by_one_last_place_at_most() {
    let exact = |u: f32, address, size| {
        let pair = Scaled::of(u.to_bits(), address, Step::CENTRE, size).pair(&Profile::NORMATIVE);
        pair.first * 256 + i64::from(pair.fraction)
    };
    let mut departures = [0_u32; 4];
    for (address, bits) in Address::ALL
        .into_iter()
        .flat_map(|a| patterns().map(move |b| (a, b)))
        .filter(|&(_, bits)| f32::from_bits(bits).is_finite())
    {
        let u = f32::from_bits(bits);
        for (departed, size) in departures.iter_mut().zip([1, 64, 1000, 16_384]) {
            let distance = by_f32(u, address, size).abs_diff(exact(u, address, size));
            assert!(distance <= 1, "{u:e} {size}");
            *departed += u32::from(distance == 1);
        }
    }
    assert!(departures.iter().any(|&count| count > 0), "{departures:?}");
    // s = 2^−9 and a little: above a tie, on it once half a texel is subtracted in f32.
    let u = f32::from_bits(0x3b00_0001);
    assert_eq!(by_f32(u, Address::Clamp, 1), -128);
    assert_eq!(exact(u, Address::Clamp, 1), -127);
}

proptest! {
    #[test]
    fn a_probe_lies_where_its_own_coordinate_would(
        u in -20.0_f32..20.0,
        tiny in 0_u32..3,
        line in any::<i32>(),
        (count, index) in (1_u8..=16).prop_flat_map(|count| (Just(count), 0..count)),
        size in 1_u32..=16_384,
        subtexel in 4_u8..=12,
        mode in 0_usize..5,
        rounding in 0_usize..4,
    ) {
        let address = Address::ALL[mode];
        let rounding = Rounding::ALL[rounding];
        let profile = profile(subtexel, rounding, PointSnap::Fixed);
        let u = u * [1.0, 1e-12, 1e-30][tiny as usize];
        let step = Step { line, index, count };
        let pair = Scaled::of(u.to_bits(), address, step, size).pair(&profile);
        // (u + line·(2·index + 1 − count)/(2·count)) in 1/(2·count·2^64), reduced by itself.
        let parts = 2 * i128::from(count);
        let odd = 2 * i128::from(index) + 1 - i128::from(count);
        let moved = naive(u) * parts + ((i128::from(line) * odd) << (64 - LINE_BITS));
        let whole = ONE * parts;
        let moved = match address {
            Address::Wrap => moved.rem_euclid(whole),
            Address::Mirror => moved % (2 * whole),
            Address::MirrorOnce | Address::Clamp | Address::Border => {
                moved.clamp(-10 * whole, 10 * whole)
            }
        };
        let exact = moved * i128::from(size) - whole / 2;
        let fixed = rounded(exact, whole >> subtexel, rounding);
        prop_assert_eq!(pair.first, fixed >> subtexel);
        prop_assert_eq!(i64::from(pair.fraction), fixed & ((1 << subtexel) - 1));
    }
}
