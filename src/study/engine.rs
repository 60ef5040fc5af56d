//! The engine, which decodes what a study measures, against the reference.

use super::claims::{CLAIM_TEXELS, sample};
use ntmu_isa::layout::Layout;
use ntmu_isa::{Asset, Program};
use ntmu_model::engine::Engine;
use ntmu_model::exec::Decoder;
use serde::Serialize;

/// The engine's codes beside the reference's, at a sample of texels.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct EngineStudy {
    /// The instructions that the engine used.
    pub path: String,
    /// Texels compared.
    pub texels: usize,
    /// Texels with another code in any channel: none.
    pub differing: usize,
}

impl EngineStudy {
    /// Every code was equal.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.differing == 0
    }
}

/// Compares both at texels of every mip.
#[must_use]
pub fn compare_with_reference(asset: &Asset) -> EngineStudy {
    let program = Program::compile(asset, Layout::LINEAR);
    let decoder = Decoder::new(asset, &program);
    let engine = Engine::new(asset);
    let mut scratch = engine.scratch();
    let mut codes = vec![0; asset.shape.outputs.len()];
    let requests = sample(asset, CLAIM_TEXELS);
    let differing = requests.iter().filter(|&&request| {
        engine.texel(&mut scratch, request, &mut codes);
        codes != decoder.texel(request, &mut ())
    });
    EngineStudy {
        path: engine.path().name().to_owned(),
        differing: differing.count(),
        texels: requests.len(),
    }
}
