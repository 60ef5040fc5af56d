//! Oracle: the real-number truth about an asset.
//!
//! A decoder in `f64`, written from the paper (Method) and DESIGN, naive enough to be checked by
//! eye. It reads an asset's data (codes, weights, multipliers, zero points, enums) and computes
//! everything from them itself: nothing here calls arithmetic of `isa` or `model`.
//!
//! What is *definition* is kept: where samples lie (`phase` is a whole number of sixteenths, see
//! [`position`]) and the clamps of the deployed network (an input or activation is in −128..=127,
//! a hard GELU's argument in −32768..=32767, a rescaled value in 32 bits, a channel in its format).
//! What is *rounding* is left out, every one of them; so `model − oracle` is rounding and nothing
//! else, and [`crate::bound`] says how much of it there may be.
//!
//! All numbers are in units of the least significant bit of the value that they stand beside: an
//! input of 64.0 is the real ½, a channel of 127.5 lies between two codes.

pub mod embed;
pub mod position;
pub mod synthesizer;

use ntmu_isa::Asset;
use ntmu_model::Request;
use rayon::prelude::*;

pub use synthesizer::RealLayer;

/// The real numbers on every wire of one texel.
#[derive(Clone, Debug, PartialEq)]
pub struct RealTaps {
    /// The synthesizer's inputs, in units of 1/128.
    pub inputs: Vec<f64>,
    /// Per layer; the last one's `outputs` are empty.
    pub layers: Vec<RealLayer>,
    /// Channels in code units, before the clamp to their formats.
    pub unclamped: Vec<f64>,
    /// Channels in code units, clamped to their formats.
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
        let layers = asset
            .layers
            .iter()
            .map(synthesizer::Synthesizer::new)
            .collect();
        Oracle { asset, layers }
    }

    /// The asset.
    #[must_use]
    pub fn asset(&self) -> &'a Asset {
        self.asset
    }

    /// The channels of a texel in code units, clamped to their formats, not rounded.
    #[must_use]
    pub fn texel(&self, request: Request) -> Vec<f64> {
        let unclamped = self.texel_unclamped(request);
        self.clamp_channels(&unclamped)
    }

    /// The channels of a texel in code units, neither clamped to their formats nor rounded.
    #[must_use]
    pub fn texel_unclamped(&self, request: Request) -> Vec<f64> {
        let inputs = embed::inputs(&self.asset.shape, &self.asset.grids, request);
        // The outputs of every layer so far: a skip path may start at any of them.
        let mut outputs: Vec<Vec<f64>> = Vec::with_capacity(self.layers.len());
        for index in 0..self.layers.len() {
            let input = outputs.last().unwrap_or(&inputs);
            let accumulators = self.accumulators(index, input);
            let activated = self.activated(index, &accumulators);
            if index + 1 == self.layers.len() {
                return self.channels(&activated);
            }
            let source = self.skip_source(index).map(|from| outputs[from].as_slice());
            outputs.push(self.outputs(index, &activated, source));
        }
        Vec::new()
    }

    /// Everything that one texel makes visible on its way.
    #[must_use]
    pub fn taps(&self, request: Request) -> RealTaps {
        let inputs = embed::inputs(&self.asset.shape, &self.asset.grids, request);
        let mut layers: Vec<RealLayer> = Vec::new();
        for index in 0..self.layers.len() {
            let input = layers.last().map_or(&inputs, |layer| &layer.outputs);
            let accumulators = self.accumulators(index, input);
            let activated = self.activated(index, &accumulators);
            let outputs = if index + 1 == self.layers.len() {
                Vec::new()
            } else {
                let source = self
                    .skip_source(index)
                    .map(|from| layers[from].outputs.as_slice());
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

    /// Every texel of a mip: `[row][column][channel]` in one vector, clamped, in code units.
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

    /// The real inputs of the synthesizer at a texel, in units of 1/128.
    #[must_use]
    pub fn inputs(&self, request: Request) -> Vec<f64> {
        embed::inputs(&self.asset.shape, &self.asset.grids, request)
    }

    /// The real accumulators of a layer, given its own input.
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
        let source = self
            .skip_source(layer)
            .zip(source)
            .map(|(from, values)| (values, f64::from(self.asset.layers[from].zero_point)));
        synthesizer::outputs(&self.asset.layers[layer], activated, source)
    }

    /// The channels in code units, given the last layer's activated accumulators; not clamped to
    /// their formats.
    #[must_use]
    pub fn channels(&self, activated: &[f64]) -> Vec<f64> {
        self.asset
            .layers
            .last()
            .map_or(Vec::new(), |last| synthesizer::rescaled(last, activated))
    }

    /// Channels clamped to their formats.
    #[must_use]
    pub fn clamp_channels(&self, unclamped: &[f64]) -> Vec<f64> {
        let formats = self.asset.shape.outputs.iter();
        formats
            .zip(unclamped)
            .map(|(format, &code)| {
                let (low, high) = format.range();
                code.clamp(f64::from(low), f64::from(high))
            })
            .collect()
    }

    /// The layer whose outputs are the start of a layer's skip path: a span of 2 adds the input of
    /// the layer before, which is the output of the layer two before.
    #[must_use]
    pub fn skip_source(&self, layer: usize) -> Option<usize> {
        let skip = self.asset.layers[layer].skip?;
        layer.checked_sub(usize::from(skip.span))
    }
}

/// Integers as reals, to hand a stage its own integer input.
#[must_use]
pub fn reals<T: Copy + Into<f64>>(values: &[T]) -> Vec<f64> {
    values.iter().map(|&value| value.into()).collect()
}
