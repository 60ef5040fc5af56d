//! Programs of every kind of asset: they return from their images, fit what they were compiled for,
//! loops change nothing, and their proofs hold.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use ntmu_conformance::certificate::{Certificate, Sums};
use ntmu_conformance::synthetic::{self, Spec, SpecActivation, SpecKind};
use ntmu_isa::instruction::{Class, Instruction};
use ntmu_isa::layout::Layout;
use ntmu_isa::limits::{MAX_INSTRUCTIONS, MAX_LAYERS};
use ntmu_isa::sampler::{Detail, Order, SampleRequest, Sampler};
use ntmu_isa::{Asset, Program, assembly, image};
use ntmu_model::Request;
use ntmu_model::exec::Decoder;
use proptest::prelude::*;

fn compiled(asset: &Asset, layout: Layout) -> [Program; 2] {
    [
        Program::compile(asset, layout),
        Program::compile_sample(asset, layout),
    ]
}

/// The same program from its image and from its text.
fn returned(asset: &Asset, program: &Program) -> [Program; 2] {
    let (layout, instructions) = (program.layout(), program.instructions());
    let from_image = image::read(&image::write(layout, instructions)).unwrap();
    let from_text = assembly::assemble(&assembly::print(layout, instructions)).unwrap();
    [from_image, from_text]
        .map(|(layout, instructions)| Program::link(asset, layout, instructions).unwrap())
}

/// The same program without loops of layers.
fn straight(asset: &Asset, program: &Program) -> Program {
    let steps = program.steps().iter().copied();
    let steps =
        steps.filter(|step| !matches!(step, Instruction::Repeat { .. } | Instruction::Again {}));
    Program::link(asset, program.layout(), steps.collect()).unwrap()
}

/// Corners and the middle of the first, a middle and the last mip.
fn some_texels(asset: &Asset) -> Vec<Request> {
    let last = asset.shape.mip_count - 1;
    [0, last / 2, last]
        .into_iter()
        .flat_map(|mip| {
            let (width, height) = asset.shape.mip_size(mip);
            [(0, 0), (width / 2, height / 3), (width - 1, height - 1)]
                .map(|(x, y)| Request::new(&asset.shape, x, y, mip).unwrap())
        })
        .collect()
}

fn codes(asset: &Asset, program: &Program) -> Vec<Vec<i32>> {
    let decoder = Decoder::new(asset, program);
    let texels = some_texels(asset).into_iter();
    texels.map(|texel| decoder.texel(texel, &mut ())).collect()
}

fn samples(asset: &Asset, program: &Program) -> Vec<Vec<i32>> {
    let decoder = Decoder::new(asset, program);
    [Order::DecodeThenFilter, Order::FilterThenDecode]
        .into_iter()
        .flat_map(|order| [0.0_f32, 0.4, 7.0].map(|lod| (order, lod)))
        .map(|(order, lod)| {
            let sampler = Sampler {
                order,
                ..Sampler::default()
            };
            let request = SampleRequest {
                place: [0.3_f32, 0.8].map(f32::to_bits),
                detail: Detail::Lod(lod.to_bits()),
                random: 0,
            };
            decoder.sample(&sampler, &request, &mut ()).unwrap()
        })
        .collect()
}

#[test]
fn programs_of_every_kind_of_asset_return_from_image_and_text_and_run_alike() {
    for seed in 0..150 {
        let asset = synthetic::asset(&synthetic::arbitrary_spec(seed), seed).unwrap();
        for layout in [Layout::LINEAR, Layout::TILED] {
            let [texel, sample] = compiled(&asset, layout);
            let expected = (codes(&asset, &texel), samples(&asset, &sample));
            assert_eq!(
                codes(&asset, &sample),
                expected.0,
                "a sample's decode is a texel's"
            );
            for again in returned(&asset, &texel) {
                assert_eq!(again, texel, "seed {seed}");
                assert_eq!(codes(&asset, &again), expected.0);
            }
            for again in returned(&asset, &sample) {
                assert_eq!(again, sample, "seed {seed}");
                assert_eq!(samples(&asset, &again), expected.1);
            }
        }
    }
}

/// Residual blocks of this span, all alike.
fn residual(blocks: u8, block_span: u8, kinds: Vec<SpecKind>) -> Asset {
    let spec = Spec {
        blocks,
        block_span,
        kinds,
        activation: SpecActivation::Leaky(3),
        ..Spec::small(12, 8)
    };
    synthetic::asset(&spec, u64::from(blocks) * 10 + u64::from(block_span)).unwrap()
}

const BYTES: SpecKind = SpecKind::Integer {
    weight_bits: 8,
    output_bits: 8,
};
const HALVES: SpecKind = SpecKind::Half { quantize: None };

fn loops(program: &Program) -> Vec<(u16, u16)> {
    let instructions = program.instructions().iter();
    instructions
        .filter_map(|instruction| {
            if let Instruction::Repeat { times, step } = *instruction {
                Some((times, step))
            } else {
                None
            }
        })
        .collect()
}

#[test]
fn residual_blocks_are_one_loop_and_their_loop_is_the_straight_program() {
    for kind in [BYTES, HALVES] {
        for (blocks, span) in (2..=20).flat_map(|blocks| [2, 3].map(|span| (blocks, span))) {
            let asset = residual(blocks, span, vec![kind]);
            for program in compiled(&asset, Layout::LINEAR) {
                let expected = vec![(u16::from(blocks), u16::from(span))];
                assert_eq!(loops(&program), expected, "{blocks} blocks of {span}");
                let plain = straight(&asset, &program);
                assert_eq!(codes(&asset, &program), codes(&asset, &plain));
                let work = |program: &Program| {
                    let mut counts = program.counts();
                    counts[Class::ALL.len() - 1].1 = 0;
                    counts
                };
                assert_eq!(work(&program), work(&plain));
            }
        }
        // A block of one layer reads and writes in turns: two of them are a run.
        let asset = residual(20, 1, vec![kind]);
        let program = Program::compile(&asset, Layout::LINEAR);
        assert_eq!(loops(&program), [(10, 2)]);
        assert_eq!(
            codes(&asset, &program),
            codes(&asset, &straight(&asset, &program))
        );
    }
}

#[test]
fn blocks_of_mixed_arithmetic_fold_where_they_are_alike() {
    // Four layers of two kinds in turns, blocks of two.
    let narrow = SpecKind::Integer {
        weight_bits: 4,
        output_bits: 12,
    };
    let asset = residual(12, 2, vec![BYTES, narrow]);
    let program = Program::compile(&asset, Layout::TILED);
    // Bits are the layers' own: the instructions of both kinds are the same.
    assert_eq!(loops(&program), [(12, 2)]);
    let asset = residual(12, 3, vec![BYTES, SpecKind::Half { quantize: Some(8) }]);
    let program = Program::compile(&asset, Layout::TILED);
    assert!(!loops(&program).is_empty());
    let plain = straight(&asset, &program);
    assert!(program.instructions().len() < plain.instructions().len());
    assert_eq!(codes(&asset, &program), codes(&asset, &plain));
}

#[test]
fn the_deepest_synthesizers_have_programs() {
    for (blocks, span) in [(62, 1), (31, 2), (20, 3)] {
        let asset = residual(blocks, span, vec![BYTES]);
        assert!(asset.layers.len() + 3 > usize::from(MAX_LAYERS));
        for program in compiled(&asset, Layout::LINEAR) {
            assert_eq!(returned(&asset, &program)[0], program);
            let plain = straight(&asset, &program);
            assert!(plain.instructions().len() < MAX_INSTRUCTIONS as usize / 3);
        }
    }
}

#[test]
fn bounds_hold_what_certificates_say_and_what_texels_reach() {
    let mut proven = 0;
    for seed in 0..120 {
        let asset = synthetic::asset(&synthetic::arbitrary_spec(seed), seed).unwrap();
        let [program, sample] = compiled(&asset, Layout::LINEAR);
        let bounds = program.sum_bounds(&asset);
        assert_eq!(sample.sum_bounds(&asset), bounds, "seed {seed}");
        let certificate = Certificate::of(&asset);
        for bound in &bounds {
            let index = usize::from(bound.layer);
            match &certificate.layers[index].sums {
                Sums::Half(_) => panic!("l{index} has integer sums"),
                Sums::Integer(sums) => {
                    assert!(
                        bound.low <= sums.sums.low && bound.high >= sums.sums.high,
                        "seed {seed}, {bound}: {:?}",
                        sums.sums
                    );
                    // The proof of the program is one of the certificate.
                    assert!(bound.may_overflow() || sums.is_wide_enough);
                    proven += usize::from(!bound.may_overflow());
                }
            }
        }
        let decoder = Decoder::new(&asset, &program);
        for texel in some_texels(&asset) {
            for tap in decoder.taps(texel).layers {
                let bound = bounds.iter().find(|bound| bound.layer == tap.layer);
                let Some(bound) = bound.filter(|bound| !bound.may_overflow()) else {
                    continue;
                };
                for sum in tap.accumulators {
                    assert!((bound.low..=bound.high).contains(&i64::from(sum)));
                }
            }
        }
    }
    assert!(proven > 100, "{proven}");
}

#[test]
fn hidden_layers_bounds_are_the_certificates_intervals() {
    // Where the first layer's exact ranges cost nothing: interpolated latents, no waves, one mip.
    for activation in [
        SpecActivation::Identity,
        SpecActivation::Relu,
        SpecActivation::Leaky(2),
        SpecActivation::HardGelu,
        SpecActivation::ClampedGelu,
        SpecActivation::Table,
    ] {
        let mut spec = Spec {
            activation,
            blocks: 3,
            ..Spec::small(12, 8)
        };
        spec.shape.octaves = 0;
        spec.shape.mip_count = 1;
        spec.shape.grids = [4, 3].map(|bits| synthetic::interpolated(3, bits, 3));
        let asset = synthetic::asset(&spec, 5).unwrap();
        let bounds = Program::compile(&asset, Layout::LINEAR).sum_bounds(&asset);
        let certificate = Certificate::of(&asset);
        assert_eq!(bounds.len(), asset.layers.len());
        for (bound, layer) in bounds.iter().zip(&certificate.layers).skip(1) {
            let Sums::Integer(sums) = &layer.sums else {
                panic!("integers");
            };
            assert!(bound.low <= sums.sums.low && bound.high >= sums.sums.high);
            let width = sums.width.unwrap();
            assert!(
                bound.bits.max(16) <= width + 1,
                "{activation:?}: {bound}, certified {width}"
            );
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(400) })]

    #[test]
    fn instructions_that_link_run_and_others_are_refused_at_a_place(
        seed in 0..40_u64, edits in proptest::collection::vec((any::<u16>(), any::<u16>(), any::<u64>()), 1..5),
        of_sample: bool,
    ) {
        // Real programs with words swapped, doubled, dropped and disturbed.
        let asset = synthetic::asset(&synthetic::arbitrary_spec(seed), seed).unwrap();
        let [texel, sample] = compiled(&asset, Layout::LINEAR);
        let program = if of_sample { sample } else { texel };
        let mut words: Vec<u64> =
            program.instructions().iter().map(Instruction::encode).collect();
        for (at, other, bits) in edits {
            let (at, other) = (usize::from(at) % words.len(), usize::from(other) % words.len());
            match bits % 4 {
                0 => words.swap(at, other),
                1 => words.insert(at, words[other]),
                2 if words.len() > 1 => drop(words.remove(at)),
                _ => words[at] ^= 1 << ((bits >> 8) % 64),
            }
        }
        let decoded: Result<Vec<Instruction>, _> =
            words.iter().map(|&word| Instruction::decode(word)).collect();
        if let Ok(instructions) = decoded {
            match Program::link(&asset, Layout::LINEAR, instructions) {
                Ok(program) => {
                    prop_assert_eq!(codes(&asset, &program)[0].len(), asset.shape.outputs.len());
                    if program.footprint_loop().is_some() {
                        samples(&asset, &program);
                    }
                    prop_assert!(program.sum_bounds(&asset).len() <= program.steps().len());
                }
                Err(error) => prop_assert!(error.at <= words.len(), "{error}"),
            }
        }
    }
}
