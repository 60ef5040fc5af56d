use super::*;
use proptest::prelude::*;

/// For every operand, each number that it may be, with the others at their smallest, their largest
/// and in between.
fn instructions() -> Vec<Instruction> {
    let picks: [fn(&Operand) -> u16; 3] = [Operand::min, Operand::max, |o| {
        o.min() + (o.max() - o.min()) / 3
    }];
    let mut all = Vec::new();
    for (row, pick) in TABLE
        .iter()
        .flat_map(|row| picks.map(move |pick| (row, pick)))
    {
        let plain: Vec<u16> = row.operands.iter().map(pick).collect();
        all.extend(Instruction::from_operands(row.opcode, &plain));
        for (at, operand) in row.operands.iter().enumerate() {
            for number in operand.min()..=operand.max() {
                let mut operands = plain.clone();
                operands[at] = number;
                all.extend(Instruction::from_operands(row.opcode, &operands));
            }
        }
    }
    all
}

#[test]
fn every_number_of_every_operand_returns_from_its_text() {
    let all = instructions();
    for part in all.chunks(MAX_INSTRUCTIONS as usize) {
        for layout in Layout::every() {
            let text = print(layout, part);
            assert_eq!(assemble(&text), Ok((layout, part.to_vec())));
        }
    }
}

#[test]
fn numbers_outside_the_range_are_refused_where_they_stand() {
    for row in TABLE {
        for (at, operand) in row.operands.iter().enumerate() {
            let mut wrong = vec![operand.max() + 1];
            wrong.extend(operand.min().checked_sub(1));
            for number in wrong {
                let mut operands: Vec<u16> = row.operands.iter().map(Operand::min).collect();
                operands[at] = number;
                let instruction = Instruction::from_operands(row.opcode, &operands).unwrap();
                let line = disassemble(&instruction);
                let error = assemble(&line).unwrap_err();
                assert_eq!(error.allowed, operand.allowed(), "{line}");
                let found = format!("{}{number}", operand.kind.prefix());
                assert_eq!(error.found, format!("{found:?}"));
                assert!(line[error.column - 1..].starts_with(&found), "{line}");
            }
        }
    }
}

#[test]
fn a_wrong_line_is_named() {
    let refusal = |text| assemble(text).unwrap_err();
    assert_eq!(refusal("end\n\nfly g0").line, 3);
    assert_eq!(refusal("end ; µ\n  ä g0").column, 3);
    assert_eq!(refusal("position g2").allowed, "grid: g0 to g1");
    assert_eq!(refusal("position g2").column, 10);
    assert_eq!(refusal("position v0").found, "\"v0\"");
    assert_eq!(
        refusal("dense l0, v0").allowed,
        "4 operands: layer, src, inputs, outputs"
    );
    assert_eq!(refusal("end 1").allowed, "no operand");
    assert_eq!(refusal("level v0, ").column, 10);
    assert_eq!(refusal(".layout spiral").allowed, layout_code::names());
    assert_eq!(refusal("position g+1").allowed, "grid: g0 to g1");
    assert_eq!(refusal("repeat 65, 1").allowed, "times: 1 to 64");
    let long = "end\n".repeat(MAX_INSTRUCTIONS as usize + 1);
    assert_eq!(refusal(&long).line, MAX_INSTRUCTIONS as usize + 1);
}

#[test]
fn the_bodies_of_loops_are_indented_and_indentation_means_nothing() {
    let (layout, loops) =
        assemble("each\n   repeat 2, 1\nrelu 4\n\tagain\nnext\nagain\nend").unwrap();
    let text = print(layout, &loops);
    let indents: Vec<usize> = text
        .lines()
        .skip(1)
        .map(|line| line.len() - line.trim_start().len())
        .collect();
    assert_eq!(indents, [0, 2, 4, 2, 0, 0, 0]);
    assert_eq!(assemble(&text), Ok((layout, loops)));
}

/// Words that a program is made of, and some that it is not.
fn word() -> impl Strategy<Value = String> {
    let known: Vec<String> = TABLE.iter().map(|row| row.mnemonic.to_owned()).collect();
    prop_oneof![
        proptest::sample::select(known),
        "[gvl]?[0-9]{0,6}",
        proptest::sample::select(vec![",", ";", "\n", " ", ".layout", "tiles-4", "g99999"])
            .prop_map(str::to_owned),
        "\\PC{0,3}",
    ]
}

proptest! {
    #![proptest_config(ProptestConfig {
        failure_persistence: None,
        ..ProptestConfig::with_cases(2048)
    })]

    #[test]
    fn any_text_is_a_program_that_returns_or_an_error_with_its_place(
        words in proptest::collection::vec(word(), 0..40), separator in "[ \n,]",
    ) {
        let text = words.join(&separator);
        match assemble(&text) {
            Ok((layout, instructions)) => {
                let printed = print(layout, &instructions);
                prop_assert_eq!(assemble(&printed), Ok((layout, instructions)));
            }
            Err(error) => {
                let line = text.lines().nth(error.line - 1).unwrap_or_default();
                prop_assert!(error.column >= 1 && error.column <= line.chars().count() + 1);
            }
        }
    }
}
