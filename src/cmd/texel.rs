//! `ntmu texel`: one texel, with every value on the way.

use super::profile::ProfileChoice;
use crate::Verdict;
use crate::{console, files};
use ntmu::isa::half::Half;
use ntmu::isa::latent::LatentFormat;
use ntmu::isa::layout::Layout;
use ntmu::isa::shape::LaneFormat;
use ntmu::isa::{Asset, Program};
use ntmu::model::Request;
use ntmu::model::exec::{Decoder, Taps};
use ntmu::precision;
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
    /// Where the unit's memory keeps the grids: linear, tiles-4, tiles-4-rows, morton, super-4, … (other
    /// sides are 2, 8 and 16), alone or with +planar or +together.
    #[arg(long, default_value_t = Layout::LINEAR)]
    layout: Layout,
    #[command(flatten)]
    profile: ProfileChoice,
}

impl Texel {
    pub(crate) fn run(self, json: bool) -> anyhow::Result<Verdict> {
        let asset = self.profile.apply(files::read_asset(&self.asset)?)?;
        let request = Request::new(&asset.shape, self.x, self.y, self.mip)?;
        self.layout.check(&asset.shape)?;
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
                "level": corners.level, "first": [corners.x.first, corners.y.first], "stride": corners.x.stride,
                "phase_of_16": [corners.x.phase, corners.y.phase], "corners": cells,
            })
        })
        .collect();
    let layers: Vec<Value> = taps
        .layers
        .iter()
        .map(|tap| {
            let layer = &asset.layers[usize::from(tap.layer)];
            let is_half = layer.half().is_some();
            json!({
                "layer": tap.layer, "precision": precision::of_layer(asset, usize::from(tap.layer)),
                "accumulators": Sums(&tap.accumulators, is_half).json(),
                "activated": Sums(&tap.activated, is_half).json(),
                "outputs": Lanes(&tap.outputs, layer.output_format()).json(),
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
        "profile": asset.profile.identity(),
        "grids": grids, "inputs": taps.inputs, "layers": layers, "codes": taps.codes, "maps": maps,
    })
}

/// The accumulators of a layer; those of an fp16 layer are the bits of f32 numbers.
struct Sums<'a>(&'a [i32], bool);

impl Sums<'_> {
    fn reals(&self) -> Vec<f32> {
        let bits = self.0.iter().map(|&sum| sum as u32);
        bits.map(f32::from_bits).collect()
    }

    fn json(&self) -> Value {
        if self.1 {
            json!(self.reals())
        } else {
            json!(self.0)
        }
    }

    fn rows(&self) -> String {
        if self.1 {
            rows(&self.reals(), 14)
        } else {
            rows(self.0, 9)
        }
    }
}

/// The lanes of a register; halves are bits of binary16 numbers.
struct Lanes<'a>(&'a [i16], LaneFormat);

impl Lanes<'_> {
    fn halves(&self) -> Vec<f32> {
        let bits = self.0.iter().map(|&lane| lane as u16);
        bits.map(|bits| Half::from_bits(bits).to_f32()).collect()
    }

    fn json(&self) -> Value {
        match self.1 {
            LaneFormat::Integer { .. } => json!(self.0),
            LaneFormat::Half => json!(self.halves()),
        }
    }

    fn rows(&self) -> String {
        match self.1 {
            LaneFormat::Integer { bits: 0..=8, .. } => rows(self.0, 4),
            LaneFormat::Integer { .. } => rows(self.0, 6),
            LaneFormat::Half => rows(&self.halves(), 14),
        }
    }
}

/// Numbers in rows, each row led by the index of its first.
fn rows<T: std::fmt::Display>(numbers: &[T], width: usize) -> String {
    let mut text = String::new();
    let columns = if width > 9 { 8 } else { 16 };
    for (row, numbers) in numbers.chunks(columns).enumerate() {
        text.push_str(&format!("  {:>4} ", row * columns));
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
        let level = if asset.shape.level_count() > 1 {
            format!(", level {}", tap.corners.level)
        } else {
            String::new()
        };
        text.push_str(&format!(
            "\ngrid {g}{}: first corner ({}, {}), stride {}, phase ({}, {})/16\n",
            level, x.first, y.first, x.stride, x.phase, y.phase
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
        "\ninputs, real = value/{}\n{}",
        1 << (asset.shape.input_bits - 1),
        Lanes(&taps.inputs, asset.shape.input_format()).rows()
    ));
    for tap in &taps.layers {
        let layer = &asset.layers[usize::from(tap.layer)];
        let activation = layer.activation.name();
        text.push_str(&format!(
            "\nlayer {}: {} → {}, {activation}\n accumulators\n{}",
            tap.layer,
            layer.inputs,
            layer.outputs,
            Sums(&tap.accumulators, layer.half().is_some()).rows()
        ));
        if tap.activated != tap.accumulators {
            let activated = Sums(&tap.activated, layer.half().is_some());
            text.push_str(&format!(" activated\n{}", activated.rows()));
        }
        if !tap.outputs.is_empty() {
            let skip = layer.skip.map_or(String::new(), |s| {
                format!(
                    ", with the skip path from layer {}",
                    usize::from(tap.layer) - usize::from(s.span)
                )
            });
            let format = layer.output_format();
            let zero = match format {
                LaneFormat::Integer { zero_point, .. } => format!(", zero at {zero_point}"),
                LaneFormat::Half => String::new(),
            };
            text.push_str(&format!(" outputs{zero}{skip}\n"));
            text.push_str(&Lanes(&tap.outputs, format).rows());
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
