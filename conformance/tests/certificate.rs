//! Certificates: no input escapes them, and the ends of what is called exact are reached.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use ntmu_conformance::certificate::{Certificate, Extreme, Method, Range, Row, Sums, witness};
use ntmu_conformance::naive;
use ntmu_conformance::oracle::number;
use ntmu_conformance::synthetic::{
    self, Random, Spec, SpecActivation, arbitrary_spec, corners, interpolated,
};
use ntmu_isa::accumulate::{Accumulator, Overflow};
use ntmu_isa::layer::Parameters;
use ntmu_isa::layout::Layout;
use ntmu_isa::position::{AddressMode, CornerSnap};
use ntmu_isa::profile::Profile;
use ntmu_isa::rescale::Requantizer;
use ntmu_isa::shape::OutputFormat;
use ntmu_isa::{Asset, Program};
use ntmu_model::Request;
use ntmu_model::exec::{Decoder, Taps};

/// The asset with every latent at one of the ends of its range, so that ranges are used.
fn extreme_latents(asset: &Asset, seed: u64) -> Asset {
    let mut random = Random::new(seed);
    let mut parts = asset.clone().into_parts();
    for (grid, sizes) in parts.shape.grids.iter().enumerate() {
        for code in &mut parts.grids[grid] {
            *code = random.choose(&[0, sizes.format.max_code()]);
        }
    }
    Asset::new(parts).unwrap()
}

/// Every sum on its way and every output of a texel lies within the certificate.
fn check(certificate: &Certificate, asset: &Asset, taps: &Taps) {
    let mut input = number::lanes(asset.shape.input_format(), &taps.inputs);
    for (index, tap) in taps.layers.iter().enumerate() {
        let layer = &asset.layers[index];
        let known = &certificate.layers[index];
        let sums = number::sums(layer, &tap.accumulators);
        for (row, &found) in sums.iter().enumerate() {
            match &known.sums {
                Sums::Integer(known) => {
                    let p = layer.integer().unwrap();
                    let mut sum = i64::from(p.bias[row]);
                    for (&weight, &x) in p.row(row, layer.inputs).iter().zip(&input) {
                        assert!(known.rows[row].sums.holds(Range::point(sum)));
                        sum += i64::from(weight) * x as i64;
                    }
                    assert!(known.rows[row].last.holds(Range::point(sum)));
                }
                Sums::Half(known) => {
                    let range = known.rows[row];
                    assert!(range.low <= found && found <= range.high);
                }
            }
        }
        if index + 1 < taps.layers.len() {
            input = number::lanes(layer.output_format(), &tap.outputs);
            for (value, range) in input.iter().zip(&known.outputs) {
                assert!(range.low <= *value && *value <= range.high, "layer {index}");
            }
        }
    }
}

#[test]
fn no_sum_and_no_output_of_four_hundred_assets_leaves_its_certificate() {
    let (mut free, mut exact) = (0, 0);
    for seed in 0..400 {
        let asset = synthetic::asset(&arbitrary_spec(seed), seed).unwrap();
        let certificate = Certificate::of(&asset);
        free += usize::from(certificate.is_free_of_overflow());
        exact += usize::from(certificate.layers[0].method == Method::Exact);
        // The certificate speaks of the weights: it is the same for other latents.
        let asset = extreme_latents(&asset, seed);
        assert_eq!(Certificate::of(&asset).layers, certificate.layers);
        let program = Program::compile(&asset, Layout::LINEAR);
        let decoder = Decoder::new(&asset, &program);
        let chain = (0..asset.shape.mip_count).flat_map(|mip| Request::blocks(&asset.shape, mip));
        for request in chain.step_by(37) {
            check(&certificate, &asset, &decoder.taps(request));
            if certificate.is_free_of_overflow() {
                assert_eq!(naive::texel(&asset, request).overflows, []);
            }
        }
    }
    assert!(
        free > 40 && exact > 40,
        "{free} free of overflow, {exact} exact"
    );
}

/// The same asset with other accumulators; none if the first layer's biases do not fit them. Those of
/// the others are left out: they are not looked at.
fn with_accumulator(asset: &Asset, bits: u8, overflow: Overflow) -> Option<Asset> {
    let mut parts = asset.clone().into_parts();
    for layer in &mut parts.layers[1..] {
        if let Parameters::Integer(p) = &mut layer.parameters {
            p.bias.fill(0);
        }
    }
    parts.profile.accumulator = Accumulator { bits, overflow };
    Asset::new(parts).ok()
}

fn first_sums(asset: &Asset, request: Request) -> Vec<i32> {
    let program = Program::compile(asset, Layout::LINEAR);
    let taps = Decoder::new(asset, &program).taps(request);
    taps.layers[0].accumulators.clone()
}

/// Whether the first layer overflows at a texel, by the naive evaluation.
fn overflows(asset: &Asset, request: Request) -> bool {
    let overflows = naive::texel(asset, request).overflows;
    overflows.iter().any(|overflow| match overflow {
        naive::Overflow::Accumulator { place, .. } => place.layer == 0,
        naive::Overflow::Half { .. } => false,
    })
}

#[test]
fn a_witness_needs_every_bit_of_the_certified_width_and_no_more() {
    let (mut shown, mut narrowest, mut biased, mut more) = (0, 0, 0, 0);
    for seed in 0..500 {
        let mut spec = arbitrary_spec(seed);
        spec.profile.accumulator = Profile::NORMATIVE.accumulator;
        let asset = synthetic::asset(&spec, seed).unwrap();
        let Some(witness) = witness(&asset) else {
            continue;
        };
        let first = &Certificate::of(&asset).layers[0];
        let Sums::Integer(sums) = &first.sums else {
            panic!("a witness of an fp16 layer");
        };
        let request = witness.request;
        assert_eq!(first.method, Method::Exact);
        // What the certificate says is what the witness reaches.
        let reached = Range::point(witness.extreme.sum);
        assert!(sums.sums.holds(reached) && reached.bits() == sums.sums.bits());
        // The texel gives the input that the witness names.
        let program = Program::compile(&witness.asset, Layout::LINEAR);
        let taps = Decoder::new(&witness.asset, &program).taps(request);
        let inputs: Vec<i64> = taps.inputs.iter().map(|&x| i64::from(x)).collect();
        assert_eq!(inputs, witness.extreme.input);
        let Some(width) = sums.width else {
            more += 1;
            assert!(overflows(&witness.asset, request));
            continue;
        };
        let wide = first_sums(&witness.asset, request);
        for overflow in Overflow::ALL {
            let enough = with_accumulator(&witness.asset, width, overflow).unwrap();
            assert!(!overflows(&enough, request));
            assert_eq!(first_sums(&enough, request), wide);
            if width == 16 {
                // There is no narrower accumulator.
                narrowest += 1;
                continue;
            }
            let Some(narrow) = with_accumulator(&witness.asset, width - 1, overflow) else {
                // A bias alone needs the width, and the asset is refused.
                biased += 1;
                continue;
            };
            shown += 1;
            assert!(overflows(&narrow, request));
            let row = witness.extreme.row;
            let is_last = witness.extreme.steps == witness.extreme.input.len();
            // A prefix that wraps may come back; a whole sum that does not fit cannot.
            if is_last {
                assert_ne!(first_sums(&narrow, request)[row], wide[row]);
            }
        }
    }
    assert!(
        shown > 100,
        "{shown}, {narrowest} of 16 bits, {biased} biases, {more} of more than 32"
    );
}

/// A row's accumulators after its bias and each product, by an accumulator and without a width.
fn agrees(asset: &Asset, layer: usize, extreme: &Extreme, accumulator: Accumulator) -> bool {
    let p = asset.layers[layer].integer().unwrap();
    let weights = p.row(extreme.row, asset.layers[layer].inputs);
    let bias = p.bias[extreme.row];
    let input: Vec<i16> = extreme.input.iter().map(|&x| x as i16).collect();
    (0..=input.len()).all(|steps| {
        let products = weights[..steps].iter().zip(&extreme.input);
        let exact = products.fold(i64::from(bias), |sum, (&w, &x)| sum + i64::from(w) * x);
        let found = accumulator.dot(bias, &weights[..steps], &input[..steps]);
        i64::from(found) == exact
    })
}

#[test]
fn every_layers_certified_width_is_enough_for_its_extreme_input_and_one_bit_less_is_not() {
    let (mut shown, mut narrowest, mut more) = (0, 0, 0);
    for seed in 0..300 {
        let asset = synthetic::asset(&arbitrary_spec(seed), seed).unwrap();
        let certificate = Certificate::of(&asset);
        for layer in 1..asset.layers.len() {
            let Sums::Integer(sums) = &certificate.layers[layer].sums else {
                continue;
            };
            let extreme = certificate.extreme(&asset, layer).unwrap();
            assert!(sums.sums.holds(Range::point(extreme.sum)));
            assert_eq!(Range::point(extreme.sum).bits(), sums.sums.bits());
            for overflow in Overflow::ALL {
                let at = |bits| Accumulator { bits, overflow };
                match sums.width {
                    None => {
                        more += 1;
                        assert!(!agrees(&asset, layer, &extreme, at(32)));
                    }
                    // There is no narrower accumulator.
                    Some(16) => {
                        narrowest += 1;
                        assert!(agrees(&asset, layer, &extreme, at(16)));
                    }
                    Some(bits) => {
                        shown += 1;
                        assert!(agrees(&asset, layer, &extreme, at(bits)));
                        assert!(!agrees(&asset, layer, &extreme, at(bits - 1)));
                    }
                }
            }
        }
    }
    assert!(
        shown > 100 && narrowest > 0,
        "{shown}, {narrowest} of 16 bits, {more} of more than 32"
    );
}

fn rows(certificate: &Certificate) -> impl Iterator<Item = &Row> {
    certificate
        .layers
        .iter()
        .flat_map(|layer| match &layer.sums {
            Sums::Integer(sums) => sums.rows.as_slice(),
            Sums::Half(_) => &[],
        })
}

#[test]
fn a_scale_too_large_for_its_sums_breaks_the_precondition_and_a_usual_one_does_not() {
    let mut spec = Spec::small(16, 16);
    spec.activation = SpecActivation::HardGelu;
    let asset = synthetic::asset(&spec, 3).unwrap();
    let certificate = Certificate::of(&asset);
    assert!(rows(&certificate).all(|row| row.rescales.iter().all(|r| r.is_safe())));
    // Argument, output and, on the path's end, the skip term.
    assert!(rows(&certificate).any(|row| row.rescales.len() == 3));
    let mut parts = asset.into_parts();
    if let Parameters::Integer(p) = &mut parts.layers[0].parameters {
        p.scales[0] = ntmu_isa::rescale::Multiplier::new(1 << 30, 10).unwrap();
    }
    let certificate = Certificate::of(&Asset::new(parts.clone()).unwrap());
    let first = &rows(&certificate).next().unwrap().rescales[0];
    assert!(!first.keeps_tosa && !first.result_fits && first.product_fits);
    // A 32-bit sum times a 16-bit mantissa has 47 bits; a narrow one's precondition has a shift of
    // its own.
    parts.profile.requantize = Requantizer::Narrow;
    let certificate = Certificate::of(&Asset::new(parts).unwrap());
    let first = &rows(&certificate).next().unwrap().rescales[0];
    assert!(!first.keeps_tosa && first.product_fits && first.product_bits <= 48);
}

/// Every prefix and the whole of every row's sum, of every texel.
fn observed(asset: &Asset, ranges: &mut [Option<(Range, Range)>]) {
    let p = asset.layers[0].integer().unwrap();
    let program = Program::compile(asset, Layout::LINEAR);
    let decoder = Decoder::new(asset, &program);
    let chain = (0..asset.shape.mip_count).flat_map(|mip| Request::blocks(&asset.shape, mip));
    for request in chain {
        let inputs = decoder.taps(request).inputs;
        for (row, range) in ranges.iter_mut().enumerate() {
            let mut sum = i64::from(p.bias[row]);
            let mut all = Range::point(sum);
            for (&weight, &x) in p.row(row, asset.layers[0].inputs).iter().zip(&inputs) {
                sum += i64::from(weight) * i64::from(x);
                all = all.union(Range::point(sum));
            }
            let last = Range::point(sum);
            *range = Some(range.map_or((all, last), |(a, l)| (a.union(all), l.union(last))));
        }
    }
}

/// Grids of few latents of one bit: all of their contents can be tried, at every texel.
#[test]
fn the_first_layers_certificate_is_what_all_latents_and_texels_reach() {
    for (seed, (width, height)) in (0..).zip([(8, 8), (16, 8), (9, 13), (16, 8), (5, 16), (16, 3)])
    {
        for (mode, snap) in AddressMode::ALL
            .into_iter()
            .flat_map(|mode| CornerSnap::ALL.map(|snap| (mode, snap)))
        {
            let mut spec = Spec::small(width, height);
            (spec.shape.address_mode, spec.shape.snap) = (mode, snap);
            spec.shape.grids = if seed % 2 == 0 {
                [corners(1, 1, 3), corners(1, 1, 3)]
            } else {
                [interpolated(1, 1, 3), corners(2, 1, 3)]
            };
            spec.shape.padding = 1;
            let asset = synthetic::asset(&spec, seed).unwrap();
            let rows = usize::from(asset.layers[0].outputs);
            let mut ranges = vec![None; rows];
            let counts = asset.grids.each_ref().map(Vec::len);
            for contents in 0..1_u32 << (counts[0] + counts[1]) {
                let mut parts = asset.clone().into_parts();
                let codes = parts.grids.iter_mut().flatten();
                for (bit, code) in codes.enumerate() {
                    *code = (contents >> bit & 1) as u8;
                }
                observed(&Asset::new(parts).unwrap(), &mut ranges);
            }
            let Sums::Integer(sums) = &Certificate::of(&asset).layers[0].sums else {
                panic!("an integer layer");
            };
            for (row, range) in sums.rows.iter().zip(ranges) {
                assert_eq!(
                    Some((row.sums, row.last)),
                    range,
                    "{width}x{height} {mode:?} {snap:?}"
                );
            }
        }
    }
}

#[test]
fn fp16_layers_of_small_integers_are_exact_in_every_order_and_large_ones_may_saturate() {
    let mut spec = Spec::small(16, 16).with_halves();
    spec.shape.outputs = vec![OutputFormat::Float16; 2];
    let half = |spec: &Spec, layer: usize| {
        let asset = synthetic::asset(spec, 3).unwrap();
        match Certificate::of(&asset).layers[layer].sums.clone() {
            Sums::Half(sums) => sums,
            Sums::Integer(_) => panic!("an integer layer"),
        }
    };
    let usual = half(&spec, 1);
    assert!(!usual.may_saturate && !usual.is_exact);
    // The roundings of f32 are far below the one to fp16.
    assert!(usual.sum_rounding * 100.0 < usual.register_rounding);
    spec.reach = 15;
    assert!(half(&spec, 1).may_saturate);
    let mut parts = synthetic::asset(&spec, 3).unwrap().into_parts();
    if let Parameters::Half(p) = &mut parts.layers[0].parameters {
        for weight in p.weights.iter_mut().chain(&mut p.bias) {
            *weight = ntmu_isa::half::Half::ONE;
        }
    }
    let certificate = Certificate::of(&Asset::new(parts).unwrap());
    let Sums::Half(first) = &certificate.layers[0].sums else {
        panic!("an integer layer");
    };
    assert!(first.is_exact && !first.may_saturate && first.sum_rounding == 0.0);
}

#[test]
fn a_certificate_is_a_row_a_layer_and_json() {
    for seed in 0..40 {
        let asset = synthetic::asset(&arbitrary_spec(seed), seed).unwrap();
        let certificate = Certificate::of(&asset);
        assert_eq!(certificate.rows().len(), asset.layers.len());
        assert_eq!(certificate.channel_lines().len(), asset.shape.outputs.len());
        let json = serde_json::to_value(&certificate).unwrap();
        assert_eq!(json["profile"], asset.profile.identity());
        assert_eq!(json["layers"].as_array().unwrap().len(), asset.layers.len());
    }
}
