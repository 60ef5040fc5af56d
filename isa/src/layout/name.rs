//! Name: a layout as text, and as a number in a program image.

use super::{Inside, Layout, Order, Storage};
use crate::shape::Shape;
use std::fmt;
use std::str::FromStr;

/// Why there is no such layout, or not for this shape.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum LayoutError {
    /// A name that no layout has.
    Name {
        /// What was found.
        found: String,
    },
    /// Grids of two sizes in records that hold a cell of each.
    Sizes {
        /// The layout asked for.
        layout: Layout,
        /// Cells of either grid along x and y.
        found: [(u32, u32); 2],
    },
}

impl LayoutError {
    /// What is allowed there.
    #[must_use]
    pub fn allowed(&self) -> String {
        match self {
            LayoutError::Name { found: _ } => {
                let orders: Vec<String> = Order::every().map(|order| order.to_string()).collect();
                let suffixes: Vec<&str> = Storage::ALL[1..].iter().map(|s| s.suffix()).collect();
                format!(
                    "{}; each alone or with one of {}",
                    orders.join(", "),
                    suffixes.join(", ")
                )
            }
            LayoutError::Sizes { layout, found: _ } => {
                format!("grids of one size, or `{}`", layout.order)
            }
        }
    }
}

impl fmt::Display for LayoutError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let allowed = self.allowed();
        match self {
            LayoutError::Name { found } => {
                write!(f, "layout: found {found:?}; allowed: {allowed}")
            }
            LayoutError::Sizes { layout, found } => {
                let [(w0, h0), (w1, h1)] = found;
                write!(
                    f,
                    "layout {layout}: found grids of {w0}x{h0} and {w1}x{h1} cells; allowed: {allowed}"
                )
            }
        }
    }
}

impl std::error::Error for LayoutError {}

impl fmt::Display for Order {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (stem, side, inside) = match *self {
            Order::Linear => return f.write_str("linear"),
            Order::Morton => return f.write_str("morton"),
            Order::Tiles { side, inside } => ("tiles", side, inside),
            Order::Super { side, inside } => ("super", side, inside),
        };
        let rows = match inside {
            Inside::Morton => "",
            Inside::Rows => "-rows",
        };
        write!(f, "{stem}-{}{rows}", side.cells())
    }
}

impl Storage {
    /// What the name of a layout ends with.
    #[must_use]
    pub const fn suffix(self) -> &'static str {
        match self {
            Storage::Interleaved => "",
            Storage::Planar => "+planar",
            Storage::Together => "+together",
        }
    }
}

impl fmt::Display for Layout {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&format!("{}{}", self.order, self.storage.suffix()))
    }
}

impl FromStr for Layout {
    type Err = LayoutError;

    fn from_str(name: &str) -> Result<Layout, LayoutError> {
        Layout::every()
            .find(|layout| layout.to_string() == name)
            .ok_or_else(|| LayoutError::Name {
                found: name.to_owned(),
            })
    }
}

impl Layout {
    /// Every layout that has a name and a code.
    pub fn every() -> impl Iterator<Item = Layout> {
        Storage::ALL
            .into_iter()
            .flat_map(|storage| Order::every().map(move |order| Layout { order, storage }))
    }

    /// The layouts worth comparing: every one, but none that is another under a second name.
    #[must_use]
    pub fn named() -> Vec<Layout> {
        Layout::every()
            .filter(|layout| !layout.order.is_alias())
            .collect()
    }

    /// The code in a program image. Bits 0 and 1 are the order (linear, tiles, Morton, super-blocks),
    /// bits 2 and 3 log2 of a tile's side less one, bit 4 is set for rows inside a tile, bits 5 and 6
    /// are the storage; what an order does not have is zero.
    #[must_use]
    pub const fn code(self) -> u16 {
        let (kind, square) = match self.order {
            Order::Linear => (0, None),
            Order::Tiles { side, inside } => (1, Some((side, inside))),
            Order::Morton => (2, None),
            Order::Super { side, inside } => (3, Some((side, inside))),
        };
        let square = match square {
            Some((side, inside)) => (side as u16) << 2 | (inside as u16) << 4,
            None => 0,
        };
        kind | square | (self.storage as u16) << 5
    }

    /// The layout with this code, if there is one.
    #[must_use]
    pub fn from_code(code: u16) -> Option<Layout> {
        Layout::every().find(|layout| layout.code() == code)
    }

    /// Whether the layout suits a shape. Every layout has an address for every cell of every shape;
    /// but records of two grids of different size would be mostly padding, which nobody can want. Whoever
    /// takes a layout from outside asks this before a program is compiled or linked with it.
    ///
    /// # Errors
    /// [`Storage::Together`] where the grids differ in size.
    pub fn check(self, shape: &Shape) -> Result<(), LayoutError> {
        // Where level 0 of both has one size, every level has.
        let found = [shape.grid_size(0), shape.grid_size(1)];
        match self.storage {
            Storage::Together if found[0] != found[1] => Err(LayoutError::Sizes {
                layout: self,
                found,
            }),
            Storage::Interleaved | Storage::Planar | Storage::Together => Ok(()),
        }
    }
}
