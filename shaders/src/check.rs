//! Checks of the shader text that need no device.

use crate::pack::header_words;
use crate::source::{HALF_STAGES, NO_HALF, NO_TAPS, STAGES, Stage, TAPS, source};
use crate::variant::Variant;
use naga::valid::{Capabilities, ValidationFlags, Validator};
use naga::{Module, ScalarKind, TypeInner};
use ntmu_isa::profile::NamedProfile;
use ntmu_isa::shape::Sampling;
use std::collections::BTreeSet;

/// Texts that a device may be given: at the smallest and the largest sizes, with each kind of layer
/// alone, and by every named profile.
fn texts() -> Vec<(String, String)> {
    let largest = Variant::largest();
    let smallest = Variant {
        vector_elements: 1,
        vector_count: 2,
        has_words: false,
        has_half_layers: false,
        has_float_output: false,
        activations: 1,
        samplings: [Sampling::Interpolated; 2],
        input_bits: 4,
        ..largest
    };
    let halves = Variant {
        has_bytes: false,
        has_integer_layers: false,
        input_bits: 16,
        ..largest
    };
    let profiles = NamedProfile::all().unwrap().into_iter().map(|named| {
        let variant = Variant {
            profile: named.profile,
            ..largest
        };
        (named.name, variant)
    });
    [
        ("smallest", smallest),
        ("largest", largest),
        ("halves", halves),
    ]
    .map(|(name, variant)| (name.to_owned(), variant))
    .into_iter()
    .chain(profiles)
    .flat_map(|(name, variant)| {
        [false, true].map(|taps| (format!("{name}, taps {taps}"), source(&variant, taps)))
    })
    .chain([("probe".to_owned(), crate::probe::text())])
    .collect()
}

fn parse(name: &str, text: &str) -> Module {
    let module = naga::front::wgsl::parse_str(text)
        .unwrap_or_else(|error| panic!("{name}: {}", error.emit_to_string(text)));
    // No capabilities: what needs one is not portable.
    let mut validator = Validator::new(ValidationFlags::all(), Capabilities::empty());
    validator
        .validate(&module)
        .unwrap_or_else(|error| panic!("{name}: {}", error.emit_to_string(text)));
    module
}

/// The kinds of scalar in a type.
fn scalar(inner: &TypeInner) -> Option<ScalarKind> {
    inner.scalar_kind()
}

#[test]
fn every_text_is_valid_without_any_extension() {
    for (name, text) in texts() {
        parse(&name, &text);
    }
}

#[test]
fn no_text_has_a_float() {
    for (name, text) in texts() {
        let module = parse(&name, &text);
        for (_, kind) in module.types.iter() {
            assert!(
                matches!(
                    scalar(&kind.inner),
                    None | Some(ScalarKind::Sint | ScalarKind::Uint | ScalarKind::Bool)
                ),
                "{name}: {kind:?}"
            );
            // Images and matrices have no scalar kind of their own, and floats in them.
            assert!(
                !matches!(
                    kind.inner,
                    TypeInner::Matrix { .. } | TypeInner::Image { .. } | TypeInner::Sampler { .. }
                ),
                "{name}: {kind:?}"
            );
        }
        // Types of intermediate results need not be in the table.
        let info = Validator::new(ValidationFlags::all(), Capabilities::empty())
            .validate(&module)
            .unwrap();
        for (handle, function) in module.functions.iter() {
            for (expression, _) in function.expressions.iter() {
                let inner = info[handle][expression].ty.inner_with(&module.types);
                assert!(
                    scalar(inner) != Some(ScalarKind::Float),
                    "{name}: {:?}",
                    function.name
                );
            }
        }
    }
}

#[test]
fn the_float_check_finds_a_float() {
    let module = parse("float", "fn f(x: i32) -> i32 { return i32(f32(x) * 0.5); }");
    let info = Validator::new(ValidationFlags::all(), Capabilities::empty())
        .validate(&module)
        .unwrap();
    let (handle, function) = module.functions.iter().next().unwrap();
    let floats = function.expressions.iter().filter(|(expression, _)| {
        let inner = info[handle][*expression].ty.inner_with(&module.types);
        scalar(inner) == Some(ScalarKind::Float)
    });
    assert!(floats.count() > 0);
}

/// The functions that a file defines, by its text.
fn defined(stage: &Stage) -> BTreeSet<&str> {
    stage
        .text
        .lines()
        .filter_map(|line| line.strip_prefix("fn "))
        .filter_map(|rest| rest.split('(').next())
        .collect()
}

#[test]
fn every_stage_defines_its_functions_and_every_function_is_in_one_file() {
    let module = parse("decode", &source(&Variant::largest(), false));
    let mut in_module: BTreeSet<&str> = module
        .functions
        .iter()
        .filter_map(|(_, function)| function.name.as_deref())
        .collect();
    in_module.extend(module.entry_points.iter().map(|entry| entry.name.as_str()));
    let mut seen = BTreeSet::new();
    for stage in STAGES.iter().chain(HALF_STAGES).chain([&NO_TAPS]) {
        let defined = defined(stage);
        for function in stage.functions {
            assert!(defined.contains(function), "{}: {function}", stage.stem);
        }
        for function in defined {
            assert!(seen.insert(function), "{function} is in two files");
        }
    }
    assert_eq!(seen, in_module);
    assert_eq!(defined(&TAPS), defined(&NO_TAPS));
    let entered: BTreeSet<&str> = NO_HALF.functions.iter().copied().collect();
    assert_eq!(defined(&NO_HALF), entered);
    let functions = HALF_STAGES.iter().flat_map(|stage| stage.functions);
    assert!(entered.is_subset(&functions.copied().collect()));
}

#[test]
fn every_file_of_the_folder_is_a_stage() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/wgsl");
    let found: BTreeSet<String> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    let listed: BTreeSet<String> = STAGES
        .iter()
        .chain(HALF_STAGES)
        .map(|stage| stage.stem)
        .chain([NO_HALF.stem, TAPS.stem, NO_TAPS.stem, "probe", "probe_half"])
        .map(|stem| format!("{stem}.wgsl"))
        .collect();
    assert_eq!(found, listed);
}

/// Field names and byte offsets of a struct.
fn members(module: &Module, name: &str) -> Vec<(String, u32)> {
    let (_, found) = module
        .types
        .iter()
        .find(|(_, kind)| kind.name.as_deref() == Some(name))
        .unwrap();
    let TypeInner::Struct { members, .. } = &found.inner else {
        panic!("{name} is no struct");
    };
    members
        .iter()
        .map(|member| (member.name.clone().unwrap(), member.offset))
        .collect()
}

#[test]
fn buffers_have_no_gaps_that_the_host_would_have_to_know() {
    let module = parse("decode", &source(&Variant::largest(), true));
    for name in ["Request", "Grid", "Layer", "Row", "Part"] {
        for (index, (field, offset)) in (0..).zip(members(&module, name)) {
            assert_eq!(offset, 4 * index, "{name}.{field}");
        }
    }
    let (_, header) = module
        .global_variables
        .iter()
        .find(|(_, variable)| variable.name.as_deref() == Some("header"))
        .unwrap();
    let size = module.types[header.ty].inner.size(module.to_ctx());
    assert_eq!(size as usize, 4 * header_words());
}

#[test]
fn the_command_line_compilers_accept_every_text() {
    // tint reads a text completely only when it has something to write; naga validates by itself.
    let commands: [(&str, &[&str]); 2] = [("naga", &[]), ("tint", &["--format", "wgsl"])];
    for (compiler, options) in commands {
        for (index, (name, text)) in texts().into_iter().enumerate() {
            let file = format!("ntmu-{compiler}-{index}-{}.wgsl", std::process::id());
            let path = std::env::temp_dir().join(file);
            std::fs::write(&path, text).unwrap();
            let outcome = std::process::Command::new(compiler)
                .args(options)
                .arg(&path)
                .output();
            std::fs::remove_file(&path).unwrap();
            match outcome {
                Err(error) => {
                    eprintln!("SKIPPED: {compiler}: {error}");
                    break;
                }
                Ok(output) => assert!(
                    output.status.success(),
                    "{compiler}, {name}: {}",
                    String::from_utf8_lossy(&output.stderr)
                ),
            }
        }
    }
}
