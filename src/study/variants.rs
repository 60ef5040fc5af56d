//! Variants: the same asset in other numbers, and under other profiles.

use super::claims::sample;
use crate::decoded::real;
use crate::precision::{self, PrecisionError};
use crate::quality;
use ndarray::Array3;
use ntmu_isa::Asset;
use ntmu_isa::profile::{NamedProfile, ProfileError};
use ntmu_model::Request;
use ntmu_model::engine::Engine;
use ntmu_model::sampler::Decode as _;
use rayon::prelude::*;
use serde::Serialize;

/// Texels that are decoded of every variant: an fp16 layer that sums in fp16 takes a millisecond for
/// one.
const VARIANT_TEXELS: usize = 1 << 15;

/// What was tried, at a sample of texels of all mips.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Variants {
    /// Texels of the sample.
    pub texels: usize,
    /// PSNR of the asset as it is, at these texels; where there is a source.
    pub psnr: Option<f64>,
    /// Each variant.
    pub tried: Vec<Variant>,
}

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
        /// PSNR over all channels of the sample against the source, in dB; where there is a source.
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

/// Decodes a sample of texels of every variant and compares the codes with the asset's own, and with
/// the source where there is one. `after_variant` is called with the variants done.
///
/// # Errors
/// When a built-in profile cannot be read.
pub fn variants(
    asset: &Asset,
    reference: Option<&[Array3<f32>]>,
    mut after_variant: impl FnMut(u64),
) -> Result<Variants, ProfileError> {
    let requests = sample(asset, VARIANT_TEXELS);
    let own = decode(asset, &requests);
    let psnr_of =
        |codes: &[Vec<i32>]| reference.map(|reference| psnr(codes, &requests, asset, reference));
    let mut tried = Vec::new();
    for (name, candidate) in candidates(asset)? {
        let outcome = match candidate {
            Err(error) => VariantOutcome::Impossible {
                reason: error.to_string(),
            },
            Ok(variant) => {
                let codes = decode(&variant, &requests);
                let pairs = own.iter().flatten().zip(codes.iter().flatten());
                let differences = || pairs.clone().map(|(a, b)| a.abs_diff(*b));
                VariantOutcome::Decoded {
                    differing: differences().filter(|&d| d != 0).count() as u64,
                    codes: differences().count() as u64,
                    largest: differences().max().unwrap_or(0),
                    psnr: psnr_of(&codes),
                    bppc: quality::bppc(&variant),
                }
            }
        };
        tried.push(Variant { name, outcome });
        after_variant(tried.len() as u64);
    }
    Ok(Variants {
        texels: requests.len(),
        psnr: psnr_of(&own),
        tried,
    })
}

/// Texels that one thread decodes at a time.
const CHUNK: usize = 1024;

fn decode(asset: &Asset, requests: &[Request]) -> Vec<Vec<i32>> {
    let engine = Engine::new(asset);
    let chunks = requests.par_chunks(CHUNK);
    chunks
        .flat_map_iter(|requests| engine.texels(requests))
        .collect()
}

/// In dB, over all channels of the texels.
fn psnr(codes: &[Vec<i32>], requests: &[Request], asset: &Asset, reference: &[Array3<f32>]) -> f64 {
    let formats = &asset.shape.outputs;
    let squares = requests.iter().zip(codes).flat_map(|(request, codes)| {
        let source = &reference[usize::from(request.mip())];
        let place = [request.y() as usize, request.x() as usize];
        let channels = codes.iter().zip(formats).enumerate();
        channels.map(move |(channel, (&code, &format))| {
            let source = f64::from(source[[channel, place[0], place[1]]]);
            (f64::from(real(code, format)) - source).powi(2)
        })
    });
    let (sum, count) = squares.fold((0.0, 0_u64), |(sum, count), square| {
        (sum + square, count + 1)
    });
    -10.0 * (sum / count as f64).log10()
}
