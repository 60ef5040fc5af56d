use ntmu_isa::profile::Profile;
use ntmu_isa::round::Rounding;
use ntmu_isa::sampler::lod::{Level, from_bits, from_footprint};
use ntmu_isa::sampler::{MipFilter, Sampler};

fn profile(lod_bits: u8, coordinate: Rounding) -> Profile {
    Profile {
        lod_bits,
        coordinate,
        ..Profile::NORMATIVE
    }
}

/// In f64, which holds a truncated f32 of moderate size plus a multiple of 1/256 exactly.
fn naive(lod: f32, sampler: &Sampler, mip_count: u8, profile: &Profile) -> u32 {
    let lod = if lod.is_nan() { 0.0 } else { f64::from(lod) };
    let biased = lod + f64::from(sampler.bias) / 256.0;
    let (low, high) = (
        f64::from(sampler.min_lod) / 256.0,
        f64::from(sampler.max_lod) / 256.0,
    );
    let steps = biased.min(high).max(low) * 2_f64.powi(profile.lod_bits.into());
    let rounded = match profile.coordinate {
        Rounding::HalfUp => (steps + 0.5).floor(),
        Rounding::HalfEven => steps.round_ties_even(),
        Rounding::HalfAway => steps.round(),
        Rounding::Floor => steps.floor(),
    };
    let last = f64::from(u32::from(mip_count - 1) << profile.lod_bits);
    rounded.clamp(0.0, last) as u32
}

#[test]
fn every_truncated_f32_gives_the_level_of_the_definition() {
    let samplers = [
        (0, 0, 4095),
        (-130, 0, 4095),
        (4093, 100, 900),
        (-4096, 900, 100),
    ]
    .map(|(bias, min_lod, max_lod)| Sampler {
        bias,
        min_lod,
        max_lod,
        ..Sampler::default()
    });
    for (bits, mode) in (4..=8).flat_map(|b| Rounding::ALL.map(|m| (b, m))) {
        let profile = profile(bits, mode);
        for (sampler, high) in samplers
            .iter()
            .flat_map(|s| (0..=u16::MAX).map(move |h| (s, h)))
        {
            let lod = f32::from_bits(u32::from(high) << 16);
            // Below 2^−20 the sum with a bias leaves f64: see the next test.
            if lod != 0.0 && lod.abs() < 1e-6 {
                continue;
            }
            let level = Level::of(from_bits(lod.to_bits()), sampler, 12, &profile);
            let fixed = (u32::from(level.mip) << bits) + level.fraction;
            assert_eq!(
                fixed,
                naive(lod, sampler, 12, &profile),
                "{lod} {sampler:?}"
            );
        }
    }
}

#[test]
fn a_level_below_the_last_place_moves_a_tie_and_a_floor() {
    let profile = profile(4, Rounding::HalfEven);
    // 8/256 is half of the last of four bits.
    let sampler = Sampler {
        bias: 8,
        ..Sampler::default()
    };
    let fraction = |bits| Level::of(from_bits(bits), &sampler, 12, &profile).fraction;
    assert_eq!(fraction(0), 0);
    assert_eq!(fraction(1), 1);
    assert_eq!(fraction(0x8000_0001), 0);
}

#[test]
fn the_nearest_mip_is_that_of_the_rounded_level_plus_a_half() {
    let sampler = Sampler {
        mip_filter: MipFilter::Point,
        ..Sampler::default()
    };
    let mip = |lod: f32| {
        let profile = profile(8, Rounding::HalfEven);
        Level::of(from_bits(lod.to_bits()), &sampler, 5, &profile).mip
    };
    assert_eq!(
        [0.0, 0.49, 0.5, 1.49, 1.5, 3.9, 99.0].map(mip),
        [0, 0, 1, 1, 2, 4, 4]
    );
    // Half a last place below a half rounds to it, and a half goes up.
    assert_eq!(mip(0.5 - 1.0 / 1024.0), 1);
    assert_eq!([-1.0, f32::NAN, f32::NEG_INFINITY].map(mip), [0; 3]);
    assert_eq!(mip(f32::INFINITY), 4);
}

#[test]
fn no_bias_brings_a_level_outside_any_chain_back() {
    let profile = Profile::NORMATIVE;
    for bias in [-4096, 4093] {
        let sampler = Sampler {
            bias,
            ..Sampler::default()
        };
        let mip = |lod| Level::of(lod, &sampler, 15, &profile).mip;
        assert_eq!(mip(from_bits(f32::INFINITY.to_bits())), 14);
        assert_eq!(mip(from_bits((-1e30_f32).to_bits())), 0);
        assert_eq!(mip(from_footprint(i32::MIN)), 0);
        assert_eq!(mip(from_footprint(i32::MAX)), 14);
    }
}
