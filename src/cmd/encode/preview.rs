//! Preview: the maps as they would decode now, as images.

use ndarray::{Array3, Axis, Slice};
use ntmu::decoded::Decoded;
use ntmu::isa::Asset;
use ntmu::texture_set::{Depth, write_map};
use std::path::PathBuf;
use std::time::{Duration, Instant};

/// A folder of images, one for each map, each replaced whole.
pub(super) struct Preview {
    folder: PathBuf,
    every: Duration,
    /// Texels of the middle along each axis; all of them without it.
    side: Option<u32>,
    last: Instant,
}

impl Preview {
    pub(super) fn new(folder: PathBuf, seconds: f64, side: Option<u32>) -> Preview {
        Preview {
            folder,
            every: Duration::from_secs_f64(seconds),
            side,
            last: Instant::now(),
        }
    }

    /// Whether the last preview is old enough.
    pub(super) fn is_due(&self) -> bool {
        self.last.elapsed() >= self.every
    }

    /// Writes every map of mip 0 as `MAP.png`.
    pub(super) fn write(&mut self, asset: &Asset) -> anyhow::Result<()> {
        let decoded = Decoded::of_mip(asset, 0).reals(&asset.shape);
        for texels in &decoded {
            let texels = self.middle(texels);
            for map in &asset.metadata.maps {
                let first = usize::from(map.first_channel);
                let channels = first..first + usize::from(map.channel_count);
                let of_map = texels.slice_axis(Axis(0), Slice::from(channels));
                let path = self.folder.join(format!("{}.png", map.name));
                write_map(&path, &of_map, Depth::Eight)?;
            }
        }
        self.last = Instant::now();
        Ok(())
    }

    fn middle(&self, texels: &Array3<f32>) -> Array3<f32> {
        let Some(side) = self.side else {
            return texels.clone();
        };
        let mut middle = texels.view();
        for axis in [Axis(1), Axis(2)] {
            let all = middle.len_of(axis);
            let kept = all.min(side as usize);
            let first = (all - kept) / 2;
            middle.slice_axis_inplace(axis, Slice::from(first..first + kept));
        }
        middle.to_owned()
    }
}
