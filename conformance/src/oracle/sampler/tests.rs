use super::*;
use ntmu_isa::latent::LatentFormat;
use ntmu_isa::sampler::{Detail, Footprint, SampleRequest};
use ntmu_isa::shape::{GridShape, Sampling};
use ntmu_model::sampler::{Decode, Probes, Texture};
use ntmu_model::{Place, Request};
use proptest::prelude::*;
use std::collections::BTreeMap;

/// A texture set of noise: codes from a hash of the texel, in every format.
struct Noise {
    shape: Shape,
    profile: Profile,
}

impl Noise {
    fn new(size: [u32; 2], mip_count: u8, profile: Profile) -> Noise {
        let grid = GridShape {
            channels: 1,
            format: LatentFormat::new(4).unwrap(),
            scale_log2: 3,
            sampling: Sampling::Interpolated,
        };
        let shape = Shape {
            mip_count,
            octaves: 1,
            ..Shape::whole_chain(size[0], size[1], [grid; 2], OutputFormat::ALL.to_vec())
        };
        Noise { shape, profile }
    }

    fn codes(mip: u8, x: u32, y: u32) -> Vec<i32> {
        let mut hash = (u64::from(mip) << 40 | u64::from(x) << 20 | u64::from(y)) + 1;
        OutputFormat::ALL
            .map(|format| {
                hash = (hash ^ hash >> 29).wrapping_mul(0x9e37_79b9_7f4a_7c15);
                let seed = (hash >> 40) as i32;
                let (low, high) = format.range();
                match format {
                    OutputFormat::Unorm8 | OutputFormat::Unorm16 | OutputFormat::Snorm8 => {
                        low + seed % (high - low + 1)
                    }
                    // Exponents of 2^−8 to 2^3, both signs.
                    OutputFormat::Float16 => seed & 0x83ff | (7 + (seed >> 10) % 12) << 10,
                }
            })
            .to_vec()
    }
}

impl Decode for Noise {
    fn shape(&self) -> &Shape {
        &self.shape
    }

    fn profile(&self) -> &Profile {
        &self.profile
    }

    fn texels(&self, requests: &[Request]) -> Vec<Vec<i32>> {
        let codes = |r: &Request| Noise::codes(r.mip(), r.x(), r.y());
        requests.iter().map(codes).collect()
    }

    fn places(&self, _places: &[Place]) -> Vec<Vec<i32>> {
        Vec::new()
    }
}

/// Weights of a sample's texels in 1/2^(2b + l), added up; the border is under no texel.
type Weights = BTreeMap<(u8, Option<(u32, u32)>), f64>;

fn weights_of_model(probes: &Probes, profile: &Profile) -> Weights {
    let Probes::Squares(probes) = probes else {
        panic!("decode then filter reads squares");
    };
    let mut weights = Weights::new();
    let one = f64::from(1_u32 << profile.subtexel_bits);
    let level = f64::from(1_u32 << profile.lod_bits);
    for probe in probes {
        let far = f64::from(probe.fraction) / level;
        for (square, share) in [(Some(probe.near), 1.0 - far), (probe.far, far)] {
            let Some(square) = square else { continue };
            let [x, y] = square.fractions.map(|f| f64::from(f) / one);
            let corners = [(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y];
            for (corner, weight) in corners.into_iter().enumerate() {
                if weight * share > 0.0 {
                    let texel = square.corner(corner);
                    *weights.entry((square.mip, texel)).or_default() += weight * share;
                }
            }
        }
    }
    weights
}

fn weights_of_oracle(reads: &[Read]) -> Weights {
    let mut weights = Weights::new();
    for read in reads {
        *weights.entry((read.mip, read.texel)).or_default() += read.weight;
    }
    weights
}

/// Both samplers on one request.
fn check(noise: &Noise, sampler: &Sampler, request: &RealRequest, detail: Detail) {
    let texture = Texture::new(noise, sampler.clone()).unwrap();
    let asked = SampleRequest {
        place: request.place.map(f32::to_bits),
        detail,
        random: 0,
    };
    let oracle = RealSampler::new(sampler, &noise.shape, &noise.profile);
    let sample = texture.sample(&asked);
    let reads = oracle.reads(request);
    assert_eq!(
        weights_of_model(&sample.probes, &noise.profile),
        weights_of_oracle(&reads),
        "{request:?} {sampler:?}"
    );
    let real_codes = oracle.sample(request, Noise::codes);
    for (channel, format) in noise.shape.outputs.iter().enumerate() {
        let filtered: Vec<f64> = reads
            .iter()
            .map(|read| match read.texel {
                Some((x, y)) => Noise::codes(read.mip, x, y)[channel],
                None => sampler.border[channel],
            })
            .map(|code| real(*format, code))
            .collect();
        let low = filtered.iter().copied().fold(f64::INFINITY, f64::min);
        let high = filtered.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let (found, expected) = (real(*format, sample.codes[channel]), real_codes[channel]);
        // f64 adds at most 128 products of 53 bits: 2^−40 of 2^16 and less.
        let slack = high.abs().max(low.abs()) * 2_f64.powi(-40);
        let bound = bound(&noise.profile, *format, high - low, expected) + slack;
        assert!(
            (found - expected).abs() <= bound,
            "channel {channel}: {found} for {expected} within {bound}: {request:?} {sampler:?} {:?}",
            noise.profile
        );
    }
}

fn any_coordinate() -> impl Strategy<Value = f32> {
    prop_oneof![
        6 => -3.0_f32..3.0,
        2 => any::<u32>().prop_map(f32::from_bits),
        1 => (-400_i32..400, 0_u32..6).prop_map(|(n, d)| n as f32 / (1_u32 << d) as f32),
        1 => prop::sample::select(vec![0.0, -0.0, 1.0, -1.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e-44, -1e-44, 9.999, -10.0, 16_777_216.0]),
    ]
}

fn any_lod() -> impl Strategy<Value = f32> {
    prop_oneof![
        6 => -2.0_f32..8.0,
        1 => any::<u32>().prop_map(f32::from_bits),
        2 => (-64_i32..1024).prop_map(|n| n as f32 / 512.0),
        1 => prop::sample::select(vec![f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e-44, -1e-44]),
    ]
}

fn any_sampler() -> impl Strategy<Value = Sampler> {
    let choices = (
        0_u8..2,
        0_usize..3,
        [0_usize..5, 0_usize..5],
        [-8_i8..=7, -8_i8..=7],
    );
    let levels = (0_u16..=1100, 0_u16..=4095, -600_i16..600);
    (choices, levels).prop_map(
        |((filter, mips, address, offset), (min_lod, max_lod, bias))| Sampler {
            filter: [Filter::Point, Filter::Linear][usize::from(filter)],
            mip_filter: [MipFilter::Base, MipFilter::Point, MipFilter::Linear][mips],
            address: address.map(|mode| Address::ALL[mode]),
            border: vec![200, 40_000, -100, 0x4248],
            offset,
            min_lod: min_lod.saturating_sub(300),
            max_lod,
            bias,
            ..Sampler::default()
        },
    )
}

fn any_profile() -> impl Strategy<Value = Profile> {
    let bits = (4_u8..=12, 4_u8..=8);
    (bits, 0_usize..4, 0_usize..4, 0_usize..4, any::<bool>()).prop_map(
        |((subtexel_bits, lod_bits), coordinate, filter, rounding, is_floor)| Profile {
            subtexel_bits,
            lod_bits,
            coordinate: Rounding::ALL[coordinate],
            point_snap: if is_floor {
                PointSnap::Floor
            } else {
                PointSnap::Fixed
            },
            filter: FilterRule::ALL[filter],
            filter_rounding: Rounding::ALL[rounding],
            ..Profile::NORMATIVE
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(4000))]

    #[test]
    fn texels_and_weights_are_equal_and_codes_are_within_the_bound(
        size in [1_u32..70, 1_u32..70],
        profile in any_profile(),
        sampler in any_sampler(),
        place in [any_coordinate(), any_coordinate()],
        lod in any_lod(),
    ) {
        let mip_count = Shape::max_mip_count(size[0], size[1]);
        let noise = Noise::new(size, mip_count, profile);
        let request = RealRequest { place, probes: 1, line: [0; 2], lod: lod.into() };
        check(&noise, &sampler, &request, Detail::Lod(lod.to_bits()));
    }

    #[test]
    fn footprints_have_equal_texels_and_codes_within_the_bound(
        size in [1_u32..70, 1_u32..70],
        profile in any_profile(),
        sampler in any_sampler(),
        place in [any_coordinate(), any_coordinate()],
        probes in 1_u8..=16,
        line in (-(1_i32 << 25)..1 << 25, any::<i32>()).prop_map(<[i32; 2]>::from),
        lod in -100_000_i32..600_000,
    ) {
        let mip_count = Shape::max_mip_count(size[0], size[1]);
        let noise = Noise::new(size, mip_count, profile);
        let sampler = Sampler { filter: Filter::Linear, max_anisotropy: 16, ..sampler };
        let request = RealRequest { place, probes, line, lod: f64::from(lod) / 65_536.0 };
        let footprint = Footprint { probes, line, lod };
        check(&noise, &sampler, &request, Detail::Footprint(footprint));
    }

    #[test]
    fn the_level_of_gradients_lies_in_the_interval_that_their_rounding_implies(
        size in [1_u32..=16_384, 1_u32..=16_384],
        x in [-0.3_f32..0.3, -0.3_f32..0.3],
        y in [-0.3_f32..0.3, -0.3_f32..0.3],
        scale in 0_i32..14,
        squash in 0_i32..8,
        max_anisotropy in 1_u8..=16,
        coordinate in 0_usize..4,
    ) {
        let profile = Profile { coordinate: Rounding::ALL[coordinate], ..Profile::NORMATIVE };
        let x = x.map(|g| g * 2_f32.powi(-scale));
        let y = y.map(|g| g * 2_f32.powi(-scale - squash));
        let real = RealFootprint::of(x, y, size, max_anisotropy);
        prop_assume!(real.major > 2_f64.powi(-14));
        let bits = |g: [f32; 2]| g.map(f32::to_bits);
        let found = Footprint::of(bits(x), bits(y), size, max_anisotropy, &profile);
        let (few, many) = real.probes();
        prop_assert!((few..=many).contains(&f64::from(found.probes)), "{} in {few}..={many}", found.probes);
        let (low, high) = real.lod(found.probes);
        let lod = f64::from(found.lod) / 65_536.0;
        prop_assert!((low..=high).contains(&lod), "{lod} in {low}..={high}");
    }
}

#[test]
fn every_index_of_every_small_size_is_the_same_by_walking() {
    for mode in Address::ALL {
        for (size, texel) in (1..=64).flat_map(|s| (-200..=200).map(move |t| (s, t))) {
            let walked = address(texel, size, mode).map(|t| t as u32);
            assert_eq!(mode.resolve(texel as i64, size as u32), walked);
        }
    }
}

#[test]
fn only_the_exact_rule_stays_within_half_a_code() {
    let mut worst = [0.0_f64; 4];
    for (slot, filter) in worst.iter_mut().zip(FilterRule::ALL) {
        let profile = Profile {
            filter,
            ..Profile::NORMATIVE
        };
        let noise = Noise::new([16, 16], 5, profile);
        let sampler = Sampler::default();
        let texture = Texture::new(&noise, sampler.clone()).unwrap();
        let oracle = RealSampler::new(&sampler, &noise.shape, &noise.profile);
        for step in 0..4000_u16 {
            let place = [f32::from(step) / 1000.0, f32::from(step) / 777.0];
            let lod = f32::from(step) / 900.0;
            let request = RealRequest {
                place,
                probes: 1,
                line: [0; 2],
                lod: lod.into(),
            };
            check(&noise, &sampler, &request, Detail::Lod(lod.to_bits()));
            let sample = texture.sample(&SampleRequest {
                place: place.map(f32::to_bits),
                detail: Detail::Lod(lod.to_bits()),
                random: 0,
            });
            let real = oracle.sample(&request, Noise::codes)[0];
            *slot = slot.max((f64::from(sample.codes[0]) - real).abs());
        }
    }
    let [exact, others @ ..] = worst;
    assert!(exact <= 0.5);
    assert!(others.iter().all(|&distance| distance > 0.5), "{worst:?}");
}
