//! Reading numbers off a byte slice, with an error that says where it ended.

use crate::error::AssetError;

/// A place in a section.
pub(super) struct Cursor<'a> {
    section: &'static str,
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Cursor<'a> {
    pub(super) fn new(section: &'static str, bytes: &'a [u8]) -> Cursor<'a> {
        Cursor {
            section,
            bytes,
            at: 0,
        }
    }

    /// The next `count` bytes.
    pub(super) fn take(&mut self, count: usize) -> Result<&'a [u8], AssetError> {
        let rest = &self.bytes[self.at..];
        if count > rest.len() {
            return Err(AssetError::Truncated {
                section: self.section,
                needed: self.at as u64 + count as u64,
                found: self.bytes.len() as u64,
            });
        }
        self.at += count;
        Ok(&rest[..count])
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], AssetError> {
        let mut array = [0; N];
        array.copy_from_slice(self.take(N)?);
        Ok(array)
    }

    pub(super) fn u8(&mut self) -> Result<u8, AssetError> {
        self.array().map(u8::from_le_bytes)
    }

    pub(super) fn u16(&mut self) -> Result<u16, AssetError> {
        self.array().map(u16::from_le_bytes)
    }

    pub(super) fn i16(&mut self) -> Result<i16, AssetError> {
        self.array().map(i16::from_le_bytes)
    }

    pub(super) fn u32(&mut self) -> Result<u32, AssetError> {
        self.array().map(u32::from_le_bytes)
    }

    pub(super) fn i32(&mut self) -> Result<i32, AssetError> {
        self.array().map(i32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Result<u64, AssetError> {
        self.array().map(u64::from_le_bytes)
    }

    /// The section has been read to its end.
    pub(super) fn finish(&self) -> Result<(), AssetError> {
        if self.at == self.bytes.len() {
            Ok(())
        } else {
            let field = format!("{}.bytes", self.section);
            Err(AssetError::field(field, self.bytes.len(), self.at))
        }
    }
}
