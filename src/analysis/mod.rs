//! Analysis: what the grids of an asset hold, as the CNTC paper looks at them.
//!
//! | module | answers | paper |
//! |---|---|---|
//! | [`similarity`](mod@similarity) | how alike the levels of a grid's pyramid are | "Motivation", CKA figure |
//! | [`fourier`](mod@fourier) | which frequencies a grid holds | "Effect of interpolation in grid-samplers" |

pub mod cka;
pub mod fourier;
mod level;
mod picture;
mod resample;
pub mod similarity;
mod spectrum;

pub use cka::linear_cka;
pub use fourier::{ChannelSpectrum, EXPECTED, FourierError, FourierSummary, GridFourier, fourier};
pub use level::level_reals;
pub use picture::{latents_png, spectrum_png};
pub use resample::Alignment;
pub use similarity::{Similarity, SimilarityError, similarity};
pub use spectrum::{Band, Spectrum, SpectrumSummary};
