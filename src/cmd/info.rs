//! `ntmu info`: what an asset holds.

use crate::Verdict;
use crate::{console, files};
use ntmu::isa::Asset;
use ntmu::isa::shape::{LaneFormat, Shape};
use ntmu::precision;
use serde_json::json;
use std::ops::RangeInclusive;
use std::path::PathBuf;

#[derive(clap::Args)]
pub(crate) struct Info {
    /// The asset, an .ntx file.
    asset: PathBuf,
}

impl Info {
    pub(crate) fn run(self, json: bool) -> anyhow::Result<Verdict> {
        let asset = files::read_asset(&self.asset)?;
        if json {
            console::print_json(&describe(&asset))?;
        } else {
            print(&asset);
        }
        Ok(Verdict::Fine)
    }
}

fn describe(asset: &Asset) -> serde_json::Value {
    let shape = &asset.shape;
    let grids: Vec<_> = (0..2)
        .map(|g| {
            let (width, height) = shape.grid_size(g);
            let levels: Vec<_> = levels(shape)
                .map(|(level, mips)| {
                    let (width, height) = shape.level_size(g, level);
                    json!({
                        "width": width, "height": height,
                        "first_mip": mips.start(), "last_mip": mips.end(),
                    })
                })
                .collect();
            json!({
                "width": width, "height": height, "channels": shape.grids[g].channels,
                "bits": shape.grids[g].format.bits(), "scale_log2": shape.grids[g].scale_log2,
                "sampling": shape.grids[g].sampling.name(), "levels": levels,
            })
        })
        .collect();
    let layers: Vec<_> = asset
        .layers
        .iter()
        .enumerate()
        .map(|(index, l)| {
            json!({
                "inputs": l.inputs, "outputs": l.outputs, "activation": l.activation.name(),
                "precision": precision::of_layer(asset, index), "output": register(l.output_format()),
                "skip_span": l.skip.map(|s| s.span), "macs": l.macs(),
            })
        })
        .collect();
    let maps: Vec<_> = asset
        .metadata
        .maps
        .iter()
        .map(|m| {
            json!({
                "name": m.name, "first_channel": m.first_channel, "channels": m.channel_count,
                "encoding": m.encoding.name(), "bit_depth": m.bit_depth,
            })
        })
        .collect();
    let profile = &asset.profile;
    json!({
        "name": asset.metadata.name, "width": shape.width, "height": shape.height,
        "mips": shape.mip_count, "channels": shape.channel_count(), "maps": maps,
        "grids": grids, "octaves": shape.octaves, "corner_snap": shape.snap.name(),
        "address_mode": shape.address_mode.name(), "inputs": shape.input_count(),
        "pyramid": { "first": shape.pyramid.first(), "each": shape.pyramid.each() },
        "wave": shape.wave.name(), "padding": shape.padding, "input_bits": shape.input_bits,
        "precision": precision::of_asset(asset), "layers": layers,
        "macs_per_texel": asset.macs(),
        "grid_bytes": asset.grid_bits().div_ceil(8),
        "parameter_bytes": asset.parameter_bits().div_ceil(8),
        "bppc": ntmu::quality::bppc(asset),
        "profile": { "identity": profile.identity(), "choices": profile },
        "record": asset.metadata.record.iter().map(|(k, v)| json!([k, v])).collect::<Vec<_>>(),
    })
}

/// The levels of the grids, each with the mips that it serves.
fn levels(shape: &Shape) -> impl Iterator<Item = (u8, RangeInclusive<u8>)> {
    let pyramid = shape.pyramid;
    let mips = || 0..shape.mip_count;
    (0..shape.level_count()).filter_map(move |level| {
        let mut served = mips().filter(|&mip| pyramid.level_of(mip) == level);
        let first = served.next()?;
        Some((level, first..=served.next_back().unwrap_or(first)))
    })
}

fn register(format: LaneFormat) -> String {
    match format {
        LaneFormat::Integer { bits, zero_point } => format!("{bits} bits about {zero_point}"),
        LaneFormat::Half => "halves".to_owned(),
    }
}

fn print(asset: &Asset) {
    let shape = &asset.shape;
    let mut facts = console::table(&["asset", "", ""]);
    let mut fact = |name: &str, value: String, unit: &str| {
        facts.add_row([name.to_owned(), value, unit.to_owned()]);
    };
    fact("name", asset.metadata.name.clone(), "");
    fact(
        "size",
        format!("{} × {}", shape.width, shape.height),
        "texels",
    );
    fact("mips", shape.mip_count.to_string(), "");
    fact("channels", shape.channel_count().to_string(), "");
    for g in 0..2 {
        let (width, height) = shape.grid_size(g);
        let grid = shape.grids[g];
        let size = format!("{width} × {height} × {}", grid.channels);
        fact(
            &format!("grid {g}"),
            size,
            &format!("latents of {} bits", grid.format.bits()),
        );
    }
    for (level, mips) in levels(shape).filter(|_| shape.level_count() > 1) {
        let [grid0, grid1] = [0, 1].map(|g| {
            let (width, height) = shape.level_size(g, level);
            format!("{width} × {height}")
        });
        let (first, last) = mips.into_inner();
        fact(
            &format!("level {level} of the grids"),
            format!("{grid0}, {grid1}"),
            &format!("cells, for mips {first} to {last}"),
        );
    }
    fact(
        "synthesizer",
        asset.macs().to_string(),
        "multiplications per texel",
    );
    fact(
        "precision",
        precision::of_asset(asset),
        "bits of weights and activations",
    );
    fact("profile", asset.profile.identity(), "");
    fact("grids", asset.grid_bits().div_ceil(8).to_string(), "bytes");
    fact(
        "parameters",
        asset.parameter_bits().div_ceil(8).to_string(),
        "bytes",
    );
    fact(
        "rate",
        format!("{:.4}", ntmu::quality::bppc(asset)),
        "bits per pixel and channel",
    );
    fact("corner snap", shape.snap.name().to_owned(), "");
    fact("address mode", shape.address_mode.name().to_owned(), "");
    console::print(&facts.to_string());

    let mut maps = console::table(&["map", "channels", "encoding", "bits"]);
    for map in &asset.metadata.maps {
        let last = map.first_channel + map.channel_count - 1;
        let channels = format!("{}..={last}", map.first_channel);
        let encoding = map.encoding.name().to_owned();
        maps.add_row([
            map.name.clone(),
            channels,
            encoding,
            map.bit_depth.to_string(),
        ]);
    }
    console::print(&maps.to_string());

    let mut layers = console::table(&[
        "layer",
        "in",
        "out",
        "numbers",
        "activation",
        "output",
        "skip from",
    ]);
    for (index, layer) in asset.layers.iter().enumerate() {
        let skip = layer
            .skip
            .map_or("".to_owned(), |s| (index - usize::from(s.span)).to_string());
        layers.add_row([
            index.to_string(),
            layer.inputs.to_string(),
            layer.outputs.to_string(),
            precision::of_layer(asset, index),
            layer.activation.name().to_owned(),
            register(layer.output_format()),
            skip,
        ]);
    }
    console::print(&layers.to_string());
    if !asset.metadata.record.is_empty() {
        let mut record = console::table(&["training record", ""]);
        for (key, value) in &asset.metadata.record {
            record.add_row([key, value]);
        }
        console::print(&record.to_string());
    }
}
