//! Encoder pass: the encoder forward and back on the processor.

use crate::convolution::{Convolution, Ending, Field, Sizes};
use crate::encoder::{BLOCKS, Encoder};
use crate::error::TrainError;
use crate::kernel::ROWS;

/// What a residual block computed.
struct Block {
    input: Field,
    narrow: Field,
    wide: Field,
}

/// A halving's input, by parity, and the blocks after it.
struct Stage {
    input: Field,
    blocks: Vec<Block>,
}

/// What the way back needs.
struct Trace {
    stages: Vec<Stage>,
    /// The input of the last halving, and what comes out of ½·tanh.
    last: Field,
    bottleneck: Field,
}

/// A pass whose gradient can still be taken, if it was tracked.
pub(crate) struct Pass {
    convolutions: Vec<Convolution>,
    trace: Option<Trace>,
    outputs: [Vec<f32>; 2],
}

impl Encoder {
    /// From images, `[item][channel][row][column]` with sides that are multiples of 8, to both
    /// grids as [`Pass::grids`] describes them.
    pub(crate) fn forward(
        &self,
        parameters: &[f32],
        images: Vec<f32>,
        shape: [usize; 4],
        tracked: bool,
    ) -> Pass {
        let convolutions = self.convolutions(parameters);
        let of = |index: usize| &convolutions[index];
        let channels = shape[1].next_multiple_of(ROWS);
        // As in `Encoder::run`: around zero.
        let mut x = Field::from_planar(&images, shape, (0, channels), |v| v * 2.0 - 1.0);
        let mut stages = Vec::new();
        for stage in 0..2 {
            let first = stage * (1 + 3 * BLOCKS);
            let input = x.split();
            x = of(first).forward(&input, Ending::Nothing, 0);
            let mut blocks = Vec::new();
            for block in 0..BLOCKS {
                let at = first + 1 + 3 * block;
                let narrow = of(at).forward(&x, Ending::Relu, 1);
                let wide = of(at + 1).forward(&narrow, Ending::Relu, 0);
                let out = of(at + 2).forward(&wide, Ending::Skip(&x), 0);
                let input = std::mem::replace(&mut x, out);
                if tracked {
                    blocks.push(Block {
                        input,
                        narrow,
                        wide,
                    });
                }
            }
            stages.push(Stage { input, blocks });
        }
        let last = x.split();
        let at = 2 * (1 + 3 * BLOCKS);
        let mut bottleneck = of(at).forward(&last, Ending::Nothing, 0);
        bottleneck.fill(|_, _, _, positions| {
            for value in positions {
                *value = 0.5 * value.tanh();
            }
        });
        let outputs = [1, 2].map(|grid: usize| {
            let out = of(at + grid).forward(&bottleneck, Ending::Nothing, 0);
            out.to_planar(self.sizes(at + grid).outputs)
        });
        let trace = tracked.then_some(Trace {
            stages,
            last,
            bottleneck,
        });
        Pass {
            convolutions,
            trace,
            outputs,
        }
    }

    /// The gradient of the parameters, given that of both grids in the layout of [`Pass::grids`].
    /// An untracked pass gives zeros.
    pub(crate) fn backward(
        &self,
        pass: Pass,
        gradients: [Vec<f32>; 2],
    ) -> Result<Vec<f32>, TrainError> {
        let mut flat = vec![0.0; self.parameters];
        let Pass {
            convolutions,
            trace,
            ..
        } = pass;
        let Some(Trace {
            stages,
            last,
            bottleneck,
        }) = trace
        else {
            return Ok(flat);
        };
        let of = |index: usize| &convolutions[index];
        let mut add = |index: usize, input: &Field, gradient: &Field| {
            let (weights, bias) = self.parts_mut(index, &mut flat);
            of(index).gradients(input, gradient, weights, bias);
        };
        let at = 2 * (1 + 3 * BLOCKS);
        let mut x: Option<Field> = None;
        for (grid, gradient) in gradients.iter().enumerate() {
            let index = at + 1 + grid;
            let sides = [
                bottleneck.items,
                self.sizes(index).outputs,
                bottleneck.rows,
                bottleneck.columns,
            ];
            let channels = of(index).output_channels();
            let gradient = Field::from_planar(gradient, sides, (0, channels), |v| v);
            add(index, &bottleneck, &gradient);
            x = Some(of(index).back(&gradient, x.as_ref(), None, 1));
        }
        let Some(mut x) = x else {
            return Ok(flat);
        };
        x.fill(|item, plane, row, gradients| {
            let values = bottleneck.row(item, plane, row);
            for (gradient, z) in gradients.iter_mut().zip(values) {
                // The derivative of z = ½·tanh, in terms of z.
                *gradient *= 0.5 - 2.0 * z * z;
            }
        });
        add(at, &last, &x);
        x = of(at).back(&x, None, None, 0).join(0);
        for (stage, Stage { input, blocks }) in stages.into_iter().enumerate().rev() {
            let first = stage * (1 + 3 * BLOCKS);
            for (block, values) in blocks.into_iter().enumerate().rev() {
                let at = first + 1 + 3 * block;
                add(at + 2, &values.wide, &x);
                let wide = of(at + 2).back(&x, None, Some(&values.wide), 1);
                add(at + 1, &values.narrow, &wide);
                let narrow = of(at + 1).back(&wide, None, Some(&values.narrow), 0);
                add(at, &values.input, &narrow);
                // The halving before the first block reads its gradient with a border.
                let border = usize::from(block == 0);
                x = of(at).back(&narrow, Some(&x), None, border);
            }
            add(first, &input, &x);
            if stage > 0 {
                x = of(first).back(&x, None, None, 0).join(0);
            }
        }
        Ok(flat)
    }

    fn convolutions(&self, parameters: &[f32]) -> Vec<Convolution> {
        let convolutions = (0..self.count()).map(|index| {
            let sizes: Sizes = self.sizes(index);
            let (weights, bias) = self.parts(index, parameters);
            // The images have as few channels as the kernels can take; what comes after them is
            // what a convolution wrote.
            let channels = if index == 0 {
                sizes.inputs.next_multiple_of(ROWS)
            } else {
                crate::kernel::padded(sizes.inputs)
            };
            Convolution::new(sizes, channels, weights, bias)
        });
        convolutions.collect()
    }
}

impl Pass {
    /// Both grids as reals, `[item][channel · cells][row][column]` at 1/8 of the resolution, not
    /// yet limited to the latents' range; the cells of a position follow each other in reading
    /// order, within a channel.
    pub(crate) fn grids(&self) -> Result<[Vec<f32>; 2], TrainError> {
        Ok(self.outputs.clone())
    }
}
