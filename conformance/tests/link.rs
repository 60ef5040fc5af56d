//! What the linker refuses, and where it says so.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use ntmu_conformance::synthetic::{self, Spec};
use ntmu_isa::instruction::Instruction;
use ntmu_isa::layout::Layout;
use ntmu_isa::limits::{MAX_INSTRUCTIONS, MAX_STEPS};
use ntmu_isa::link::LinkError;
use ntmu_isa::{Asset, Program, assembly};

/// Inputs of 2·4 + 3 + 4 + 1 = 16 lanes, a layer of 6, two blocks of two layers of 6, two channels.
fn asset() -> Asset {
    let spec = Spec {
        blocks: 2,
        ..Spec::small(12, 8)
    };
    synthetic::asset(&spec, 7).unwrap()
}

fn link(text: &str) -> Result<Program, LinkError> {
    let (layout, instructions) = assembly::assemble(text).unwrap();
    Program::link(&asset(), layout, instructions)
}

/// The inputs of [`asset`], ten instructions.
const EMBED: &str = "
    position g0
    fetch    g0
    position g1
    fetch    g1
    concat   v0, 0, g0
    lerp     v0, 8, g1
    wave     v0, 11, 1
    level    v0, 15
";

const BLOCKS: &str = "
    dense    l0, v0, 16, 6
    rescale  l0, v1, 6
    repeat   2, 2
      dense    l1, v1, 6, 6
      rescale  l1, v0, 6
      dense    l2, v0, 6, 6
      rescale.skip l2, v1, v1, 6
    again
    dense    l5, v1, 6, 2
";

fn texel() -> String {
    format!("{EMBED}{BLOCKS}emit l5, 2\nend")
}

fn sample() -> String {
    format!("footprint\neach\n{EMBED}{BLOCKS}collect l5, 2\nnext\nblend 2\nend")
}

/// Where it is refused, of the instructions from 0, what was found and what is allowed.
fn refusal(text: &str) -> (usize, String, String) {
    let LinkError { at, found, allowed } = link(text).unwrap_err();
    (at, found, allowed)
}

/// Refused at the instruction that stands in this text, with this among what is allowed.
fn refused(text: &str, at: &str, allowed: &str) {
    let error = link(text).unwrap_err();
    let (_, instructions) = assembly::assemble(text).unwrap();
    let found = instructions.get(error.at).map(assembly::disassemble);
    let found = found.unwrap_or("the end".to_owned());
    let squeezed: Vec<&str> = found.split_whitespace().collect();
    assert_eq!(squeezed.join(" "), at, "{error}");
    assert!(error.allowed.contains(allowed), "{error}");
}

#[test]
fn both_programs_of_this_test_fit() {
    assert!(link(&texel()).is_ok());
    assert!(link(&sample()).is_ok());
    assert_eq!(link(&texel()).unwrap().footprint_loop(), None);
}

#[test]
fn loops_are_matched_and_not_nested() {
    let texel = texel();
    refused(
        &texel.replace("again", ""),
        "repeat 2, 2",
        "a loop with an end",
    );
    refused(
        &texel.replace("repeat   2, 2", ""),
        "again",
        "behind a `repeat`",
    );
    let nested = texel.replace("dense    l1", "repeat 2, 0\n dense    l1");
    refused(&nested, "repeat 2, 0", "no loop inside");
    let sample = sample();
    refused(&sample.replace("next", ""), "each", "a loop with an end");
    refused(&sample.replace("each", ""), "next", "behind an `each`");
    let crossed = sample.replace("again", "").replace("next", "next\nagain");
    refused(&crossed, "next", "`again` before");
    let inside = sample.replace("dense    l1", "each\n dense    l1");
    refused(&inside, "each", "no loop inside");
    let twice = sample.replace("blend 2", "each\nnext\nblend 2");
    refused(&twice, "each", "one `each`");
}

#[test]
fn every_run_of_a_loop_has_its_layers() {
    let texel = texel();
    // The third run would be of layers 5 and 6 of 0 to 5.
    refused(
        &texel.replace("repeat   2, 2", "repeat 3, 2"),
        "dense l1, v1, 6, 6",
        "6 and 2",
    );
    // Runs from l1 in steps of 60 leave the layers that a word can name.
    let (at, found, allowed) = refusal(&texel.replace("repeat   2, 2", "repeat 3, 60"));
    assert_eq!((at, allowed.as_str()), (11, "l0 to l63"), "{found}");
    let beyond = texel.replace("repeat   2, 2", "repeat 2, 40");
    refused(&beyond, "dense l1, v1, 6, 6", "l0 to l5");
}

#[test]
fn what_a_run_leaves_must_be_what_the_next_one_needs() {
    // v1 holds l0's lanes in the first run only: the second finds inputs of another format there.
    let text = texel().replace(
        "rescale.skip l2, v1, v1, 6",
        "rescale.skip l2, v2, v1, 6\n zero v1, 0, 8",
    );
    let error = link(&text).unwrap_err();
    assert!(error.found.contains("v1"), "{error}");
    // Accumulators of the run before.
    let text = texel().replace("again", "dense l5, v1, 6, 2\n again");
    assert!(link(&text).is_err());
}

#[test]
fn programs_end_and_are_short() {
    refused("", "the end", "a program that ends");
    refused(
        &texel().replace("\nend", ""),
        "emit l5, 2",
        "`end` as the last",
    );
    refused(
        &texel().replace("again", "end\nagain"),
        "end",
        "`end` as the last",
    );
    let relu = Instruction::Relu { outputs: 1 };
    let longest = vec![relu; MAX_INSTRUCTIONS as usize + 1];
    let error = Program::link(&asset(), Layout::LINEAR, longest).unwrap_err();
    assert_eq!(error.at, MAX_INSTRUCTIONS as usize);
    let body = vec![relu; MAX_STEPS as usize / 64];
    let start = vec![Instruction::Repeat { times: 64, step: 0 }];
    let end = vec![Instruction::Again {}, Instruction::End {}];
    let error = Program::link(&asset(), Layout::LINEAR, [start, body, end].concat());
    let error = error.unwrap_err();
    assert!(error.found.contains("steps"), "{error}");
}

#[test]
fn codes_are_sent_once() {
    let texel = texel();
    let layer = "dense l5, v1, 6, 2\nemit l5, 2\nend";
    refused(&texel.replace("end", layer), "emit l5, 2", "one `emit`");
    refused(&texel.replace("emit l5, 2", ""), "the end", "one `emit`");
    refused(
        &texel.replace("emit", "collect"),
        "collect l5, 2",
        "in the loop",
    );
    refused(
        &texel.replace("end", "blend 2\nend"),
        "blend 2",
        "after the loop",
    );
    refused(
        &texel.replace("emit", "footprint\nemit"),
        "footprint",
        "with `each`",
    );
    let sample = sample();
    refused(&sample.replace("blend 2", ""), "the end", "one `blend`");
    refused(
        &sample.replace("blend 2", "blend 2\nblend 2"),
        "blend 2",
        "once",
    );
    refused(&sample.replace("blend 2", "blend 1"), "blend 1", "2");
    refused(
        &sample
            .replace("next", "")
            .replace("blend 2", "blend 2\nnext"),
        "blend 2",
        "after",
    );
    refused(
        &sample.replace("each", "blend 2\neach"),
        "blend 2",
        "after the loop",
    );
    refused(
        &sample.replace("collect l5, 2", ""),
        "next",
        "one `collect`",
    );
    refused(
        &sample.replace("collect", "emit"),
        "emit l5, 2",
        "`collect`",
    );
    let layer = "collect l5, 2\ndense l5, v1, 6, 2\ncollect l5, 2";
    refused(
        &sample.replace("collect l5, 2", layer),
        "collect l5, 2",
        "one `collect`",
    );
    refused(
        &sample.replace("footprint", ""),
        "each",
        "after `footprint`",
    );
    let twice = sample.replace("footprint", "footprint\nfootprint");
    refused(&twice, "footprint", "once");
}

#[test]
fn places_are_in_the_loop_of_the_footprint_and_nothing_of_it_is_read_behind() {
    let sample = sample();
    for outside in [
        "position g0",
        "wave v3, 0, 1",
        "saw v3, 0, 1",
        "level v3, 0",
    ] {
        let before = sample.replace("each", &format!("{outside}\neach"));
        refused(&before, outside, "in the loop");
        let behind = sample.replace("blend 2", &format!("{outside}\nblend 2"));
        refused(&behind, outside, "in the loop");
    }
    let behind = sample.replace("blend 2", "dense l1, v1, 6, 6\nblend 2");
    refused(&behind, "dense l1, v1, 6, 6", "at least 6");
    // What stands before the loop stays for every run of it.
    let hoisted = sample.replace("each", "zero v3, 0, 6\neach");
    assert!(link(&hoisted).is_ok());
}

#[test]
fn a_register_that_only_the_first_run_of_a_footprint_finds_is_refused() {
    // l5 leaves six lanes fewer in v0 than the run before wrote; here v3 is overwritten at the end of
    // a run by activations, where the next one continues inputs.
    let text = sample()
        .replace("each", "zero v3, 0, 4\neach")
        .replace("level    v0, 15", "level v0, 15\n zero v3, 4, 4")
        .replace(
            "collect l5, 2",
            "collect l5, 2\n dense l1, v1, 6, 6\n rescale l1, v3, 6",
        );
    refused(&text, "zero v3, 4, 4", "without gaps");
}
