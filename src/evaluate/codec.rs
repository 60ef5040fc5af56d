//! Codec: one way of coding a set, at one rate. All that decides the result is in it.

use crate::rival::astc::{AstcQuality, Block};
use crate::rival::packing::Scalars;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fmt;

/// How much work a neural codec spends: a number from 0 to 100, or a name the trainer knows.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Effort {
    /// 0 to 100.
    Number(u8),
    /// `medium`, `exhaustive`, …
    Name(String),
}

/// A neural codec.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Neural {
    /// The shape, by name: `cntc-16`, `ntc-0.5`, …
    pub preset: String,
    /// The preset's own where left out.
    pub effort: Option<Effort>,
    /// The name of a training plan in the place of the effort's: `paper-short`, `ntc`, …
    pub plan: Option<String>,
    /// The arithmetic of every layer, by name; the preset's own where left out.
    pub precision: Option<String>,
    /// What computes the training steps in reals, by name, where it is not the processor: bits and
    /// identities depend on it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub backend: Option<String>,
    /// Fields of the training configuration that replace the preset's.
    pub config: BTreeMap<String, serde_json::Value>,
    /// The seed of every random choice.
    pub seed: u64,
}

impl Neural {
    /// Whether weights have other bits than the preset's.
    pub(super) fn sets_weight_bits(&self) -> bool {
        let fields = ["weight_bits", "weight_bits_per_layer"];
        fields.iter().any(|&field| self.config.contains_key(field))
    }
}

/// One way of coding a set, at one rate.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "codec", rename_all = "kebab-case")]
pub enum Codec {
    /// Grids and a synthesizer, trained.
    Neural(Neural),
    /// ASTC by Arm's encoder.
    Astc {
        /// The block's size.
        block: Block,
        /// The encoder's effort.
        quality: AstcQuality,
    },
    /// BC4, BC5 and BC7.
    Bc {
        /// What becomes of scalar maps.
        scalars: Scalars,
    },
}

impl fmt::Display for Codec {
    /// The name of the point on its curve: `cntc-16`, `astc-8x8`, `bc-alone`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Codec::Neural(neural) => f.write_str(&neural.preset),
            Codec::Astc { block, .. } => write!(f, "astc-{block}"),
            Codec::Bc { scalars } => match scalars {
                Scalars::Together => f.write_str("bc-together"),
                Scalars::Alone => f.write_str("bc-alone"),
            },
        }
    }
}
