//! Claims: the convolution is burn's, forward and back.

use super::{Convolution, Ending, Field, Sizes};
use crate::kernel::{ROWS, padded};
use crate::random::{Purpose, Stream};
use burn_tensor::module::conv2d;
use burn_tensor::ops::ConvOptions;
use burn_tensor::{Device, Tensor, TensorData};

/// Small integers: every product and sum is exact, so results must be equal in any order.
fn numbers(seed: u64, len: usize) -> Vec<f32> {
    let stream = Stream::new(seed, Purpose::Batch, 0);
    (0..len as u64)
        .map(|i| stream.below(i, 9) as f32 - 4.0)
        .collect()
}

fn tensor<const D: usize>(numbers: &[f32], sides: [usize; D]) -> Tensor<D> {
    let device = Device::flex().autodiff();
    Tensor::from_data(TensorData::new(numbers.to_vec(), sides), &device).require_grad()
}

fn vec<const D: usize>(tensor: Tensor<D>) -> Vec<f32> {
    tensor.into_data().try_into_vec().unwrap()
}

#[test]
fn forward_and_back_equal_burns_at_every_kernel_and_size() {
    for (kernel, stride) in [(1, 1), (3, 1), (5, 2)] {
        for (inputs, outputs) in [(3, 8), (33, 40), (64, 5)] {
            for (high, wide) in [(16, 16), (8, 40), (24, 10)] {
                let (items, pad) = (2, kernel / 2);
                let sizes = Sizes {
                    inputs,
                    outputs,
                    kernel,
                    stride,
                };
                let image = numbers(1, items * inputs * high * wide);
                let weights = numbers(2, outputs * inputs * kernel * kernel);
                let bias = numbers(3, outputs);
                let x = tensor(&image, [items, inputs, high, wide]);
                let w = tensor(&weights, [outputs, inputs, kernel, kernel]);
                let b = tensor(&bias, [outputs]);
                let options = ConvOptions::new([stride; 2], [pad; 2], [1; 2], 1);
                let expected = conv2d(x.clone(), w.clone(), Some(b.clone()), options);
                let [_, _, rows, columns] = expected.dims();
                let gradient = numbers(4, items * outputs * rows * columns);
                let constant = tensor(&gradient, [items, outputs, rows, columns]);
                let mut gradients = (expected.clone() * constant).sum().backward();

                let channels = padded(inputs);
                let convolution = Convolution::new(sizes, channels, &weights, &bias);
                let border = sizes.border();
                let sides = [items, inputs, high, wide];
                let field = if stride == 2 {
                    Field::from_planar(&image, sides, (0, channels), |v| v).split()
                } else {
                    Field::from_planar(&image, sides, (border, channels), |v| v)
                };
                let out = convolution.forward(&field, Ending::Nothing, 0);
                assert_eq!(out.to_planar(outputs), vec(expected), "{sizes:?} forward");

                let sides = [items, outputs, rows, columns];
                let of_output = Field::from_planar(
                    &gradient,
                    sides,
                    (border, convolution.output_channels()),
                    |v| v,
                );
                let back = convolution.back(&of_output, None, None, 0);
                let back = if stride == 2 { back.join(1) } else { back };
                let expected = vec(x.grad_remove(&mut gradients).unwrap());
                assert_eq!(back.to_planar(inputs), expected, "{sizes:?} back");

                let (mut of_weights, mut of_bias) = (weights.clone(), bias.clone());
                convolution.gradients(&field, &of_output, &mut of_weights, &mut of_bias);
                let expected = vec(w.grad_remove(&mut gradients).unwrap());
                assert_eq!(of_weights, expected, "{sizes:?} weights");
                let expected = vec(b.grad_remove(&mut gradients).unwrap());
                assert_eq!(of_bias, expected, "{sizes:?} bias");
            }
        }
    }
}

#[test]
fn skips_relus_and_masks_are_what_they_say() {
    let sizes = Sizes {
        inputs: 4,
        outputs: 4,
        kernel: 1,
        stride: 1,
    };
    let identity: Vec<f32> = (0..16).map(|i| f32::from(u8::from(i % 5 == 0))).collect();
    let channels = padded(4);
    let convolution = Convolution::new(sizes, channels, &identity, &[1.0; 4]);
    let planar = numbers(5, 4 * 3 * 11);
    let field = Field::from_planar(&planar, [1, 4, 3, 11], (0, channels), |v| v);
    assert_eq!(field.width() % ROWS, 0);
    let relu = convolution.forward(&field, Ending::Relu, 1).to_planar(4);
    let expected: Vec<f32> = planar.iter().map(|v| (v + 1.0).max(0.0)).collect();
    assert_eq!(relu, expected);
    let skip = convolution.forward(&field, Ending::Skip(&field), 0);
    let expected: Vec<f32> = planar.iter().map(|v| 2.0 * v + 1.0).collect();
    assert_eq!(skip.to_planar(4), expected);
    let back = convolution.back(&field, Some(&field), Some(&field), 1);
    let expected: Vec<f32> = planar.iter().map(|v| 2.0 * v.max(0.0)).collect();
    assert_eq!(back.to_planar(4), expected);
}
