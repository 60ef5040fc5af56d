//! The networks, their inputs and their codes, for other engines to compute.

use crate::support::{self, BATCH, KINDS, inputs};
use ntmu_isa::layer::{Layer, Parameters};
use ntmu_isa::rescale::Multiplier;
use ntmu_model::engine::Engine;
use serde_json::{Value, json};
use std::path::Path;

/// Writes `NAME.json`, `NAME.inputs` (signed bytes) and `NAME.codes` (bytes) for each network.
pub(crate) fn export(folder: &Path) {
    for kind in KINDS {
        let asset = support::asset(kind, 8);
        let layers: Vec<Value> = asset.layers.iter().map(layer).collect();
        let batch = inputs(&asset);
        let mut codes = vec![0; BATCH * kind.channels];
        Engine::new(&asset).synthesize(&batch, &mut codes);
        let write = |extension: &str, bytes: Vec<u8>| {
            std::fs::write(folder.join(format!("{}.{extension}", kind.name)), bytes).unwrap();
        };
        write("inputs", batch.iter().map(|&x| x as u8).collect());
        write("codes", codes.iter().map(|&code| code as u8).collect());
        let network = json!({
            "name": kind.name,
            "batch": BATCH,
            "macs": asset.macs(),
            "half": kind.is_half,
            "layers": layers,
        });
        write("json", network.to_string().into_bytes());
    }
}

fn layer(layer: &Layer) -> Value {
    let scale = |m: Multiplier| f64::from(m.mantissa()) * 2_f64.powi(-i32::from(m.shift()));
    let mut value = json!({
        "inputs": layer.inputs,
        "outputs": layer.outputs,
        "skip": layer.skip.map(|skip| json!({"span": skip.span, "scale": scale(skip.scale)})),
    });
    match &layer.parameters {
        Parameters::Integer(numbers) => {
            value["weights"] = json!(numbers.weights);
            value["bias"] = json!(numbers.bias);
            value["scales"] = numbers.scales.iter().map(|&m| json!(scale(m))).collect();
            value["zero_point"] = json!(numbers.zero_point);
        }
        Parameters::Half(numbers) => {
            value["weights"] = numbers.weights.iter().map(|w| json!(w.to_f32())).collect();
            value["bias"] = numbers.bias.iter().map(|b| json!(b.to_f32())).collect();
        }
    }
    value
}
