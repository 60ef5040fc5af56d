use crate::shape;
use ntmu_isa::profile::Profile;
use ntmu_isa::sampler::coordinate::LINE_BITS;
use ntmu_isa::sampler::plan::{Probe, Spot, Square};
use ntmu_isa::sampler::{
    Address, Detail, Filter, Footprint, MipBlend, MipFilter, Order, SampleRequest, Sampler,
};
use ntmu_isa::shape::OutputFormat;
use std::collections::BTreeMap;

const LINE_ONE: i32 = 1 << LINE_BITS;

fn request(place: [f32; 2], lod: f32) -> SampleRequest {
    SampleRequest {
        place: place.map(f32::to_bits),
        detail: Detail::Lod(lod.to_bits()),
        random: 0,
    }
}

fn small(subtexel_bits: u8, lod_bits: u8) -> Profile {
    Profile {
        subtexel_bits,
        lod_bits,
        ..Profile::NORMATIVE
    }
}

#[test]
fn a_point_sample_at_a_texels_centre_is_that_texel() {
    let shape = shape([13, 9], 4, &[OutputFormat::Unorm8]);
    let sampler = Sampler {
        filter: Filter::Point,
        mip_filter: MipFilter::Point,
        ..Sampler::default()
    };
    for mip in 0..4 {
        let (width, height) = shape.mip_size(mip);
        for (x, y) in (0..width).flat_map(|x| (0..height).map(move |y| (x, y))) {
            let u = (x as f32 + 0.5) / width as f32;
            let v = (y as f32 + 0.5) / height as f32;
            let request = request([u, v], f32::from(mip));
            let squares = request.squares(&sampler, &shape, &Profile::NORMATIVE);
            let expected = Square {
                mip,
                columns: [Some(x); 2],
                rows: [Some(y); 2],
                fractions: [0; 2],
            };
            assert_eq!(squares, [Probe::one(expected)]);
        }
    }
}

#[test]
fn a_linear_sample_halfway_between_centres_has_half_of_each() {
    let shape = shape([8, 8], 1, &[OutputFormat::Unorm8]);
    let squares =
        request([0.25, 0.0], 0.0).squares(&Sampler::default(), &shape, &Profile::NORMATIVE);
    let expected = Square {
        mip: 0,
        columns: [Some(1), Some(2)],
        rows: [Some(7), Some(0)],
        fractions: [128, 128],
    };
    assert_eq!(squares, [Probe::one(expected)]);
}

#[test]
fn the_next_mip_takes_part_unless_the_level_is_whole() {
    let shape = shape([16, 16], 3, &[OutputFormat::Unorm8]);
    let mips = |lod: f32| {
        let squares =
            request([0.3, 0.3], lod).squares(&Sampler::default(), &shape, &Profile::NORMATIVE);
        (
            squares[0].near.mip,
            squares[0].far.map(|s| s.mip),
            squares[0].fraction,
        )
    };
    assert_eq!(mips(1.0), (1, None, 0));
    assert_eq!(mips(1.0 + 1.0 / 256.0), (1, Some(2), 1));
    assert_eq!(mips(0.75), (0, Some(1), 192));
    assert_eq!(mips(7.0), (2, None, 0));
    assert_eq!(mips(-7.0), (0, None, 0));
}

#[test]
fn an_offset_moves_texels_before_the_address_mode() {
    let shape = shape([5, 5], 1, &[OutputFormat::Unorm8]);
    let columns = |address, offset| {
        let sampler = Sampler {
            address: [address; 2],
            offset: [offset, 0],
            border: vec![0],
            ..Sampler::default()
        };
        let squares = request([0.3, 0.3], 0.0).squares(&sampler, &shape, &Profile::NORMATIVE);
        squares[0].near.columns
    };
    // s − ½ = 1: texels 1 and 2.
    assert_eq!(columns(Address::Wrap, 0), [Some(1), Some(2)]);
    assert_eq!(columns(Address::Wrap, -3), [Some(3), Some(4)]);
    assert_eq!(columns(Address::Mirror, -3), [Some(1), Some(0)]);
    assert_eq!(columns(Address::MirrorOnce, 7), [Some(4), Some(4)]);
    assert_eq!(columns(Address::Clamp, -8), [Some(0), Some(0)]);
    assert_eq!(columns(Address::Border, -2), [None, Some(0)]);
}

#[test]
fn no_offset_leads_back_from_the_end_of_the_range() {
    // Section 7.18.6 chose ±10 for this: even one texel and the largest offset stay outside.
    let shape = shape([1, 1], 1, &[OutputFormat::Unorm8]);
    for (u, offset) in [(1e30, -8), (-1e30, 7), (f32::INFINITY, -8)] {
        let sampler = Sampler {
            address: [Address::Border; 2],
            border: vec![0],
            offset: [offset; 2],
            ..Sampler::default()
        };
        let squares = request([u, 0.5], 0.0).squares(&sampler, &shape, &Profile::NORMATIVE);
        assert_eq!(squares[0].near.columns, [None; 2]);
        assert!((0..4).all(|corner| squares[0].near.corner(corner).is_none()));
    }
}

#[test]
fn a_gather_goes_round_from_the_lower_left() {
    let shape = shape([8, 8], 2, &[OutputFormat::Unorm8]);
    let sampler = Sampler {
        filter: Filter::Point,
        address: [Address::Clamp, Address::Wrap],
        ..Sampler::default()
    };
    let profile = &Profile::NORMATIVE;
    let (mip, texels) = request([0.5, 0.5], 0.0).gathered(&sampler, &shape, profile);
    assert_eq!(mip, 0);
    assert_eq!(
        texels,
        [Some((3, 4)), Some((4, 4)), Some((4, 3)), Some((3, 3))]
    );
    let (mip, texels) = request([0.0, 0.0], 1.0).gathered(&sampler, &shape, profile);
    assert_eq!(mip, 1);
    assert_eq!(
        texels,
        [Some((0, 0)), Some((0, 0)), Some((0, 3)), Some((0, 3))]
    );
}

#[test]
fn probes_lie_evenly_about_the_place() {
    let shape = shape([64, 64], 1, &[OutputFormat::Unorm8]);
    let sampler = Sampler {
        max_anisotropy: 16,
        ..Sampler::default()
    };
    for probes in 1..=16 {
        let footprint = Footprint {
            probes,
            // As many texels as probes, along u.
            line: [i32::from(probes) * LINE_ONE / 64, 0],
            lod: 0,
        };
        let request = SampleRequest {
            place: [0.5_f32.to_bits(), (32.5_f32 / 64.0).to_bits()],
            detail: Detail::Footprint(footprint),
            random: 0,
        };
        let squares = request.squares(&sampler, &shape, &Profile::NORMATIVE);
        let places: Vec<i64> = squares
            .iter()
            .map(|p| i64::from(p.near.columns[0].unwrap()) * 256 + i64::from(p.near.fractions[0]))
            .collect();
        // The middle is texel 31 and a half; one texel from probe to probe.
        let first = 31 * 256 + 128 - 128 * (i64::from(probes) - 1);
        let expected: Vec<i64> = (0..i64::from(probes)).map(|i| first + 256 * i).collect();
        assert_eq!(places, expected);
        assert!(squares.iter().all(|p| p.near.rows == [Some(32), Some(33)]));
    }
}

#[test]
fn a_footprint_has_no_more_probes_than_the_sampler_allows() {
    let shape = shape([8, 8], 4, &[OutputFormat::Unorm8]);
    for (asked, allowed, found) in [(0, 4, 1), (3, 4, 3), (9, 4, 4), (255, 16, 16)] {
        let sampler = Sampler {
            max_anisotropy: allowed,
            ..Sampler::default()
        };
        let request = SampleRequest {
            place: [0; 2],
            detail: Detail::Footprint(Footprint {
                probes: asked,
                line: [0; 2],
                lod: 0,
            }),
            random: 0,
        };
        let squares = request.squares(&sampler, &shape, &Profile::NORMATIVE);
        assert_eq!(squares.len(), found);
    }
}

/// Weight of every texel of the deterministic filter, over 2^(2b + l) and the number of probes.
fn weights(squares: &[Probe<Square>], bits: u32, lod_bits: u32) -> BTreeMap<(u8, u32, u32), u64> {
    let mut weights = BTreeMap::new();
    for probe in squares {
        let far = u64::from(probe.fraction);
        let near = (1 << lod_bits) - far;
        for (square, share) in [(Some(probe.near), near), (probe.far, far)] {
            let Some(square) = square else { continue };
            let [x, y] = square.fractions.map(u64::from);
            let one = 1_u64 << bits;
            let corners = [(one - x) * (one - y), x * (one - y), (one - x) * y, x * y];
            for (corner, weight) in corners.into_iter().enumerate() {
                if let (Some((x, y)), true) = (square.corner(corner), weight * share > 0) {
                    *weights.entry((square.mip, x, y)).or_default() += weight * share;
                }
            }
        }
    }
    weights
}

#[test]
fn random_bits_choose_every_texel_as_often_as_it_weighs() {
    let shape = shape([11, 6], 4, &[OutputFormat::Unorm8]);
    let places = [[0.37, 0.81], [0.0, 0.5], [-3.3, 0.999], [0.1, 0.2]];
    for (bits, lod_bits) in [(4, 4), (5, 4), (4, 6)] {
        for (place, probes) in places.into_iter().flat_map(|p| [1, 2, 4].map(|n| (p, n))) {
            let profile = small(bits, lod_bits);
            let mut request = request(place, 0.0);
            request.detail = Detail::Footprint(Footprint {
                probes,
                line: [LINE_ONE / 3, -LINE_ONE / 5],
                lod: 0x1_5800,
            });
            let mut sampler = Sampler {
                max_anisotropy: 16,
                ..Sampler::default()
            };
            let (b, l) = (u32::from(bits), u32::from(lod_bits));
            let squares = request.squares(&sampler, &shape, &profile);
            let expected = weights(&squares, b, l);
            sampler.stochastic = true;
            let mut found = BTreeMap::new();
            for low in 0..1_u64 << (2 * b + l) {
                for probe in 0..u64::from(probes) {
                    // The probe is chosen by the highest of its 32 bits.
                    let high = (probe << 32) / u64::from(probes);
                    request.random = high << (2 * b + l) | low;
                    let chosen = request.squares(&sampler, &shape, &profile);
                    assert_eq!((chosen.len(), chosen[0].far), (1, None));
                    let texel = chosen[0].near.corner(0).unwrap();
                    assert_eq!(chosen[0].near.fractions, [0; 2]);
                    *found
                        .entry((chosen[0].near.mip, texel.0, texel.1))
                        .or_default() += 1;
                }
            }
            assert_eq!(found, expected, "{bits} {lod_bits} {place:?} {probes}");
        }
    }
}

#[test]
fn every_probe_is_chosen_by_a_share_of_two_to_the_32_within_one() {
    let shape = shape([64, 1], 1, &[OutputFormat::Unorm8]);
    let profile = Profile::NORMATIVE;
    for probes in 1..=16_u8 {
        // Texels apart from each other, so that the column tells the probe.
        let middle = 32.0 + f32::from(1 - probes % 2) / 2.0 - 0.5;
        let request = |random| SampleRequest {
            place: [(middle / 64.0_f32).to_bits(), 0.5_f32.to_bits()],
            detail: Detail::Footprint(Footprint {
                probes,
                line: [i32::from(probes) * LINE_ONE / 64, 0],
                lod: 0,
            }),
            random,
        };
        let chosen = |random: u64| {
            let sampler = Sampler {
                filter: Filter::Point,
                max_anisotropy: 16,
                stochastic: true,
                ..Sampler::default()
            };
            let squares = request(random).squares(&sampler, &shape, &profile);
            squares[0].near.columns[0].unwrap()
        };
        let all = Sampler {
            filter: Filter::Point,
            max_anisotropy: 16,
            ..Sampler::default()
        };
        let squares = request(0).squares(&all, &shape, &profile);
        let columns: Vec<u32> = squares.iter().map(|p| p.near.columns[0].unwrap()).collect();
        assert!(columns.windows(2).all(|pair| pair[1] == pair[0] + 1));
        // The first value that chooses probe i is ⌈i·2^32 / n⌉; 16 + 8 bits come before.
        let count = u64::from(probes);
        let first = |i: u64| (i << 32).div_ceil(count);
        for (index, &column) in (0..count).zip(&columns) {
            let share = first(index + 1) - first(index);
            assert!(share.abs_diff((1 << 32) / count) <= 1);
            assert_eq!(chosen(first(index) << 24), column);
            assert_eq!(chosen((first(index + 1) - 1) << 24), column);
        }
    }
}

#[test]
fn a_spot_is_the_place_between_the_texels_of_a_square() {
    let shape = shape([12, 10], 3, &[OutputFormat::Unorm8]);
    let profile = Profile::NORMATIVE;
    for address in [
        Address::Wrap,
        Address::Mirror,
        Address::MirrorOnce,
        Address::Clamp,
    ] {
        let sampler = Sampler {
            address: [address; 2],
            order: Order::FilterThenDecode,
            offset: [3, -2],
            ..Sampler::default()
        };
        for step in -300..300_i32 {
            let u = step as f32 / 100.0;
            let request = request([u, -0.7 * u], 0.25);
            let spots = request.spots(&sampler, &shape, &profile);
            let squares = request.squares(&sampler, &shape, &profile);
            let (spot, square) = (spots[0].near, squares[0].near);
            for (axis, (texels, size)) in [(square.columns, 12), (square.rows, 10)]
                .into_iter()
                .enumerate()
            {
                let centres = texels.map(|t| i64::from(t.unwrap()) * 256 + 128);
                let fraction = i64::from(square.fractions[axis]);
                let place = spot.coordinates[axis];
                if (centres[0] - centres[1]).abs() <= 256 {
                    let between = (centres[0] * (256 - fraction) + centres[1] * fraction) / 256;
                    assert_eq!(place, between, "{} {u} {axis}", address.name());
                } else {
                    // Across the seam, which only a wrapped texture has.
                    assert_eq!(address, Address::Wrap);
                    let seam = (centres[0] + fraction).rem_euclid(size * 256);
                    assert_eq!(place, seam);
                }
            }
            assert_eq!((spots[0].fraction, spot.lod), (64, 0));
            assert_eq!(spots[0].far.unwrap().lod, 256);
        }
    }
}

#[test]
fn a_blend_of_levels_is_one_spot_at_the_fractional_level() {
    let shape = shape([16, 16], 4, &[OutputFormat::Unorm8]);
    let sampler = Sampler {
        order: Order::FilterThenDecode,
        mip_blend: MipBlend::Level,
        ..Sampler::default()
    };
    let spots = request([0.5, 0.25], 1.75).spots(&sampler, &shape, &Profile::NORMATIVE);
    let expected = Spot {
        mip: 1,
        coordinates: [4 * 256, 2 * 256],
        lod: 256 + 192,
    };
    assert_eq!(spots, [Probe::one(expected)]);
}
