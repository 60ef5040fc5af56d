//! Machine: the registers of the unit, and what every instruction does to them.

use super::filter::Filter;
use super::layer::Held;
use super::position::Corners;
use super::{Decoder, Probe, embed, half, interpolate, layer, output, position};
use crate::place::Place;
use crate::request::Request;
use ntmu_isa::embed::Wave;
use ntmu_isa::instruction::{Instruction, VECTOR_COUNT};
use ntmu_isa::layer::{HalfParameters, IntegerParameters, Layer};
use ntmu_isa::position::PHASE_BITS;
use std::ops::Range;

/// Lanes of a register, and accumulators of a unit.
const LANES: usize = ntmu_isa::limits::MAX_LANES as usize;

/// The registers of the unit while it runs a texel.
pub(super) struct Machine<'d, 'a> {
    decoder: &'d Decoder<'a>,
    corners: [Corners; 2],
    /// Per grid, the codes of the four corners one after the other.
    codes: [Vec<u8>; 2],
    /// Integers, or the bits of halves.
    vectors: [Vec<i16>; VECTOR_COUNT as usize],
    accumulators: Vec<i32>,
    held: Held,
    /// The sums of an fp16 layer, and which.
    sums: Vec<f32>,
    summed: u16,
    emitted: Vec<i32>,
    /// There while a sample is under way.
    filter: Option<Filter<'d>>,
}

impl<'d, 'a> Machine<'d, 'a> {
    pub(super) fn new(decoder: &'d Decoder<'a>) -> Machine<'d, 'a> {
        Machine {
            decoder,
            corners: [Corners::default(); 2],
            codes: [Vec::new(), Vec::new()],
            vectors: std::array::from_fn(|_| vec![0; LANES]),
            accumulators: vec![0; LANES],
            held: Held::Sums,
            sums: vec![0.0; LANES],
            summed: 0,
            emitted: vec![0; decoder.asset.shape.outputs.len()],
            filter: None,
        }
    }

    pub(super) fn texel(&mut self, request: Request, probe: &mut impl Probe) -> &[i32] {
        self.run(&Place::of(request), PHASE_BITS, probe)
    }

    pub(super) fn run(&mut self, place: &Place, phase_bits: u8, probe: &mut impl Probe) -> &[i32] {
        for instruction in self.decoder.program.steps() {
            self.step(instruction, place, phase_bits, probe);
        }
        &self.emitted
    }

    /// A sample, by a program with this loop of its footprint.
    pub(super) fn sample(
        &mut self,
        filter: Filter<'d>,
        body: Range<usize>,
        probe: &mut impl Probe,
    ) -> &[i32] {
        self.filter = Some(filter);
        let steps = self.decoder.program.steps();
        // Nothing outside the loop asks where it is.
        let nowhere = Place::of(Request::within(0, 0, 0));
        for instruction in &steps[..body.start] {
            self.step(instruction, &nowhere, PHASE_BITS, probe);
        }
        while let Some((place, phase_bits)) = self.filter.as_ref().and_then(Filter::next) {
            for instruction in &steps[body.clone()] {
                self.step(instruction, &place, phase_bits, probe);
            }
        }
        for instruction in &steps[body.end..] {
            self.step(instruction, &nowhere, PHASE_BITS, probe);
        }
        self.filter = None;
        &self.emitted
    }

    pub(super) fn step(
        &mut self,
        instruction: &Instruction,
        place: &Place,
        phase_bits: u8,
        probe: &mut impl Probe,
    ) {
        let (asset, profile) = (self.decoder.asset, &self.decoder.asset.profile);
        match *instruction {
            Instruction::Position { grid } => {
                let g = usize::from(grid);
                self.corners[g] = position::corners(&asset.shape, g, place, phase_bits);
                probe.position(g, &self.corners[g]);
            }
            Instruction::Fetch { grid } => {
                let g = usize::from(grid);
                let memory = &self.decoder.memory;
                memory.codes(g, &self.corners[g], &mut self.codes[g]);
                probe.fetch(&memory.addresses(g, &self.corners[g]));
                probe.codes(g, &self.codes[g]);
            }
            Instruction::Concat { dst, lane, grid } => {
                let g = usize::from(grid);
                let lanes = &mut self.vectors[usize::from(dst)][usize::from(lane)..];
                let written = embed::concat(asset, g, &self.codes[g], lanes);
                probe.embedded("concat", lane, &lanes[..written]);
            }
            Instruction::Lerp { dst, lane, grid } => {
                let g = usize::from(grid);
                let lanes = &mut self.vectors[usize::from(dst)][usize::from(lane)..];
                let corners = &self.corners[g];
                let written = interpolate::lerp(asset, g, &self.codes[g], corners, lanes);
                probe.embedded("lerp", lane, &lanes[..written]);
            }
            Instruction::Wave { dst, lane, octaves } => {
                let lanes = &mut self.vectors[usize::from(dst)][usize::from(lane)..];
                let written = embed::waves(Wave::Triangle, &asset.shape, place, octaves, lanes);
                probe.embedded("wave", lane, &lanes[..written]);
            }
            Instruction::Saw { dst, lane, octaves } => {
                let lanes = &mut self.vectors[usize::from(dst)][usize::from(lane)..];
                let written = embed::waves(Wave::Saw, &asset.shape, place, octaves, lanes);
                probe.embedded("saw", lane, &lanes[..written]);
            }
            Instruction::Level { dst, lane } => {
                let lanes = &mut self.vectors[usize::from(dst)][usize::from(lane)..];
                lanes[0] = embed::level(&asset.shape, place);
                probe.embedded("level", lane, &lanes[..1]);
            }
            Instruction::Zero { dst, lane, lanes } => {
                let written = &mut self.vectors[usize::from(dst)][usize::from(lane)..];
                let written = &mut written[..usize::from(lanes)];
                written.fill(0);
                probe.embedded("zero", lane, written);
            }
            Instruction::Dense {
                layer,
                src,
                inputs,
                outputs,
            } => {
                let Some((_, parameters)) = self.integer(layer) else {
                    return;
                };
                let weights = &self.decoder.weights[usize::from(layer)];
                let input = &self.vectors[usize::from(src)][..usize::from(inputs)];
                let accumulators = &mut self.accumulators[..usize::from(outputs)];
                weights.dense(parameters, profile.accumulator, input, accumulators);
                self.held = Held::Sums;
                probe.accumulators(layer, accumulators);
            }
            Instruction::Relu { outputs } => {
                let accumulators = &mut self.accumulators[..usize::from(outputs)];
                layer::relu(accumulators);
                probe.activated(accumulators);
            }
            Instruction::Leaky { shift, outputs } => {
                let accumulators = &mut self.accumulators[..usize::from(outputs)];
                layer::leaky(accumulators, shift, profile.leak);
                probe.activated(accumulators);
            }
            Instruction::Gate { layer, outputs } => {
                let Some((numbers, parameters)) = self.integer(layer) else {
                    return;
                };
                let accumulators = &mut self.accumulators[..usize::from(outputs)];
                let requantizer = profile.requantize;
                layer::gate(accumulators, numbers.activation, parameters, requantizer);
                self.held = Held::Gated;
                probe.activated(accumulators);
            }
            Instruction::Table { layer, outputs } => {
                let Some((_, parameters)) = self.integer(layer) else {
                    return;
                };
                let accumulators = &mut self.accumulators[..usize::from(outputs)];
                layer::table(accumulators, parameters, profile.requantize);
                self.held = Held::LookedUp;
                probe.activated(accumulators);
            }
            Instruction::Rescale {
                layer,
                dst,
                outputs,
            } => self.rescale(layer, None, dst, outputs, probe),
            Instruction::RescaleSkip {
                layer,
                dst,
                skip,
                outputs,
            } => self.rescale(layer, Some(skip), dst, outputs, probe),
            Instruction::Emit { layer, outputs } => {
                self.codes(layer, outputs);
                probe.emitted(&self.emitted);
            }
            Instruction::Collect { layer, outputs } => {
                self.codes(layer, outputs);
                self.collect(probe);
            }
            Instruction::DenseHalf {
                layer,
                src,
                inputs,
                outputs,
            } => {
                let Some(parameters) = self.half(layer) else {
                    return;
                };
                let lanes = &self.vectors[usize::from(src)][..usize::from(inputs)];
                let input = half::read(lanes, asset.input_format(usize::from(layer)));
                let sums = &mut self.sums[..usize::from(outputs)];
                half::dense(parameters, profile.sum, &input, sums);
                self.summed = layer;
                probe.sums(layer, sums);
            }
            Instruction::ReluHalf { outputs } => {
                let sums = &mut self.sums[..usize::from(outputs)];
                half::relu(sums);
                probe.activated_sums(sums);
            }
            Instruction::LeakyHalf { shift, outputs } => {
                let sums = &mut self.sums[..usize::from(outputs)];
                half::leaky(sums, shift);
                probe.activated_sums(sums);
            }
            Instruction::GateHalf { clamped, outputs } => {
                let sums = &mut self.sums[..usize::from(outputs)];
                half::gate(sums, clamped == 1);
                probe.activated_sums(sums);
            }
            Instruction::SkipHalf { skip, outputs } => {
                let sums = &mut self.sums[..usize::from(outputs)];
                half::add_skip(sums, &self.vectors[usize::from(skip)]);
            }
            Instruction::RoundHalf { dst, outputs } => {
                let lanes = &mut self.vectors[usize::from(dst)][..usize::from(outputs)];
                half::round(&self.sums, lanes);
                probe.outputs(self.summed, lanes);
            }
            Instruction::QuantizeHalf {
                layer,
                dst,
                outputs,
            } => {
                let Some(quantize) = self.half(layer).and_then(|numbers| numbers.quantize) else {
                    return;
                };
                let lanes = &mut self.vectors[usize::from(dst)][..usize::from(outputs)];
                half::quantize(&self.sums, quantize, profile.convert, lanes);
                probe.outputs(layer, lanes);
            }
            Instruction::EmitHalf { outputs } => {
                self.half_codes(outputs);
                probe.emitted(&self.emitted);
            }
            Instruction::CollectHalf { outputs } => {
                self.half_codes(outputs);
                self.collect(probe);
            }
            Instruction::Footprint {} => {
                if let Some(filter) = &mut self.filter {
                    filter.plan();
                }
            }
            Instruction::Blend { outputs: _ } => {
                // Without a sample under way, the footprint is the one texel that was decoded.
                if let Some(codes) = self.filter.as_ref().and_then(Filter::blend) {
                    self.emitted = codes;
                }
                probe.emitted(&self.emitted);
            }
            // The steps are in the order of execution.
            Instruction::Repeat { times: _, step: _ }
            | Instruction::Again {}
            | Instruction::Each {}
            | Instruction::Next {}
            | Instruction::End {} => {}
        }
    }

    /// Codes from the accumulators.
    fn codes(&mut self, layer: u16, outputs: u16) {
        let Some((_, parameters)) = self.integer(layer) else {
            return;
        };
        let asset = self.decoder.asset;
        let accumulators = &self.accumulators[..usize::from(outputs)];
        let (formats, codes) = (&asset.shape.outputs, &mut self.emitted);
        output::emit(
            accumulators,
            parameters,
            formats,
            asset.profile.output,
            codes,
        );
    }

    /// Codes from an fp16 layer's sums.
    fn half_codes(&mut self, outputs: u16) {
        let asset = self.decoder.asset;
        let sums = &self.sums[..usize::from(outputs)];
        half::emit(
            sums,
            &asset.shape.outputs,
            &asset.profile,
            &mut self.emitted,
        );
    }

    /// The codes of a decode to the filter's buffer.
    fn collect(&mut self, probe: &mut impl Probe) {
        probe.collected(&self.emitted);
        if let Some(filter) = &mut self.filter {
            filter.collect(&self.emitted);
        }
    }

    /// The held accumulators, rescaled, with a skip path if there is one, to a register.
    fn rescale(
        &mut self,
        layer: u16,
        skip: Option<u16>,
        dst: u16,
        outputs: u16,
        probe: &mut impl Probe,
    ) {
        let Some((numbers, parameters)) = self.integer(layer) else {
            return;
        };
        let asset = self.decoder.asset;
        let accumulators = &self.accumulators[..usize::from(outputs)];
        let requantizer = asset.profile.requantize;
        let mut values = layer::rescale(accumulators, self.held, numbers, parameters, requantizer);
        if let Some(skip) = skip {
            let source = &self.vectors[usize::from(skip)];
            layer::add_skip(asset, usize::from(layer), source, &mut values);
        }
        let lanes = &mut self.vectors[usize::from(dst)][..usize::from(outputs)];
        layer::saturate_to(values, parameters.output_bits, lanes);
        probe.outputs(layer, lanes);
    }

    /// An integer layer. A linked program names one wherever one is asked for.
    fn integer(&self, layer: u16) -> Option<(&'a Layer, &'a IntegerParameters)> {
        let layer = &self.decoder.asset.layers[usize::from(layer)];
        layer.integer().map(|parameters| (layer, parameters))
    }

    /// The numbers of an fp16 layer. A linked program names one wherever one is asked for.
    fn half(&self, layer: u16) -> Option<&'a HalfParameters> {
        self.decoder.asset.layers[usize::from(layer)].half()
    }
}
