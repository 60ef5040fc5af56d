//! Image: a program as bytes, the `.ntp` file.
//!
//! Everything is little endian. Every byte is covered by a CRC-32.
//!
//! ```text
//!  0  magic  89 'N' 'T' 'P' 0d 0a 1a 0a
//!  8  u16 major, u16 minor
//! 12  u32 code of the layout
//! 16  u32 words
//! 20  u32 CRC-32 of the words
//! 24  u32 zero
//! 28  u32 CRC-32 of bytes 0..28
//! 32  u64 words, one an instruction
//! ```
//!
//! An image says nothing of the asset that it is for: whoever runs it links it first.

use crate::instruction::{Instruction, WordError};
use crate::layout::Layout;
use crate::layout_code;
use crate::limits::MAX_INSTRUCTIONS;
use std::fmt;

/// The first eight bytes.
pub const MAGIC: [u8; 8] = [0x89, b'N', b'T', b'P', 0x0d, 0x0a, 0x1a, 0x0a];
/// The major and minor version that this crate writes, and the only one that it reads.
pub const VERSION: (u16, u16) = (1, 0);
/// Bytes before the first word.
pub const HEADER_BYTES: usize = 32;
/// Bytes of a word.
pub const WORD_BYTES: usize = 8;
/// Bytes of the longest image.
pub const MAX_BYTES: usize = HEADER_BYTES + WORD_BYTES * MAX_INSTRUCTIONS as usize;

/// Why bytes are no program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ImageError {
    /// The first bytes are those of another format.
    Foreign {
        /// The first eight bytes (fewer in a shorter file).
        found: Vec<u8>,
    },
    /// The header says something that is not allowed.
    Field {
        /// `version`, `layout`, `words`, `zero` or `bytes`.
        field: &'static str,
        /// What was found.
        found: String,
        /// What is allowed.
        allowed: String,
    },
    /// The bytes of a part are not those that were written.
    Checksum {
        /// `header` or `words`.
        part: &'static str,
        /// The CRC-32 that the file states.
        stated: u32,
        /// The CRC-32 of the bytes.
        computed: u32,
    },
    /// A word is no instruction.
    Word {
        /// The word, from 0.
        at: usize,
        /// Why.
        error: WordError,
    },
}

impl fmt::Display for ImageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ImageError::Foreign { found } => write!(
                f,
                "not a program image: it starts with {found:02x?}; allowed: {MAGIC:02x?}"
            ),
            ImageError::Field {
                field,
                found,
                allowed,
            } => write!(f, "image.{field}: found {found}; allowed: {allowed}"),
            ImageError::Checksum {
                part,
                stated,
                computed,
            } => write!(
                f,
                "image.{part}: damaged: its CRC-32 is {computed:08x} and the file states {stated:08x}"
            ),
            ImageError::Word { at, error } => write!(f, "word {at}: {error}"),
        }
    }
}

impl std::error::Error for ImageError {}

/// A layout and instructions as a program image.
#[must_use]
pub fn write(layout: Layout, instructions: &[Instruction]) -> Vec<u8> {
    let words: Vec<u8> = instructions
        .iter()
        .flat_map(|instruction| instruction.encode().to_le_bytes())
        .collect();
    let mut bytes = Vec::with_capacity(HEADER_BYTES + words.len());
    bytes.extend(MAGIC);
    bytes.extend(VERSION.0.to_le_bytes());
    bytes.extend(VERSION.1.to_le_bytes());
    bytes.extend(layout_code::code(layout).to_le_bytes());
    bytes.extend((instructions.len() as u32).to_le_bytes());
    bytes.extend(crc32fast::hash(&words).to_le_bytes());
    bytes.extend([0; 4]);
    bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
    bytes.extend(words);
    bytes
}

/// The layout and the instructions of a program image. They are not linked.
///
/// # Errors
/// When the bytes are another format's, damaged, cut off, too long, or hold a word that is no
/// instruction.
pub fn read(bytes: &[u8]) -> Result<(Layout, Vec<Instruction>), ImageError> {
    if !bytes.starts_with(&MAGIC) {
        return Err(ImageError::Foreign {
            found: bytes.iter().take(MAGIC.len()).copied().collect(),
        });
    }
    let Some((header, words)) = bytes.split_first_chunk::<HEADER_BYTES>() else {
        return field("bytes", bytes.len(), format!("at least {HEADER_BYTES}"));
    };
    let half = |at: usize| u16::from_le_bytes([header[at], header[at + 1]]);
    let word = |at: usize| u32::from(half(at)) | u32::from(half(at + 2)) << 16;
    checksum("header", word(28), &header[..28])?;
    let version = (half(8), half(10));
    if version != VERSION {
        let found = format!("{}.{}", version.0, version.1);
        return field("version", found, format!("{}.{}", VERSION.0, VERSION.1));
    }
    let Some(layout) = layout_code::from_code(word(12)) else {
        let allowed = format!("the code of one of {}", layout_code::names());
        return field("layout", word(12), allowed);
    };
    let count = word(16);
    if count > MAX_INSTRUCTIONS {
        return field("words", count, format!("at most {MAX_INSTRUCTIONS}"));
    }
    if word(24) != 0 {
        return field("zero", word(24), "0".to_owned());
    }
    let expected = HEADER_BYTES + WORD_BYTES * count as usize;
    if bytes.len() != expected {
        let allowed = format!("{expected}, for {count} words");
        return field("bytes", bytes.len(), allowed);
    }
    checksum("words", word(20), words)?;
    let (words, _) = words.as_chunks::<WORD_BYTES>();
    let instructions = words.iter().enumerate().map(|(at, &word)| {
        Instruction::decode(u64::from_le_bytes(word))
            .map_err(|error| ImageError::Word { at, error })
    });
    Ok((layout, instructions.collect::<Result<_, _>>()?))
}

fn field<T>(field: &'static str, found: impl ToString, allowed: String) -> Result<T, ImageError> {
    Err(ImageError::Field {
        field,
        found: found.to_string(),
        allowed,
    })
}

fn checksum(part: &'static str, stated: u32, bytes: &[u8]) -> Result<(), ImageError> {
    let computed = crc32fast::hash(bytes);
    if stated == computed {
        return Ok(());
    }
    Err(ImageError::Checksum {
        part,
        stated,
        computed,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn instructions() -> Vec<Instruction> {
        vec![
            Instruction::Position { grid: 1 },
            Instruction::Repeat { times: 3, step: 1 },
            Instruction::Relu { outputs: 1024 },
            Instruction::Again {},
            Instruction::End {},
        ]
    }

    /// An image whose header is sound, whatever it says.
    fn with_header(change: impl Fn(&mut [u8])) -> Vec<u8> {
        let mut bytes = write(layout_code::DEFAULT, &instructions());
        change(&mut bytes);
        let crc = crc32fast::hash(&bytes[HEADER_BYTES..]);
        bytes[20..24].copy_from_slice(&crc.to_le_bytes());
        let crc = crc32fast::hash(&bytes[..28]);
        bytes[28..32].copy_from_slice(&crc.to_le_bytes());
        bytes
    }

    #[test]
    fn every_program_returns_from_its_image() {
        for layout in Layout::every() {
            for count in 0..=5 {
                let part = instructions()[..count].to_vec();
                assert_eq!(read(&write(layout, &part)), Ok((layout, part)));
            }
            let longest = vec![Instruction::End {}; MAX_INSTRUCTIONS as usize];
            let bytes = write(layout, &longest);
            assert_eq!(bytes.len(), MAX_BYTES);
            assert_eq!(read(&bytes), Ok((layout, longest)));
        }
    }

    #[test]
    fn every_flipped_bit_truncation_and_addition_is_refused() {
        let mut bytes = write(layout_code::DEFAULT, &instructions());
        for bit in 0..8 * bytes.len() {
            bytes[bit / 8] ^= 1 << (bit % 8);
            assert!(read(&bytes).is_err(), "bit {bit}");
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
        for length in 0..bytes.len() {
            assert!(read(&bytes[..length]).is_err(), "{length} bytes");
        }
        bytes.push(0);
        assert!(read(&bytes).is_err());
    }

    #[test]
    fn a_sound_header_that_says_too_much_is_refused_by_name() {
        let refused = |at: usize, number: u32| {
            let change =
                |bytes: &mut [u8]| bytes[at..at + 4].copy_from_slice(&number.to_le_bytes());
            match read(&with_header(change)) {
                Err(ImageError::Field { field, .. }) => field,
                other => panic!("{other:?}"),
            }
        };
        assert_eq!(refused(8, 2), "version");
        assert_eq!(refused(8, 1 << 16 | 1), "version");
        assert_eq!(refused(12, u32::MAX), "layout");
        assert_eq!(refused(16, u32::MAX), "words");
        assert_eq!(refused(16, 4), "bytes");
        assert_eq!(refused(24, 1), "zero");
        let word = read(&with_header(|bytes| bytes[HEADER_BYTES + 8] = 0xff));
        let error = WordError::Opcode { found: 0xff };
        assert_eq!(word, Err(ImageError::Word { at: 1, error }));
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            failure_persistence: None,
            ..ProptestConfig::with_cases(2048)
        })]

        #[test]
        fn any_words_are_read_or_refused(words in proptest::collection::vec(any::<u64>(), 0..20)) {
            let mut bytes = with_header(|bytes| {
                bytes[16..20].copy_from_slice(&(words.len() as u32).to_le_bytes());
            });
            bytes.truncate(HEADER_BYTES);
            bytes.extend(words.iter().flat_map(|word| word.to_le_bytes()));
            let crc = crc32fast::hash(&bytes[HEADER_BYTES..]);
            bytes[20..24].copy_from_slice(&crc.to_le_bytes());
            let crc = crc32fast::hash(&bytes[..28]);
            bytes[28..32].copy_from_slice(&crc.to_le_bytes());
            match read(&bytes) {
                Ok((layout, instructions)) => prop_assert_eq!(write(layout, &instructions), bytes),
                Err(error) => prop_assert!(matches!(error, ImageError::Word { .. }), "{error}"),
            }
        }
    }
}
