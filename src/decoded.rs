//! Decoded: every texel of every mip of an asset, from the model.

use ndarray::Array3;
use ntmu_isa::half::Half;
use ntmu_isa::layout::Layout;
use ntmu_isa::shape::{OutputFormat, Shape};
use ntmu_isa::{Asset, Program};
use ntmu_model::exec::Decoder;

/// The channel codes of an asset's chain.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Decoded {
    /// Per mip, \[channel, row, column\].
    pub mips: Vec<Array3<i32>>,
}

impl Decoded {
    /// Runs the model on every texel of every mip. `after_mip` is called with the texels done.
    #[must_use]
    pub fn of(asset: &Asset, mut after_mip: impl FnMut(u64)) -> Decoded {
        // Values do not depend on where memory keeps the grids.
        let program = Program::compile(asset, Layout::Linear);
        let decoder = Decoder::new(asset, &program);
        let mut done = 0;
        let mips = (0..asset.shape.mip_count)
            .map(|mip| {
                let codes = decoder.mip(mip);
                let (_, height, width) = codes.dim();
                done += (height * width) as u64;
                after_mip(done);
                codes
            })
            .collect();
        Decoded { mips }
    }

    /// Runs the model on every texel of one mip, which must be in the chain.
    #[must_use]
    pub fn of_mip(asset: &Asset, mip: u8) -> Decoded {
        let program = Program::compile(asset, Layout::Linear);
        Decoded {
            mips: vec![Decoder::new(asset, &program).mip(mip)],
        }
    }

    /// The same texels as reals, in the representation of a texture set: 0..=1 for unorm; snorm's
    /// −1..=1 is mapped to 0..=1 as (real + 1) / 2, which is how image files hold normals.
    #[must_use]
    pub fn reals(&self, shape: &Shape) -> Vec<Array3<f32>> {
        self.mips
            .iter()
            .map(|codes| {
                Array3::from_shape_fn(codes.dim(), |(channel, row, column)| {
                    real(codes[[channel, row, column]], shape.outputs[channel])
                })
            })
            .collect()
    }
}

/// What a code means, on 0..=1.
pub(crate) fn real(code: i32, format: OutputFormat) -> f32 {
    if format == OutputFormat::Float16 {
        // A code of this format is a binary16 number's bits.
        return Half::from_bits(code as u16).to_f32();
    }
    let (_, max) = format.range();
    let real = f64::from(code) / f64::from(max);
    match format {
        OutputFormat::Unorm8 | OutputFormat::Unorm16 | OutputFormat::Float16 => real as f32,
        OutputFormat::Snorm8 => ((real + 1.0) / 2.0) as f32,
    }
}
