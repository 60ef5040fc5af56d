//! Decoded: every texel of every mip of an asset.

use ndarray::{Array3, ArrayView3};
use ntmu_isa::Asset;
use ntmu_isa::half::Half;
use ntmu_isa::shape::{OutputFormat, Shape};
use ntmu_model::engine::Engine;

/// The channel codes of an asset's chain.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Decoded {
    /// Per mip, \[channel, row, column\].
    pub mips: Vec<Array3<i32>>,
}

impl Decoded {
    /// Decodes every texel of every mip, with the engine. `after_mip` is called with the texels
    /// done.
    #[must_use]
    pub fn of(asset: &Asset, mut after_mip: impl FnMut(u64)) -> Decoded {
        let engine = Engine::new(asset);
        let mut done = 0;
        let mips = (0..asset.shape.mip_count)
            .map(|mip| {
                let codes = engine.mip(mip);
                let (_, height, width) = codes.dim();
                done += (height * width) as u64;
                after_mip(done);
                codes
            })
            .collect();
        Decoded { mips }
    }

    /// Decodes every texel of one mip, which must be in the chain.
    #[must_use]
    pub fn of_mip(asset: &Asset, mip: u8) -> Decoded {
        Decoded {
            mips: vec![Engine::new(asset).mip(mip)],
        }
    }

    /// The same texels as reals, in the representation of a texture set: 0..=1 for unorm; snorm's
    /// −1..=1 is mapped to 0..=1 as (real + 1) / 2, which is how image files hold normals.
    #[must_use]
    pub fn reals(&self, shape: &Shape) -> Vec<Array3<f32>> {
        let mips = self.mips.iter();
        mips.map(|codes| reals(codes.view(), &shape.outputs))
            .collect()
    }
}

/// Codes \[channel, row, column\] as reals, see [`Decoded::reals`]; one format a channel.
#[must_use]
pub fn reals(codes: ArrayView3<'_, i32>, formats: &[OutputFormat]) -> Array3<f32> {
    Array3::from_shape_fn(codes.dim(), |(channel, row, column)| {
        real(codes[[channel, row, column]], formats[channel])
    })
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
