//! Control: the same set as plain textures, on the same front end.
//!
//! A result about neural textures says little by itself. A control answers what the same demands cost
//! on the same queues, cache and memory where the set is stored as textures are stored today, and
//! what comes out of the cache is decoded by fixed-function hardware at one quad a cycle, with no
//! layers. What a neural set costs beyond its control is the price of its decode; what it costs less
//! is the gain of its smaller footprint.
//!
//! A decode of a place fetches the texel that the place lies in, once from every map of the set. It
//! does not filter: that is the sampler's, and a sample that filters asks for several places.
//!
//! Maps follow one another, each with its whole chain. A map and a mip begin at a multiple of
//! [`BASE_ALIGNMENT`], so that no line of a cache holds parts of two.

use crate::place::Place;
use crate::time::Work;
use crate::trace::{Addresses, Fetch};
use ntmu_isa::layout::BASE_ALIGNMENT;
use ntmu_isa::limits;
use ntmu_isa::position::AddressMode;
use ntmu_isa::shape::Shape;
use std::fmt;

/// The order of a mip's elements in memory: of the texels, or of the blocks where texels are stored
/// in blocks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Order {
    /// Row after row.
    Rows,
    /// Tiles of `side` × `side` elements, row after row of tiles, and row after row in a tile: the
    /// blocked representation of Hakura and Gupta (1997), who take 4 × 4 and 8 × 8 texels. A mip is
    /// padded to whole tiles.
    Blocked {
        /// A power of two, 2..=[`MAX_SIDE`].
        side: u32,
    },
    /// The same tiles with Morton order in a tile, x in the lower bit, so that every line of 4^n
    /// elements up to a tile is a square.
    Morton {
        /// A power of two, 2..=[`MAX_SIDE`].
        side: u32,
    },
}

/// The longest side of a tile, in elements.
pub const MAX_SIDE: u32 = 64;

impl Order {
    /// The side of a tile; 1 where there are none.
    const fn side(self) -> u32 {
        match self {
            Order::Rows => 1,
            Order::Blocked { side } | Order::Morton { side } => side,
        }
    }

    /// Where an element stands among those of a mip that is `columns` wide, a multiple of the side.
    fn index(self, x: u32, y: u32, columns: u32) -> u64 {
        let side = self.side();
        let (inner_x, inner_y) = (x % side, y % side);
        let inside = match self {
            Order::Rows => 0,
            Order::Blocked { side } => inner_y * side + inner_x,
            Order::Morton { .. } => (0..MAX_SIDE.ilog2())
                .map(|bit| {
                    (inner_x >> bit & 1) << (2 * bit) | (inner_y >> bit & 1) << (2 * bit + 1)
                })
                .sum(),
        };
        let tile = u64::from(y / side) * u64::from(columns / side) + u64::from(x / side);
        tile * u64::from(side * side) + u64::from(inside)
    }
}

/// What no control can be made of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ControlError {
    /// No texels along an axis, or too many.
    Size {
        /// `width` or `height`.
        field: &'static str,
        /// Texels of mip 0.
        found: u32,
        /// The most that there may be.
        limit: u32,
    },
    /// No mips, or more than down to one texel.
    Mips {
        /// Mips of the chain.
        found: u8,
        /// The most that there may be.
        limit: u8,
    },
    /// No maps, or more than a set has channels.
    Maps {
        /// The number asked for.
        found: u16,
        /// The most that there may be.
        limit: u16,
    },
    /// The side of a tile is no power of two, 1, or too long.
    Side {
        /// The side asked for, in elements.
        found: u32,
        /// The longest.
        limit: u32,
    },
}

impl fmt::Display for ControlError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            ControlError::Size {
                field,
                found,
                limit,
            } => write!(f, "control.{field}: found {found}; allowed: 1..={limit}"),
            ControlError::Mips { found, limit } => {
                write!(f, "control.mip_count: found {found}; allowed: 1..={limit}")
            }
            ControlError::Maps { found, limit } => {
                write!(f, "control.maps: found {found}; allowed: 1..={limit}")
            }
            ControlError::Side { found, limit } => write!(
                f,
                "control.side: found {found}; allowed: powers of two in 2..={limit}"
            ),
        }
    }
}

impl std::error::Error for ControlError {}

/// Multiply-adds of an address: row times pitch, and the base of the mip.
const ADDRESS_STEPS: u32 = 2;

/// One mip of a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Mip {
    /// Texels along x and y.
    size: (u32, u32),
    /// Elements along x, padded to whole tiles.
    columns: u32,
    /// The address of its first byte in the map.
    base: u64,
}

/// Maps of one size and their chains, stored in elements.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Maps {
    /// Texels along the side of an element.
    element_side: u32,
    element_bytes: u32,
    order: Order,
    address_mode: AddressMode,
    mips: Vec<Mip>,
    count: u16,
    /// Bytes of one map.
    map_bytes: u64,
}

impl Maps {
    /// `element_side` texels along the side of an element of `element_bytes`.
    fn new(
        shape: &Shape,
        count: u16,
        order: Order,
        (element_side, element_bytes): (u32, u32),
    ) -> Result<Maps, ControlError> {
        check(shape, count, order)?;
        let side = order.side();
        let elements = |texels: u32| texels.div_ceil(element_side).next_multiple_of(side);
        let mut map_bytes = 0_u64;
        let mut mip = |mip| {
            let size = shape.mip_size(mip);
            let (columns, rows) = (elements(size.0), elements(size.1));
            let base = map_bytes.next_multiple_of(BASE_ALIGNMENT);
            map_bytes = base + u64::from(columns) * u64::from(rows) * u64::from(element_bytes);
            Mip {
                size,
                columns,
                base,
            }
        };
        Ok(Maps {
            element_side,
            element_bytes,
            order,
            address_mode: shape.address_mode,
            mips: (0..shape.mip_count).map(&mut mip).collect(),
            count,
            map_bytes,
        })
    }

    fn map_base(&self, map: u16) -> u64 {
        u64::from(map) * self.map_bytes.next_multiple_of(BASE_ALIGNMENT)
    }

    fn bytes(&self) -> u64 {
        self.map_base(self.count - 1) + self.map_bytes
    }

    /// One address a map, by a row and a base, and nothing to multiply: a group is decoded in a
    /// cycle, and four channels of each map leave the unit.
    fn work(&self) -> Work {
        let count = u32::from(self.count);
        Work {
            positions: 1,
            address_steps: ADDRESS_STEPS * count,
            fetches: count,
            channels: 4 * count,
            ..Work::default()
        }
    }

    fn fetches(&self, place: &Place, fetches: &mut Vec<Fetch>) {
        let mip = &self.mips[usize::from(place.mip())];
        // A place is at most 2^16 texels away.
        let element = |coordinate: i64, size| {
            let texel = (coordinate >> place.bits()) as i32;
            self.address_mode.resolve(texel, size) / self.element_side
        };
        let (x, y) = (
            element(place.x(), mip.size.0),
            element(place.y(), mip.size.1),
        );
        let index = self.order.index(x, y, mip.columns);
        let address = mip.base + index * u64::from(self.element_bytes);
        fetches.extend((0..self.count).map(|map| Fetch {
            grid: 0,
            addresses: [self.map_base(map) + address; 4],
            cell_bytes: self.element_bytes,
            planes: 1,
            plane_bytes: 0,
        }));
    }
}

fn check(shape: &Shape, maps: u16, order: Order) -> Result<(), ControlError> {
    for (field, found) in [("width", shape.width), ("height", shape.height)] {
        let limit = limits::MAX_SIZE;
        if found < 1 || found > limit {
            return Err(ControlError::Size {
                field,
                found,
                limit,
            });
        }
    }
    let (found, limit) = (
        shape.mip_count,
        Shape::max_mip_count(shape.width, shape.height),
    );
    if found < 1 || found > limit {
        return Err(ControlError::Mips { found, limit });
    }
    let (found, limit) = (maps, limits::MAX_CHANNELS);
    if found < 1 || found > limit {
        return Err(ControlError::Maps { found, limit });
    }
    match order {
        Order::Rows => Ok(()),
        Order::Blocked { side } | Order::Morton { side } => {
            if side.is_power_of_two() && side > 1 && side <= MAX_SIDE {
                Ok(())
            } else {
                let (found, limit) = (side, MAX_SIDE);
                Err(ControlError::Side { found, limit })
            }
        }
    }
}

/// A set as maps in BC7: 16 bytes for a block of 4×4 texels of up to four channels, 8 bits a texel.
///
/// What a set costs where it is stored as games store it. The formats with blocks of the same size
/// (BC2, BC3, BC5, BC6H, and ASTC at 4×4) have the same addresses. A decode fetches the one block
/// that the texel lies in from each map, so the four addresses of a fetch are equal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Bc7 {
    maps: Maps,
}

impl Bc7 {
    /// `maps` maps of the size, the chain and the address mode of `shape`; nothing else of it
    /// matters. The elements of `order` are blocks.
    ///
    /// The places that it is asked for must come from this shape.
    ///
    /// # Errors
    /// When the size, the chain, the number of maps (1..=[`limits::MAX_CHANNELS`]) or the side of a
    /// tile is out of range.
    pub fn new(shape: &Shape, maps: u16, order: Order) -> Result<Bc7, ControlError> {
        let maps = Maps::new(shape, maps, order, (4, 16))?;
        Ok(Bc7 { maps })
    }

    /// What one texel asks of each resource.
    #[must_use]
    pub fn work(&self) -> Work {
        self.maps.work()
    }
}

impl Addresses for Bc7 {
    fn fetches(&self, place: &Place, fetches: &mut Vec<Fetch>) {
        self.maps.fetches(place, fetches);
    }

    fn bytes(&self) -> u64 {
        self.maps.bytes()
    }

    fn mip_size(&self, mip: u8) -> (u32, u32) {
        self.maps.mips[usize::from(mip)].size
    }
}

/// A set as maps of uncompressed RGBA8 texels, four bytes each.
///
/// What the literature on texture caches measures, and the upper end of what a set can cost. With
/// one map and [`Order::Blocked`] it is the texture of Hakura and Gupta (1997). A decode fetches the
/// one texel from each map, so the four addresses of a fetch are equal.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Plain {
    maps: Maps,
}

impl Plain {
    /// `maps` maps of the size, the chain and the address mode of `shape`; nothing else of it
    /// matters. The elements of `order` are texels.
    ///
    /// The places that it is asked for must come from this shape.
    ///
    /// # Errors
    /// When the size, the chain, the number of maps (1..=[`limits::MAX_CHANNELS`]) or the side of a
    /// tile is out of range.
    pub fn new(shape: &Shape, maps: u16, order: Order) -> Result<Plain, ControlError> {
        let maps = Maps::new(shape, maps, order, (1, 4))?;
        Ok(Plain { maps })
    }

    /// What one texel asks of each resource.
    #[must_use]
    pub fn work(&self) -> Work {
        self.maps.work()
    }
}

impl Addresses for Plain {
    fn fetches(&self, place: &Place, fetches: &mut Vec<Fetch>) {
        self.maps.fetches(place, fetches);
    }

    fn bytes(&self) -> u64 {
        self.maps.bytes()
    }

    fn mip_size(&self, mip: u8) -> (u32, u32) {
        self.maps.mips[usize::from(mip)].size
    }
}
