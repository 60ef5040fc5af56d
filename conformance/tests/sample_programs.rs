//! The program of a sample gives what the sampler in front of single decodes gives.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use ntmu_conformance::synthetic::{self, Spec};
use ntmu_isa::filter::FilterRule;
use ntmu_isa::layout::Layout;
use ntmu_isa::profile::Profile;
use ntmu_isa::sampler::{
    Address, Detail, Filter, Footprint, MipBlend, MipFilter, Order, SampleRequest, Sampler,
};
use ntmu_isa::shape::OutputFormat;
use ntmu_isa::{Asset, Program};
use ntmu_model::exec::{Decoder, Probe, SampleError};
use ntmu_model::sampler::Texture;
use proptest::prelude::*;

/// Counts what a sample's program shows.
#[derive(Default)]
struct Watch {
    collected: u32,
    emitted: Vec<Vec<i32>>,
}

impl Probe for Watch {
    fn collected(&mut self, _codes: &[i32]) {
        self.collected += 1;
    }

    fn emitted(&mut self, codes: &[i32]) {
        self.emitted.push(codes.to_vec());
    }
}

/// Both ways agree, in codes, in decodes and in refusals. Whether the sampler fits.
fn agree(asset: &Asset, program: &Program, sampler: &Sampler, requests: &[SampleRequest]) -> bool {
    let decoder = Decoder::new(asset, program);
    let texture = Texture::new(&decoder, sampler.clone());
    for request in requests {
        let mut watch = Watch::default();
        let found = decoder.sample(sampler, request, &mut watch);
        match &texture {
            Ok(texture) => {
                let expected = texture.sample(request);
                assert_eq!(
                    found.as_ref(),
                    Ok(&expected.codes),
                    "{sampler:?} {request:?}"
                );
                assert_eq!(watch.collected, expected.decodes);
                assert_eq!(watch.emitted, [expected.codes]);
            }
            Err(error) => assert_eq!(found, Err(SampleError::Sampler(error.clone()))),
        }
    }
    texture.is_ok()
}

const ADDRESSES: [Address; 5] = Address::ALL;
const FILTERS: [Filter; 2] = [Filter::Point, Filter::Linear];
const MIP_FILTERS: [MipFilter; 3] = [MipFilter::Base, MipFilter::Point, MipFilter::Linear];
const ORDERS: [Order; 2] = [Order::DecodeThenFilter, Order::FilterThenDecode];
const MIP_BLENDS: [MipBlend; 2] = [MipBlend::Codes, MipBlend::Level];

/// A set of four channels, one of each format.
fn asset(profile: Profile) -> Asset {
    let mut spec = Spec {
        profile,
        ..Spec::small(10, 6)
    };
    spec.shape.outputs = OutputFormat::ALL.to_vec();
    synthetic::asset(&spec, 11).unwrap()
}

fn request(u: f32, v: f32, detail: Detail, random: u64) -> SampleRequest {
    SampleRequest {
        place: [u.to_bits(), v.to_bits()],
        detail,
        random,
    }
}

/// Inside, at an edge, at a corner and far outside; whole and broken levels; a line; gradients.
fn requests() -> Vec<SampleRequest> {
    let lod = |lod: f32| Detail::Lod(lod.to_bits());
    let line = Detail::Footprint(Footprint {
        probes: 5,
        line: [1 << 22, -(1 << 21)],
        lod: 3 << 15,
    });
    let gradients = Detail::Gradients {
        x: [0.3_f32, 0.01].map(f32::to_bits),
        y: [0.0_f32, 0.1].map(f32::to_bits),
    };
    vec![
        request(0.37, 0.61, lod(0.0), 3),
        request(0.37, 0.61, lod(1.3), u64::MAX / 3),
        request(1.0, 0.99, lod(0.6), 1 << 40),
        request(0.0, 0.0, lod(9.0), 77),
        request(-2.7, 3.4, lod(0.2), u64::MAX),
        request(0.5, 0.5, line, 12_345_678_901),
        request(0.93, 0.08, gradients, 1 << 63),
    ]
}

#[test]
fn every_combination_of_choices_gives_the_same_codes_decodes_and_refusals() {
    let (mut fitting, mut refused) = (0, 0);
    for rule in FilterRule::ALL {
        let asset = asset(Profile {
            filter: rule,
            ..Profile::NORMATIVE
        });
        let program = Program::compile_sample(&asset, Layout::TILED);
        let addresses = ADDRESSES
            .into_iter()
            .flat_map(|u| ADDRESSES.map(|v| [u, v]));
        for address in addresses {
            for (filter, mip_filter) in FILTERS
                .into_iter()
                .flat_map(|f| MIP_FILTERS.map(|m| (f, m)))
            {
                for (order, mip_blend) in
                    ORDERS.into_iter().flat_map(|o| MIP_BLENDS.map(|b| (o, b)))
                {
                    for (stochastic, max_anisotropy) in
                        [(false, 1), (false, 4), (true, 1), (true, 16)]
                    {
                        let has_border = address.contains(&Address::Border);
                        let sampler = Sampler {
                            filter,
                            mip_filter,
                            address,
                            border: if has_border {
                                vec![200, 40_000, -100, 0x3c00]
                            } else {
                                Vec::new()
                            },
                            order,
                            mip_blend,
                            stochastic,
                            max_anisotropy,
                            ..Sampler::default()
                        };
                        let fits = agree(&asset, &program, &sampler, &requests());
                        fitting += u32::from(fits);
                        refused += u32::from(!fits);
                    }
                }
            }
        }
    }
    assert_eq!(fitting + refused, 4 * 25 * 6 * 4 * 4);
    assert!(fitting > 1000 && refused > 1000, "{fitting} {refused}");
}

#[test]
fn a_texels_program_does_not_sample() {
    let asset = asset(Profile::NORMATIVE);
    let program = Program::compile(&asset, Layout::LINEAR);
    let decoder = Decoder::new(&asset, &program);
    let found = decoder.sample(&Sampler::default(), &requests()[0], &mut ());
    assert_eq!(found, Err(SampleError::Program));
}

#[test]
fn a_footprint_of_border_alone_runs_no_decode() {
    let asset = asset(Profile::NORMATIVE);
    let program = Program::compile_sample(&asset, Layout::LINEAR);
    let border = vec![200, 40_000, -100, 0x3c00];
    let sampler = Sampler {
        address: [Address::Border; 2],
        border: border.clone(),
        ..Sampler::default()
    };
    let mut watch = Watch::default();
    let outside = request(5.0, 5.0, Detail::Lod(0), 0);
    let codes = Decoder::new(&asset, &program).sample(&sampler, &outside, &mut watch);
    assert_eq!(codes, Ok(border.clone()));
    assert_eq!((watch.collected, watch.emitted), (0, vec![border]));
}

fn sampler() -> impl Strategy<Value = Sampler> {
    let select = proptest::sample::select::<u8>;
    let choices = (
        (
            0..2_usize,
            0..3_usize,
            0..5_usize,
            0..5_usize,
            0..2_usize,
            0..2_usize,
        ),
        (any::<bool>(), select(vec![1, 1, 2, 7, 16])),
        (
            -8..=7_i8,
            -8..=7_i8,
            0..2000_u16,
            0..=4095_u16,
            -4096..=4093_i16,
        ),
    );
    choices.prop_map(|(chosen, (stochastic, max_anisotropy), numbers)| {
        let (filter, mip_filter, u, v, order, mip_blend) = chosen;
        let (x, y, min_lod, max_lod, bias) = numbers;
        let address = [ADDRESSES[u], ADDRESSES[v]];
        let has_border = address.contains(&Address::Border);
        Sampler {
            filter: FILTERS[filter],
            mip_filter: MIP_FILTERS[mip_filter],
            address,
            border: if has_border {
                vec![7, 65_535, 127, 0x8000]
            } else {
                Vec::new()
            },
            offset: [x, y],
            min_lod,
            max_lod,
            bias: bias / 8,
            max_anisotropy,
            order: ORDERS[order],
            mip_blend: MIP_BLENDS[mip_blend],
            stochastic,
        }
    })
}

fn any_request() -> impl Strategy<Value = SampleRequest> {
    let near = || (-40..80_i32).prop_map(|n| (n as f32 / 23.0).to_bits());
    let coordinate = move || prop_oneof![4 => near(), 1 => any::<u32>()];
    let detail = prop_oneof![
        coordinate().prop_map(Detail::Lod),
        (coordinate(), coordinate(), coordinate(), coordinate()).prop_map(|(a, b, c, d)| {
            Detail::Gradients {
                x: [a, b],
                y: [c, d],
            }
        }),
        (any::<u8>(), any::<[i32; 2]>(), -(1 << 18)..(1 << 19))
            .prop_map(|(probes, line, lod)| { Detail::Footprint(Footprint { probes, line, lod }) }),
    ];
    (coordinate(), coordinate(), detail, any::<u64>()).prop_map(|(u, v, detail, random)| {
        SampleRequest {
            place: [u, v],
            detail,
            random,
        }
    })
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(1500) })]

    #[test]
    fn any_sampler_and_request_give_the_same_codes(
        seed in 0..60_u64, sampler in sampler(),
        requests in proptest::collection::vec(any_request(), 1..4),
    ) {
        // Any profile, any synthesizer, four channels of all formats.
        let mut spec = synthetic::arbitrary_spec(seed);
        spec.shape.outputs = OutputFormat::ALL.to_vec();
        let asset = synthetic::asset(&spec, seed).unwrap();
        let program = Program::compile_sample(&asset, Layout::LINEAR);
        agree(&asset, &program, &sampler, &requests);
    }
}
