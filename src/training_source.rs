//! Training source: a texture set as the trainer takes it.

use crate::texture_set::TextureSet;
use ntmu_isa::asset::Map;
use ntmu_isa::shape::OutputFormat;
use ntmu_trainer::Source;

/// A texture set as the trainer takes it.
#[must_use]
pub fn training_source(set: &TextureSet) -> Source {
    let mut maps: Vec<Map> = Vec::new();
    let mut outputs = Vec::new();
    for map in &set.maps {
        let name = unused(&plain_name(&map.name), &maps);
        // A map stored at more than 8 bits leaves the unit at 16.
        let format = if map.bit_depth == 8 {
            OutputFormat::Unorm8
        } else {
            OutputFormat::Unorm16
        };
        outputs.extend(std::iter::repeat_n(format, map.channel_count));
        maps.push(Map {
            name,
            first_channel: map.first_channel as u16,
            channel_count: map.channel_count as u16,
            encoding: map.encoding,
            bit_depth: map.bit_depth,
        });
    }
    Source {
        name: set.name.clone(),
        mips: set.texels.clone(),
        outputs,
        maps,
        mask: None,
    }
}

/// A map's name as the format allows it: it becomes a file name.
fn plain_name(name: &str) -> String {
    let plain = |c: char| {
        if c.is_ascii_alphanumeric() || c == '_' || c == '-' {
            c
        } else {
            '_'
        }
    };
    let name: String = name.chars().map(plain).take(60).collect();
    if name.is_empty() {
        "map".to_owned()
    } else {
        name
    }
}

/// The name, with a number where another map has it.
fn unused(name: &str, maps: &[Map]) -> String {
    let is_free = |candidate: &str| maps.iter().all(|map| map.name != candidate);
    if is_free(name) {
        return name.to_owned();
    }
    let numbered = (2..)
        .map(|number| format!("{name}_{number}"))
        .find(|n| is_free(n));
    numbered.unwrap_or_else(|| name.to_owned())
}
