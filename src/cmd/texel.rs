//! `ntmu texel`: one texel, with every value on the way.

use crate::Verdict;
use crate::{console, files};
use ntmu::isa::latent::LatentFormat;
use ntmu::isa::layout::Layout;
use ntmu::isa::{Asset, Program};
use ntmu::model::Request;
use ntmu::model::exec::{Decoder, Taps};
use serde_json::{Value, json};
use std::path::PathBuf;

#[derive(clap::Args)]
pub(crate) struct Texel {
    /// The asset, an .ntx file.
    asset: PathBuf,
    /// Texel of the mip along x, from 0.
    x: u32,
    /// Texel of the mip along y, from 0.
    y: u32,
    /// The mip; 0 is the largest.
    mip: u8,
    /// Where the unit's memory keeps the grids.
    #[arg(long, default_value = "linear", value_parser = super::program::layout)]
    layout: Layout,
}

impl Texel {
    pub(crate) fn run(self, json: bool) -> anyhow::Result<Verdict> {
        let asset = files::read_asset(&self.asset)?;
        let request = Request::new(&asset.shape, self.x, self.y, self.mip)?;
        let program = Program::compile(&asset, self.layout);
        let taps = Decoder::new(&asset, &program).taps(request);
        if json {
            console::print_json(&describe(&asset, &taps))?;
        } else {
            print(&asset, &taps);
        }
        Ok(Verdict::Fine)
    }
}

fn values(codes: &[u8], format: LatentFormat) -> Vec<i32> {
    codes.iter().map(|&code| format.value(code)).collect()
}

fn describe(asset: &Asset, taps: &Taps) -> Value {
    let grids: Vec<Value> = taps
        .grids
        .iter()
        .enumerate()
        .map(|(g, tap)| {
            let shape = asset.shape.grids[g];
            let corners = &tap.corners;
            let cells: Vec<Value> = corners
                .cells()
                .iter()
                .zip(corners.weights())
                .zip(tap.codes.chunks(usize::from(shape.channels)))
                .enumerate()
                .map(|(c, (((column, row), weight), codes))| {
                    json!({
                        "column": column, "row": row, "weight_of_256": weight,
                        "address": tap.fetch.map(|f| f.addresses[c]),
                        "codes": codes, "values": values(codes, shape.format),
                    })
                })
                .collect();
            json!({
                "first": [corners.x.first, corners.y.first], "stride": corners.x.stride,
                "phase_of_16": [corners.x.phase, corners.y.phase], "corners": cells,
            })
        })
        .collect();
    let layers: Vec<Value> = taps
        .layers
        .iter()
        .map(|tap| {
            json!({
                "layer": tap.layer, "accumulators": tap.accumulators,
                "activated": tap.activated, "outputs": tap.outputs,
            })
        })
        .collect();
    let maps: Vec<Value> = asset
        .metadata
        .maps
        .iter()
        .map(|map| {
            let first = usize::from(map.first_channel);
            let codes = &taps.codes[first..first + usize::from(map.channel_count)];
            json!({ "map": map.name, "codes": codes })
        })
        .collect();
    json!({
        "x": taps.request.x(), "y": taps.request.y(), "mip": taps.request.mip(),
        "grids": grids, "inputs": taps.inputs, "layers": layers, "codes": taps.codes, "maps": maps,
    })
}

/// Numbers in rows of sixteen, each row led by the index of its first.
fn rows<T: std::fmt::Display>(numbers: &[T], width: usize) -> String {
    let mut text = String::new();
    for (row, numbers) in numbers.chunks(16).enumerate() {
        text.push_str(&format!("  {:>4} ", row * 16));
        for number in numbers {
            text.push_str(&format!(" {number:>width$}"));
        }
        text.push('\n');
    }
    text
}

fn print(asset: &Asset, taps: &Taps) {
    let request = taps.request;
    let mut text = format!(
        "texel ({}, {}) of mip {}\n",
        request.x(),
        request.y(),
        request.mip()
    );
    for (g, tap) in taps.grids.iter().enumerate() {
        let shape = asset.shape.grids[g];
        let (x, y) = (tap.corners.x, tap.corners.y);
        text.push_str(&format!(
            "\ngrid {g}: first corner ({}, {}), stride {}, phase ({}, {})/16\n",
            x.first, y.first, x.stride, x.phase, y.phase
        ));
        let codes = tap.codes.chunks(usize::from(shape.channels));
        for (c, ((cell, weight), codes)) in tap
            .corners
            .cells()
            .iter()
            .zip(tap.corners.weights())
            .zip(codes)
            .enumerate()
        {
            let address = tap.fetch.map_or(0, |f| f.addresses[c]);
            text.push_str(&format!(
                " cell ({}, {}) at byte {address}, weight {weight}/256, values\n{}",
                cell.0,
                cell.1,
                rows(&values(codes, shape.format), 4)
            ));
        }
    }
    text.push_str(&format!(
        "\ninputs, real = value/128\n{}",
        rows(&taps.inputs, 4)
    ));
    for tap in &taps.layers {
        let layer = &asset.layers[usize::from(tap.layer)];
        let activation = layer.activation.name();
        text.push_str(&format!(
            "\nlayer {}: {} → {}, {activation}\n accumulators\n{}",
            tap.layer,
            layer.inputs,
            layer.outputs,
            rows(&tap.accumulators, 9)
        ));
        if tap.activated != tap.accumulators {
            text.push_str(&format!(" activated\n{}", rows(&tap.activated, 9)));
        }
        if !tap.outputs.is_empty() {
            let zero_point = layer.zero_point;
            let skip = layer.skip.map_or(String::new(), |s| {
                format!(
                    ", with the skip path from layer {}",
                    usize::from(tap.layer) - usize::from(s.span)
                )
            });
            text.push_str(&format!(" outputs, zero at {zero_point}{skip}\n"));
            text.push_str(&rows(&tap.outputs, 4));
        }
    }
    text.push_str("\ncodes\n");
    for map in &asset.metadata.maps {
        let first = usize::from(map.first_channel);
        let codes = &taps.codes[first..first + usize::from(map.channel_count)];
        let codes: Vec<String> = codes.iter().map(ToString::to_string).collect();
        text.push_str(&format!("  {:<12} {}\n", map.name, codes.join(" ")));
    }
    console::print(&text);
}
