//! Spec: the numbers of the specification as WGSL constants.
//!
//! The shaders share the specification's *numbers* with the model and nothing else: arithmetic is
//! written again, so that two implementations agreeing means something. `wgsl/spec.wgsl` is this
//! module's output, committed; a test compares them.

use ntmu_isa::activation::{Activation, GATE_FRACTION_BITS, GATE_RANGE};
use ntmu_isa::embed::{ACTIVATION_RANGE, INPUT_FRACTION_BITS, WAVES_PER_OCTAVE};
use ntmu_isa::limits::{MAX_CHANNELS, MAX_LAYERS};
use ntmu_isa::position::{AddressMode, CornerSnap, PHASE_BITS};
use ntmu_isa::rescale::Requantizer;
use ntmu_isa::round::Rounding;
use ntmu_isa::shape::OutputFormat;
use std::fmt::Write;

/// The code of an activation: the one that `.ntx` files use (isa, `format::sections`).
#[must_use]
pub const fn activation_code(activation: &Activation) -> u32 {
    match activation {
        Activation::Identity => 0,
        Activation::Relu => 1,
        Activation::Leaky { .. } => 2,
        Activation::HardGelu { .. } => 3,
    }
}

/// The names of the activations, in the order of [`activation_code`].
const ACTIVATIONS: [&str; 4] = ["IDENTITY", "RELU", "LEAKY", "HARD_GELU"];

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

    section(&mut text, "isa::position");
    unsigned(&mut text, "PHASE_BITS", u32::from(PHASE_BITS));
    for snap in CornerSnap::ALL {
        code(&mut text, "SNAP", snap.name(), snap.code());
    }
    for mode in AddressMode::ALL {
        code(&mut text, "ADDRESS", mode.name(), mode.code());
    }

    section(&mut text, "isa::embed");
    let bits = u32::from(INPUT_FRACTION_BITS);
    unsigned(&mut text, "INPUT_FRACTION_BITS", bits);
    unsigned(&mut text, "WAVES_PER_OCTAVE", u32::from(WAVES_PER_OCTAVE));
    range(&mut text, "ACTIVATION", ACTIVATION_RANGE);

    section(&mut text, "isa::round");
    for mode in Rounding::ALL {
        code(&mut text, "ROUNDING", mode.name(), mode.code());
    }

    section(&mut text, "isa::rescale");
    for requantizer in Requantizer::ALL {
        let name = requantizer.name();
        code(&mut text, "REQUANTIZER", name, requantizer.code());
    }

    section(&mut text, "isa::activation");
    let bits = u32::from(GATE_FRACTION_BITS);
    unsigned(&mut text, "GATE_FRACTION_BITS", bits);
    range(&mut text, "GATE", GATE_RANGE);
    for (code, name) in (0..).zip(ACTIVATIONS) {
        unsigned(&mut text, &format!("ACTIVATION_{name}"), code);
    }

    section(&mut text, "isa::shape");
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
    use ntmu_isa::rescale::Multiplier;
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
    fn activation_codes_are_those_of_the_names() {
        let scale = Multiplier::power_of_two(0);
        for activation in [
            Activation::Identity,
            Activation::Relu,
            Activation::Leaky { shift: 1 },
            Activation::HardGelu { scale },
        ] {
            let name = ACTIVATIONS[activation_code(&activation) as usize];
            assert_eq!(name, constant_name(activation.name()));
        }
    }
}
