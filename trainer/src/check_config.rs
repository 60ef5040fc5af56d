//! What a valid configuration promises.

use crate::choices::{ActivationKind, Precision};
use crate::config::{BIAS_LIMIT, CHUNKS, TILE, TrainConfig, WIDEST};
use crate::error::TrainError;
use crate::plan::Plan;
use crate::topology::Topology;
use ntmu_isa::activation::MAX_LEAK_SHIFT;
use ntmu_isa::embed::MAX_OCTAVES;
use ntmu_isa::limits;

/// Bits of an integer that every half holds exactly: eleven of its significand and a sign.
const BITS_OF_HALF: u8 = 12;

impl TrainConfig {
    /// Whether every field is in range.
    ///
    /// # Errors
    /// The first field that is not.
    pub fn validate(&self) -> Result<(), TrainError> {
        self.check_shape()?;
        self.check_layers()?;
        self.check_numbers()?;
        self.check_training()
    }

    fn check_shape(&self) -> Result<(), TrainError> {
        for (index, grid) in self.grids.iter().enumerate() {
            let field = |name: &str| format!("grids[{index}].{name}");
            range(
                field("channels"),
                grid.channels,
                1,
                limits::MAX_GRID_CHANNELS,
            )?;
            let (low, high) = limits::LATENT_BITS;
            range(field("bits"), grid.bits, low, high)?;
            let (low, high) = limits::GRID_SCALE_LOG2;
            range(field("scale_log2"), grid.scale_log2, low, high)?;
        }
        range("octaves", self.octaves, 0, MAX_OCTAVES)?;
        range("padding", self.padding, 0, limits::MAX_PADDING)?;
        let (low, high) = limits::LANE_BITS;
        range("input_bits", self.input_bits, low, high)?;
        range("activation_bits", self.activation_bits, low, high)?;
        range(
            "inputs",
            self.input_count(),
            1,
            usize::from(limits::MAX_LANES),
        )
    }

    fn check_layers(&self) -> Result<(), TrainError> {
        if self.hidden.is_empty() {
            return Err(TrainError::config("hidden", "no layer", "at least one"));
        }
        for (index, &width) in self.hidden.iter().enumerate() {
            range(format!("hidden[{index}]"), width, 1, WIDEST)?;
        }
        range(
            "layers_per_block",
            self.layers_per_block,
            1,
            limits::MAX_SKIP_SPAN,
        )?;
        let layers = self.layer_count();
        range("layers", layers, 2, usize::from(limits::MAX_LAYERS))?;
        if let ActivationKind::Leaky { shift } = self.activation {
            range("activation.shift", shift, 1, MAX_LEAK_SHIFT)?;
        }
        let (low, high) = limits::WEIGHT_BITS;
        range("weight_bits", self.weight_bits, low, high)?;
        let listed = self.weight_bits_per_layer.iter().flatten();
        for (layer, &bits) in listed.enumerate() {
            range(format!("weight_bits_per_layer[{layer}]"), bits, low, high)?;
        }
        let lists = [
            (
                "precision_per_layer",
                self.precision_per_layer.as_ref().map(Vec::len),
            ),
            (
                "weight_bits_per_layer",
                self.weight_bits_per_layer.as_ref().map(Vec::len),
            ),
        ];
        for (field, length) in lists {
            match length {
                Some(length) if length != layers => {
                    let found = format!("{length} layers");
                    return Err(TrainError::config(field, found, layers.to_string()));
                }
                Some(_) | None => {}
            }
        }
        Ok(())
    }

    /// Whether training holds every number of the decode exactly, and the layers' registers fit.
    fn check_numbers(&self) -> Result<(), TrainError> {
        // How many channels there are matters to none of the checks.
        let topology = Topology::new(self, 1);
        for (index, layer) in topology.layers.iter().enumerate() {
            let (field, bits) = if index == 0 {
                ("input_bits", self.input_bits)
            } else {
                ("activation_bits", self.activation_bits)
            };
            let reads_halves = index > 0 && topology.writes_halves(index - 1);
            if !reads_halves {
                let most = match layer.precision {
                    Precision::Int8 => {
                        exact_bits(layer.inputs, self.weight_bits_of(index), index == 0)
                    }
                    // An activation without its zero point has one bit more.
                    Precision::Fp16 => BITS_OF_HALF - u8::from(index > 0),
                };
                let (low, high) = limits::LANE_BITS;
                if bits > most {
                    let allowed = format!(
                        "{low}..={} in front of layer {index}, {} inputs wide and {}",
                        most.min(high),
                        layer.inputs,
                        layer.precision.name()
                    );
                    return Err(TrainError::config(field, bits, allowed));
                }
            }
            let Some(span) = layer.skip else {
                continue;
            };
            let (source, halves) = (index - span, layer.precision == Precision::Fp16);
            if topology.writes_halves(source) != halves {
                let found = format!(
                    "layer {index} is {} and the layer after {source}, where its skip path \
                     starts, another",
                    layer.precision.name()
                );
                let allowed = "one precision from a skip path's start to its end";
                return Err(TrainError::config("precision_per_layer", found, allowed));
            }
        }
        Ok(())
    }

    fn check_training(&self) -> Result<(), TrainError> {
        range("encoder_width", self.encoder_width, 4, 512)?;
        multiple("encoder_width", u32::from(self.encoder_width), 2)?;
        check_crop("crop", self.crop)?;
        range("crops", self.crops, 1, 64)?;
        check_batch("batch", self.batch)?;
        range("uniform_mips", self.uniform_mips, 0.0, 1.0)?;
        range("encoder_rate", self.encoder_rate, 0.0, 1.0)?;
        range("latent_rate", self.latent_rate, 0.0, 1.0)?;
        range("synthesizer_rate", self.synthesizer_rate, 0.0, 1.0)?;
        range("checkpoint_every", self.checkpoint_every, 1, u64::MAX)?;
        range("effort", self.effort, 0, 100)?;
        range("rate_factor", self.rate_factor, 0.0, 10.0)?;
        for (map, &weight) in &self.weights {
            range(format!("weights.{map}"), weight, 0.0, 1e6)?;
        }
        let week = 7.0 * 24.0 * 3600.0;
        range("seconds", self.seconds.unwrap_or(1.0), 1.0, week)?;
        range("settle", self.settle.unwrap_or(0), 0, 100)?;
        range("target_psnr", self.target_psnr.unwrap_or(0.0), 0.0, 200.0)?;
        self.plan.as_ref().map_or(Ok(()), Plan::check)
    }
}

/// Whether crops may have this side.
pub(crate) fn check_crop(field: &str, crop: u32) -> Result<(), TrainError> {
    range(field, crop, 64, 4096)?;
    multiple(field, crop, 64)
}

/// Whether a step may have this many texels.
pub(crate) fn check_batch(field: &str, batch: u32) -> Result<(), TrainError> {
    range(field, batch, (CHUNKS * TILE) as u32, 1 << 22)?;
    multiple(field, batch, (CHUNKS * TILE) as u32)
}

/// The most bits of what an integer layer reads, so that bias and products stay below 2^24, where
/// training's floats are exact. `is_first`: inputs have no zero point, which spares a bit.
fn exact_bits(inputs: usize, weight_bits: u8, is_first: bool) -> u8 {
    let weight = (1_usize << (weight_bits - 1)) - 1;
    let room = (1 << 24) - 1 - BIAS_LIMIT as usize;
    let largest = room / (inputs * weight);
    // Inputs reach 2^(bits − 1), other values without their zero point 2^bits − 1.
    let bits = if is_first {
        largest.ilog2() + 1
    } else {
        (largest + 1).ilog2()
    };
    bits as u8
}

pub(crate) fn range<T: PartialOrd + std::fmt::Display>(
    field: impl Into<String>,
    found: T,
    low: T,
    high: T,
) -> Result<(), TrainError> {
    // A NaN fails both comparisons, as it should.
    if found >= low && found <= high {
        Ok(())
    } else {
        Err(TrainError::config(field, found, format!("{low}..={high}")))
    }
}

fn multiple(field: &str, found: u32, of: u32) -> Result<(), TrainError> {
    if found.is_multiple_of(of) {
        Ok(())
    } else {
        Err(TrainError::config(
            field,
            found,
            format!("a multiple of {of}"),
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_most_bits_keep_the_sum_below_two_to_the_24_and_one_more_does_not() {
        for (inputs, weight_bits) in (1..=1024).flat_map(|n| (2..=8).map(move |w| (n, w))) {
            let weight = (1_u64 << (weight_bits - 1)) - 1;
            let sum = |largest: u64| inputs as u64 * weight * largest + u64::from(BIAS_LIMIT);
            let bits = exact_bits(inputs, weight_bits, true);
            assert!(sum(1 << (bits - 1)) < 1 << 24 && sum(1 << bits) >= 1 << 24);
            let bits = exact_bits(inputs, weight_bits, false);
            assert!(sum((1 << bits) - 1) < 1 << 24 && sum((2 << bits) - 1) >= 1 << 24);
        }
        assert_eq!(exact_bits(usize::from(WIDEST), 8, false), 8);
        assert_eq!(
            [48, 57, 774, 775].map(|n| exact_bits(n, 8, true)),
            [12, 11, 8, 7]
        );
    }
}
