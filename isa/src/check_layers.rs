//! What a validated asset promises of its layers.

use crate::accumulate::signed_range;
use crate::activation::{Activation, MAX_LEAK_SHIFT, TABLE_ENTRIES};
use crate::asset::{Parts, in_range};
use crate::error::AssetError;
use crate::layer::{HalfParameters, IntegerParameters, Layer, Parameters, Skip};
use crate::limits;
use crate::rescale::Multiplier;
use crate::shape::LaneFormat;

/// The scale of fp16 layers, which share one.
pub(crate) const ONE: Multiplier = Multiplier::power_of_two(0);

pub(crate) fn check_layers(parts: &Parts) -> Result<(), AssetError> {
    in_range(
        "weights.layers",
        parts.layers.len() as u64,
        1,
        u64::from(limits::MAX_LAYERS),
    )?;
    let mut lanes = parts.shape.input_count();
    let mut format = parts.shape.input_format();
    for (index, layer) in parts.layers.iter().enumerate() {
        Check {
            parts,
            index,
            layer,
        }
        .run(lanes, format)?;
        lanes = u32::from(layer.outputs);
        format = layer.output_format();
    }
    if lanes != u32::from(parts.shape.channel_count()) {
        let last = parts.layers.len() - 1;
        let channels = parts.shape.channel_count();
        return Err(AssetError::field(
            format!("weights.layer{last}.outputs"),
            lanes,
            format!("{channels}, the channels of the set"),
        ));
    }
    Ok(())
}

/// One layer, and where it stands.
struct Check<'a> {
    parts: &'a Parts,
    index: usize,
    layer: &'a Layer,
}

impl Check<'_> {
    fn field(&self, name: &str) -> String {
        format!("weights.layer{}.{name}", self.index)
    }

    fn refuse<T>(
        &self,
        name: &str,
        found: impl std::fmt::Display,
        allowed: impl std::fmt::Display,
    ) -> Result<T, AssetError> {
        Err(AssetError::field(self.field(name), found, allowed))
    }

    fn is_last(&self) -> bool {
        self.index + 1 == self.parts.layers.len()
    }

    fn run(&self, lanes: u32, input: LaneFormat) -> Result<(), AssetError> {
        let layer = self.layer;
        if u32::from(layer.inputs) != lanes {
            let allowed = format!("{lanes}, what the stage before it gives");
            return self.refuse("inputs", layer.inputs, allowed);
        }
        in_range(self.field("outputs"), layer.outputs, 1, limits::MAX_LANES)?;
        match &layer.parameters {
            Parameters::Integer(parameters) => self.integer(parameters, input)?,
            Parameters::Half(parameters) => self.half(parameters)?,
        }
        if self.is_last() {
            if layer.activation != Activation::Identity {
                let allowed = "identity, because it is the last layer";
                return self.refuse("activation", layer.activation.name(), allowed);
            }
            if layer.skip.is_some() {
                return self.refuse("skip", "a skip path", "none in the last layer");
            }
        }
        if let Activation::Leaky { shift } = layer.activation {
            in_range(self.field("leak_shift"), shift, 1, MAX_LEAK_SHIFT)?;
        }
        layer.skip.map_or(Ok(()), |skip| self.skip(skip))
    }

    fn counts(&self, counts: &[(&str, usize, usize)]) -> Result<(), AssetError> {
        counts
            .iter()
            .find(|(_, found, expected)| found != expected)
            .map_or(Ok(()), |(name, found, expected)| {
                self.refuse(name, found, expected)
            })
    }

    fn integer(&self, p: &IntegerParameters, input: LaneFormat) -> Result<(), AssetError> {
        if input == LaneFormat::Half {
            let allowed = "an fp16 layer, or a layer before it that gives integers";
            return self.refuse("kind", "an integer layer after halves", allowed);
        }
        let (low, high) = limits::WEIGHT_BITS;
        in_range(self.field("weight_bits"), p.weight_bits, low, high)?;
        let rows = usize::from(self.layer.outputs);
        let macs = self.layer.macs() as usize;
        self.counts(&[
            ("weights", p.weights.len(), macs),
            ("bias", p.bias.len(), rows),
            ("scales", p.scales.len(), rows),
        ])?;
        let (low, high) = signed_range(p.weight_bits);
        for &weight in &p.weights {
            in_range(self.field("weight"), i32::from(weight), low, high)?;
        }
        // A bias starts the accumulator, so it has to fit that too.
        let profile = &self.parts.profile;
        let (low, high) = signed_range(profile.bias_bits.min(profile.accumulator.bits));
        for &bias in &p.bias {
            in_range(self.field("bias"), bias, low, high)?;
        }
        let entries = match self.layer.activation {
            Activation::Table => TABLE_ENTRIES,
            Activation::Identity
            | Activation::Relu
            | Activation::Leaky { .. }
            | Activation::HardGelu { .. } => 0,
        };
        if p.table.len() != entries {
            return self.refuse("table", p.table.len(), entries);
        }
        if self.is_last() {
            in_range(self.field("output_bits"), p.output_bits, 8, 8)?;
            return in_range(self.field("zero_point"), p.zero_point, 0, 0);
        }
        self.lane("output_bits", p.output_bits, p.zero_point)
    }

    fn half(&self, p: &HalfParameters) -> Result<(), AssetError> {
        let rows = usize::from(self.layer.outputs);
        let macs = self.layer.macs() as usize;
        self.counts(&[
            ("weights", p.weights.len(), macs),
            ("bias", p.bias.len(), rows),
        ])?;
        for (name, halves) in [("weight", &p.weights), ("bias", &p.bias)] {
            if let Some(half) = halves.iter().find(|half| !half.is_finite()) {
                let found = format!("fp16 bits {:04x}", half.bits());
                return self.refuse(name, found, "a finite number");
            }
        }
        match self.layer.activation {
            Activation::Table => {
                return self.refuse("activation", "table", "none in an fp16 layer");
            }
            Activation::HardGelu { scale, .. } if scale != ONE => {
                return self.refuse("gate", "a scale", "one in an fp16 layer");
            }
            Activation::Identity
            | Activation::Relu
            | Activation::Leaky { .. }
            | Activation::HardGelu { .. } => {}
        }
        let Some(quantize) = p.quantize else {
            return Ok(());
        };
        if self.is_last() {
            return self.refuse("quantize", "integers", "none in the last layer");
        }
        let (low, high) = limits::QUANTIZE_EXPONENT;
        let exponent = self.field("quantize_exponent");
        in_range(exponent, quantize.exponent, low, high)?;
        self.lane("quantize_bits", quantize.bits, quantize.zero_point)
    }

    fn lane(&self, name: &str, bits: u8, zero_point: i16) -> Result<(), AssetError> {
        let (low, high) = limits::LANE_BITS;
        in_range(self.field(name), bits, low, high)?;
        let (low, high) = signed_range(bits);
        in_range(self.field("zero_point"), i32::from(zero_point), low, high)
    }

    fn skip(&self, skip: Skip) -> Result<(), AssetError> {
        in_range(self.field("skip_span"), skip.span, 1, limits::MAX_SKIP_SPAN)?;
        // The path starts at the output of the layer `span` before this one: never at the inputs
        // of the synthesizer, which have another width and no scale of their own.
        let source = self
            .index
            .checked_sub(usize::from(skip.span))
            .map(|from| &self.parts.layers[from]);
        let Some(source) = source.filter(|source| source.outputs == self.layer.outputs) else {
            let found = source.map_or("no such layer".to_owned(), |s| {
                format!("{} outputs", s.outputs)
            });
            let allowed = format!("{} outputs, like the layer itself", self.layer.outputs);
            return self.refuse("skip_source", found, allowed);
        };
        let is_half = source.output_format() == LaneFormat::Half;
        match (&self.layer.parameters, is_half) {
            (Parameters::Integer(_), false) => Ok(()),
            (Parameters::Half(_), true) if skip.scale == ONE => Ok(()),
            (Parameters::Half(_), true) => {
                self.refuse("skip_scale", "a scale", "one in an fp16 layer")
            }
            (Parameters::Integer(_), true) => {
                self.refuse("skip_source", "halves", "integers, like the layer itself")
            }
            (Parameters::Half(_), false) => {
                self.refuse("skip_source", "integers", "halves, like the layer itself")
            }
        }
    }
}
