//! Layout as program images name it: by its code, and what names an error lists.

use crate::layout::{Layout, LayoutError};

/// Every name, as an error lists them.
pub(crate) fn names() -> String {
    let found = String::new();
    LayoutError::Name { found }.allowed()
}

/// The code in a program image.
pub(crate) fn code(layout: Layout) -> u32 {
    u32::from(layout.code())
}

/// The layout with this code.
pub(crate) fn from_code(code: u32) -> Option<Layout> {
    u16::try_from(code).ok().and_then(Layout::from_code)
}

/// What no program names is linear.
pub(crate) const DEFAULT: Layout = Layout::LINEAR;
