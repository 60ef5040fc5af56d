use crate::shape;
use ntmu_isa::sampler::{
    Address, Detail, Filter, Footprint, MipBlend, MipFilter, Order, SampleRequest, Sampler,
};
use ntmu_isa::shape::OutputFormat;

#[test]
fn a_sampler_returns_from_its_text_and_missing_keys_are_the_default() {
    let sampler = Sampler {
        filter: Filter::Point,
        mip_filter: MipFilter::Base,
        address: [Address::MirrorOnce, Address::Border],
        border: vec![1, -2],
        offset: [-8, 7],
        min_lod: 3,
        max_lod: 4,
        bias: -5,
        max_anisotropy: 16,
        order: Order::FilterThenDecode,
        mip_blend: MipBlend::Level,
        stochastic: true,
    };
    let text = toml::to_string(&sampler).unwrap();
    assert_eq!(toml::from_str::<Sampler>(&text).unwrap(), sampler);
    assert_eq!(toml::from_str::<Sampler>("").unwrap(), Sampler::default());
    assert!(toml::from_str::<Sampler>("anisotropy = 3").is_err());
    assert!(toml::from_str::<Sampler>("filter = \"cubic\"").is_err());
}

#[test]
fn a_request_returns_from_its_text() {
    let footprint = Footprint {
        probes: 3,
        line: [5, -7],
        lod: -9,
    };
    let gradients = Detail::Gradients {
        x: [1, 2],
        y: [3, 4],
    };
    for detail in [Detail::Lod(7), gradients, Detail::Footprint(footprint)] {
        let request = SampleRequest {
            place: [0x3f00_0000, 0xbf80_0000],
            detail,
            random: 11,
        };
        let text = toml::to_string(&request).unwrap();
        assert_eq!(toml::from_str::<SampleRequest>(&text).unwrap(), request);
    }
}

#[test]
fn what_a_sampler_may_not_hold_is_refused_by_name() {
    let shape = shape([8, 8], 4, &[OutputFormat::Snorm8, OutputFormat::Float16]);
    let refused = |change: fn(&mut Sampler)| {
        let mut sampler = Sampler::default();
        change(&mut sampler);
        sampler.check(&shape).unwrap_err().to_string()
    };
    assert_eq!(Sampler::default().check(&shape), Ok(()));
    for (change, message) in [
        (
            (|s| s.offset[1] = 8) as fn(&mut Sampler),
            "sampler.offset.v: found 8; allowed: -8..=7",
        ),
        (
            |s| s.offset[0] = -9,
            "sampler.offset.u: found -9; allowed: -8..=7",
        ),
        (
            |s| s.bias = 4094,
            "sampler.bias: found 4094; allowed: -4096..=4093",
        ),
        (
            |s| s.min_lod = 4096,
            "sampler.min_lod: found 4096; allowed: 0..=4095",
        ),
        (
            |s| s.max_lod = 4096,
            "sampler.max_lod: found 4096; allowed: 0..=4095",
        ),
        (
            |s| s.max_anisotropy = 0,
            "sampler.max_anisotropy: found 0; allowed: 1..=16",
        ),
        (
            |s| s.max_anisotropy = 17,
            "sampler.max_anisotropy: found 17; allowed: 1..=16",
        ),
        (
            |s| s.address[1] = Address::Border,
            "sampler.border: found 0 codes; allowed: 2, one a channel",
        ),
        (
            |s| s.border = vec![-128, 0],
            "sampler.border[0]: found -128; allowed: a code of snorm8",
        ),
        (
            |s| s.border = vec![0, 0x7c00],
            "sampler.border[1]: found 31744; allowed: a code of float16",
        ),
        (
            |s| {
                s.filter = Filter::Point;
                s.max_anisotropy = 2;
            },
            "sampler: found max_anisotropy above 1; allowed with: filter linear",
        ),
        (
            |s| s.mip_blend = MipBlend::Level,
            "sampler: found mip_blend level; allowed with: order filter-then-decode",
        ),
        (
            |s| {
                s.filter = Filter::Point;
                s.order = Order::FilterThenDecode;
            },
            "sampler: found order filter-then-decode; allowed with: filter linear",
        ),
        (
            |s| {
                s.address[0] = Address::Border;
                s.border = vec![0, 0];
                s.order = Order::FilterThenDecode;
            },
            "sampler: found order filter-then-decode; allowed with: no border on any axis",
        ),
    ] {
        assert_eq!(refused(change), message);
    }
}
