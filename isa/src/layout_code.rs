//! Layout as programs name it: in assembly by its name, in an image by its code.

use crate::layout::Layout;

/// Every name, as an error lists them.
pub(crate) fn names() -> String {
    Layout::ALL.map(Layout::name).join(", ")
}

/// The layout with this name.
pub(crate) fn named(name: &str) -> Option<Layout> {
    Layout::ALL.into_iter().find(|layout| layout.name() == name)
}

/// The name of a layout.
pub(crate) fn name(layout: Layout) -> String {
    layout.name().to_owned()
}

/// The code in a program image.
pub(crate) fn code(layout: Layout) -> u32 {
    layout as u32
}

/// The layout with this code.
pub(crate) fn from_code(code: u32) -> Option<Layout> {
    Layout::ALL
        .into_iter()
        .find(|&layout| layout as u32 == code)
}

/// What no program names is linear.
pub(crate) const DEFAULT: Layout = Layout::Linear;
