//! Identity: which configuration a result was made with.

use super::Unit;
use sha2::{Digest, Sha256};

impl Unit {
    /// The first six bytes of the SHA-256 of the effective configuration, in hexadecimal.
    ///
    /// What is hashed is a line `field=value` for every field, sorted by name, so that neither the
    /// order of a file or of the table, nor a name, a reason or a base is part of it. A unit that
    /// has one field more than another version's has another hash.
    #[must_use]
    pub fn hash(&self) -> String {
        let mut lines: Vec<String> = self
            .fields()
            .into_iter()
            .map(|(field, value)| format!("{}={value}\n", field.name))
            .collect();
        lines.sort_unstable();
        hexadecimal(&lines.concat())
    }

    /// Name and hash, `desktop@0123456789ab`: what every result prints.
    #[must_use]
    pub fn identity(&self) -> String {
        format!("{}@{}", self.name(), self.hash())
    }
}

/// The first six bytes of the SHA-256 of a text.
pub(in crate::time) fn hexadecimal(text: &str) -> String {
    let digest = Sha256::digest(text.as_bytes());
    digest[..6]
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect()
}
