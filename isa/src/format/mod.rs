//! Format: an [`Asset`] as bytes, the `.ntx` file.
//!
//! Everything is little endian. A file is a 64-byte header, a table of sections, and the sections,
//! each on a multiple of 8 bytes with zeros between. Every byte is either covered by a CRC-32 or
//! required to be zero, so that no damage goes unseen.
//!
//! ```text
//! header   0  magic  89 'N' 'T' 'X' 0d 0a 1a 0a
//!          8  u16 major, u16 minor
//!         12  u32 sections
//!         16  u64 bytes of the file
//!         24  u32 CRC-32 of the table
//!         28  zeros
//!         60  u32 CRC-32 of bytes 0..60
//! table   64  per section: 4 letters, u32 CRC-32, u64 offset, u64 length, u64 zero
//! SHAP        sizes and sampling          PROF  profile
//! GRD0 GRD1   codes, B bits each, from the least significant bit of the first byte; levels,
//!             level 0 first, of rows of cells, of channels; the last byte is filled with zeros
//! WGTS        layers                      META  names and training record
//! ```
//!
//! **Promise.** A reader accepts every file of its major version that is not newer than itself.
//! Within a major version bits never change their meaning; a minor version only adds. A section
//! whose first letter is lower case may be skipped by whoever does not know it.
//!
//! | version | what it added | a file of the version before has |
//! |---|---|---|
//! | 2.0 | | |
//! | 2.1 | [the pyramid](crate::pyramid) in `SHAP`, and with it levels of the grids | a zero there: a single level |
//!
//! A file carries the smallest version that has what is in it: without a pyramid 2.0.

mod bits;
mod cursor;
mod layers;
mod sections;

use crate::asset::{Asset, Parts};
use crate::error::AssetError;
use crate::pyramid::Pyramid;
use cursor::Cursor;

/// The first eight bytes. As in PNG, they show a transfer that changed line ends or lost a bit.
pub const MAGIC: [u8; 8] = [0x89, b'N', b'T', b'X', 0x0d, 0x0a, 0x1a, 0x0a];
/// The newest major and minor version that this crate reads and writes.
pub const VERSION: (u16, u16) = (2, 1);
/// The version of a file without a pyramid.
const WITHOUT_PYRAMID: (u16, u16) = (2, 0);

const HEADER_BYTES: usize = 64;
const ENTRY_BYTES: usize = 32;
const ALIGNMENT: usize = 8;
/// More sections than any version has: bounds the table before it is read.
const MAX_SECTIONS: u32 = 64;
const KINDS: [&[u8; 4]; 6] = [b"SHAP", b"PROF", b"GRD0", b"GRD1", b"WGTS", b"META"];

impl Asset {
    /// The version of the asset's file: the smallest that has what is in it.
    #[must_use]
    pub fn version(&self) -> (u16, u16) {
        if self.shape.pyramid == Pyramid::SINGLE {
            WITHOUT_PYRAMID
        } else {
            VERSION
        }
    }

    /// The asset as an `.ntx` file. The same asset always gives the same bytes.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let bodies = [
            sections::write_shape(&self.shape),
            self.profile.to_bytes().to_vec(),
            bits::pack(
                self.grids[0].iter().copied(),
                self.shape.grids[0].format.bits(),
            ),
            bits::pack(
                self.grids[1].iter().copied(),
                self.shape.grids[1].format.bits(),
            ),
            layers::write_layers(&self.layers),
            sections::write_metadata(&self.metadata),
        ];
        let mut offset = HEADER_BYTES + ENTRY_BYTES * KINDS.len();
        let mut table = Vec::new();
        let mut data = Vec::new();
        for (kind, body) in KINDS.iter().zip(&bodies) {
            table.extend_from_slice(*kind);
            table.extend_from_slice(&crc32fast::hash(body).to_le_bytes());
            table.extend_from_slice(&(offset as u64).to_le_bytes());
            table.extend_from_slice(&(body.len() as u64).to_le_bytes());
            table.extend_from_slice(&[0; 8]);
            data.extend_from_slice(body);
            let padded = body.len().next_multiple_of(ALIGNMENT);
            data.resize(data.len() + padded - body.len(), 0);
            offset += padded;
        }
        let mut file = Vec::with_capacity(offset);
        file.extend_from_slice(&MAGIC);
        let (major, minor) = self.version();
        file.extend_from_slice(&major.to_le_bytes());
        file.extend_from_slice(&minor.to_le_bytes());
        file.extend_from_slice(&(KINDS.len() as u32).to_le_bytes());
        file.extend_from_slice(&(offset as u64).to_le_bytes());
        file.extend_from_slice(&crc32fast::hash(&table).to_le_bytes());
        file.resize(HEADER_BYTES - 4, 0);
        let header_crc = crc32fast::hash(&file);
        file.extend_from_slice(&header_crc.to_le_bytes());
        file.extend_from_slice(&table);
        file.extend_from_slice(&data);
        file
    }

    /// The asset in an `.ntx` file.
    ///
    /// Allocates no more than a small multiple of `bytes.len()`: every size is checked against the
    /// bytes that are there before anything is made of it.
    ///
    /// # Errors
    /// Any byte string that is not an asset: see [`AssetError`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Asset, AssetError> {
        let (version, bodies) = read_sections(bytes)?;
        let [shape, profile, grid0, grid1, weights, metadata] = bodies;
        let shape = sections::read_shape(shape)?;
        if version < VERSION && shape.pyramid != Pyramid::SINGLE {
            let (major, minor) = version;
            let allowed = format!("0 in a file of version {major}.{minor}");
            let code = shape.pyramid.code();
            return Err(AssetError::field("shape.pyramid", code, allowed));
        }
        crate::asset::check_shape(&shape)?;
        let grid = |index: usize, body: &[u8]| {
            let name = ["grid0", "grid1"][index];
            let format = shape.grids[index].format;
            bits::unpack(name, body, shape.grid_latents(index), format.bits())
        };
        let grids = [grid(0, grid0)?, grid(1, grid1)?];
        Asset::new(Parts {
            profile: sections::read_profile(profile)?,
            grids,
            layers: layers::read_layers(weights)?,
            metadata: sections::read_metadata(metadata)?,
            shape,
        })
    }
}

/// The bodies of the six sections, in the order of [`KINDS`].
type Bodies<'a> = [&'a [u8]; 6];

/// The version, and the bodies.
fn read_sections(bytes: &[u8]) -> Result<((u16, u16), Bodies<'_>), AssetError> {
    if bytes.len() < MAGIC.len() || bytes[..MAGIC.len()] != MAGIC {
        let found = bytes[..bytes.len().min(MAGIC.len())].to_vec();
        return Err(AssetError::Foreign {
            found,
            allowed: MAGIC,
        });
    }
    let mut header = Cursor::new("header", bytes);
    header.take(MAGIC.len())?;
    let version = (header.u16()?, header.u16()?);
    if version.0 != VERSION.0 || version.1 > VERSION.1 {
        return Err(AssetError::Version {
            found: version,
            allowed: VERSION,
        });
    }
    let section_count = header.u32()?;
    let file_bytes = header.u64()?;
    let table_crc = header.u32()?;
    let reserved = header.take(HEADER_BYTES - 4 - 28)?;
    let header_crc = header.u32()?;
    check_crc("header", header_crc, &bytes[..HEADER_BYTES - 4])?;
    if reserved.iter().any(|&b| b != 0) {
        return Err(AssetError::field("header.reserved", "a set bit", "zeros"));
    }
    if (bytes.len() as u64) < file_bytes {
        let found = bytes.len() as u64;
        return Err(AssetError::Truncated {
            section: "file",
            needed: file_bytes,
            found,
        });
    }
    if bytes.len() as u64 != file_bytes {
        let allowed = format!("{file_bytes}, as the header states");
        return Err(AssetError::field("file.bytes", bytes.len(), allowed));
    }
    if section_count > MAX_SECTIONS {
        let allowed = format!("at most {MAX_SECTIONS}");
        return Err(AssetError::field("header.sections", section_count, allowed));
    }
    let mut table = Cursor::new("table", &bytes[HEADER_BYTES..]);
    let entries = table.take(section_count as usize * ENTRY_BYTES)?;
    check_crc("table", table_crc, entries)?;
    Ok((version, collect_sections(bytes, entries)?))
}

fn collect_sections<'a>(bytes: &'a [u8], entries: &[u8]) -> Result<Bodies<'a>, AssetError> {
    let mut found: [Option<&[u8]>; 6] = [None; 6];
    let mut end = HEADER_BYTES + entries.len();
    for entry in entries.chunks_exact(ENTRY_BYTES) {
        let mut fields = Cursor::new("table", entry);
        let letters = fields.take(4)?;
        let section = String::from_utf8_lossy(letters).into_owned();
        let refuse = |found: String, allowed: String| AssetError::Table {
            section: section.clone(),
            found,
            allowed,
        };
        let crc = fields.u32()?;
        let (offset, length, reserved) = (fields.u64()?, fields.u64()?, fields.u64()?);
        let start = end.next_multiple_of(ALIGNMENT);
        if offset != start as u64 || reserved != 0 {
            let found = format!("offset {offset}, reserved {reserved}");
            return Err(refuse(found, format!("offset {start}, reserved 0")));
        }
        let room = bytes.len().saturating_sub(start) as u64;
        if length > room {
            return Err(refuse(format!("{length} bytes"), format!("at most {room}")));
        }
        // Both fit: `length` is at most what the slice holds past `start`.
        let stop = start + length as usize;
        if bytes[end..start].iter().any(|&b| b != 0) {
            return Err(refuse("a set bit in the padding".into(), "zeros".into()));
        }
        let body = &bytes[start..stop];
        check_crc(&section, crc, body)?;
        end = stop;
        match KINDS.iter().position(|kind| kind.as_slice() == letters) {
            Some(index) if found[index].is_none() => found[index] = Some(body),
            Some(_) => return Err(refuse("a second one".into(), "one".into())),
            None if letters[0].is_ascii_lowercase() => {}
            None => {
                let known = KINDS
                    .map(|k| String::from_utf8_lossy(k).into_owned())
                    .join(", ");
                return Err(refuse(
                    "an unknown section".into(),
                    format!("{known}, or lower case"),
                ));
            }
        }
    }
    if bytes.len() != end.next_multiple_of(ALIGNMENT) || bytes[end..].iter().any(|&b| b != 0) {
        let found = format!("{} bytes after the last section", bytes.len() - end);
        return Err(AssetError::field(
            "file.end",
            found,
            "zeros up to a multiple of 8",
        ));
    }
    let mut bodies = [&bytes[..0]; 6];
    for ((body, found), kind) in bodies.iter_mut().zip(found).zip(KINDS) {
        *body = found.ok_or_else(|| AssetError::Table {
            section: String::from_utf8_lossy(kind).into_owned(),
            found: "none".into(),
            allowed: "one".into(),
        })?;
    }
    Ok(bodies)
}

fn check_crc(section: &str, stated: u32, bytes: &[u8]) -> Result<(), AssetError> {
    let computed = crc32fast::hash(bytes);
    if stated == computed {
        Ok(())
    } else {
        Err(AssetError::Checksum {
            section: section.to_owned(),
            stated,
            computed,
        })
    }
}
