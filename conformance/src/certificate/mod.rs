//! Certificate: what is proven of an asset, whatever its latents and whichever texel.
//!
//! The weights are known when an asset is made; its grids may be streamed, its texels are asked for
//! one at a time. So a unit can be sized from the weights alone: how wide an accumulator has to be,
//! which rescalings keep what their arithmetic asks for, what a lane can hold. In the first layer the
//! ranges are exact (see [`LayerCertificate::method`]); after it they are intervals propagated
//! through the actual weights, which forget that lanes depend on each other: sound, and wider than
//! what is reached.

mod half;
mod inputs;
mod integer;
mod range;
mod text;
mod witness;

pub use half::HalfSums;
pub use integer::{IntegerSums, Purpose, Rescale, Row};
pub use range::{Range, RealRange};
pub use text::HEADINGS;
pub use witness::{Extreme, Witness, witness};

use crate::bound::{typical, worst};
use crate::oracle::Oracle;
use inputs::Inputs;
use integer::Prefixes;
use ntmu_isa::Asset;
use ntmu_isa::layer::Parameters;
use ntmu_model::Request;
use serde::Serialize;

/// Texels whose rounding variances are propagated for the typical error, spread over the chain.
const TYPICAL_TEXELS: usize = 64;

/// What is proven of an asset.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Certificate {
    /// Name and hash of the profile.
    pub profile: String,
    /// First layer first.
    pub layers: Vec<LayerCertificate>,
    /// One per channel.
    pub channels: Vec<ChannelCertificate>,
}

/// How the ranges of a layer's sums were found.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Every combination of codes, waves and level: some latents and some texel reach each end.
    Exact,
    /// Intervals, lane by lane: no more than this.
    Interval,
}

/// What is proven of a layer.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct LayerCertificate {
    /// From 0.
    pub layer: usize,
    /// Of its sums: exact in the first layer if it is one of integers. Corners that coincide are
    /// counted once there.
    pub method: Method,
    /// Its sums.
    pub sums: Sums,
    /// What every lane of its register can hold, after saturation, by intervals: integers, or the
    /// reals of halves. Empty in the last layer.
    pub outputs: Vec<RealRange>,
}

/// The sums of a layer.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "arithmetic", rename_all = "kebab-case")]
pub enum Sums {
    /// Of an integer layer.
    Integer(IntegerSums),
    /// Of an fp16 layer.
    Half(HalfSums),
}

/// What is known of a channel's distance to the real-valued network.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ChannelCertificate {
    /// From 0.
    pub channel: usize,
    /// The name of its format.
    pub format: &'static str,
    /// The largest distance that any latents can give, in the channel's units, where no sum
    /// overflows.
    pub worst: f64,
    /// How that was found.
    pub worst_method: &'static str,
    /// The expected root mean square of the distance, with the asset's own latents.
    pub typical: f64,
    /// How that was found.
    pub typical_method: &'static str,
    /// Over so many texels.
    pub typical_texels: usize,
}

impl Certificate {
    /// Everything that can be said of an asset.
    #[must_use]
    pub fn of(asset: &Asset) -> Certificate {
        Certificate {
            profile: asset.profile.identity(),
            layers: layers(asset),
            channels: channels(asset),
        }
    }

    /// No sum of any integer layer overflows the profile's accumulators, and no fp16 number
    /// saturates: then the bounds hold of every texel.
    #[must_use]
    pub fn is_free_of_overflow(&self) -> bool {
        self.layers.iter().all(|layer| match &layer.sums {
            Sums::Integer(sums) => sums.is_wide_enough,
            Sums::Half(sums) => !sums.may_saturate,
        })
    }

    /// The narrowest accumulator, 16..=32 bits, for all integer layers; none if 32 bits are too few
    /// for one.
    #[must_use]
    pub fn width(&self) -> Option<u8> {
        let mut widths = self.layers.iter().filter_map(|layer| match &layer.sums {
            Sums::Integer(sums) => Some(sums.width),
            Sums::Half(_) => None,
        });
        widths.try_fold(integer::NARROWEST, |widest, width| Some(widest.max(width?)))
    }
}

fn layers(asset: &Asset) -> Vec<LayerCertificate> {
    let inputs = Inputs::of(asset);
    let lanes = inputs.lanes().into_iter();
    // The inputs, then the outputs of every layer: those of layer n are at n + 1.
    let mut registers: Vec<Vec<RealRange>> = vec![lanes.map(RealRange::from).collect()];
    let mut layers = Vec::new();
    for (index, layer) in asset.layers.iter().enumerate() {
        let (method, made) = match &layer.parameters {
            Parameters::Half(_) => {
                let made = half::layer(asset, index, &registers);
                (
                    Method::Interval,
                    made.map(|(sums, out)| (Sums::Half(sums), out)),
                )
            }
            Parameters::Integer(p) => {
                let rows = 0..usize::from(layer.outputs);
                let of_row = |row| (p.bias[row], p.row(row, layer.inputs));
                let lanes: Vec<Range> = registers[index].iter().map(|l| l.integers()).collect();
                let prefixes = rows.map(of_row).map(|(bias, row)| {
                    let exact = (index == 0)
                        .then(|| Prefixes::of_inputs(asset, bias, row, &inputs))
                        .flatten();
                    exact.unwrap_or_else(|| Prefixes::of(bias, row, &lanes))
                });
                let prefixes: Vec<Prefixes> = prefixes.collect();
                let method = if index == 0 {
                    Method::Exact
                } else {
                    Method::Interval
                };
                let made = integer::layer(asset, index, &prefixes, &registers);
                (method, made.map(|(sums, out)| (Sums::Integer(sums), out)))
            }
        };
        // Each kind of layer has the parameters of its kind.
        let Some((sums, outputs)) = made else {
            continue;
        };
        registers.push(outputs.clone());
        layers.push(LayerCertificate {
            layer: index,
            method,
            sums,
            outputs,
        });
    }
    layers
}

fn channels(asset: &Asset) -> Vec<ChannelCertificate> {
    let oracle = Oracle::new(asset);
    let texels = asset.shape.texel_count();
    let step = texels.div_ceil(TYPICAL_TEXELS as u64).max(1);
    let requests: Vec<Request> = (0..texels)
        .step_by(step as usize)
        .filter_map(|texel| nth_texel(asset, texel))
        .collect();
    let typical = typical::rms(&oracle, &requests);
    let formats = asset.shape.outputs.iter();
    let distances = worst::asset(asset).into_iter().zip(typical);
    formats
        .zip(distances)
        .enumerate()
        .map(|(channel, (format, (worst, typical)))| ChannelCertificate {
            channel,
            format: format.name(),
            worst,
            worst_method: "interval propagation",
            typical,
            typical_method: "variance propagation",
            typical_texels: requests.len(),
        })
        .collect()
}

/// The n-th texel of the chain, mip by mip, row by row.
fn nth_texel(asset: &Asset, n: u64) -> Option<Request> {
    let mut left = n;
    for mip in 0..asset.shape.mip_count {
        let (width, height) = asset.shape.mip_size(mip);
        let count = u64::from(width) * u64::from(height);
        if left < count {
            let (x, y) = (left % u64::from(width), left / u64::from(width));
            return Request::new(&asset.shape, x as u32, y as u32, mip).ok();
        }
        left -= count;
    }
    None
}
