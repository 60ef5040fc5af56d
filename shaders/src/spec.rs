//! Spec: the numbers of the specification as WGSL constants.
//!
//! The shaders share the specification's *numbers* with the model and nothing else: arithmetic is
//! written again, so that two implementations agreeing means something. `wgsl/spec.wgsl` is this
//! module's output, committed; a test compares them.

use ntmu_isa::accumulate::Overflow;
use ntmu_isa::activation::{Activation, GATE_FRACTION_BITS, GATE_RANGE};
use ntmu_isa::embed::{WAVES_PER_OCTAVE, Wave};
use ntmu_isa::filter::FilterRule;
use ntmu_isa::half::activation::SIXTH;
use ntmu_isa::half::{Half, SumOrder};
use ntmu_isa::limits::{MAX_CHANNELS, MAX_LAYERS, MAX_LEVELS};
use ntmu_isa::position::{AddressMode, CornerSnap, PHASE_BITS};
use ntmu_isa::rescale::{Multiplier, Requantizer};
use ntmu_isa::round::Rounding;
use ntmu_isa::shape::{OutputFormat, Sampling};
use std::fmt::Write;

/// Every activation, its parameters aside.
const ACTIVATIONS: [Activation; 6] = [
    Activation::Identity,
    Activation::Relu,
    Activation::Leaky { shift: 1 },
    gelu(false),
    gelu(true),
    Activation::Table,
];

const fn gelu(is_clamped: bool) -> Activation {
    Activation::HardGelu {
        scale: Multiplier::power_of_two(0),
        is_clamped,
    }
}

/// The text of `wgsl/spec.wgsl`.
#[must_use]
pub fn generate() -> String {
    let mut text = String::from(
        "// Generated from the constants of ntmu-isa by shaders/src/spec.rs. Do not edit: change the\n\
         // constant there and refresh with `NTMU_BLESS=1 cargo test -p ntmu-shaders spec`.\n",
    );
    section(&mut text, "isa::limits");
    unsigned(&mut text, "MAX_CHANNELS", u32::from(MAX_CHANNELS));
    unsigned(&mut text, "MAX_LAYERS", u32::from(MAX_LAYERS));
    unsigned(&mut text, "MAX_LEVELS", u32::from(MAX_LEVELS));

    section(&mut text, "isa::position");
    unsigned(&mut text, "PHASE_BITS", u32::from(PHASE_BITS));
    for snap in CornerSnap::ALL {
        code(&mut text, "SNAP", snap.name(), snap.code());
    }
    for mode in AddressMode::ALL {
        code(&mut text, "ADDRESS", mode.name(), mode.code());
    }

    section(&mut text, "isa::filter");
    for rule in FilterRule::ALL {
        code(&mut text, "FILTER", rule.name(), rule.code());
    }

    section(&mut text, "isa::embed");
    unsigned(&mut text, "WAVES_PER_OCTAVE", u32::from(WAVES_PER_OCTAVE));
    for wave in Wave::ALL {
        code(&mut text, "WAVE", wave.name(), wave.code());
    }

    section(&mut text, "isa::round");
    for mode in Rounding::ALL {
        code(&mut text, "ROUNDING", mode.name(), mode.code());
    }

    section(&mut text, "isa::rescale");
    for requantizer in Requantizer::ALL {
        let name = requantizer.name();
        code(&mut text, "REQUANTIZER", name, requantizer.code());
    }

    section(&mut text, "isa::accumulate");
    for overflow in Overflow::ALL {
        code(&mut text, "OVERFLOW", overflow.name(), overflow.code());
    }

    section(&mut text, "isa::half");
    bits(&mut text, "HALF_ONE", u32::from(Half::ONE.bits()));
    bits(&mut text, "HALF_MAX", u32::from(Half::MAX.bits()));
    bits(&mut text, "FLOAT_SIXTH", SIXTH.to_bits());
    for order in SumOrder::ALL {
        code(&mut text, "SUM", order.name(), order.code());
    }

    section(&mut text, "isa::activation");
    let fraction = u32::from(GATE_FRACTION_BITS);
    unsigned(&mut text, "GATE_FRACTION_BITS", fraction);
    range(&mut text, "GATE", GATE_RANGE);
    for activation in ACTIVATIONS {
        code(
            &mut text,
            "ACTIVATION",
            activation.name(),
            activation.code(),
        );
    }

    section(&mut text, "isa::shape");
    for sampling in Sampling::ALL {
        code(&mut text, "SAMPLING", sampling.name(), sampling.code());
    }
    for format in OutputFormat::ALL {
        code(&mut text, "OUTPUT", format.name(), format.code());
        let name = format!("OUTPUT_{}", constant_name(format.name()));
        range(&mut text, &name, format.range());
    }
    text
}

fn section(text: &mut String, module: &str) {
    line(text, format_args!("\n// {module}"));
}

fn unsigned(text: &mut String, name: &str, value: u32) {
    line(text, format_args!("const {name}: u32 = {value}u;"));
}

fn bits(text: &mut String, name: &str, value: u32) {
    line(text, format_args!("const {name}: u32 = {value:#x}u;"));
}

fn code(text: &mut String, prefix: &str, name: &str, value: u8) {
    let name = format!("{prefix}_{}", constant_name(name));
    unsigned(text, &name, u32::from(value));
}

fn range(text: &mut String, name: &str, (low, high): (i32, i32)) {
    line(text, format_args!("const {name}_MIN: i32 = {low};"));
    line(text, format_args!("const {name}_MAX: i32 = {high};"));
}

fn constant_name(name: &str) -> String {
    name.to_ascii_uppercase().replace('-', "_")
}

fn line(text: &mut String, line: std::fmt::Arguments<'_>) {
    // Writing to a string has no failure to report.
    let _ = writeln!(text, "{line}");
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::path::Path;

    #[test]
    fn spec_wgsl_is_what_the_specification_generates() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("wgsl/spec.wgsl");
        let text = generate();
        let may_bless = std::env::var_os("CI").is_none();
        if may_bless && std::env::var_os("NTMU_BLESS").is_some_and(|v| v == "1") {
            std::fs::write(&path, &text).unwrap();
        }
        let committed = std::fs::read_to_string(&path).unwrap();
        assert_eq!(
            committed, text,
            "refresh with: NTMU_BLESS=1 cargo test -p ntmu-shaders spec"
        );
    }

    #[test]
    fn no_activation_is_left_out() {
        let scale = Multiplier::power_of_two(0);
        let named: Vec<_> = (0..=u8::MAX)
            .filter_map(|code| Activation::from_code(code, 1, scale))
            .collect();
        assert_eq!(named, ACTIVATIONS);
    }
}
