//! The encoder's part of a step: crops from the set on the device, and the way from its output to
//! whole cells and back.

use super::flat::upload;
use super::sums::{Sums, indices};
use crate::constructor::{Constructors, Piece};
use crate::crop::Crops;
use crate::model::Ground;
use crate::sampler::Window;
use burn_tensor::{Device, Int, Tensor, TensorData};

/// Images of crops, `[item][channel][row][column]`, from every texel of mip 0.
pub(crate) fn images(ground: &Ground<'_>, crops: &Crops, texels: &Tensor<2>) -> Tensor<4> {
    let device = texels.device();
    let lines = crops.lines(ground);
    let items = lines.len();
    let (width, _) = ground.texels.sizes[0];
    let axis = |axis: usize| -> Vec<i32> {
        let of_items = lines.iter().flat_map(|lines| &lines[axis]);
        of_items.map(|&at| at as i32).collect()
    };
    let (columns, rows) = (axis(0), axis(1));
    let [wide, high] = [columns.len() / items, rows.len() / items];
    let columns = ints(columns, [items, 1, wide], &device);
    let rows = ints(rows, [items, high, 1], &device);
    let places = (rows * width as i32 + columns).reshape([items * high * wide]);
    let channels = ground.texels.channels;
    let image = texels.clone().select(0, places);
    image
        .reshape([items, high, wide, channels])
        .permute([0, 3, 1, 2])
}

fn ints<const D: usize>(values: Vec<i32>, sides: [usize; D], device: &Device) -> Tensor<D, Int> {
    Tensor::from_data(TensorData::new(values, sides), device)
}

/// How the numbers of the encoder's tensor for one grid make latents: each latent is the sum of
/// the numbers that have a share in it.
pub(crate) struct Construction {
    channels: usize,
    sums: Sums,
    /// For each number of the tensor the latent it has a share in.
    latent: Tensor<1, Int>,
    /// That share.
    share: Tensor<2>,
    /// Latents of the grid in all crops, all levels counted.
    pub(crate) latents: usize,
}

impl Construction {
    /// That of grid `grid` for tensors of `shape` (items, rows, columns) whose latents lie in
    /// `windows`.
    pub(crate) fn new(
        constructors: &Constructors,
        (grid, shape): (usize, (usize, usize, usize)),
        windows: &[Window],
        device: &Device,
    ) -> Construction {
        let channels = constructors.channels();
        let (items, rows, columns) = shape;
        let numbers = items * constructors.planes * rows * columns;
        let cells: usize = windows.iter().map(|w| w.cells(grid)).sum();
        let piece = Piece {
            tensor: shape,
            margin: 0,
            origin: [0; 2],
            extent: [columns, rows],
        };
        let mut latent = vec![0; numbers];
        // A number that has a share in no latent stays at a share of nothing.
        let mut share = vec![0.0; numbers];
        constructors.for_latents(piece, grid, windows, |from, to, of_latent| {
            latent[from] = to as i32;
            share[from] = of_latent;
        });
        let latents = cells * channels;
        Construction {
            channels,
            sums: Sums::new(&latent, latents),
            share: upload(share, [numbers, 1], device),
            latent: indices(latent, device),
            latents,
        }
    }

    /// Whole cells (cells × channels) from the encoder's tensor.
    pub(crate) fn cells(&self, tensor: Tensor<4>) -> Tensor<2> {
        let numbers = tensor.shape().num_elements();
        let rows = tensor.reshape([numbers, 1]) * self.share.clone();
        let cells = self.latents / self.channels;
        self.sums.of(rows).reshape([cells, self.channels])
    }

    /// The gradient of the encoder's tensor, of sides `sides`, from that of the cells.
    pub(crate) fn gradient(&self, cells: Tensor<2>, sides: [usize; 4]) -> Tensor<4> {
        let rows = cells.reshape([self.latents, 1]);
        let numbers = rows.select(0, self.latent.clone()) * self.share.clone();
        numbers.reshape(sides)
    }
}
