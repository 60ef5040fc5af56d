use super::*;
use ntmu_isa::latent::LatentFormat;
use ntmu_isa::sampler::{Address, Detail, Filter, Footprint, MipBlend, MipFilter, Order};
use ntmu_isa::shape::{GridShape, OutputFormat, Sampling};
use std::cell::RefCell;

/// A source whose codes say where they were read, and that remembers what was asked.
struct Marked {
    shape: Shape,
    profile: Profile,
    texels: RefCell<Vec<Request>>,
    places: RefCell<Vec<Place>>,
}

/// Codes of the three channels at a texel: column, row, 100 times the mip.
fn marks(x: i32, y: i32, mip: i32) -> Vec<i32> {
    vec![x, y, 100 * mip]
}

impl Marked {
    fn new(width: u32, height: u32, mip_count: u8) -> Marked {
        let grid = GridShape {
            channels: 1,
            format: LatentFormat::new(4).unwrap(),
            scale_log2: 3,
            sampling: Sampling::Interpolated,
        };
        let shape = Shape {
            mip_count,
            octaves: 1,
            ..Shape::whole_chain(width, height, [grid; 2], vec![OutputFormat::Unorm16; 3])
        };
        Marked {
            shape,
            profile: Profile::NORMATIVE,
            texels: RefCell::default(),
            places: RefCell::default(),
        }
    }
}

impl Decode for Marked {
    fn shape(&self) -> &Shape {
        &self.shape
    }

    fn profile(&self) -> &Profile {
        &self.profile
    }

    fn texels(&self, requests: &[Request]) -> Vec<Vec<i32>> {
        self.texels.borrow_mut().extend_from_slice(requests);
        let codes = |r: &Request| marks(r.x() as i32, r.y() as i32, r.mip().into());
        requests.iter().map(codes).collect()
    }

    fn places(&self, places: &[Place]) -> Vec<Vec<i32>> {
        self.places.borrow_mut().extend_from_slice(places);
        let codes = |p: &Place| vec![p.x() as i32, p.y() as i32, p.lod() as i32];
        places.iter().map(codes).collect()
    }
}

fn request(u: f32, v: f32, detail: Detail) -> SampleRequest {
    SampleRequest {
        place: [u.to_bits(), v.to_bits()],
        detail,
        random: 0,
    }
}

fn lod(lod: f32) -> Detail {
    Detail::Lod(lod.to_bits())
}

fn clamped() -> Sampler {
    Sampler {
        address: [Address::Clamp; 2],
        ..Sampler::default()
    }
}

#[test]
fn a_point_sample_is_one_texel_exactly() {
    let source = Marked::new(16, 8, 3);
    let sampler = Sampler {
        filter: Filter::Point,
        mip_filter: MipFilter::Point,
        ..clamped()
    };
    let texture = Texture::new(&source, sampler).unwrap();
    for (x, y) in (0..8).flat_map(|x| (0..4).map(move |y| (x, y))) {
        let (u, v) = ((x as f32 + 0.9) / 8.0, (y as f32 + 0.1) / 4.0);
        let sample = texture.sample(&request(u, v, lod(1.25)));
        assert_eq!(sample.codes, marks(x, y, 1));
        assert_eq!((sample.reads, sample.decodes), (1, 1));
    }
}

#[test]
fn a_linear_sample_of_a_ramp_is_the_ramp() {
    let source = Marked::new(256, 256, 1);
    let texture = Texture::new(&source, clamped()).unwrap();
    // At 3 + ¼ and 100 + ½ texels from the centre of texel 0; ties go up.
    let sample = texture.sample(&request(3.75 / 256.0, 101.0 / 256.0, lod(0.0)));
    assert_eq!(sample.codes, [3, 101, 0]);
    assert_eq!((sample.reads, sample.decodes), (4, 4));
}

#[test]
fn texels_without_weight_are_not_decoded() {
    let source = Marked::new(16, 16, 3);
    let texture = Texture::new(&source, clamped()).unwrap();
    let reads = |u: f32, v: f32, level: f32| {
        texture
            .sample(&request(u / 16.0, v / 16.0, lod(level)))
            .reads
    };
    assert_eq!(reads(3.5, 3.5, 0.0), 1);
    assert_eq!(reads(3.6, 3.5, 0.0), 2);
    assert_eq!(reads(3.6, 3.6, 0.0), 4);
    assert_eq!(reads(3.6, 3.6, 1.0), 4);
    assert_eq!(reads(3.6, 3.6, 1.0 + 1.0 / 256.0), 8);
    assert_eq!(reads(3.6, 3.6, 0.0 + 1.0 / 1024.0), 4);
}

#[test]
fn equal_texels_of_a_sample_are_decoded_once() {
    let source = Marked::new(16, 16, 1);
    let sampler = Sampler {
        max_anisotropy: 16,
        ..clamped()
    };
    let texture = Texture::new(&source, sampler).unwrap();
    // Four probes a texel apart along u: five columns of two rows, three columns read twice.
    let footprint = Footprint {
        probes: 4,
        line: [4 << 20, 0],
        lod: 0,
    };
    let wide = request(0.52, 0.5, Detail::Footprint(footprint));
    let sample = texture.sample(&wide);
    assert_eq!((sample.reads, sample.decodes), (16, 10));
    assert_eq!(source.texels.borrow().len(), 10);
    let reads = texture.reads(&wide);
    assert_eq!(reads.texels(), source.texels.borrow().as_slice());
    // At the corner of the texture the four texels are one.
    let sample = texture.sample(&request(0.0, 0.0, lod(0.0)));
    assert_eq!(
        (sample.reads, sample.decodes, sample.codes),
        (4, 1, vec![0, 0, 0])
    );
}

#[test]
fn a_border_gives_its_codes_without_a_decode() {
    let source = Marked::new(8, 8, 1);
    let sampler = Sampler {
        address: [Address::Border, Address::Clamp],
        border: vec![1000, 2000, 3000],
        ..Sampler::default()
    };
    let texture = Texture::new(&source, sampler).unwrap();
    let outside = texture.sample(&request(1.5, 0.5, lod(0.0)));
    assert_eq!(
        (outside.codes, outside.decodes),
        (vec![1000, 2000, 3000], 0)
    );
    // Half of the edge column, texel 7, and half of the border.
    let edge = texture.sample(&request(1.0, 3.5 / 8.0, lod(0.0)));
    assert_eq!(edge.codes, [(7 + 1000) / 2 + 1, (3 + 2000) / 2 + 1, 1500]);
    assert_eq!(edge.decodes, 1);
    let gather = texture.gather(0, &request(1.0, 0.5, lod(0.0))).unwrap();
    assert_eq!(gather.codes, [7, 1000, 1000, 7]);
    assert_eq!(gather.texels, [Some((7, 4)), None, None, Some((7, 3))]);
    assert_eq!((gather.reads, gather.decodes), (2, 2));
    assert_eq!(texture.gather(3, &request(1.0, 0.5, lod(0.0))), None);
}

#[test]
fn two_mips_are_blended_by_the_level_of_detail() {
    let source = Marked::new(16, 16, 4);
    let texture = Texture::new(&source, clamped()).unwrap();
    let level = |l| texture.sample(&request(0.3, 0.3, lod(l))).codes[2];
    assert_eq!(
        [0.0, 0.25, 1.5, 2.99, 3.0, 9.0].map(level),
        [0, 25, 150, 299, 300, 300]
    );
}

#[test]
fn filtering_first_decodes_once_or_once_a_mip() {
    let source = Marked::new(16, 16, 4);
    let sample = |mip_blend, detail| {
        let sampler = Sampler {
            order: Order::FilterThenDecode,
            max_anisotropy: 4,
            mip_blend,
            ..clamped()
        };
        let texture = Texture::new(&source, sampler).unwrap();
        texture.sample(&request(0.25, 0.5, detail))
    };
    // In mip 1 the place is 2 and 4 texels from the edge, in mip 2 half as much.
    let level = sample(MipBlend::Level, lod(1.5));
    assert_eq!((level.codes, level.decodes), (vec![512, 1024, 384], 1));
    let codes = sample(MipBlend::Codes, lod(1.5));
    assert_eq!((codes.codes, codes.decodes), (vec![384, 768, 384], 2));
    let whole = sample(MipBlend::Codes, lod(1.0));
    assert_eq!((whole.codes, whole.decodes), (vec![512, 1024, 256], 1));
    let footprint = Footprint {
        probes: 4,
        line: [1 << 22, 0],
        lod: 0,
    };
    let probes = sample(MipBlend::Codes, Detail::Footprint(footprint));
    assert_eq!((probes.codes, probes.decodes), (vec![1024, 2048, 0], 4));
}

#[test]
fn a_stochastic_sample_decodes_one_texel_and_is_that_texel() {
    let source = Marked::new(16, 16, 4);
    let sampler = Sampler {
        stochastic: true,
        max_anisotropy: 8,
        ..clamped()
    };
    let texture = Texture::new(&source, sampler).unwrap();
    let footprint = Footprint {
        probes: 5,
        line: [1 << 23, 1 << 22],
        lod: 3 << 15,
    };
    let mut seen = std::collections::BTreeSet::new();
    let mut random = 1_u64;
    for _ in 0..2000 {
        random = random
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        let request = SampleRequest {
            random,
            ..request(0.4, 0.6, Detail::Footprint(footprint))
        };
        let sample = texture.sample(&request);
        assert_eq!((sample.reads, sample.decodes), (1, 1));
        let texel = texture.reads(&request).texels()[0];
        assert_eq!(
            sample.codes,
            marks(texel.x() as i32, texel.y() as i32, texel.mip().into())
        );
        seen.insert(texel);
    }
    // All that the deterministic filter reads, and nothing else.
    let deterministic = Texture::new(
        &source,
        Sampler {
            max_anisotropy: 8,
            ..clamped()
        },
    )
    .unwrap();
    let reads = deterministic.reads(&request(0.4, 0.6, Detail::Footprint(footprint)));
    assert_eq!(seen, reads.texels().iter().copied().collect());
}

#[test]
fn gradients_and_their_footprint_give_the_same_sample() {
    let source = Marked::new(64, 32, 6);
    let sampler = Sampler {
        max_anisotropy: 16,
        bias: -40,
        ..Sampler::default()
    };
    let texture = Texture::new(&source, sampler).unwrap();
    let bits = |gradient: [f32; 2]| gradient.map(f32::to_bits);
    for (x, y) in [
        ([0.2, 0.01], [0.0, 0.03]),
        ([0.001, 0.0], [0.01, 0.3]),
        ([0.0; 2], [0.0; 2]),
    ] {
        let footprint = Footprint::of(bits(x), bits(y), [64, 32], 16, &source.profile);
        let gradients = Detail::Gradients {
            x: bits(x),
            y: bits(y),
        };
        let by = |detail| texture.sample(&request(0.7, 0.2, detail));
        assert_eq!(by(gradients), by(Detail::Footprint(footprint)));
    }
}

#[test]
fn many_samples_are_the_samples_one_by_one_in_one_call_to_the_source() {
    let source = Marked::new(16, 16, 4);
    for order in [Order::DecodeThenFilter, Order::FilterThenDecode] {
        let sampler = Sampler { order, ..clamped() };
        let texture = Texture::new(&source, sampler).unwrap();
        let requests: Vec<SampleRequest> = (0..50)
            .map(|i| request(i as f32 / 37.0, i as f32 / 11.0, lod(i as f32 / 17.0)))
            .collect();
        let one_by_one: Vec<Sample> = requests.iter().map(|r| texture.sample(r)).collect();
        assert_eq!(texture.samples(&requests), one_by_one);
        assert_eq!(texture.samples(&[]), []);
    }
}

#[test]
fn a_sampler_that_does_not_fit_is_refused() {
    let source = Marked::new(8, 8, 1);
    let sampler = Sampler {
        border: vec![1],
        ..Sampler::default()
    };
    let found = Texture::new(&source, sampler).err();
    assert_eq!(
        found,
        Some(SamplerError::BorderLength {
            found: 1,
            allowed: 3
        })
    );
}
