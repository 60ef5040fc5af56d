//! Shape: the sizes of a compressed texture set, and how its grids are sampled.

use crate::embed::WAVES_PER_OCTAVE;
use crate::latent::LatentFormat;
use crate::position::{AddressMode, CornerSnap};

/// How a channel leaves the unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum OutputFormat {
    /// 0..=255, real = code / 255.
    Unorm8,
    /// 0..=65535, real = code / 65535.
    Unorm16,
    /// −127..=127, real = code / 127.
    Snorm8,
}

impl OutputFormat {
    /// Every format, in the order of its code in a file.
    pub const ALL: [OutputFormat; 3] = [
        OutputFormat::Unorm8,
        OutputFormat::Unorm16,
        OutputFormat::Snorm8,
    ];

    /// The name in tables, assembly and JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            OutputFormat::Unorm8 => "unorm8",
            OutputFormat::Unorm16 => "unorm16",
            OutputFormat::Snorm8 => "snorm8",
        }
    }

    /// The smallest and the largest code.
    #[must_use]
    pub const fn range(self) -> (i32, i32) {
        match self {
            OutputFormat::Unorm8 => (0, 255),
            OutputFormat::Unorm16 => (0, 65_535),
            OutputFormat::Snorm8 => (-127, 127),
        }
    }

    /// The code in a file.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// The format with this code, if there is one.
    #[must_use]
    pub fn from_code(code: u8) -> Option<OutputFormat> {
        OutputFormat::ALL.get(usize::from(code)).copied()
    }
}

/// The sizes of one grid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct GridShape {
    /// Latents per cell.
    pub channels: u16,
    /// The width of a latent.
    pub format: LatentFormat,
    /// log2 of mip 0's resolution over the grid's: 3 for the paper's 1/8.
    pub scale_log2: u8,
}

impl GridShape {
    /// Cells along an axis of `texels` texels: the quotient, rounded up.
    #[must_use]
    pub const fn cells(self, texels: u32) -> u32 {
        texels.div_ceil(1 << self.scale_log2)
    }
}

/// The sizes of a compressed texture set, and how its grids are sampled.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Texels of mip 0 along x.
    pub width: u32,
    /// Texels of mip 0 along y.
    pub height: u32,
    /// Mips in the chain, mip 0 included.
    pub mip_count: u8,
    /// Octaves of the waves.
    pub octaves: u8,
    /// See [`CornerSnap`].
    pub snap: CornerSnap,
    /// See [`AddressMode`]; for both axes and grids.
    pub address_mode: AddressMode,
    /// Grid 0, whose corners are concatenated, and grid 1, which is interpolated.
    pub grids: [GridShape; 2],
    /// One output format for each channel.
    pub outputs: Vec<OutputFormat>,
}

impl Shape {
    /// Channels of the texture set.
    #[must_use]
    pub fn channel_count(&self) -> u16 {
        self.outputs.len() as u16
    }

    /// Texels of a mip along x and y: halved and rounded down at every mip, at least 1.
    #[must_use]
    pub const fn mip_size(&self, mip: u8) -> (u32, u32) {
        let (w, h) = (self.width >> mip, self.height >> mip);
        (if w == 0 { 1 } else { w }, if h == 0 { 1 } else { h })
    }

    /// Cells of a grid along x and y.
    #[must_use]
    pub const fn grid_size(&self, grid: usize) -> (u32, u32) {
        (
            self.grids[grid].cells(self.width),
            self.grids[grid].cells(self.height),
        )
    }

    /// Latents of a grid.
    #[must_use]
    pub const fn grid_latents(&self, grid: usize) -> u64 {
        let (w, h) = self.grid_size(grid);
        w as u64 * h as u64 * self.grids[grid].channels as u64
    }

    /// Inputs of the synthesizer: 4·c0 + c1 + waves + the level.
    #[must_use]
    pub const fn input_count(&self) -> u32 {
        4 * self.grids[0].channels as u32
            + self.grids[1].channels as u32
            + self.wave_count() as u32
            + 1
    }

    /// Waves among the inputs.
    #[must_use]
    pub const fn wave_count(&self) -> u16 {
        self.octaves as u16 * WAVES_PER_OCTAVE
    }

    /// The longest possible chain for this size, down to 1×1.
    #[must_use]
    pub const fn max_mip_count(width: u32, height: u32) -> u8 {
        let longest = if width > height { width } else { height };
        (32 - longest.leading_zeros()) as u8
    }

    /// Every texel of every mip.
    #[must_use]
    pub fn texel_count(&self) -> u64 {
        (0..self.mip_count)
            .map(|mip| {
                let (w, h) = self.mip_size(mip);
                u64::from(w) * u64::from(h)
            })
            .sum()
    }
}
