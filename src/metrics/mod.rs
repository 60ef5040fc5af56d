//! How far a decoded texture set is from the original, and what it costs.
//!
//! Two sets are compared as mip chains: one array `[channel, row, column]` per mip, mip 0 first,
//! values in 0..=1 (stored code / largest code). PSNR, SSIM and BPPC follow the evaluation
//! section of the CNTC paper (ECCV 2024). All sums are taken in f64 in a fixed order, so the
//! same inputs give the same bits whatever the number of threads.
//!
//! | file | measures |
//! |---|---|
//! | `psnr` | squared error in dB |
//! | `ssim` | structural similarity of single channels |
//! | `angle` | degrees between normals |
//! | `perceptual` | SSIMULACRA2 of colours |
//! | `difference` | differences of codes |
//! | `rate` | bits per pixel and channel |
//! | `mask` | which texels count |

mod angle;
mod difference;
mod error;
mod mask;
mod perceptual;
mod psnr;
mod rate;
mod selection;
mod ssim;

pub use angle::{AngleErrors, AngleFigures, angle_errors};
pub use difference::{code_difference_histogram, max_abs_difference};
pub use error::MetricsError;
pub use mask::Mask;
pub use perceptual::{LEAST_SIDE, ssimulacra2};
pub use psnr::{psnr, psnr_within};
pub use rate::bppc;
pub use ssim::{ssim, ssim_plane, ssim_within};
