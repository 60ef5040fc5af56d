//! Variants: the same asset in other numbers, and under other profiles.

use crate::decoded::Decoded;
use crate::metrics::{self, MetricsError};
use crate::precision::{self, PrecisionError};
use crate::quality;
use ndarray::Array3;
use ntmu_isa::Asset;
use ntmu_isa::profile::{NamedProfile, ProfileError};
use serde::Serialize;

/// One variant and what became of it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Variant {
    /// What is different: `activations of 6 bits`, or a profile's name and hash.
    pub name: String,
    /// What became of it.
    pub outcome: VariantOutcome,
}

/// What became of a variant.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "status", rename_all = "snake_case")]
pub enum VariantOutcome {
    /// It was decoded.
    Decoded {
        /// Codes that differ from the asset's own.
        differing: u64,
        /// Codes compared.
        codes: u64,
        /// The largest difference, in codes.
        largest: u32,
        /// PSNR over all maps and mips against the source, in dB; where there is a source.
        psnr: Option<f64>,
        /// Bits per pixel and channel, parameters counted.
        bppc: f64,
    },
    /// The asset cannot be had so.
    Impossible {
        /// Why.
        reason: String,
    },
}

/// Why the variants could not be tried.
#[derive(Debug, thiserror::Error)]
pub enum VariantError {
    /// A built-in profile cannot be read.
    #[error(transparent)]
    Profile(#[from] ProfileError),
    /// A variant cannot be compared with the source.
    #[error(transparent)]
    Metrics(#[from] MetricsError),
}

/// Widths of activations that are tried, where they are not the asset's own.
const ACTIVATION_BITS: [u8; 6] = [4, 6, 8, 10, 12, 16];

type Candidate = (String, Result<Asset, PrecisionError>);

/// Other numbers first, then every built-in profile that is not the asset's own. A profile of
/// fp16 layers is tried on the fp16 asset where the asset has none.
fn candidates(asset: &Asset) -> Result<Vec<Candidate>, ProfileError> {
    let mut found = Vec::new();
    for bits in ACTIVATION_BITS {
        if asset.shape.input_bits != bits {
            let variant = precision::with_activations(asset, bits);
            found.push((format!("activations of {bits} bits"), variant));
        }
    }
    let halves = precision::in_halves(asset);
    found.push(("fp16 layers".to_owned(), halves.clone()));
    for named in NamedProfile::all()? {
        if named.profile == asset.profile {
            continue;
        }
        let identity = named.profile.identity();
        let under = |asset: &Asset| {
            let mut parts = asset.clone().into_parts();
            parts.profile = named.profile;
            Ok(Asset::new(parts)?)
        };
        found.push((identity.clone(), under(asset)));
        if named.profile.sum != asset.profile.sum
            && let Ok(halves) = &halves
        {
            found.push((format!("fp16 layers, {identity}"), under(halves)));
        }
    }
    Ok(found)
}

/// How many variants [`variants`] tries.
///
/// # Errors
/// When a built-in profile cannot be read.
pub fn variant_count(asset: &Asset) -> Result<u64, ProfileError> {
    Ok(candidates(asset)?.len() as u64)
}

/// Decodes every variant and compares its codes with the asset's own, and with the source where
/// there is one. `after_variant` is called with the variants done.
///
/// # Errors
/// When the source does not have the asset's shape.
pub fn variants(
    asset: &Asset,
    decoded: &Decoded,
    reference: Option<&[Array3<f32>]>,
    mut after_variant: impl FnMut(u64),
) -> Result<Vec<Variant>, VariantError> {
    let mut tried = Vec::new();
    for (name, candidate) in candidates(asset)? {
        let outcome = match candidate {
            Err(error) => VariantOutcome::Impossible {
                reason: error.to_string(),
            },
            Ok(variant) => compare(&variant, decoded, reference)?,
        };
        tried.push(Variant { name, outcome });
        after_variant(tried.len() as u64);
    }
    Ok(tried)
}

fn compare(
    variant: &Asset,
    decoded: &Decoded,
    reference: Option<&[Array3<f32>]>,
) -> Result<VariantOutcome, MetricsError> {
    let other = Decoded::of(variant, |_| ());
    let pairs = decoded.mips.iter().zip(&other.mips);
    let differences = pairs.flat_map(|(a, b)| a.iter().zip(b).map(|(a, b)| a.abs_diff(*b)));
    let (mut codes, mut differing, mut largest) = (0, 0, 0);
    for difference in differences {
        codes += 1;
        differing += u64::from(difference != 0);
        largest = largest.max(difference);
    }
    let psnr = match reference {
        None => None,
        Some(reference) => {
            let channels: Vec<usize> = (0..variant.shape.outputs.len()).collect();
            let mips: Vec<usize> = (0..reference.len()).collect();
            let reals = other.reals(&variant.shape);
            Some(metrics::psnr(reference, &reals, &channels, &mips)?)
        }
    };
    Ok(VariantOutcome::Decoded {
        differing,
        codes,
        largest,
        psnr,
        bppc: quality::bppc(variant),
    })
}
