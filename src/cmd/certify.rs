//! `ntmu certify`: what is proven of an asset.

use super::profile::ProfileChoice;
use crate::Verdict;
use crate::{console, files};
use anyhow::Context as _;
use ntmu::conformance::certificate::{Certificate, HEADINGS, Sums, witness};
use ntmu::isa::Asset;
use serde_json::{Value, json};
use std::path::PathBuf;

/// For every content of the grids and every texel: how wide each layer's accumulators have to be,
/// whether its rescalings keep what their arithmetic asks for, and how far each channel may lie
/// from the real-valued network. Exit code 1 where a sum may leave its width or a rescaling is not
/// safe.
#[derive(clap::Args)]
pub(crate) struct Certify {
    /// The asset, an .ntx file.
    asset: PathBuf,
    /// Also write the asset with other latents, which need every bit of the width that is certified
    /// for the first layer.
    #[arg(long, value_name = "FILE")]
    witness: Option<PathBuf>,
    #[command(flatten)]
    profile: ProfileChoice,
}

impl Certify {
    pub(crate) fn run(self, json: bool) -> anyhow::Result<Verdict> {
        let asset = self.profile.apply(files::read_asset(&self.asset)?)?;
        let certificate = Certificate::of(&asset);
        let witness = self.write_witness(&asset)?;
        if json {
            let mut value = serde_json::to_value(&certificate)?;
            value["witness"] = witness;
            console::print_json(&value)?;
        } else {
            print(&certificate, &witness);
        }
        Ok(
            if certificate.is_free_of_overflow() && rescales_are_safe(&certificate) {
                Verdict::Fine
            } else {
                Verdict::Failed
            },
        )
    }

    fn write_witness(&self, asset: &Asset) -> anyhow::Result<Value> {
        let Some(path) = &self.witness else {
            return Ok(Value::Null);
        };
        let found = witness(asset).context(
            "no witness: the first layer has no integer sums, or its grids are too small",
        )?;
        files::write(path, &found.asset.to_bytes())?;
        Ok(json!({
            "file": path.display().to_string(),
            "x": found.request.x(), "y": found.request.y(), "mip": found.request.mip(),
            "row": found.extreme.row, "after_products": found.extreme.steps,
            "sum": found.extreme.sum,
        }))
    }
}

fn rescales_are_safe(certificate: &Certificate) -> bool {
    certificate.layers.iter().all(|layer| match &layer.sums {
        Sums::Integer(sums) => sums.rescales_are_safe,
        Sums::Half(_) => true,
    })
}

fn print(certificate: &Certificate, witness: &Value) {
    let mut table = console::table(&HEADINGS);
    for row in certificate.rows() {
        table.add_row(row);
    }
    console::print(&table.to_string());
    console::print(&certificate.channel_lines().join("\n"));
    console::print(&format!("profile {}", certificate.profile));
    if !witness.is_null() {
        console::print(&format!(
            "{}: texel ({}, {}) of mip {} reaches {} in row {} after {} products",
            witness["file"],
            witness["x"],
            witness["y"],
            witness["mip"],
            witness["sum"],
            witness["row"],
            witness["after_products"]
        ));
    }
}
