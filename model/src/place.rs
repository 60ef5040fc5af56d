//! Place: where a decode happens, at a texel's centre or anywhere else.

use crate::request::Request;
use ntmu_isa::position::COORDINATE_LOG2;
use ntmu_isa::shape::Shape;
use std::fmt;

/// One place of one mip of an asset's chain, and a level of detail, known to be decodable.
///
/// Coordinates count 1/2^`bits` texels of the mip from the edge of texel 0: the centre of a texel is
/// `(2·texel + 1)·2^(bits − 1)`. They may lie before the mip or beyond it; the address mode of the
/// grids says what is there. The level of detail is what the synthesizer is told; it lies within the
/// chain and need not be the mip's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Place {
    x: i64,
    y: i64,
    bits: u8,
    mip: u8,
    lod: u32,
    lod_bits: u8,
}

/// Fractional bits of a coordinate: a texel's centre needs one.
pub const COORDINATE_BITS: (u8, u8) = (1, 12);

/// Fractional bits of a level of detail.
pub const LOD_BITS: (u8, u8) = (0, 8);

/// A place that cannot be decoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PlaceError {
    /// The chain is shorter.
    Mip {
        /// The mip asked for.
        found: u8,
        /// Mips in the chain.
        mip_count: u8,
    },
    /// A number of fractional bits that no place has.
    Bits {
        /// `bits` or `lod_bits`.
        field: &'static str,
        /// The number asked for.
        found: u8,
        /// The smallest and the largest.
        allowed: (u8, u8),
    },
    /// A coordinate too far away: more than 2^16 texels.
    Coordinate {
        /// The coordinate asked for.
        found: i64,
        /// The largest magnitude, in the same unit.
        limit: i64,
    },
    /// The level of detail is beyond the last mip.
    Lod {
        /// The level asked for, in 1/2^`lod_bits`.
        found: u32,
        /// The largest, in the same unit.
        last: u32,
    },
}

impl fmt::Display for PlaceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            PlaceError::Mip { found, mip_count } => {
                write!(f, "mip {found}: the chain has mips 0..={}", mip_count - 1)
            }
            PlaceError::Bits {
                field,
                found,
                allowed: (low, high),
            } => write!(f, "place.{field}: found {found}; allowed: {low}..={high}"),
            PlaceError::Coordinate { found, limit } => write!(
                f,
                "place.coordinate: found {found}; allowed: {}..={limit}",
                -limit
            ),
            PlaceError::Lod { found, last } => {
                write!(f, "place.lod: found {found}; allowed: 0..={last}")
            }
        }
    }
}

impl std::error::Error for PlaceError {}

impl Place {
    /// The place at `coordinates` (x, y) of a mip, in 1/2^`bits` texels, with the level of detail
    /// `lod` in 1/2^`lod_bits` mips.
    ///
    /// # Errors
    /// When the mip does not exist, a coordinate is more than 2^16 texels away, the level of detail
    /// is beyond the last mip, or a number of bits is outside [`COORDINATE_BITS`] or [`LOD_BITS`].
    pub fn new(
        shape: &Shape,
        coordinates: [i64; 2],
        bits: u8,
        mip: u8,
        lod: u32,
        lod_bits: u8,
    ) -> Result<Place, PlaceError> {
        let mip_count = shape.mip_count;
        if mip >= mip_count {
            return Err(PlaceError::Mip {
                found: mip,
                mip_count,
            });
        }
        for (field, found, allowed) in [
            ("bits", bits, COORDINATE_BITS),
            ("lod_bits", lod_bits, LOD_BITS),
        ] {
            if found < allowed.0 || found > allowed.1 {
                return Err(PlaceError::Bits {
                    field,
                    found,
                    allowed,
                });
            }
        }
        let limit = 1_i64 << (COORDINATE_LOG2 + bits);
        for found in coordinates {
            if !(-limit..=limit).contains(&found) {
                return Err(PlaceError::Coordinate { found, limit });
            }
        }
        let last = u32::from(mip_count - 1) << lod_bits;
        if lod > last {
            return Err(PlaceError::Lod { found: lod, last });
        }
        let [x, y] = coordinates;
        Ok(Place {
            x,
            y,
            bits,
            mip,
            lod,
            lod_bits,
        })
    }

    /// A place that the caller knows to lie within its mip, with a level of detail within the chain.
    pub(crate) const fn within(
        [x, y]: [i64; 2],
        bits: u8,
        mip: u8,
        lod: u32,
        lod_bits: u8,
    ) -> Place {
        Place {
            x,
            y,
            bits,
            mip,
            lod,
            lod_bits,
        }
    }

    /// The centre of a texel, at the level of its mip.
    #[must_use]
    pub fn of(request: Request) -> Place {
        let centre = |texel| 2 * i64::from(texel) + 1;
        Place {
            x: centre(request.x()),
            y: centre(request.y()),
            bits: 1,
            mip: request.mip(),
            lod: u32::from(request.mip()),
            lod_bits: 0,
        }
    }

    /// The texel whose centre and level this is, if it is one, of the mip or around it.
    pub(crate) fn texel(self) -> Option<Request> {
        let centre = 1_i64 << (self.bits - 1);
        let texel = |coordinate: i64| {
            let is_centre = coordinate & ((1 << self.bits) - 1) == centre;
            u32::try_from(coordinate >> self.bits)
                .ok()
                .filter(|_| is_centre)
        };
        let is_level = self.lod == u32::from(self.mip) << self.lod_bits;
        let (x, y) = (texel(self.x)?, texel(self.y)?);
        is_level.then_some(Request::within(x, y, self.mip))
    }

    /// From the left edge of texel 0, in 1/2^[`Place::bits`] texels.
    #[must_use]
    pub const fn x(self) -> i64 {
        self.x
    }

    /// From the upper edge of texel 0, in 1/2^[`Place::bits`] texels.
    #[must_use]
    pub const fn y(self) -> i64 {
        self.y
    }

    /// Fractional bits of the coordinates.
    #[must_use]
    pub const fn bits(self) -> u8 {
        self.bits
    }

    /// The mip that the coordinates are of.
    #[must_use]
    pub const fn mip(self) -> u8 {
        self.mip
    }

    /// The level of detail, in 1/2^[`Place::lod_bits`] mips.
    #[must_use]
    pub const fn lod(self) -> u32 {
        self.lod
    }

    /// Fractional bits of the level of detail.
    #[must_use]
    pub const fn lod_bits(self) -> u8 {
        self.lod_bits
    }
}
