//! The built-in set as the trainer takes it.

use ntmu::brick_wall;
use ntmu::isa::asset::Map;
use ntmu::isa::shape::OutputFormat;
use ntmu::trainer::Source;

/// The brick wall at `size` × `size` texels.
pub(crate) fn brick_wall(size: u32) -> Source {
    let set = brick_wall::generate(size, 3);
    let maps = set.maps.iter().map(|map| Map {
        name: map.name.clone(),
        first_channel: map.first_channel as u16,
        channel_count: map.channel_count as u16,
        encoding: map.encoding,
        bit_depth: map.bit_depth,
    });
    let outputs = vec![OutputFormat::Unorm8; set.channel_count()];
    Source {
        name: set.name.clone(),
        maps: maps.collect(),
        outputs,
        mips: set.texels,
        mask: None,
    }
}
