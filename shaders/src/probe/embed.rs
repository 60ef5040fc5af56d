//! Probes of what enters the synthesizer: positions, codes, interpolation, waves, level.

use super::{Case, Random, compare, rounding};
use ntmu_isa::embed::{MAX_OCTAVES, Wave, corner_input, lerp_input, level_input, wave_input};
use ntmu_isa::filter::FilterRule;
use ntmu_isa::latent::LatentFormat;
use ntmu_isa::position::{AddressMode, AxisPosition, CornerSnap};
use ntmu_isa::profile::Profile;
use ntmu_isa::pyramid::Pyramid;
use ntmu_isa::round::Rounding;

fn format(bits: u32) -> LatentFormat {
    LatentFormat::new(bits as u8).unwrap()
}

fn rule(code: u32) -> FilterRule {
    FilterRule::from_code(code as u8).unwrap()
}

#[test]
fn positions_agree_at_every_mip_scale_snap_and_address_mode() {
    let mut cases = Vec::new();
    for mip in 0..=14_u32 {
        let texels = 16_384_u32 >> mip;
        for scale in 1..=3_u32 {
            for snap in CornerSnap::ALL {
                for mode in AddressMode::ALL {
                    let packed = scale | u32::from(snap.code()) << 8 | u32::from(mode.code()) << 16;
                    // Every texel near both ends, and a sample between.
                    let chosen = (0..texels)
                        .filter(|texel| *texel < 40 || texels - texel < 40 || texel % 61 == 0);
                    for texel in chosen {
                        for size in [16_384_u32.div_ceil(1 << scale), 1, 2, 3, 37] {
                            cases.push([texel, mip, packed, size]);
                        }
                    }
                }
            }
        }
    }
    compare("probe_position", &cases, |&[texel, mip, packed, size]| {
        let snap = CornerSnap::from_code((packed >> 8) as u8).unwrap();
        let mode = AddressMode::from_code((packed >> 16) as u8).unwrap();
        let axis = AxisPosition::of(texel, mip as u8, packed as u8, snap);
        let [first, second] = axis.corners(size, mode);
        let phase = i32::from(axis.phase);
        [axis.first, phase, first as i32, second as i32]
    });
}

#[test]
fn levels_agree_in_every_pyramid_at_every_mip() {
    let pyramids = || (0..=255_u8).filter_map(Pyramid::from_code);
    let cases: Vec<Case> = pyramids()
        .flat_map(|pyramid| (0..=14).map(move |mip| [u32::from(pyramid.code()), mip, 0, 0]))
        .collect();
    compare("probe_pyramid", &cases, |&[code, mip, _, _]| {
        let (pyramid, mip) = (Pyramid::from_code(code as u8).unwrap(), mip as u8);
        let (level, mip) = (pyramid.level_of(mip), pyramid.mip_in_level(mip));
        [i32::from(level), i32::from(mip), 0, 0]
    });
}

#[test]
fn interpolation_weights_agree_at_all_fractions_of_up_to_eight_bits() {
    let mut cases = Vec::new();
    for rule in [FilterRule::Exact, FilterRule::Factored] {
        let code = u32::from(rule.code());
        for bits in 4..=8_u32 {
            let ones = 1 << bits;
            cases.extend((0..ones * ones).map(|i| [i % ones, i / ones, bits, code]));
        }
    }
    compare("probe_interpolate", &cases, |&[x, y, bits, code]| {
        rule(code)
            .weights([x, y], bits)
            .map(|weight| i32::try_from(weight).unwrap())
    });
}

/// Codes of the corners, fractions, then bytes as `probe_lerp` wants them.
fn lerp_case(
    codes: [u8; 4],
    fractions: [u32; 2],
    [fraction_bits, bits, input_bits]: [u8; 3],
    rule: FilterRule,
    mode: Rounding,
) -> Case {
    [
        u32::from_le_bytes(codes),
        fractions[0] | fractions[1] << 16,
        u32::from_le_bytes([
            fraction_bits,
            bits,
            input_bits,
            rule.code() | mode.code() << 4,
        ]),
        0,
    ]
}

fn expected_lerp(&[codes, fractions, packed, _]: &Case) -> [i32; 4] {
    let [fraction_bits, bits, input_bits, choices] = packed.to_le_bytes();
    let profile = Profile {
        subtexel_bits: fraction_bits,
        interpolate: rule(u32::from(choices & 15)),
        input: rounding(u32::from(choices >> 4)),
        ..Profile::NORMATIVE
    };
    let format = format(u32::from(bits));
    let values = codes.to_le_bytes().map(|code| format.value(code));
    let fractions = [fractions & 0xffff, fractions >> 16];
    [
        lerp_input(values, fractions, format, input_bits, &profile),
        0,
        0,
        0,
    ]
}

#[test]
fn interpolated_inputs_agree_by_every_rule_and_mode_at_every_width() {
    let mut cases = Vec::new();
    let mut random = Random(4);
    for (rule, mode) in FilterRule::ALL
        .into_iter()
        .flat_map(|rule| Rounding::ALL.map(|mode| (rule, mode)))
    {
        // The exact rule is only ever asked with the four bits of a phase; 12 would overflow.
        let widest = if rule == FilterRule::Exact { 11 } else { 12 };
        for (bits, input_bits) in (1..=8).flat_map(|b| (4..=16).map(move |i| (b, i))) {
            let max = u64::from(format(bits.into()).max_code());
            for _ in 0..400 {
                let fraction_bits = 4 + random.below(widest - 3) as u8;
                let fractions = [(); 2].map(|()| random.below(1 << fraction_bits) as u32);
                let ends = random.below(2) == 0;
                let codes = [(); 4].map(|()| {
                    let code = random.below(max + 1);
                    (if ends { code % 2 * max } else { code }) as u8
                });
                let widths = [fraction_bits, bits, input_bits];
                cases.push(lerp_case(codes, fractions, widths, rule, mode));
            }
        }
    }
    compare("probe_lerp", &cases, expected_lerp);
}

#[test]
fn interpolated_inputs_agree_on_all_corners_of_two_bits_at_all_phases() {
    let mut cases = Vec::new();
    for rule in FilterRule::ALL {
        for (corners, phases) in (0..256_u32).flat_map(|c| (0..256_u32).map(move |p| (c, p))) {
            let codes = [0, 2, 4, 6].map(|shift| (corners >> shift & 3) as u8);
            let fractions = [phases % 16, phases / 16];
            let mode = Rounding::ALL[(corners + phases) as usize % 4];
            cases.push(lerp_case(codes, fractions, [4, 2, 8], rule, mode));
        }
    }
    compare("probe_lerp", &cases, expected_lerp);
}

#[test]
fn the_exact_rule_does_not_depend_on_the_bits_of_a_fraction() {
    // What lets the shader keep a phase's four bits whatever the profile has.
    let mut random = Random(5);
    for _ in 0..200_000 {
        let bits = 1 + random.below(8) as u32;
        let max = u64::from(format(bits).max_code()) + 1;
        let values = [(); 4].map(|()| format(bits).value(random.below(max) as u8));
        let phases = [(); 2].map(|()| random.below(16) as u32);
        let input = Rounding::ALL[random.below(4) as usize];
        let at = |subtexel_bits: u8| {
            let profile = Profile {
                subtexel_bits,
                input,
                ..Profile::NORMATIVE
            };
            let fractions = phases.map(|phase| phase << (subtexel_bits - 4));
            lerp_input(values, fractions, format(bits), 8, &profile)
        };
        for subtexel_bits in 5..=12 {
            assert_eq!(at(subtexel_bits), at(4));
        }
    }
}

#[test]
fn unpack_agrees_on_every_code_at_every_bit() {
    let mut cases = Vec::new();
    for bits in 1..=8_u32 {
        for (code, offset) in (0..1_u64 << bits).flat_map(|c| (0..32).map(move |o| (c, o))) {
            // Between zeros and between ones.
            let field = code << offset;
            let around = !(((1_u64 << bits) - 1) << offset);
            for words in [field, field | around] {
                cases.push([words as u32, (words >> 32) as u32, offset, bits]);
            }
        }
    }
    compare("probe_unpack", &cases, |&[low, high, offset, bits]| {
        let words = u64::from(low) | u64::from(high) << 32;
        let code = (words >> offset & ((1 << bits) - 1)) as u8;
        [i32::from(code), format(bits).value(code), 0, 0]
    });
}

#[test]
fn corner_inputs_agree_on_every_value_at_every_width_and_mode() {
    let mut cases = Vec::new();
    for (bits, input_bits) in (1..=8_u32).flat_map(|b| (4..=16).map(move |i| (b, i))) {
        for mode in 0..4 {
            let values = format(bits).min_value()..=format(bits).max_value();
            cases.extend(values.map(|value| [value as u32, bits, mode, input_bits]));
        }
    }
    compare("probe_input", &cases, |&[value, bits, mode, input_bits]| {
        let (format, mode) = (format(bits), rounding(mode));
        let corner = corner_input(value as i32, format, input_bits as u8, mode);
        [corner, 0, 0, 0]
    });
}

#[test]
fn waves_agree_at_every_mip_and_width() {
    let mut cases = Vec::new();
    for mip in 0..=14_u32 {
        let texels = 16_384_u32 >> mip;
        for octave in 0..u32::from(MAX_OCTAVES) {
            let chosen = (0..texels).filter(|texel| *texel < 64 || texels - texel < 64);
            cases.extend(
                chosen.flat_map(|texel| (4..=16).map(move |bits| [texel, mip, octave, bits])),
            );
        }
    }
    compare("probe_waves", &cases, |&[texel, mip, octave, bits]| {
        let at =
            |wave, quarter| wave_input(wave, texel, mip as u8, octave as u8, quarter, bits as u8);
        [
            at(Wave::Triangle, false),
            at(Wave::Triangle, true),
            at(Wave::Saw, false),
            at(Wave::Saw, true),
        ]
    });
}

#[test]
fn levels_agree_at_every_mip_of_every_chain_and_width() {
    let mut cases = Vec::new();
    for mip_count in 1..=15_u32 {
        for mip in 0..mip_count {
            cases.extend((4..=16).map(|bits| [mip, mip_count, bits, 0]));
        }
    }
    compare("probe_level", &cases, |&[mip, mip_count, bits, _]| {
        [level_input(mip as u8, mip_count as u8, bits as u8), 0, 0, 0]
    });
}
