//! Shape: the sizes of a compressed texture set, and how its grids are sampled.

use crate::embed::{WAVES_PER_OCTAVE, Wave};
use crate::latent::LatentFormat;
use crate::position::{AddressMode, CornerSnap};
use crate::pyramid::Pyramid;

/// How a channel leaves the unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum OutputFormat {
    /// 0..=255, real = code / 255.
    Unorm8,
    /// 0..=65535, real = code / 65535.
    Unorm16,
    /// −127..=127, real = code / 127.
    Snorm8,
    /// The bits of an IEEE 754 binary16 number, 0..=65535; finite.
    Float16,
}

impl OutputFormat {
    /// Every format, in the order of its code in a file.
    pub const ALL: [OutputFormat; 4] = [
        OutputFormat::Unorm8,
        OutputFormat::Unorm16,
        OutputFormat::Snorm8,
        OutputFormat::Float16,
    ];

    /// The name in tables, assembly and JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            OutputFormat::Unorm8 => "unorm8",
            OutputFormat::Unorm16 => "unorm16",
            OutputFormat::Snorm8 => "snorm8",
            OutputFormat::Float16 => "float16",
        }
    }

    /// The smallest and the largest code.
    #[must_use]
    pub const fn range(self) -> (i32, i32) {
        match self {
            OutputFormat::Unorm8 => (0, 255),
            OutputFormat::Unorm16 | OutputFormat::Float16 => (0, 65_535),
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

/// What a grid gives the synthesizer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Sampling {
    /// The four corners one after the other; the synthesizer learns to interpolate them.
    Corners,
    /// One latent a channel, interpolated among the four corners.
    Interpolated,
}

impl Sampling {
    /// Every choice, in the order of its code in a file.
    pub const ALL: [Sampling; 2] = [Sampling::Corners, Sampling::Interpolated];

    /// The name in tables and JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Sampling::Corners => "corners",
            Sampling::Interpolated => "interpolated",
        }
    }

    /// The code in a file.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// The choice with this code, if there is one.
    #[must_use]
    pub fn from_code(code: u8) -> Option<Sampling> {
        Sampling::ALL.get(usize::from(code)).copied()
    }
}

/// What the lanes of a vector register hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum LaneFormat {
    /// Signed integers of this many bits, 4..=16, about a zero point.
    Integer {
        /// Bits of a value.
        bits: u8,
        /// The value that stands for the real zero.
        zero_point: i16,
    },
    /// The bits of IEEE 754 binary16 numbers.
    Half,
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
    /// See [`Sampling`].
    pub sampling: Sampling,
}

impl GridShape {
    /// Inputs that the grid gives.
    #[must_use]
    pub const fn input_count(self) -> u16 {
        match self.sampling {
            Sampling::Corners => 4 * self.channels,
            Sampling::Interpolated => self.channels,
        }
    }

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
    /// The form of the waves.
    pub wave: Wave,
    /// Zeros after the level.
    pub padding: u8,
    /// Bits of an input, 4..=16: real = value / 2^(bits − 1).
    pub input_bits: u8,
    /// See [`CornerSnap`].
    pub snap: CornerSnap,
    /// See [`AddressMode`]; for both axes and grids.
    pub address_mode: AddressMode,
    /// Which level of the grids serves a mip; see [`Pyramid`].
    pub pyramid: Pyramid,
    /// Grid 0 and grid 1; in CNTC the corners of grid 0 are concatenated and grid 1 is interpolated.
    pub grids: [GridShape; 2],
    /// One output format for each channel.
    pub outputs: Vec<OutputFormat>,
}

impl Shape {
    /// The shape of a whole mip chain whose grids have one level and repeat: three octaves of
    /// triangle waves, no padding, inputs of 8 bits, the first corner at its cell.
    #[must_use]
    pub fn whole_chain(
        width: u32,
        height: u32,
        grids: [GridShape; 2],
        outputs: Vec<OutputFormat>,
    ) -> Shape {
        Shape {
            width,
            height,
            mip_count: Shape::max_mip_count(width, height),
            octaves: 3,
            wave: Wave::Triangle,
            padding: 0,
            input_bits: 8,
            snap: CornerSnap::Cell,
            address_mode: AddressMode::Wrap,
            pyramid: Pyramid::SINGLE,
            grids,
            outputs,
        }
    }

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

    /// Cells of level 0 of a grid along x and y.
    #[must_use]
    pub const fn grid_size(&self, grid: usize) -> (u32, u32) {
        self.level_size(grid, 0)
    }

    /// Levels of each grid: as many as the mips need.
    #[must_use]
    pub const fn level_count(&self) -> u8 {
        self.pyramid.level_of(self.mip_count.saturating_sub(1)) + 1
    }

    /// Cells of a level of a grid along x and y: the texels of mip 0 over the reduction of grid and
    /// level, rounded up.
    #[must_use]
    pub const fn level_size(&self, grid: usize, level: u8) -> (u32, u32) {
        let log2 = self.grids[grid]
            .scale_log2
            .saturating_add(self.pyramid.reduction_log2(level));
        // A side is below 2^32.
        let log2 = if log2 > 31 { 31 } else { log2 };
        (
            self.width.div_ceil(1 << log2),
            self.height.div_ceil(1 << log2),
        )
    }

    /// Latents of a level of a grid.
    #[must_use]
    pub const fn level_latents(&self, grid: usize, level: u8) -> u64 {
        let (w, h) = self.level_size(grid, level);
        w as u64 * h as u64 * self.grids[grid].channels as u64
    }

    /// Latents of a grid before those of a level: levels follow each other, level 0 first.
    #[must_use]
    pub fn level_base(&self, grid: usize, level: u8) -> u64 {
        (0..level)
            .map(|level| self.level_latents(grid, level))
            .sum()
    }

    /// Latents of all levels of a grid.
    #[must_use]
    pub fn grid_latents(&self, grid: usize) -> u64 {
        self.level_base(grid, self.level_count())
    }

    /// Inputs of the synthesizer: those of both grids, the waves, the level, the padding.
    #[must_use]
    pub const fn input_count(&self) -> u32 {
        self.grids[0].input_count() as u32
            + self.grids[1].input_count() as u32
            + self.wave_count() as u32
            + 1
            + self.padding as u32
    }

    /// What the register of the inputs holds.
    #[must_use]
    pub const fn input_format(&self) -> LaneFormat {
        LaneFormat::Integer {
            bits: self.input_bits,
            zero_point: 0,
        }
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
