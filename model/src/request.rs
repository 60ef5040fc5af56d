//! Request: which texel of which mip.

use ntmu_isa::shape::Shape;

/// One texel of one mip of an asset's chain, known to exist.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Request {
    x: u32,
    y: u32,
    mip: u8,
}

/// A request for a texel that does not exist.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RequestError {
    /// The chain is shorter.
    Mip {
        /// The mip asked for.
        found: u8,
        /// Mips in the chain.
        mip_count: u8,
    },
    /// The mip is smaller.
    Texel {
        /// The texel asked for.
        found: (u32, u32),
        /// The mip asked for.
        mip: u8,
        /// The mip's size.
        size: (u32, u32),
    },
}

impl std::fmt::Display for RequestError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            RequestError::Mip { found, mip_count } => {
                write!(f, "mip {found}: the chain has mips 0..={}", mip_count - 1)
            }
            RequestError::Texel {
                found: (x, y),
                mip,
                size: (w, h),
            } => write!(
                f,
                "texel ({x}, {y}): mip {mip} has x 0..={} and y 0..={}",
                w - 1,
                h - 1
            ),
        }
    }
}

impl std::error::Error for RequestError {}

impl Request {
    /// The request, if the chain of `shape` has such a texel.
    ///
    /// # Errors
    /// When the mip or the texel does not exist.
    pub fn new(shape: &Shape, x: u32, y: u32, mip: u8) -> Result<Request, RequestError> {
        if mip >= shape.mip_count {
            return Err(RequestError::Mip {
                found: mip,
                mip_count: shape.mip_count,
            });
        }
        let size = shape.mip_size(mip);
        if x >= size.0 || y >= size.1 {
            return Err(RequestError::Texel {
                found: (x, y),
                mip,
                size,
            });
        }
        Ok(Request { x, y, mip })
    }

    /// Every texel of a mip, texel block (4×4) by texel block, rows inside a block, blocks in rows.
    ///
    /// That is the order in which a rasteriser with 4×4 tiles asks.
    pub fn blocks(shape: &Shape, mip: u8) -> impl Iterator<Item = Request> + use<> {
        let (width, height) = shape.mip_size(mip);
        (0..height.div_ceil(BLOCK)).flat_map(move |by| {
            (0..width.div_ceil(BLOCK)).flat_map(move |bx| {
                let rows = by * BLOCK..((by + 1) * BLOCK).min(height);
                rows.flat_map(move |y| {
                    let columns = bx * BLOCK..((bx + 1) * BLOCK).min(width);
                    columns.map(move |x| Request { x, y, mip })
                })
            })
        })
    }

    /// A request that the caller knows to exist.
    pub(crate) const fn within(x: u32, y: u32, mip: u8) -> Request {
        Request { x, y, mip }
    }

    /// Texel of the mip along x.
    #[must_use]
    pub const fn x(self) -> u32 {
        self.x
    }

    /// Texel of the mip along y.
    #[must_use]
    pub const fn y(self) -> u32 {
        self.y
    }

    /// The mip.
    #[must_use]
    pub const fn mip(self) -> u8 {
        self.mip
    }
}

/// Texels along the side of a texel block.
pub const BLOCK: u32 = 4;
