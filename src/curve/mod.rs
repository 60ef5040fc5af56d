//! Curves: quality against rate, and what lies between two of them.
//!
//! A [`Curve`] is what CompressAI writes for a codec: a name and series of numbers, one number a
//! point. [`Points`] are two of its series, one the rate. Two of them have a Bjøntegaard delta:
//! [`bd_rate`] and [`bd_psnr`] (VCEG-M33, 2001; interpolated as in JVET-T2010 or after Akima).

mod delta;
mod document;
mod error;
mod interpolant;
mod matrix;
mod plot;
mod points;
mod table;

pub use delta::{Delta, bd_psnr, bd_rate};
pub use document::Curve;
pub use error::CurveError;
pub use interpolant::Method;
pub use matrix::{Cell, Matrix, matrix};
pub use plot::{Labels, plot_png, plot_svg};
pub use points::{Axes, Points};
pub(crate) use table::cell as markdown_cell;
pub use table::markdown;
