//! Identity: what a set is, and what a point is, as hashes of their content.

use super::codec::Codec;
use crate::texture_set::TextureSet;
use serde::Serialize;
use sha2::{Digest, Sha256};

/// Raised when a change makes points of a codec come out otherwise that their configuration does not
/// tell, as another default of training does.
fn evaluation(codec: &Codec) -> u32 {
    match codec {
        Codec::Neural(neural) if neural.sets_weight_bits() => 6,
        Codec::Neural(_) => 5,
        Codec::Astc { .. } | Codec::Bc { .. } => 1,
    }
}

/// Hexadecimal digits of an identity: 64 bits.
const DIGITS: usize = 16;

/// A set's fingerprint: SHA-256 over its maps and the texels of mip 0, from which the rest follows.
/// Names of files and folders do not enter.
#[must_use]
pub fn fingerprint(set: &TextureSet) -> String {
    let mut hash = Sha256::new();
    hash.update(set.width.to_le_bytes());
    hash.update(set.height.to_le_bytes());
    for map in &set.maps {
        let depth = map.bit_depth;
        let name = (map.name.len() as u64).to_le_bytes();
        hash.update(name);
        hash.update(map.name.as_bytes());
        hash.update([map.channel_count as u8, depth]);
        hash.update(format!("{:?};", map.encoding).as_bytes());
    }
    if let Some(mip0) = set.texels.first() {
        let mut bytes = Vec::new();
        for plane in mip0.outer_iter() {
            bytes.clear();
            bytes.extend(plane.iter().flat_map(|value| value.to_le_bytes()));
            hash.update(&bytes);
        }
    }
    digits(&hash.finalize())
}

/// A point's identity: what is coded, how, and by which version of this program. Versions of outside
/// encoders are recorded in the result; they do not enter, so that a machine without the encoder
/// names the same points.
#[must_use]
pub fn identity(fingerprint: &str, codec: &Codec) -> String {
    let content = Content {
        evaluation: evaluation(codec),
        ntmu: env!("CARGO_PKG_VERSION"),
        set: fingerprint,
        codec,
    };
    let mut hash = Hashing(Sha256::new());
    // Neither the codec's fields nor the hash can fail to be written.
    let _ = serde_json::to_writer(&mut hash, &content);
    digits(&hash.0.finalize())
}

/// What an identity is of. A struct, because its fields are written in the order in which they
/// stand here, whatever features the JSON crate is built with.
#[derive(Serialize)]
struct Content<'a> {
    evaluation: u32,
    ntmu: &'static str,
    set: &'a str,
    codec: &'a Codec,
}

struct Hashing(Sha256);

impl std::io::Write for Hashing {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.0.update(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

fn digits(hash: &[u8]) -> String {
    let bytes = hash.iter().take(DIGITS / 2);
    bytes.map(|byte| format!("{byte:02x}")).collect()
}
