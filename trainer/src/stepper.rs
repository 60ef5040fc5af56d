//! Stepper: what takes the steps of a stage.

use crate::device::{Backend, TrainingDevice};
use crate::engine::Engine;
use crate::error::TrainError;
use crate::graph::{Graph, Subject};
use crate::model::{Ground, Model};
use crate::plan::Train;
use crate::stage::{Rates, Stage};

/// What takes the steps of a stage.
pub(crate) enum Stepper {
    /// The processor's own kernels. Every step changes the model.
    Processor {
        engine: Box<Engine>,
        /// Those that nobody has read.
        losses: Vec<f64>,
    },
    /// A device. It has what its steps change until [`Stepper::write_to`].
    Device(Box<Graph>),
}

impl Stepper {
    /// That of a stage, from the state of `model`. Stages in the numbers of the decode run on the
    /// processor, and where that is the device, so do all others: its own kernels are faster there
    /// than burn's.
    pub(crate) fn new(
        ground: &Ground<'_>,
        model: &Model,
        stage: &Stage,
        device: &TrainingDevice,
    ) -> Stepper {
        if device.backend() == Backend::Flex || stage.is_deployed() {
            let channels = ground.texels.channels;
            return Stepper::Processor {
                engine: Box::new(Engine::new(&ground.topology, stage.batch, channels)),
                losses: Vec::new(),
            };
        }
        let subject = Subject::of(stage.train);
        Stepper::Device(Box::new(Graph::new(
            ground,
            model,
            subject,
            device.tensors(),
        )))
    }

    /// Whether reading losses or state waits for a device.
    pub(crate) const fn is_remote(&self) -> bool {
        match self {
            Stepper::Processor { .. } => false,
            Stepper::Device(_) => true,
        }
    }

    /// Takes step `step`, from 0.
    pub(crate) fn step(
        &mut self,
        ground: &Ground<'_>,
        model: &mut Model,
        stage: &Stage,
        step: u64,
        rates: Rates,
    ) -> Result<(), TrainError> {
        match self {
            Stepper::Processor { engine, losses } => losses.push(match stage.train {
                Train::Encoder => model.encoder_step(ground, engine, stage, step, rates)?,
                Train::Latents | Train::Synthesizer => {
                    model.step(ground, engine, stage, step, rates)
                }
            }),
            Stepper::Device(graph) => graph.step(ground, stage, step, rates),
        }
        Ok(())
    }

    /// The mean squared errors of the batches since the last call.
    pub(crate) fn losses(&mut self) -> Result<Vec<f64>, TrainError> {
        match self {
            Stepper::Processor { losses, .. } => Ok(std::mem::take(losses)),
            Stepper::Device(graph) => graph.losses(),
        }
    }

    /// Brings the state to `model`, where it is not there anyway.
    pub(crate) fn write_to(&self, model: &mut Model) -> Result<(), TrainError> {
        match self {
            Stepper::Processor { .. } => Ok(()),
            Stepper::Device(graph) => graph.write_to(model),
        }
    }
}
