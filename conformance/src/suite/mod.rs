//! Suites: the vectors themselves, made from nothing but the specification and fixed seeds.

mod arithmetics;
pub mod container;
pub mod position;
mod pyramids;
pub mod refuse;
mod refuse_layers;
mod refuse_pyramid;
pub mod rescale;
mod subjects;
pub mod texel;

use crate::emit::VectorError;
use crate::vector::VectorFile;

/// Why a suite cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum SuiteError {
    /// An asset of the suite is outside the limits.
    #[error("asset {name}: {error}")]
    Asset {
        /// The asset.
        name: String,
        /// What is wrong with it.
        error: ntmu_isa::AssetError,
    },
    /// A multiplier of the suite is outside the limits.
    #[error(transparent)]
    Multiplier(#[from] ntmu_isa::rescale::MultiplierError),
    /// The file that was made contradicts itself.
    #[error(transparent)]
    Vector(#[from] VectorError),
}

/// All suites, in the order in which a device should be brought up.
///
/// # Errors
/// Never, unless the specification changed under the suites.
pub fn all() -> Result<Vec<VectorFile>, SuiteError> {
    let files = vec![
        rescale::suite()?,
        position::suite(),
        texel::suite()?,
        refuse::suite()?,
    ];
    for file in &files {
        crate::emit::check(file)?;
    }
    Ok(files)
}
