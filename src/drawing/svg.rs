//! SVG: a drawing as a file that needs nothing else.

use super::{Anchor, Colour, Drawing, Item, Marker, PAPER, RADIUS};
use crate::report::px;
use maud::{Markup, html};

impl Drawing {
    /// The file's text.
    pub(crate) fn svg(&self) -> String {
        let (width, height) = self.size;
        let page = html! {
            svg xmlns="http://www.w3.org/2000/svg" width=(width) height=(height)
                viewBox={ "0 0 " (width) " " (height) } role="img" aria-label=(self.title)
                font-family="DejaVu Sans Mono, Menlo, Consolas, monospace" font-size="10" {
                title { (self.title) }
                rect width=(width) height=(height) fill=(hex(PAPER)) {}
                @for item in &self.items { (shape(item)) }
            }
        };
        page.into_string() + "\n"
    }
}

fn shape(item: &Item) -> Markup {
    match item {
        Item::Path {
            points,
            colour,
            width,
        } => html! {
            polyline points=(list(points)) fill="none" stroke=(hex(*colour)) stroke-width=(width) {}
        },
        Item::Mark { at, marker, colour } => match marker {
            Marker::Circle => html! {
                circle cx=(px(at.0)) cy=(px(at.1)) r=(RADIUS) fill=(hex(*colour)) {}
            },
            Marker::Square | Marker::Triangle | Marker::Diamond => {
                let corners = marker.corners().iter();
                let corners: Vec<_> = corners.map(|(x, y)| (at.0 + x, at.1 + y)).collect();
                html! { polygon points=(list(&corners)) fill=(hex(*colour)) {} }
            }
        },
        Item::Box { area, colour } => {
            let [x, y, width, height] = area.map(px);
            html! { rect x=(x) y=(y) width=(width) height=(height) fill=(hex(*colour)) {} }
        }
        Item::Text {
            at,
            text,
            anchor,
            colour,
        } => {
            let anchor = match anchor {
                Anchor::Start => "start",
                Anchor::Middle => "middle",
                Anchor::End => "end",
            };
            html! {
                text x=(px(at.0)) y=(px(at.1)) text-anchor=(anchor) fill=(hex(*colour)) { (text) }
            }
        }
    }
}

fn hex([red, green, blue]: Colour) -> String {
    format!("#{red:02x}{green:02x}{blue:02x}")
}

fn list(points: &[(f64, f64)]) -> String {
    let places: Vec<String> = points
        .iter()
        .map(|(x, y)| format!("{},{}", px(*x), px(*y)))
        .collect();
    places.join(" ")
}
