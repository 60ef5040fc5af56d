//! Flat: a slice of parameters on a device, with Adam's moments, in the order of the CPU path.

use crate::adam::{BETA1, BETA2, EPSILON, Moments, Rate};
use crate::error::TrainError;
use burn_tensor::{Device, Gradients, Tensor, TensorData};

/// Parameters and their moments, none of them tracked.
#[derive(Clone, Debug)]
pub(crate) struct Flat {
    pub(crate) values: Tensor<1>,
    pub(super) first: Tensor<1>,
    pub(super) second: Tensor<1>,
}

/// A float tensor on a device.
pub(crate) fn upload<const D: usize>(
    values: Vec<f32>,
    sides: [usize; D],
    device: &Device,
) -> Tensor<D> {
    Tensor::from_data(TensorData::new(values, sides), device)
}

/// The numbers of a float tensor.
pub(crate) fn download<const D: usize>(tensor: Tensor<D>) -> Result<Vec<f32>, TrainError> {
    let data = tensor
        .try_into_data()
        .map_err(|e| TrainError::Engine(format!("{e:?}")))?;
    data.try_into_vec()
        .map_err(|e| TrainError::Engine(format!("{e:?}")))
}

/// The gradient of a leaf as part of a flat slice; nothing that reached it is a gradient of zero.
pub(crate) fn flat_gradient<const D: usize>(
    leaf: &Tensor<D>,
    gradients: &mut Gradients,
) -> Tensor<1> {
    let len = leaf.shape().num_elements();
    match leaf.grad_remove(gradients) {
        Some(gradient) => gradient.reshape([len]),
        None => leaf.clone().inner().zeros_like().reshape([len]),
    }
}

impl Flat {
    pub(crate) fn upload(values: &[f32], moments: &Moments, device: &Device) -> Flat {
        let of = |values: &[f32]| upload(values.to_vec(), [values.len()], device);
        Flat {
            values: of(values),
            first: of(&moments.first),
            second: of(&moments.second),
        }
    }

    /// Writes everything to where the CPU path keeps it.
    pub(crate) fn download(
        &self,
        values: &mut Vec<f32>,
        moments: &mut Moments,
    ) -> Result<(), TrainError> {
        *values = download(self.values.clone())?;
        moments.first = download(self.first.clone())?;
        moments.second = download(self.second.clone())?;
        Ok(())
    }

    /// A part of the slice as a tensor whose gradient can be asked for.
    pub(crate) fn leaf<const D: usize>(&self, at: usize, sides: [usize; D]) -> Tensor<D> {
        let len = sides.iter().product();
        let part = self.values.clone().narrow(0, at, len).reshape(sides);
        part.autodiff().require_grad()
    }

    /// [`Rate::advance`] on every element, in the same order of operations.
    pub(crate) fn update(&mut self, rate: Rate, gradient: Tensor<1>) {
        let (first, second) = (self.first.clone(), self.second.clone());
        let square = gradient.clone() * gradient.clone();
        self.first = first * BETA1 + gradient * (1.0 - BETA1);
        self.second = second * BETA2 + square * (1.0 - BETA2);
        let root = self.second.clone().sqrt() * rate.root + EPSILON;
        self.values = self.values.clone() - self.first.clone() * rate.step / root;
    }
}
