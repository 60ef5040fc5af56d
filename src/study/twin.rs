//! The model against its GPU twin.

use crate::decoded::Decoded;
use ntmu_isa::Asset;
use serde::Serialize;

/// What came of running the twin.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "status", rename_all = "kebab-case")]
pub enum TwinStudy {
    /// It ran.
    Ran {
        /// The adapter's name and driver.
        adapter: String,
        /// Codes compared.
        codes: u64,
        /// Codes that differ.
        differing: u64,
        /// The first that differs: mip, channel, row, column, the model's code, the twin's.
        first: Option<(u8, usize, usize, usize, i32, i32)>,
    },
    /// It started and did not come to an end, and why.
    Failed {
        /// Why.
        reason: String,
    },
    /// It did not run, and why.
    Skipped {
        /// Why.
        reason: String,
    },
}

impl TwinStudy {
    /// The twin agreed on every code, or there is no device to ask.
    #[must_use]
    pub fn holds(&self) -> bool {
        match self {
            TwinStudy::Ran { differing, .. } => *differing == 0,
            TwinStudy::Failed { .. } => false,
            TwinStudy::Skipped { .. } => true,
        }
    }
}

/// Runs the twin on every texel of every mip and compares word for word. `after_mip` is called with
/// the mips done.
///
/// A machine without an adapter, or a build without the feature `gpu`, skips.
#[cfg(feature = "gpu")]
#[must_use]
pub fn compare_with_twin(
    asset: &Asset,
    decoded: &Decoded,
    mut after_mip: impl FnMut(u64),
) -> TwinStudy {
    let mut run = || -> Result<TwinStudy, ntmu_shaders::TwinError> {
        let twin = ntmu_shaders::Twin::new(asset)?;
        let info = twin.adapter();
        let adapter = format!("{}, {}, {}", info.name, info.backend, info.driver);
        let (mut codes, mut differing, mut first) = (0, 0, None);
        for (mip, model) in (0..).zip(&decoded.mips) {
            let twin = twin.mip(mip)?;
            let (channels, _, width) = model.dim();
            for (index, &theirs) in twin.iter().enumerate() {
                let (texel, channel) = (index / channels, index % channels);
                let (row, column) = (texel / width, texel % width);
                let ours = model[[channel, row, column]];
                codes += 1;
                if ours != theirs {
                    differing += 1;
                    first.get_or_insert((mip, channel, row, column, ours, theirs));
                }
            }
            after_mip(u64::from(mip) + 1);
        }
        Ok(TwinStudy::Ran {
            adapter,
            codes,
            differing,
            first,
        })
    };
    run().unwrap_or_else(|error| {
        let reason = error.to_string();
        if error.is_no_adapter() {
            TwinStudy::Skipped { reason }
        } else {
            TwinStudy::Failed { reason }
        }
    })
}

/// Says that this build has no twin.
#[cfg(not(feature = "gpu"))]
#[must_use]
pub fn compare_with_twin(_: &Asset, _: &Decoded, _: impl FnMut(u64)) -> TwinStudy {
    let reason = "this build has no GPU feature; `--features gpu` brings it".to_owned();
    TwinStudy::Skipped { reason }
}
