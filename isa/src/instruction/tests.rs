use super::*;
use proptest::prelude::*;

/// Every number that the operand's bits hold.
fn numbers(operand: &Operand) -> std::ops::RangeInclusive<u16> {
    0..=(operand.field.mask() >> operand.field.low) as u16
}

/// For every operand, each number of its bits, with the others at their smallest, their largest and
/// two mixtures.
fn words() -> impl Iterator<Item = (&'static Row, Vec<u16>)> {
    TABLE.iter().flat_map(|row| {
        let picks: [fn(usize, &Operand) -> u16; 4] = [
            |_, o| o.min(),
            |_, o| o.max(),
            |at, o| o.min() + (7919 * (at as u16 + 1)) % (o.max() - o.min() + 1),
            |at, o| o.min() + (104_u16 * (at as u16 + 3) + 1) % (o.max() - o.min() + 1),
        ];
        let plain = std::iter::once((row, row.operands.iter().map(Operand::max).collect()));
        let varied = picks.into_iter().flat_map(move |pick| {
            row.operands
                .iter()
                .enumerate()
                .flat_map(move |(at, operand)| {
                    numbers(operand).map(move |number| {
                        let mut operands: Vec<u16> = row
                            .operands
                            .iter()
                            .enumerate()
                            .map(|(i, o)| pick(i, o))
                            .collect();
                        operands[at] = number;
                        (row, operands)
                    })
                })
        });
        plain.chain(varied)
    })
}

#[test]
fn no_two_rows_share_a_mnemonic_and_none_is_empty() {
    for (index, row) in TABLE.iter().enumerate() {
        assert!(!row.mnemonic.is_empty() && !row.summary.trim().is_empty());
        for other in &TABLE[..index] {
            assert_ne!(row.mnemonic, other.mnemonic);
        }
    }
}

#[test]
fn every_bit_of_every_row_has_one_owner() {
    for row in TABLE {
        for bit in 0..64 {
            let operands = row.operands.iter().map(|o| o.field);
            let owners = operands
                .chain(row.reserved.iter().copied())
                .chain([OPCODE])
                .filter(|field| field.mask() >> bit & 1 == 1);
            assert_eq!(owners.count(), 1, "bit {bit} of {}", row.mnemonic);
        }
    }
}

#[test]
fn every_number_of_every_operand_returns_from_its_word_or_is_refused() {
    let mut refused = 0;
    for (row, operands) in words() {
        let instruction = Instruction::from_operands(row.opcode, &operands).unwrap();
        let word = instruction.encode();
        assert_eq!(instruction.row(), row);
        let is_legal = row
            .operands
            .iter()
            .zip(&operands)
            .all(|(o, &n)| o.allows(n));
        if is_legal {
            assert_eq!(Instruction::decode(word), Ok(instruction));
            assert_eq!(Instruction::decode(word).unwrap().encode(), word);
        } else {
            refused += 1;
            let error = Instruction::decode(word).unwrap_err();
            assert!(matches!(error, WordError::Operand { .. }), "{error}");
            assert_eq!(instruction.check_operands(), Err(error));
        }
    }
    assert!(refused > 0, "some operands have more bits than numbers");
}

#[test]
fn a_reserved_bit_or_an_unknown_opcode_is_refused() {
    for row in TABLE {
        let operands: Vec<u16> = row.operands.iter().map(Operand::min).collect();
        let word = Instruction::from_operands(row.opcode, &operands)
            .unwrap()
            .encode();
        for bit in (8..64).filter(|bit| row.reserved_mask() >> bit & 1 == 1) {
            let mnemonic = row.mnemonic;
            let found = 1 << bit;
            let error = WordError::Reserved { mnemonic, found };
            assert_eq!(Instruction::decode(word | found), Err(error));
        }
    }
    for opcode in 0..=255_u8 {
        let known = TABLE.iter().any(|row| row.opcode == opcode);
        let error = Instruction::decode(u64::from(opcode)).err();
        assert_eq!(error == Some(WordError::Opcode { found: opcode }), !known);
    }
}

#[test]
fn another_layer_changes_the_layer_alone() {
    for (row, operands) in words() {
        let instruction = Instruction::from_operands(row.opcode, &operands).unwrap();
        let moved = instruction.with_layer(63);
        assert_eq!(moved.layer(), instruction.layer().map(|_| 63));
        let back = instruction.layer().map(|layer| moved.with_layer(layer));
        assert_eq!(back.unwrap_or(moved), instruction);
    }
}

proptest! {
    #![proptest_config(ProptestConfig {
        failure_persistence: None,
        ..ProptestConfig::with_cases(4096)
    })]

    #[test]
    fn what_any_word_decodes_to_encodes_to_that_word(word: u64, opcode in 0..TABLE.len()) {
        // Mostly words of a known opcode and few bits, or nearly all would be refused.
        let known = u64::from(TABLE[opcode].opcode);
        let legal = word & !TABLE[opcode].reserved_mask() & !OPCODE.mask() | known;
        for word in [word, word & !OPCODE.mask() | known, legal] {
            match Instruction::decode(word) {
                Ok(instruction) => prop_assert_eq!(instruction.encode(), word),
                Err(error) => prop_assert!(!error.to_string().is_empty()),
            }
        }
    }
}
