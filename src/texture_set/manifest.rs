//! Manifests: a TOML file that says which maps a set has, for names no convention covers.
//!
//! ```toml
//! name = "old wall"
//!
//! [[map]]
//! name = "color"
//! file = "scan_a.png"       # relative to the manifest
//! channels = "rgb"          # optional: components in map order; without it, all colour
//! encoding = "srgb"         # optional: srgb, linear, normal-gl, normal-dx
//! ```
//!
//! Maps keep the order of the manifest. Unknown keys are errors.

use std::path::Path;

use serde::Deserialize;

use super::naming::{self, Component, Part};
use super::{Encoding, TextureSetError};

/// File name under which a directory may carry its manifest.
pub(super) const FILE_NAME: &str = "texture_set.toml";

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawManifest {
    name: String,
    map: Vec<RawMap>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMap {
    name: String,
    file: String,
    channels: Option<String>,
    encoding: Option<RawEncoding>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum RawEncoding {
    Srgb,
    Linear,
    NormalGl,
    NormalDx,
}

/// A checked manifest: the set's name, and each map with its file, in the order written.
#[derive(Debug)]
pub(super) struct Manifest {
    pub(super) name: String,
    pub(super) maps: Vec<(String, Part)>,
}

/// Checks the text of the manifest at `path`, which is used in errors only.
pub(super) fn parse(path: &Path, text: &str) -> Result<Manifest, TextureSetError> {
    let refuse = |found: String, allowed: &'static str| TextureSetError::Manifest {
        path: path.to_owned(),
        found,
        allowed,
    };
    let raw: RawManifest = toml::from_str(text).map_err(|error| {
        refuse(
            error.to_string().trim_end().to_owned(),
            "`name`, and for each `[[map]]`: name, file, channels, encoding",
        )
    })?;
    if raw.name.trim().is_empty() {
        return Err(refuse("an empty set name".to_owned(), "a name"));
    }
    if raw.map.is_empty() {
        return Err(refuse("no map".to_owned(), "at least one `[[map]]`"));
    }
    let mut maps = Vec::with_capacity(raw.map.len());
    for map in raw.map {
        if map.name.is_empty() || !map.name.bytes().all(name_byte) {
            return Err(refuse(
                format!("map name {:?}", map.name),
                "letters, digits, `_` and `-`, because outputs are named after maps",
            ));
        }
        if map.file.is_empty() {
            return Err(refuse(
                format!("map `{}` with an empty file name", map.name),
                "a file",
            ));
        }
        let components = match &map.channels {
            None => None,
            Some(letters) => Some(components(letters).ok_or_else(|| {
                refuse(
                    format!("channels {letters:?} of map `{}`", map.name),
                    "1 to 4 of the letters r, g, b, a, each at most once",
                )
            })?),
        };
        let encoding = match map.encoding {
            None => naming::default_encoding(&map.name),
            Some(RawEncoding::Srgb) => Encoding::Srgb,
            Some(RawEncoding::Linear) => Encoding::Linear,
            Some(RawEncoding::NormalGl) => Encoding::NormalGl,
            Some(RawEncoding::NormalDx) => Encoding::NormalDx,
        };
        maps.push((
            map.file,
            Part {
                map: map.name,
                encoding,
                components,
            },
        ));
    }
    Ok(Manifest {
        name: raw.name,
        maps,
    })
}

fn name_byte(byte: u8) -> bool {
    byte.is_ascii_alphanumeric() || byte == b'_' || byte == b'-'
}

fn components(letters: &str) -> Option<Vec<Component>> {
    let mut components = Vec::new();
    for letter in letters.chars() {
        let component = match letter {
            'r' => Component::R,
            'g' => Component::G,
            'b' => Component::B,
            'a' => Component::A,
            _ => return None,
        };
        if components.contains(&component) {
            return None;
        }
        components.push(component);
    }
    (!components.is_empty()).then_some(components)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(text: &str) -> String {
        parse(Path::new("set.toml"), text).unwrap_err().to_string()
    }

    #[test]
    fn a_full_entry_is_read() {
        let text =
            "name='w'\n[[map]]\nname='normal'\nfile='n.png'\nchannels='bg'\nencoding='normal-dx'";
        let manifest = parse(Path::new("set.toml"), text).unwrap();
        assert_eq!(manifest.name, "w");
        let part = Part {
            map: "normal".to_owned(),
            encoding: Encoding::NormalDx,
            components: Some(vec![Component::B, Component::G]),
        };
        assert_eq!(manifest.maps, [("n.png".to_owned(), part)]);
    }

    #[test]
    fn what_is_left_out_has_a_default() {
        let text = "name='w'\n[[map]]\nname='color'\nfile='c.png'";
        let manifest = parse(Path::new("set.toml"), text).unwrap();
        assert_eq!(manifest.maps[0].1.encoding, Encoding::Srgb);
        assert_eq!(manifest.maps[0].1.components, None);
    }

    #[test]
    fn unknown_keys_are_refused() {
        let text = "name='w'\n[[map]]\nname='color'\nfile='c.png'\ncolour='x'";
        assert!(message(text).contains("unknown field `colour`"));
    }

    #[test]
    fn repeated_or_unknown_channel_letters_are_refused() {
        for letters in ["", "rr", "x", "rgbar"] {
            let text = format!("name='w'\n[[map]]\nname='c'\nfile='c.png'\nchannels='{letters}'");
            assert!(message(&text).contains("each at most once"), "{letters}");
        }
    }

    #[test]
    fn map_names_that_cannot_name_a_file_are_refused() {
        assert!(message("name='w'\n[[map]]\nname='../c'\nfile='c.png'").contains("\"../c\""));
    }
}
