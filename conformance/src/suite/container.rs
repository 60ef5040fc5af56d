//! The `.ntx` container as sections, to take files apart and put wrong ones together.
//!
//! Written from the format's description, not with its code: a file that `isa` would not write is
//! what this is for.

/// The letters and body of each section, in the file's order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Container {
    /// The sections.
    pub sections: Vec<([u8; 4], Vec<u8>)>,
    /// Major and minor.
    pub version: (u16, u16),
    /// The first eight bytes.
    pub magic: [u8; 8],
}

const HEADER: usize = 64;
const ENTRY: usize = 32;

impl Container {
    /// The sections of a valid file; none where the bytes are no such thing.
    #[must_use]
    pub fn parse(file: &[u8]) -> Option<Container> {
        let magic = file.get(..8)?.try_into().ok()?;
        let version = (word(file, 8, 2)? as u16, word(file, 10, 2)? as u16);
        let sections = (0..word(file, 12, 4)? as usize).map(|index| {
            let at = HEADER + ENTRY * index;
            let letters = file.get(at..at + 4)?.try_into().ok()?;
            let (offset, length) = (word(file, at + 8, 8)?, word(file, at + 16, 8)?);
            let body = file.get(offset as usize..(offset + length) as usize)?;
            Some((letters, body.to_vec()))
        });
        Some(Container {
            sections: sections.collect::<Option<_>>()?,
            version,
            magic,
        })
    }

    /// The file, with every CRC-32 right.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut file = vec![0; HEADER + ENTRY * self.sections.len()];
        file[..8].copy_from_slice(&self.magic);
        file[8..10].copy_from_slice(&self.version.0.to_le_bytes());
        file[10..12].copy_from_slice(&self.version.1.to_le_bytes());
        file[12..16].copy_from_slice(&(self.sections.len() as u32).to_le_bytes());
        for (index, (letters, body)) in self.sections.iter().enumerate() {
            let at = HEADER + ENTRY * index;
            let offset = file.len() as u64;
            file[at..at + 4].copy_from_slice(letters);
            file[at + 8..at + 16].copy_from_slice(&offset.to_le_bytes());
            file[at + 16..at + 24].copy_from_slice(&(body.len() as u64).to_le_bytes());
            file.extend_from_slice(body);
            file.resize(file.len().next_multiple_of(8), 0);
        }
        let length = file.len() as u64;
        file[16..24].copy_from_slice(&length.to_le_bytes());
        seal(&mut file);
        file
    }

    /// The body of the section with these letters, empty if there is none.
    #[must_use]
    pub fn body(&self, letters: &str) -> &[u8] {
        let section = self
            .sections
            .iter()
            .find(|(found, _)| found == letters.as_bytes());
        section.map_or(&[], |(_, body)| body)
    }

    /// The same with some bytes of one section replaced.
    #[must_use]
    pub fn with(&self, letters: &str, at: usize, bytes: &[u8]) -> Container {
        let mut changed = self.clone();
        for (found, body) in &mut changed.sections {
            if found == letters.as_bytes() {
                body[at..at + bytes.len()].copy_from_slice(bytes);
            }
        }
        changed
    }
}

/// Makes every CRC-32 of a file right: those of the sections as its table describes them, the
/// table's and the header's. What the table puts outside the file is left alone.
pub fn seal(file: &mut [u8]) {
    let count = word(file, 12, 4).unwrap_or(0) as usize;
    for at in (0..count).map(|index| HEADER + ENTRY * index) {
        let place = word(file, at + 8, 8).zip(word(file, at + 16, 8));
        let body = place.and_then(|(offset, length)| {
            file.get(
                usize::try_from(offset).ok()?..usize::try_from(offset.checked_add(length)?).ok()?,
            )
        });
        if let Some(crc) = body.map(crc32fast::hash) {
            file[at + 4..at + 8].copy_from_slice(&crc.to_le_bytes());
        }
    }
    if let Some(crc) = file
        .get(HEADER..HEADER + ENTRY * count)
        .map(crc32fast::hash)
    {
        file[24..28].copy_from_slice(&crc.to_le_bytes());
    }
    let crc = crc32fast::hash(&file[..HEADER - 4]);
    file[HEADER - 4..HEADER].copy_from_slice(&crc.to_le_bytes());
}

/// A little-endian number of `bytes` bytes.
fn word(file: &[u8], at: usize, bytes: usize) -> Option<u64> {
    let bytes = file.get(at..at.checked_add(bytes)?)?;
    Some(
        bytes
            .iter()
            .rev()
            .fold(0, |word, &byte| word << 8 | u64::from(byte)),
    )
}
