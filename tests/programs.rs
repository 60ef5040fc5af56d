//! Programs as files: assembly and images, both ways, and what is refused.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod support;

use ntmu::isa::layout::Layout;
use ntmu::isa::{Program, assembly, image, manual};
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};
use support::command::{asset_in, folder, json, ntmu, stderr};

#[test]
fn the_committed_manual_is_the_generated_one() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let committed = std::fs::read_to_string(root.join("docs/isa.md")).unwrap();
    assert!(
        committed == manual::manual(),
        "run `ntmu program --manual > docs/isa.md`"
    );
    let printed = ntmu(&["program", "--manual"], root);
    assert_eq!(String::from_utf8(printed.stdout).unwrap(), committed);
}

#[test]
fn a_program_returns_from_assembly_to_an_image_and_back() {
    let folder = folder();
    let asset = asset_in(folder.path());
    let asset = asset.to_str().unwrap();
    for kind in [&["--layout", "tiles-4"][..], &["--sample"][..]] {
        let program = [&["program", asset, "-o", "wall.s", "--json"], kind].concat();
        let described = json(&ntmu(&program, folder.path()));
        let asm = [
            "asm", "wall.s", "-o", "wall.ntp", "--asset", asset, "--json",
        ];
        let made = json(&ntmu(&asm, folder.path()));
        assert_eq!(
            made["words"].as_u64().unwrap() as usize,
            described["instructions"].as_array().unwrap().len()
        );
        let disassembled = ntmu(&["disasm", "wall.ntp"], folder.path());
        let text = std::fs::read_to_string(folder.path().join("wall.s")).unwrap();
        assert_eq!(String::from_utf8(disassembled.stdout).unwrap(), text);
        // The image that `program` writes itself is the same.
        let direct = [&["program", asset, "-o", "direct.ntp"], kind].concat();
        assert!(ntmu(&direct, folder.path()).status.success());
        let read = |name: &str| std::fs::read(folder.path().join(name)).unwrap();
        assert_eq!(read("wall.ntp"), read("direct.ntp"));
        // Both forms are accepted again, and are the compiled program.
        for file in ["wall.s", "wall.ntp"] {
            let checked = json(&ntmu(
                &["program", asset, "--check", file, "--json"],
                folder.path(),
            ));
            for key in [
                "instructions",
                "sums",
                "classes",
                "steps",
                "layout",
                "filters",
            ] {
                assert_eq!(checked[key], described[key], "{key}");
            }
        }
    }
}

#[test]
fn a_program_is_shown_with_its_proof_and_its_classes() {
    let folder = folder();
    let asset = asset_in(folder.path());
    let asset = asset.to_str().unwrap();
    let value = json(&ntmu(
        &["program", asset, "--sample", "--json"],
        folder.path(),
    ));
    let built_in = ntmu::built_in::asset().unwrap();
    let program = Program::compile_sample(&built_in, Layout::LINEAR);
    assert_eq!(value["steps"].as_u64(), Some(program.steps().len() as u64));
    assert_eq!(value["filters"], true);
    let counts: u64 = value["classes"]
        .as_object()
        .unwrap()
        .values()
        .map(|count| count.as_u64().unwrap())
        .sum();
    assert_eq!(counts, program.steps().len() as u64);
    // A trained asset's 32 bits never overflow.
    assert_eq!(program.overflows(&built_in), []);
    let sums = value["sums"].as_array().unwrap();
    assert_eq!(sums.len(), built_in.layers.len());
    assert!(sums.iter().all(|sum| sum["may_overflow"] == false));
    // As text, the proof stands in comments: what is printed assembles to the program.
    let text = ntmu(&["program", asset, "--sample"], folder.path());
    let text = String::from_utf8(text.stdout).unwrap();
    assert!(text.contains("; l0: sums within"), "{text}");
    assert!(text.contains("never overflows"), "{text}");
    let (_, instructions) = assembly::assemble(&text).unwrap();
    assert_eq!(instructions, program.instructions());
}

#[test]
fn words_are_disassembled_from_the_line_and_from_stdin() {
    let folder = folder();
    let line = ntmu(&["disasm", "--hex", "101", "0x1f"], folder.path());
    let expected = String::from_utf8(line.stdout).unwrap();
    let mnemonics: Vec<&str> = expected
        .lines()
        .map(|line| line.split_whitespace().next().unwrap())
        .collect();
    assert_eq!(mnemonics, ["position", "end"]);
    let mut piped = Command::new(env!("CARGO_BIN_EXE_ntmu"))
        .args(["disasm", "--hex"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = piped.stdin.take().unwrap();
    stdin.write_all(b"0000000000000101\n 1f\n").unwrap();
    drop(stdin);
    let piped = piped.wait_with_output().unwrap();
    assert_eq!(String::from_utf8(piped.stdout).unwrap(), expected);
    for (words, word) in [
        (&["1f", "xyz"][..], "word 1"),
        (&["11111111111111111"], "1 to 16"),
        (&["ff"], "opcode 0xff"),
        (&["021f"], "reserved"),
        (&["000000000000800010"], "1 to 16"),
        (&["0800000000000010"], "dense"),
    ] {
        let refused = ntmu(&[&["disasm", "--hex"], words].concat(), folder.path());
        assert_eq!(refused.status.code(), Some(2), "{words:?}");
        assert!(stderr(&refused).contains(word), "{}", stderr(&refused));
    }
}

#[test]
fn damaged_foreign_and_unfit_programs_are_refused_and_nothing_is_written() {
    let folder = folder();
    let asset = asset_in(folder.path());
    let asset = asset.to_str().unwrap();
    let put = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    let built_in = ntmu::built_in::asset().unwrap();
    let program = Program::compile(&built_in, Layout::LINEAR);
    let good = image::write(program.layout(), program.instructions());
    put("short.ntp", &good[..good.len() - 1]);
    let mut damaged = good.clone();
    damaged[image::HEADER_BYTES + 3] ^= 16;
    put("damaged.ntp", &damaged);
    put(
        "huge.ntp",
        &[&good[..], &vec![0; image::MAX_BYTES]].concat(),
    );
    put("foreign.ntp", ntmu::built_in::BYTES.get(..200).unwrap());
    put("empty.ntp", b"");
    put("bad.s", b"position g0\n  fetch g7\nend\n");
    put("unfit.s", b"position g0\nfetch g1\nend\n");
    put("binary.s", &[0xff, 0xfe, 0x00]);
    put("huge.s", &vec![b' '; (1 << 20) + 1]);
    let cases: [(&[&str], &str); 12] = [
        (&["disasm", "missing.ntp"], "missing.ntp"),
        (&["disasm", "short.ntp"], "image.bytes"),
        (&["disasm", "damaged.ntp"], "CRC-32"),
        (&["disasm", "huge.ntp"], "allowed: at most"),
        (&["disasm", "foreign.ntp"], "not a program image"),
        (&["disasm", "empty.ntp"], "not a program image"),
        (
            &["asm", "bad.s", "-o", "out.ntp"],
            "line 2, column 9: found \"g7\"; allowed: grid: g0 to g1",
        ),
        (
            &["asm", "unfit.s", "-o", "out.ntp", "--asset", asset],
            "instruction 1",
        ),
        (&["asm", "binary.s", "-o", "out.ntp"], "UTF-8"),
        (&["asm", "huge.s", "-o", "out.ntp"], "more than"),
        (&["asm", "damaged.ntp", "-o", "out.ntp"], "damaged.ntp"),
        (
            &["program", asset, "--check", "damaged.ntp", "-o", "out.ntp"],
            "CRC-32",
        ),
    ];
    for (arguments, word) in cases {
        let output = ntmu(arguments, folder.path());
        let errors = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {errors}");
        assert!(errors.contains(word), "{arguments:?}: {errors}");
        assert!(output.stdout.is_empty(), "{arguments:?}");
        assert!(!folder.path().join("out.ntp").exists(), "{arguments:?}");
    }
    // Words alone are fine: only an asset says that they do not fit together.
    let alone = ntmu(&["asm", "unfit.s", "-o", "out.ntp"], folder.path());
    assert!(alone.status.success(), "{}", stderr(&alone));
}
