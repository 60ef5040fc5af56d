//! Oracle: the real-number truth about an asset.
//!
//! A decoder in `f64`, written from the paper (Method) and DESIGN, naive enough to be checked by
//! eye. It reads an asset's data (codes, weights, multipliers, zero points, enums) and computes
//! everything from them itself: nothing here calls arithmetic of `isa` or `model`.
//!
//! What is *definition* is kept: where samples lie (`phase` is a whole number of sixteenths, see
//! [`position`]), what a fraction means as a weight, the entries of a table, and the clamps of the
//! deployed network (inputs and activations to their bits or to ±65504, a hard GELU's argument to 16
//! bits, a table's index to eight, a rescaled value to 32, a skip term to the profile's, a channel to
//! its format). What is *rounding* is left out, every one of them, also that of a table's index to
//! an entry; so `model − oracle` is rounding and nothing else, and [`crate::bound`] says how much of
//! it there may be.
//!
//! Sums are wide: an accumulator that wraps or saturates, or an fp16 sum that does, is no rounding.
//! What is claimed of a distance holds where none does, which [`crate::naive`] reports of a texel
//! and a [`crate::certificate`] proves of an asset.
//!
//! Integers are in units of the least significant bit of the value that they stand beside: an
//! input of 64.0 of eight bits is the real ½, a channel of 127.5 lies between two codes. Halves, and
//! the sums of fp16 layers, are the reals themselves. A `Float16` channel is in units of 2^−10, see
//! [`number::channel`].

pub mod embed;
pub mod number;
pub mod position;
pub mod sampler;
pub mod synthesizer;

use ntmu_isa::Asset;
use ntmu_isa::layer::Parameters;
use ntmu_isa::shape::{LaneFormat, OutputFormat};
use ntmu_model::Request;
use rayon::prelude::*;

pub use synthesizer::{RealLayer, Source};

/// The real numbers on every wire of one texel.
#[derive(Clone, Debug, PartialEq)]
pub struct RealTaps {
    /// The synthesizer's inputs, in units of 1/2^(bits − 1).
    pub inputs: Vec<f64>,
    /// Per layer; the last one's `outputs` are empty.
    pub layers: Vec<RealLayer>,
    /// Channels in their units, before the clamp to their formats.
    pub unclamped: Vec<f64>,
    /// Channels in their units, clamped to their formats.
    pub channels: Vec<f64>,
}

/// The naive decoder of one asset.
///
/// Methods that take a `layer` want one of the asset's, from 0; those that take values want one per
/// lane of the stage, as the asset's shapes say.
#[derive(Clone, Debug)]
pub struct Oracle<'a> {
    asset: &'a Asset,
    layers: Vec<synthesizer::Synthesizer>,
}

impl<'a> Oracle<'a> {
    /// The decoder of `asset`.
    #[must_use]
    pub fn new(asset: &'a Asset) -> Oracle<'a> {
        let layers = asset.layers.iter().enumerate();
        let layers = layers
            .map(|(index, layer)| synthesizer::Synthesizer::new(layer, asset.input_format(index)))
            .collect();
        Oracle { asset, layers }
    }

    /// The asset.
    #[must_use]
    pub fn asset(&self) -> &'a Asset {
        self.asset
    }

    /// The channels of a texel in their units, clamped to their formats, not rounded.
    #[must_use]
    pub fn texel(&self, request: Request) -> Vec<f64> {
        let unclamped = self.texel_unclamped(request);
        self.clamp_channels(&unclamped)
    }

    /// The channels of a texel in their units, neither clamped to their formats nor rounded.
    #[must_use]
    pub fn texel_unclamped(&self, request: Request) -> Vec<f64> {
        let inputs = self.inputs(request);
        // The outputs of every layer so far: a skip path may start at any of them.
        let mut outputs: Vec<Vec<f64>> = Vec::with_capacity(self.layers.len());
        for index in 0..self.layers.len() {
            let input = outputs.last().unwrap_or(&inputs);
            let accumulators = self.accumulators(index, input);
            let activated = self.activated(index, &accumulators);
            if index + 1 == self.layers.len() {
                return self.channels(&activated);
            }
            let source = self.asset.skip_source(index);
            let source = source.map(|from| outputs[from].as_slice());
            outputs.push(self.outputs(index, &activated, source));
        }
        Vec::new()
    }

    /// Everything that one texel makes visible on its way.
    #[must_use]
    pub fn taps(&self, request: Request) -> RealTaps {
        let inputs = self.inputs(request);
        let mut layers: Vec<RealLayer> = Vec::new();
        for index in 0..self.layers.len() {
            let input = layers.last().map_or(&inputs, |layer| &layer.outputs);
            let accumulators = self.accumulators(index, input);
            let activated = self.activated(index, &accumulators);
            let outputs = if index + 1 == self.layers.len() {
                Vec::new()
            } else {
                let source = self.asset.skip_source(index);
                let source = source.map(|from| layers[from].outputs.as_slice());
                self.outputs(index, &activated, source)
            };
            layers.push(RealLayer {
                accumulators,
                activated,
                outputs,
            });
        }
        let unclamped = layers
            .last()
            .map_or(Vec::new(), |last| self.channels(&last.activated));
        let channels = self.clamp_channels(&unclamped);
        RealTaps {
            inputs,
            layers,
            unclamped,
            channels,
        }
    }

    /// Every texel of a mip: `[row][column][channel]` in one vector, clamped, in channel units.
    #[must_use]
    pub fn mip(&self, mip: u8) -> Vec<f64> {
        let (width, height) = self.asset.shape.mip_size(mip);
        (0..height)
            .into_par_iter()
            .flat_map_iter(|y| {
                // Both coordinates come from the mip's own size.
                (0..width)
                    .filter_map(move |x| Request::new(&self.asset.shape, x, y, mip).ok())
                    .flat_map(|request| self.texel(request))
            })
            .collect()
    }

    /// The real inputs of the synthesizer at a texel, in units of 1/2^(bits − 1).
    #[must_use]
    pub fn inputs(&self, request: Request) -> Vec<f64> {
        let asset = self.asset;
        embed::inputs(&asset.shape, &asset.profile, &asset.grids, request)
    }

    /// The real weights of a row of a layer.
    #[must_use]
    pub fn row(&self, layer: usize, row: usize) -> &[f64] {
        self.layers[layer].row(row)
    }

    /// The real accumulators of a layer, given the register that it reads.
    #[must_use]
    pub fn accumulators(&self, layer: usize, input: &[f64]) -> Vec<f64> {
        self.layers[layer].accumulators(input)
    }

    /// The real accumulators after the activation, given the accumulators.
    #[must_use]
    pub fn activated(&self, layer: usize, accumulators: &[f64]) -> Vec<f64> {
        synthesizer::activated(&self.asset.layers[layer], accumulators)
    }

    /// The real output of a hidden layer, given its activated accumulators and the values at the
    /// start of its skip path, if it has one.
    #[must_use]
    pub fn outputs(&self, layer: usize, activated: &[f64], source: Option<&[f64]>) -> Vec<f64> {
        let source = self.source(layer, source);
        let (layer, profile) = (&self.asset.layers[layer], &self.asset.profile);
        synthesizer::outputs(layer, profile, activated, source)
    }

    /// Values at the start of a layer's skip path, with their zero point.
    #[must_use]
    pub fn source<'v>(&self, layer: usize, values: Option<&'v [f64]>) -> Option<Source<'v>> {
        let from = self.asset.skip_source(layer)?;
        let zero_point = match self.asset.layers[from].output_format() {
            LaneFormat::Integer { zero_point, .. } => f64::from(zero_point),
            LaneFormat::Half => 0.0,
        };
        let source = |values| Source { values, zero_point };
        values.map(source)
    }

    /// The channels in their units, given the last layer's activated accumulators; not clamped to
    /// their formats.
    #[must_use]
    pub fn channels(&self, activated: &[f64]) -> Vec<f64> {
        let Some(last) = self.asset.layers.last() else {
            return Vec::new();
        };
        let formats = self.asset.shape.outputs.iter().enumerate();
        formats
            .zip(activated)
            .map(|((row, &format), &a)| match &last.parameters {
                Parameters::Integer(p) => match format {
                    OutputFormat::Unorm8 | OutputFormat::Unorm16 | OutputFormat::Snorm8 => {
                        synthesizer::rescale(a, p.scales[row])
                    }
                    OutputFormat::Float16 => {
                        a * synthesizer::scale(p.scales[row]) * number::HALF_UNITS
                    }
                },
                Parameters::Half(_) => a * number::channel_units(format),
            })
            .collect()
    }

    /// Channels clamped to their formats.
    #[must_use]
    pub fn clamp_channels(&self, unclamped: &[f64]) -> Vec<f64> {
        let formats = self.asset.shape.outputs.iter();
        formats
            .zip(unclamped)
            .map(|(&format, &code)| {
                let (low, high) = number::channel_range(format);
                code.clamp(low, high)
            })
            .collect()
    }

    /// Channel codes in the units of the oracle's channels.
    #[must_use]
    pub fn code_units(&self, codes: &[i32]) -> Vec<f64> {
        let formats = self.asset.shape.outputs.iter();
        formats
            .zip(codes)
            .map(|(&format, &code)| number::channel(format, code))
            .collect()
    }
}
