//! Claims about single instructions, each run by a tiny asset whose numbers are worked out here.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]
#![allow(dead_code, reason = "the fixture serves several tests")]

mod fixture;
mod naive;

use fixture::{
    PLAIN, asset, asset_of, exact, half, integer, power, quantized, shape, taps, with_integer,
    with_skip,
};
use naive::float::Float;
use ntmu_isa::activation::Activation;
use ntmu_isa::embed::Wave;
use ntmu_isa::half::Half;
use ntmu_isa::instruction::Instruction;
use ntmu_isa::layer::{Layer, Quantize};
use ntmu_isa::layout::Layout;
use ntmu_isa::profile::Profile;
use ntmu_isa::round::Rounding;
use ntmu_isa::shape::OutputFormat;
use ntmu_isa::{Asset, Program};
use ntmu_model::Request;
use ntmu_model::exec::Decoder;
use ntmu_model::time::work_of;

const NORMATIVE: Profile = Profile::NORMATIVE;

/// An input layer that passes the first latent on, in fp16: real = value / 256.
fn first_latent(activation: Activation) -> Layer {
    half(&[&[1.0, 0.0, 0.0]], &[0.0], activation)
}

/// An fp16 layer of one row that passes its input on.
fn pass() -> Layer {
    half(&[&[1.0]], &[0.0], Activation::Identity)
}

/// A synthesizer of one channel that reads one latent and nothing of another.
fn of_latent(value: i32, profile: Profile, layers: Vec<Layer>, output: OutputFormat) -> Asset {
    asset(&[value, 0], PLAIN, profile, layers, &[output])
}

const LATENTS: std::ops::RangeInclusive<i32> = -127..=128;

#[test]
fn saw_writes_the_fraction_of_the_period_and_zero_fills_the_rest() {
    let mut shape = shape(2, 8, &[OutputFormat::Unorm8]);
    shape.octaves = 2;
    shape.wave = Wave::Saw;
    shape.padding = 3;
    let layer = integer(&[&[0; 14]], &[0], power(0), Activation::Identity);
    let zero = vec![127_u8];
    let asset = asset_of(shape, [zero.clone(), zero], NORMATIVE, vec![layer]);
    let program = Program::compile(&asset, Layout::LINEAR);
    let decoder = Decoder::new(&asset, &program);
    for (x, y) in (0..8).flat_map(|x| (0..8).map(move |y| (x, y))) {
        let request = Request::new(&asset.shape, x, y, 0).unwrap();
        // t = (2·texel + 1)·2^octave / 16 periods, a quarter period later 4 more sixteenths; 2f − 1
        // of the fraction is in eighths, 16 of 128 each.
        let mut expected = vec![0; 2];
        for octave in [1, 2] {
            for texel in [x, y] {
                for quarter in [0, 4] {
                    let sixteenths = ((2 * texel + 1) * octave + quarter) % 16;
                    expected.push((sixteenths as i16 - 8) * 16);
                }
            }
        }
        expected.extend([0; 4]);
        assert_eq!(decoder.taps(request).inputs, expected, "({x}, {y})");
    }
}

#[test]
fn table_replaces_the_rescaled_value_and_the_skip_path_is_added_to_its_entry() {
    let table: Vec<i16> = (0..256).map(|i: i16| (i - 128) * 3 - 7).collect();
    for value in LATENTS {
        // l0: the latent itself, about 5. l1: 3·(l0 − 5) / 2, to an index; the entry, plus
        // (l0 − 5) · ½, plus 9, in 9 bits.
        let first = with_integer(
            integer(&[&[1, 0, 0]], &[0], power(0), Activation::Identity),
            |p| {
                p.output_bits = PLAIN;
                p.zero_point = 5;
            },
        );
        let second = with_integer(integer(&[&[3]], &[-15], power(1), Activation::Table), |p| {
            p.table.clone_from(&table);
            p.output_bits = 9;
            p.zero_point = 9;
        });
        let last = integer(&[&[1]], &[0], power(0), Activation::Identity);
        let layers = vec![first, with_skip(second, 1, power(1)), last];
        let found = taps(&of_latent(value, NORMATIVE, layers, OutputFormat::Unorm8));
        // Ties up: ⌊(2x + 1)/2⌋ of x/2 … as (x + 1) >> 1.
        let halved = |x: i32| (x + 1) >> 1;
        let index = halved(3 * value).clamp(-128, 127) + 128;
        let entry = i32::from(table[index as usize]);
        assert_eq!(found.layers[1].activated, [entry]);
        let output = (entry + halved(value) + 9).clamp(-256, 255);
        assert_eq!(found.layers[1].outputs, [output as i16], "{value}");
    }
}

#[test]
fn a_clamped_gate_limits_its_argument_to_three() {
    for (is_clamped, value) in [false, true]
        .into_iter()
        .flat_map(|c| LATENTS.map(move |v| (c, v)))
    {
        // The argument is the latent · 16 in 1/256: −8 to 8.
        let gate = Activation::HardGelu {
            scale: power(8),
            is_clamped,
        };
        let first = with_integer(integer(&[&[16, 0, 0]], &[0], power(0), gate), |p| {
            p.output_bits = 16;
        });
        let last = integer(&[&[1]], &[0], power(0), Activation::Identity);
        let found = taps(&of_latent(
            value,
            NORMATIVE,
            vec![first, last],
            OutputFormat::Unorm8,
        ));
        let x = if is_clamped {
            (16 * value).min(768)
        } else {
            16 * value
        };
        let product = x * (2 * x + 768).clamp(0, 1536);
        assert_eq!(found.layers[0].activated, [product]);
        let output = ((product + 128) >> 8).clamp(-32_768, 32_767);
        assert_eq!(found.layers[0].outputs, [output as i16]);
    }
}

#[test]
fn integers_of_every_width_are_read_as_halves() {
    // A latent is 2^−8 of its value, whatever the input's bits; 4 bits round ties up and saturate.
    for (input_bits, value) in (4..=16).flat_map(|bits| LATENTS.map(move |value| (bits, value))) {
        let layers = vec![first_latent(Activation::Identity)];
        let asset = asset(
            &[value, 0],
            input_bits,
            NORMATIVE,
            layers,
            &[OutputFormat::Float16],
        );
        let found = taps(&asset);
        let input = if input_bits >= 9 {
            value << (input_bits - 9)
        } else {
            let unit = 1 << (9 - input_bits);
            (value + unit / 2)
                .div_euclid(unit)
                .min((1 << (input_bits - 1)) - 1)
        };
        assert_eq!(i32::from(found.inputs[0]), input);
        let real = input as f32 / f32::from(1_u16 << (input_bits - 1));
        assert_eq!(found.layers[0].accumulators, [real.to_bits() as i32]);
        assert_eq!(found.codes, [i32::from(exact(real).bits())]);
    }
}

#[test]
fn relu_leaky_and_gate_of_halves_are_those_of_the_definition() {
    for activation in [
        Activation::Relu,
        Activation::Leaky { shift: 1 },
        Activation::Leaky { shift: 7 },
        Activation::HardGelu {
            scale: power(0),
            is_clamped: false,
        },
        Activation::HardGelu {
            scale: power(0),
            is_clamped: true,
        },
    ] {
        for value in LATENTS {
            // The latent · 16: −8 to 8.
            let first = half(&[&[16.0, 0.0, 0.0]], &[0.0], activation);
            let found = taps(&of_latent(
                value,
                NORMATIVE,
                vec![first, pass()],
                OutputFormat::Snorm8,
            ));
            let activated = naive::activate(activation, Float::of_integer(value.into(), 4));
            assert_eq!(
                found.layers[0].accumulators,
                [(value as f32 / 16.0).to_bits() as i32]
            );
            assert_eq!(
                found.layers[0].activated,
                [activated.bits() as i32],
                "{value}"
            );
            // Round.half.
            assert_eq!(found.layers[0].outputs, [activated.nearest_half() as i16]);
        }
    }
    // A third of 3 and ½ are one: x itself beyond 3/2; at x = 1, 5/6 is 0x3f555555 + 1 in f32.
    let gate = Activation::HardGelu {
        scale: power(0),
        is_clamped: true,
    };
    let at = |value| {
        let first = half(&[&[16.0, 0.0, 0.0]], &[0.0], gate);
        let asset = of_latent(value, NORMATIVE, vec![first, pass()], OutputFormat::Snorm8);
        f32::from_bits(taps(&asset).layers[0].activated[0] as u32)
    };
    assert_eq!(
        [-128, -24, 0, 24, 48, 128].map(|v| at(v.max(-127))),
        [-0.0, -0.0, 0.0, 1.5, 3.0, 3.0]
    );
    assert_eq!(at(16).to_bits(), 0x3f55_5556);
}

#[test]
fn skip_half_adds_in_f32_and_rounds_once() {
    // 2048 + 1 is a tie in fp16: 2048. One more ulp below or above decides it.
    let sum = |skipped: f32, own: f32| {
        // A product of −0, so that a bias of −0 stays one.
        let zero = 0.0_f32.copysign(skipped);
        let first = half(&[&[zero; 3]], &[skipped], Activation::Identity);
        let second = half(&[&[0.0]], &[own], Activation::Identity);
        let layers = vec![first, with_skip(second, 1, power(0)), pass()];
        let found = taps(&of_latent(0, NORMATIVE, layers, OutputFormat::Snorm8));
        // The skip path comes behind the activation, which a tap shows.
        assert_eq!(found.layers[1].activated, [own.to_bits() as i32]);
        Half::from_bits(found.layers[1].outputs[0] as u16).to_f32()
    };
    assert_eq!(sum(2048.0, 1.0), 2048.0);
    assert_eq!(sum(2048.0, 1.000_976_6), 2050.0);
    assert_eq!(sum(2050.0, 1.0), 2052.0);
    assert_eq!(sum(65_504.0, 65_504.0), 65_504.0);
    assert_eq!(sum(-65_504.0, -16.0), -65_504.0);
    assert_eq!(sum(1.5, -1.5).to_bits(), 0.0_f32.to_bits());
    assert_eq!(sum(-0.0, -0.0).to_bits(), (-0.0_f32).to_bits());
}

#[test]
fn quantize_half_scales_rounds_and_saturates_about_its_zero_point() {
    for convert in Rounding::ALL {
        let profile = Profile {
            convert,
            ..NORMATIVE
        };
        for (bits, exponent, zero_point) in [(8, 7, 0), (8, 6, -11), (16, 14, 300), (4, 2, 1)] {
            for value in LATENTS {
                let quantize = Quantize {
                    bits,
                    exponent,
                    zero_point,
                };
                let first = quantized(first_latent(Activation::Identity), quantize);
                let last = integer(&[&[1]], &[0], power(0), Activation::Identity);
                let found = taps(&of_latent(
                    value,
                    profile,
                    vec![first, last],
                    OutputFormat::Unorm8,
                ));
                // value · 2^exponent / 2^8.
                let scaled = i64::from(value) << exponent;
                let integer = convert.shift(scaled, 8) + i64::from(zero_point);
                let high = (1_i64 << (bits - 1)) - 1;
                let expected = integer.clamp(-high - 1, high) as i16;
                assert_eq!(found.layers[0].outputs, [expected]);
                assert_eq!(found.layers[1].accumulators, [i32::from(expected)]);
            }
        }
    }
}

#[test]
fn emit_half_gives_the_nearest_code_of_every_format() {
    for convert in Rounding::ALL {
        let profile = Profile {
            convert,
            ..NORMATIVE
        };
        for (format, value) in OutputFormat::ALL
            .into_iter()
            .flat_map(|f| LATENTS.map(move |v| (f, v)))
        {
            // The latent · 2: −1 to 1.
            let last = half(&[&[2.0, 0.0, 0.0]], &[0.0], Activation::Identity);
            let found = taps(&of_latent(value, profile, vec![last], format));
            let code = |largest: i64, low: i64| {
                let code = convert.shift(i64::from(value) * largest, 7);
                code.clamp(low, largest) as i32
            };
            let expected = match format {
                OutputFormat::Unorm8 => code(255, 0),
                OutputFormat::Unorm16 => code(65_535, 0),
                OutputFormat::Snorm8 => code(127, -127),
                OutputFormat::Float16 => i32::from(exact(value as f32 / 128.0).bits()),
            };
            assert_eq!(found.codes, [expected], "{} of {value}", format.name());
        }
    }
}

#[test]
fn emit_gives_the_nearest_half_of_an_accumulator() {
    for (value, shift) in LATENTS.flat_map(|v| [2, 10, 31, 40, 53, 62].map(move |s| (v, s))) {
        let mantissa = 1_234_567_891;
        let scale = ntmu_isa::rescale::Multiplier::new(mantissa, shift).unwrap();
        let last = integer(&[&[-127, 0, 0]], &[3], scale, Activation::Identity);
        let found = taps(&of_latent(
            value,
            NORMATIVE,
            vec![last],
            OutputFormat::Float16,
        ));
        let accumulator = i64::from(-127 * value + 3);
        let product = Float::of_integer(accumulator * i64::from(mantissa), i32::from(shift));
        assert_eq!(found.codes, [i32::from(product.nearest_half())]);
    }
}

#[test]
fn a_rescale_follows_what_was_done_and_not_what_the_layer_says() {
    // A layer with a gate, and one with a table, by a program that leaves both out.
    let gate = Activation::HardGelu {
        scale: power(4),
        is_clamped: false,
    };
    let gated = integer(&[&[1, 0, 0]], &[0], power(1), gate);
    let looked_up = with_integer(integer(&[&[1]], &[0], power(2), Activation::Table), |p| {
        p.table = vec![99; 256];
    });
    let last = integer(&[&[1]], &[0], power(0), Activation::Identity);
    let asset = of_latent(
        64,
        NORMATIVE,
        vec![gated, looked_up, last],
        OutputFormat::Unorm8,
    );
    let whole = Program::compile(&asset, Layout::LINEAR);
    let plain = whole.instructions().iter().copied();
    let plain = plain.filter(|instruction| {
        !matches!(
            instruction,
            Instruction::Gate { .. } | Instruction::Table { .. }
        )
    });
    let plain = Program::link(&asset, Layout::LINEAR, plain.collect()).unwrap();
    let request = Request::new(&asset.shape, 0, 0, 0).unwrap();
    let outputs = |program| {
        let taps = Decoder::new(&asset, program).taps(request);
        [taps.layers[0].outputs[0], taps.layers[1].outputs[0]]
    };
    // 64/2 in 1/256 is 32: 32·(64 + 768) = 26624, / 16 = 1664, which saturates. Its entry is 99.
    assert_eq!(outputs(&whole), [127, 99]);
    assert_eq!(outputs(&plain), [32, 8]);
}

#[test]
fn repeat_runs_its_body_on_one_layer_after_the_other() {
    // l0 is the latent; then times 1, 2, 3, 4 and plus 1 each, in place; then the code.
    let first = integer(&[&[1, 0, 0]], &[0], power(0), Activation::Identity);
    let scaled = |weight: i8| integer(&[&[weight]], &[1], power(0), Activation::Identity);
    let last = integer(&[&[1]], &[0], power(0), Activation::Identity);
    // Every register holds 16-bit integers: a layer reads any other's.
    let first = with_integer(first, |p| p.output_bits = 16);
    let middle = (1..=4).map(|weight| with_integer(scaled(weight), |p| p.output_bits = 16));
    let layers: Vec<Layer> = [first].into_iter().chain(middle).chain([last]).collect();
    let asset = of_latent(3, NORMATIVE, layers, OutputFormat::Unorm8);
    let text = |loop_start: &str, layer: u16| {
        format!(
            "position g0\nfetch g0\nposition g1\nfetch g1\nlerp v0, 0, g0\nlerp v0, 1, g1
             level v0, 2\ndense l0, v0, 3, 1\nrescale l0, v1, 1
             {loop_start}\ndense l{layer}, v1, 1, 1\nrescale l{layer}, v1, 1\nagain
             dense l5, v1, 1, 1\nemit l5, 1\nend"
        )
    };
    let run = |text: &str| {
        let (layout, instructions) = ntmu_isa::assembly::assemble(text).unwrap();
        let program = Program::link(&asset, layout, instructions).unwrap();
        let request = Request::new(&asset.shape, 0, 0, 0).unwrap();
        let taps = Decoder::new(&asset, &program).taps(request);
        let layers: Vec<u16> = taps.layers.iter().map(|tap| tap.layer).collect();
        (layers, taps.codes[0])
    };
    // 3, 4, 9, 28, 113.
    assert_eq!(run(&text("repeat 4, 1", 1)), (vec![0, 1, 2, 3, 4, 5], 113));
    // 3, 7, 29.
    assert_eq!(run(&text("repeat 2, 2", 2)), (vec![0, 2, 4, 5], 29));
    // 3, 7, 15, 31, 63.
    assert_eq!(run(&text("repeat 4, 0", 2)), (vec![0, 2, 2, 2, 2, 5], 63));
}

#[test]
fn a_loop_is_the_work_of_its_runs() {
    let first = integer(
        &[&[1, 0, 0], &[0, 1, 0]],
        &[0, 0],
        power(0),
        Activation::Identity,
    );
    let same = integer(&[&[1, 2], &[3, 4]], &[5, 6], power(2), Activation::Relu);
    let last = integer(&[&[1, 1]], &[0], power(0), Activation::Identity);
    let mut layers = vec![first];
    layers.extend(vec![same; 6]);
    layers.push(last);
    let asset = of_latent(3, NORMATIVE, layers, OutputFormat::Unorm8);
    let program = Program::compile(&asset, Layout::LINEAR);
    assert!(program.instructions().len() < program.steps().len());
    let straight = program
        .steps()
        .iter()
        .copied()
        .filter(|step| !matches!(step, Instruction::Repeat { .. } | Instruction::Again {}));
    let straight = Program::link(&asset, Layout::LINEAR, straight.collect()).unwrap();
    let sample = Program::compile_sample(&asset, Layout::LINEAR);
    let work = work_of(&asset, &straight);
    assert_eq!(work_of(&asset, &program), work);
    assert_eq!(work_of(&asset, &sample), work);
}
