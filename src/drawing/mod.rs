//! Drawing: lines, shapes and words on a white page, written as SVG or as PNG.
//!
//! Charts that stand alone are made of these, so that both files show the same.

mod png;
mod svg;

/// A colour in sRGB.
pub(crate) type Colour = [u8; 3];

pub(crate) const INK: Colour = [27, 31, 36];
pub(crate) const SOFT: Colour = [92, 102, 112];
pub(crate) const RULE: Colour = [217, 222, 227];
pub(crate) const PAPER: Colour = [255; 3];

/// Colours of curves, far apart for every kind of colour vision; more curves begin again, with
/// other markers.
pub(crate) const CURVES: [Colour; 6] = [
    [47, 111, 168],
    [196, 86, 26],
    [42, 146, 121],
    [139, 148, 158],
    [197, 131, 171],
    [227, 163, 43],
];

/// Units from one letter of a text to the next. The font of a PNG has one width.
pub(crate) const LETTER: f64 = 5.0;

/// Where a text's place is on its baseline.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Anchor {
    Start,
    Middle,
    End,
}

/// A mark at a point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Marker {
    Circle,
    Square,
    Triangle,
    Diamond,
}

impl Marker {
    pub(crate) const ALL: [Marker; 4] = [
        Marker::Circle,
        Marker::Square,
        Marker::Triangle,
        Marker::Diamond,
    ];

    /// The corners about the place, clockwise on a page; a circle has none.
    fn corners(self) -> &'static [(f64, f64)] {
        match self {
            Marker::Circle => &[],
            Marker::Square => &[(-3.8, -3.8), (3.8, -3.8), (3.8, 3.8), (-3.8, 3.8)],
            Marker::Triangle => &[(0.0, -5.2), (4.9, 4.0), (-4.9, 4.0)],
            Marker::Diamond => &[(0.0, -5.4), (5.4, 0.0), (0.0, 5.4), (-5.4, 0.0)],
        }
    }
}

/// The radius of a [`Marker::Circle`].
const RADIUS: f64 = 4.2;

/// One thing drawn; y goes down, units are pixels of the SVG.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Item {
    /// Straight lines through points.
    Path {
        points: Vec<(f64, f64)>,
        colour: Colour,
        width: f64,
    },
    /// A mark.
    Mark {
        at: (f64, f64),
        marker: Marker,
        colour: Colour,
    },
    /// A filled rectangle: left, top, width, height.
    Box { area: [f64; 4], colour: Colour },
    /// A line of text on a baseline.
    Text {
        at: (f64, f64),
        text: String,
        anchor: Anchor,
        colour: Colour,
    },
}

/// A page.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Drawing {
    /// What it shows, for readers who cannot see it.
    pub(crate) title: String,
    /// Units along x and y.
    pub(crate) size: (u32, u32),
    /// What is drawn, the lowest first.
    pub(crate) items: Vec<Item>,
}

impl Drawing {
    /// An empty page.
    pub(crate) fn new(title: impl Into<String>, size: (u32, u32)) -> Drawing {
        Drawing {
            title: title.into(),
            size,
            items: Vec::new(),
        }
    }

    pub(crate) fn line(&mut self, from: (f64, f64), to: (f64, f64), colour: Colour) {
        self.items.push(Item::Path {
            points: vec![from, to],
            colour,
            width: 1.0,
        });
    }

    pub(crate) fn text(
        &mut self,
        at: (f64, f64),
        text: impl Into<String>,
        anchor: Anchor,
        colour: Colour,
    ) {
        self.items.push(Item::Text {
            at,
            text: text.into(),
            anchor,
            colour,
        });
    }
}
