//! Stage: the names of the intermediate values of a texel, and where two runs part.

use ntmu_model::exec;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};
use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

/// What a grid makes visible.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum GridPart {
    /// First corner, stride, phase along x, then along y: 6 values.
    Position,
    /// Column and row of the corners (0,0), (1,0), (0,1), (1,1): 8 values.
    Cells,
    /// Codes of the corners, one corner after the other: 4 × channels.
    Codes,
}

/// What a layer makes visible.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum LayerPart {
    /// Bias plus products, one per row.
    Accumulators,
    /// The accumulators after the activation; for a hard GELU the gate's product.
    Activated,
    /// The values of the register; not in the last layer.
    Outputs,
}

/// One stage of the texel's journey; the order is that of the journey.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Stage {
    /// Of grid 0 or 1.
    Grid(u8, GridPart),
    /// The synthesizer's inputs, all lanes.
    Inputs,
    /// Of a layer, from 0.
    Layer(u8, LayerPart),
    /// The channel codes.
    Channels,
}

impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Stage::Grid(grid, GridPart::Position) => write!(f, "grid{grid}.position"),
            Stage::Grid(grid, GridPart::Cells) => write!(f, "grid{grid}.cells"),
            Stage::Grid(grid, GridPart::Codes) => write!(f, "grid{grid}.codes"),
            Stage::Inputs => f.write_str("inputs"),
            Stage::Layer(layer, LayerPart::Accumulators) => write!(f, "layer{layer}.accumulators"),
            Stage::Layer(layer, LayerPart::Activated) => write!(f, "layer{layer}.activated"),
            Stage::Layer(layer, LayerPart::Outputs) => write!(f, "layer{layer}.outputs"),
            Stage::Channels => f.write_str("channels"),
        }
    }
}

/// A name that is no stage's.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "stage {found:?}; allowed: grid0 or grid1 with .position .cells .codes, inputs, layer0 to \
     layer63 with .accumulators .activated .outputs, channels"
)]
pub struct StageError {
    /// The name.
    pub found: String,
}

impl FromStr for Stage {
    type Err = StageError;

    fn from_str(name: &str) -> Result<Stage, StageError> {
        let parse = || {
            if let Some((owner, part)) = name.split_once('.') {
                if let Some(grid) = owner.strip_prefix("grid") {
                    let part = match part {
                        "position" => GridPart::Position,
                        "cells" => GridPart::Cells,
                        "codes" => GridPart::Codes,
                        _ => return None,
                    };
                    return Some(Stage::Grid(grid.parse().ok().filter(|&g| g < 2)?, part));
                }
                let layer = owner
                    .strip_prefix("layer")?
                    .parse()
                    .ok()
                    .filter(|&l| l < 64)?;
                let part = match part {
                    "accumulators" => LayerPart::Accumulators,
                    "activated" => LayerPart::Activated,
                    "outputs" => LayerPart::Outputs,
                    _ => return None,
                };
                return Some(Stage::Layer(layer, part));
            }
            match name {
                "inputs" => Some(Stage::Inputs),
                "channels" => Some(Stage::Channels),
                _ => None,
            }
        };
        // `parse` takes "01" and "+1" for 1; a name has one spelling.
        let stage: Option<Stage> = parse();
        stage
            .filter(|stage| stage.to_string() == name)
            .ok_or_else(|| StageError {
                found: name.to_owned(),
            })
    }
}

impl Serialize for Stage {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        to.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Stage {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Stage, D::Error> {
        String::deserialize(from)?.parse().map_err(D::Error::custom)
    }
}

/// Intermediate values of one texel by stage, in the order of the journey. A device may offer any
/// subset.
pub type Taps = BTreeMap<Stage, Vec<i64>>;

/// Where two runs of a texel part.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Divergence {
    /// The first stage with a difference.
    pub stage: Stage,
    /// The first lane of the stage with a difference.
    pub lane: usize,
    /// The value there; none where the stage should have ended.
    pub expected: Option<i64>,
    /// The value found there; none where it ends too early.
    pub found: Option<i64>,
}

/// The first difference in the stages that both runs have, if there is one.
#[must_use]
pub fn first_divergence(expected: &Taps, found: &Taps) -> Option<Divergence> {
    expected.iter().find_map(|(stage, expected)| {
        let found = found.get(stage)?;
        let lanes = expected.len().max(found.len());
        let lane = (0..lanes).find(|&lane| expected.get(lane) != found.get(lane))?;
        let (expected, found) = (expected.get(lane).copied(), found.get(lane).copied());
        Some(Divergence {
            stage: *stage,
            lane,
            expected,
            found,
        })
    })
}

/// The model's taps by stage.
#[must_use]
pub fn from_model(taps: &exec::Taps) -> Taps {
    let wide = |values: &[i32]| values.iter().map(|&v| i64::from(v)).collect::<Vec<i64>>();
    let mut stages = Taps::new();
    for (grid, tap) in (0..).zip(&taps.grids) {
        let axes = [tap.corners.x, tap.corners.y];
        let position = axes.iter().flat_map(|axis| {
            [
                i64::from(axis.first),
                i64::from(axis.stride),
                i64::from(axis.phase),
            ]
        });
        stages.insert(Stage::Grid(grid, GridPart::Position), position.collect());
        let cells = tap.corners.cells().into_iter();
        let cells = cells.flat_map(|(column, row)| [i64::from(column), i64::from(row)]);
        stages.insert(Stage::Grid(grid, GridPart::Cells), cells.collect());
        let codes = tap.codes.iter().map(|&code| i64::from(code));
        stages.insert(Stage::Grid(grid, GridPart::Codes), codes.collect());
    }
    let inputs = taps.inputs.iter().map(|&value| i64::from(value));
    stages.insert(Stage::Inputs, inputs.collect());
    for tap in &taps.layers {
        // A synthesizer has at most 64 layers.
        let layer = tap.layer as u8;
        let part = |part| Stage::Layer(layer, part);
        stages.insert(part(LayerPart::Accumulators), wide(&tap.accumulators));
        stages.insert(part(LayerPart::Activated), wide(&tap.activated));
        if !tap.outputs.is_empty() {
            let outputs = tap.outputs.iter().map(|&value| i64::from(value));
            stages.insert(part(LayerPart::Outputs), outputs.collect());
        }
    }
    stages.insert(Stage::Channels, wide(&taps.codes));
    stages
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_has_one_spelling_and_returns() {
        let grids = [GridPart::Position, GridPart::Cells, GridPart::Codes];
        let layers = [
            LayerPart::Accumulators,
            LayerPart::Activated,
            LayerPart::Outputs,
        ];
        let stages = grids
            .into_iter()
            .flat_map(|part| [0, 1].map(|grid| Stage::Grid(grid, part)));
        let stages = stages.chain(
            layers
                .into_iter()
                .flat_map(|p| (0..64).map(move |l| Stage::Layer(l, p))),
        );
        for stage in stages.chain([Stage::Inputs, Stage::Channels]) {
            assert_eq!(stage.to_string().parse(), Ok(stage));
        }
        for name in [
            "grid2.codes",
            "layer64.outputs",
            "layer01.outputs",
            "layer+1.outputs",
            "grid0",
            "x",
        ] {
            assert!(name.parse::<Stage>().is_err(), "{name}");
        }
    }

    #[test]
    fn the_first_divergence_is_the_earliest_stage_and_a_missing_stage_is_none() {
        let early = Stage::Layer(2, LayerPart::Outputs);
        let late = Stage::Layer(10, LayerPart::Accumulators);
        let expected = Taps::from([
            (late, vec![1, 2]),
            (early, vec![3, 4]),
            (Stage::Inputs, vec![9]),
        ]);
        let found = Taps::from([(late, vec![0, 0]), (early, vec![3])]);
        let divergence = first_divergence(&expected, &found);
        let at_end = Divergence {
            stage: early,
            lane: 1,
            expected: Some(4),
            found: None,
        };
        assert_eq!(divergence, Some(at_end));
        assert_eq!(first_divergence(&expected, &Taps::new()), None);
    }
}
