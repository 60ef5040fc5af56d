//! Claims: what is promised of the model, and what was observed of it.
//!
//! 1. The model is the specification: every tap equals [`crate::naive`]'s, always.
//! 2. Stage by stage, given the stage's own input, it lies within the stage's bound of the oracle.
//! 3. End to end it lies within the worst case, and its root mean square is about the predicted one.
//!
//! The second and third are claims about rounding: they are not made of a row, or of a texel, whose
//! sums went beyond their width, which [`crate::naive`] reports.

use crate::bound::{stage, typical, worst};
use crate::naive::{self, Overflow};
use crate::oracle::{Oracle, RealTaps, number};
use crate::stage::{Divergence, GridPart, LayerPart, Stage, first_divergence, from_model};
use ntmu_isa::layout::Layout;
use ntmu_isa::{Asset, Program};
use ntmu_model::Request;
use ntmu_model::exec::{Decoder, Taps};
use rayon::prelude::*;
use serde::Serialize;
use std::collections::BTreeMap;

/// How far a stage of the model lies from the oracle, at the lane that uses most of its bound.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Distance {
    /// The lane.
    pub lane: usize,
    /// |model − oracle|.
    pub found: f64,
    /// What is admissible there.
    pub bound: f64,
}

impl Distance {
    /// The part of the bound that is used; 0 where the model is exact, infinite where it should be
    /// and is not.
    #[must_use]
    pub fn share(&self) -> f64 {
        if self.found == 0.0 {
            0.0
        } else {
            self.found / self.bound
        }
    }

    fn of(model: &[f64], oracle: &[f64], bounds: &[f64], skipped: &[usize]) -> Distance {
        let mut most = Distance::default();
        let lanes = model.iter().zip(oracle).zip(bounds).enumerate();
        for (lane, ((m, o), &bound)) in lanes.filter(|(lane, _)| !skipped.contains(lane)) {
            let found = (m - o).abs();
            let here = Distance { lane, found, bound };
            if lane == 0 || here.share() > most.share() {
                most = here;
            }
        }
        most
    }
}

/// What was found of one texel.
#[derive(Clone, Debug, PartialEq)]
pub struct Texel {
    /// Where the model parts from the naive evaluation: nowhere, by the first claim.
    pub naive: Option<Divergence>,
    /// Sums beyond their width.
    pub overflows: Vec<Overflow>,
    /// Every stage, on its own input.
    pub stages: BTreeMap<Stage, Distance>,
    /// The channels, end to end; not where a sum overflows.
    pub end_to_end: Option<Distance>,
}

impl Texel {
    /// The first claim, and the bounds of the other two.
    #[must_use]
    pub fn holds(&self) -> bool {
        let distances = self.stages.values().chain(&self.end_to_end);
        self.naive.is_none() && distances.into_iter().all(|d| d.share() <= 1.0)
    }
}

/// A decoder of an asset, its oracle, and the claims about them.
pub struct Claims<'a> {
    decoder: Decoder<'a>,
    oracle: Oracle<'a>,
}

impl<'a> Claims<'a> {
    /// Of an asset and a program for it.
    #[must_use]
    pub fn new(asset: &'a Asset, program: &'a Program) -> Claims<'a> {
        Claims {
            decoder: Decoder::new(asset, program),
            oracle: Oracle::new(asset),
        }
    }

    /// The decoder.
    #[must_use]
    pub fn decoder(&self) -> &Decoder<'a> {
        &self.decoder
    }

    /// The oracle.
    #[must_use]
    pub fn oracle(&self) -> &Oracle<'a> {
        &self.oracle
    }

    /// Checks one texel of the asset.
    #[must_use]
    pub fn texel(&self, request: Request) -> Texel {
        let asset = self.oracle.asset();
        let taps = self.decoder.taps(request);
        let naive = naive::texel(asset, request);
        let stages = self.stages(&taps, &naive.overflows);
        let real = self.oracle.taps(request);
        let end_to_end = naive.overflows.is_empty().then(|| {
            let codes = self.oracle.code_units(&taps.codes);
            let bounds = worst::texel(&self.oracle, &real);
            Distance::of(&codes, &real.channels, &bounds, &[])
        });
        Texel {
            naive: first_divergence(&naive.taps, &from_model(&taps)),
            overflows: naive.overflows,
            stages,
            end_to_end,
        }
    }

    /// Every stage of a texel against its bound, on the model's own input of the stage.
    fn stages(&self, taps: &Taps, overflows: &[Overflow]) -> BTreeMap<Stage, Distance> {
        let (oracle, asset) = (&self.oracle, self.oracle.asset());
        let mut stages = self.grids(taps);
        let inputs = number::lanes(asset.shape.input_format(), &taps.inputs);
        let real = oracle.inputs(taps.request);
        let bounds = stage::inputs(asset);
        stages.insert(Stage::Inputs, Distance::of(&inputs, &real, &bounds, &[]));
        let mut registers = vec![inputs];
        for (index, tap) in taps.layers.iter().enumerate() {
            let layer = &asset.layers[index];
            let part = |part| Stage::Layer(index as u8, part);
            let input = &registers[index];
            let sums = number::sums(layer, &tap.accumulators);
            let rows: Vec<usize> = overflows
                .iter()
                .map(|overflow| match overflow {
                    Overflow::Accumulator { place, .. } | Overflow::Half { place, .. } => place,
                })
                .filter(|place| place.layer == index)
                .map(|place| place.row)
                .collect();
            let bounds = stage::accumulators(asset, index, input);
            let distance = Distance::of(&sums, &oracle.accumulators(index, input), &bounds, &rows);
            stages.insert(part(LayerPart::Accumulators), distance);
            let activated = number::sums(layer, &tap.activated);
            let bounds = stage::activated(asset, index, &sums);
            let real = oracle.activated(index, &sums);
            let distance = Distance::of(&activated, &real, &bounds, &[]);
            stages.insert(part(LayerPart::Activated), distance);
            if index + 1 == taps.layers.len() {
                let bounds = stage::channels(asset, &activated);
                let real = oracle.clamp_channels(&oracle.channels(&activated));
                let codes = oracle.code_units(&taps.codes);
                stages.insert(Stage::Channels, Distance::of(&codes, &real, &bounds, &[]));
                break;
            }
            let outputs = number::lanes(layer.output_format(), &tap.outputs);
            let source = asset.skip_source(index);
            let source = source.map(|from| registers[from + 1].as_slice());
            let bounds = stage::outputs(asset, index, &activated, source);
            let real = oracle.outputs(index, &activated, source);
            let distance = Distance::of(&outputs, &real, &bounds, &[]);
            stages.insert(part(LayerPart::Outputs), distance);
            registers.push(outputs);
        }
        stages
    }

    /// Positions and corners, which are exact.
    fn grids(&self, taps: &Taps) -> BTreeMap<Stage, Distance> {
        use crate::oracle::position::{RealAxis, RealLevel};
        let shape = &self.oracle.asset().shape;
        let mut stages = BTreeMap::new();
        for (grid, tap) in taps.grids.iter().enumerate() {
            let level = RealLevel::of(shape.pyramid, taps.request.mip());
            let scale = level.scale_log2(shape, grid);
            let [width, height] = level.cells(shape, grid);
            let (mut model, mut real) = (Vec::new(), Vec::new());
            let (mut cells, mut real_cells) = (Vec::new(), Vec::new());
            let request = taps.request;
            for (texel, size, axis, found) in [
                (request.x(), width, tap.corners.x, tap.corners.columns),
                (request.y(), height, tap.corners.y, tap.corners.rows),
            ] {
                let truth = RealAxis::of(texel, request.mip(), scale, shape.snap);
                model.extend([f64::from(axis.first), f64::from(axis.stride)]);
                model.push(f64::from(axis.phase) / 16.0);
                real.extend([truth.first, truth.stride, truth.fraction]);
                cells.extend(found.map(f64::from));
                real_cells.extend(truth.cells(size, shape.address_mode).map(f64::from));
            }
            let zeros = [0.0; 6];
            let part = |part| Stage::Grid(grid as u8, part);
            let position = Distance::of(&model, &real, &zeros, &[]);
            stages.insert(part(GridPart::Position), position);
            let cells = Distance::of(&cells, &real_cells, &zeros, &[]);
            stages.insert(part(GridPart::Cells), cells);
        }
        stages
    }
}

/// One channel, end to end, over some texels.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Channel {
    /// The largest |model − oracle|, in the channel's units.
    pub observed_max: f64,
    /// What interval propagation proves for any texel.
    pub worst: f64,
    /// The root mean square of model − oracle.
    pub observed_rms: f64,
    /// What variance propagation predicts for it.
    pub predicted_rms: f64,
}

/// What was found of many texels.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Findings {
    /// Name and hash of the profile.
    pub profile: String,
    /// Texels looked at.
    pub texels: usize,
    /// Of these, texels with a sum beyond its width: the second and third claim leave them out.
    pub overflowing: usize,
    /// Texels at which the model parts from the naive evaluation: none, by the first claim.
    pub not_naive: usize,
    /// By the name of the stage, layers together: the lane that used most of its bound.
    pub stages: BTreeMap<String, Distance>,
    /// Per channel.
    pub channels: Vec<Channel>,
}

impl Findings {
    /// Every claim, but for that of the root mean square, which is a prediction.
    #[must_use]
    pub fn hold(&self) -> bool {
        let stages = self.stages.values().all(|distance| distance.share() <= 1.0);
        let channels = self.channels.iter().all(|c| c.observed_max <= c.worst);
        self.not_naive == 0 && stages && channels
    }
}

/// The claims at these texels, in parallel. The naive evaluation makes it slow: some milliseconds for
/// a texel of fifty thousand multiplications, and more in fp16.
#[must_use]
pub fn findings(asset: &Asset, requests: &[Request]) -> Findings {
    let program = Program::compile(asset, Layout::LINEAR);
    let claims = Claims::new(asset, &program);
    let texels: Vec<(Texel, Vec<f64>, RealTaps)> = requests
        .par_iter()
        .map(|&request| {
            let codes = claims.decoder.texel(request, &mut ());
            let units = claims.oracle.code_units(&codes);
            (claims.texel(request), units, claims.oracle.taps(request))
        })
        .collect();
    let mut findings = Findings {
        profile: asset.profile.identity(),
        texels: texels.len(),
        overflowing: 0,
        not_naive: 0,
        stages: BTreeMap::new(),
        channels: Vec::new(),
    };
    for (texel, _, _) in &texels {
        findings.overflowing += usize::from(!texel.overflows.is_empty());
        findings.not_naive += usize::from(texel.naive.is_some());
        for (stage, &distance) in &texel.stages {
            let name = stage.to_string();
            // "layer3.outputs" and "layer5.outputs" are the same kind of stage.
            let kind = match name.split_once('.') {
                Some((owner, part)) => {
                    format!("{}.{part}", owner.trim_end_matches(char::is_numeric))
                }
                None => name,
            };
            let most = findings.stages.entry(kind).or_insert(distance);
            if distance.share() > most.share() {
                *most = distance;
            }
        }
    }
    let counted = texels.iter().zip(requests);
    let counted: Vec<_> = counted
        .filter(|((texel, _, _), _)| texel.overflows.is_empty())
        .collect();
    let count = counted.len().max(1) as f64;
    let bounds = worst::asset(asset);
    let predicted: Vec<Vec<f64>> = counted
        .par_iter()
        .map(|((_, _, real), request)| typical::texel(&claims.oracle, **request, real))
        .collect();
    for (channel, &worst) in bounds.iter().enumerate() {
        let distances = counted
            .iter()
            .map(|((_, codes, real), _)| (codes[channel] - real.channels[channel]).abs());
        let squares: f64 = distances.clone().map(|d| d * d).sum();
        let expected: f64 = predicted.iter().map(|squares| squares[channel]).sum();
        findings.channels.push(Channel {
            observed_max: distances.fold(0.0, f64::max),
            worst,
            observed_rms: (squares / count).sqrt(),
            predicted_rms: (expected / count).sqrt(),
        });
    }
    findings
}
