//! Demands: what a sample asks.

use super::*;

/// A source that is asked for its shape alone.
struct Silent(Shape);

impl Decode for Silent {
    fn shape(&self) -> &Shape {
        &self.0
    }

    fn profile(&self) -> &Profile {
        &PROFILE
    }

    fn texels(&self, _: &[Request]) -> Vec<Vec<i32>> {
        Vec::new()
    }

    fn places(&self, _: &[Place]) -> Vec<Vec<i32>> {
        Vec::new()
    }
}

fn any_sampler() -> impl Strategy<Value = Sampler> {
    let address = prop::sample::select(Address::ALL.to_vec());
    let choices = (any::<bool>(), any::<bool>(), any::<bool>());
    (address, choices, 1..=16_u8, -300..300_i16).prop_map(
        |(address, (latents, is_point, stochastic), max_anisotropy, bias)| {
            let latents = latents && address != Address::Border;
            let is_point = is_point && !latents;
            Sampler {
                filter: if is_point {
                    Filter::Point
                } else {
                    Filter::Linear
                },
                address: [address; 2],
                border: if address == Address::Border {
                    vec![0; 3]
                } else {
                    Vec::new()
                },
                max_anisotropy: if is_point { 1 } else { max_anisotropy },
                order: if latents {
                    Order::FilterThenDecode
                } else {
                    Order::DecodeThenFilter
                },
                bias,
                stochastic,
                ..Sampler::default()
            }
        },
    )
}

proptest! {
    #[test]
    fn a_demand_is_what_the_sampler_reads(
        sampler in any_sampler(),
        place in any::<[u32; 2]>(),
        near in any::<[i16; 2]>(),
        gradients in any::<[i16; 4]>(),
        is_near in any::<bool>(),
        random in any::<u64>(),
    ) {
        let bits = |n: i16| (f32::from(n) / 16_384.0).to_bits();
        let [a, b, c, d] = gradients.map(bits);
        let request = SampleRequest {
            place: if is_near { near.map(bits) } else { place },
            detail: Detail::Gradients { x: [a, b], y: [c, d] },
            random,
        };
        let source = Silent(shape(100, 36));
        let texture = Texture::new(&source, sampler.clone()).unwrap();
        let reads = texture.reads(&request);
        let mut demand = Demand { pixel: [3, 4], material: 5, ..Demand::default() };
        sampled(100, 36, sampler).demand(&request, &mut demand);
        let texels = reads.texels().iter().map(|&texel| Place::of(texel));
        let expected: Vec<Place> = texels.chain(reads.places().iter().copied()).collect();
        prop_assert_eq!(&demand.places, &expected);
        prop_assert_eq!(demand.weights, reads.count());
        prop_assert_eq!((demand.pixel, demand.material), ([3, 4], 5));
    }

    #[test]
    fn a_scenes_text_is_read_back(
        scale in 1e-6..1e6_f64,
        pitch in -90.0..90.0_f64,
        distance in 1.001..1e6_f64,
        fov in 1.0..170.0_f64,
        side in (1..=512_u32).prop_map(|n| 2 * n),
        seed in any::<u64>(),
    ) {
        for text in [
            format!("quad:scale={scale},order=tiles:{side},detail=lod"),
            format!("plane:height={scale},pitch={pitch},fov={fov},size={scale},order=zorder,detail=gradients"),
            format!("sphere:distance={distance},fov={fov},repeat={scale},order=raster,detail=lod"),
            format!("random:mip=3,seed={seed},count=9"),
        ] {
            prop_assert_eq!(text.parse::<AccessSpec>().unwrap().to_string(), text);
        }
        let interleave = Interleave::Random { side, seed };
        prop_assert_eq!(interleave.to_string().parse(), Ok(interleave));
    }
}

#[test]
fn pixels_that_see_the_border_alone_ask_for_nothing() {
    let sampler = Sampler {
        address: [Address::Border; 2],
        border: vec![0; 3],
        ..Sampler::default()
    };
    let materials = [sampled(16, 16, sampler)];
    let spec = scene_spec("quad:scale=1");
    let stream = Stream::scene(&spec, [64, 32], &materials, Interleave::QUADS).unwrap();
    assert_eq!(all(stream.demands()).len(), 16 * 16);
}
