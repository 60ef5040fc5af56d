//! Material: what the unit in time knows of an asset, or of a texture that stands in for one.

use crate::exec::Tracer;
use crate::time::{Work, work_of};
use crate::trace::Addresses;
use ntmu_isa::{Asset, Program};
use std::fmt;

/// One texture set of a scene: the work of a texel, and where memory keeps the texels' latents.
pub struct Material<'a> {
    name: String,
    work: Work,
    addresses: Box<dyn Addresses + Sync + 'a>,
}

impl<'a> Material<'a> {
    /// An asset behind a program that was compiled for it, or linked to it.
    #[must_use]
    pub fn new(name: impl Into<String>, asset: &'a Asset, program: &'a Program) -> Material<'a> {
        let addresses = Tracer::new(asset, program);
        Material::with_addresses(name, work_of(asset, program), addresses)
    }

    /// Anything that is decoded with this work from these addresses: a control, or a synthesizer
    /// behind recorded addresses.
    #[must_use]
    pub fn with_addresses(
        name: impl Into<String>,
        work: Work,
        addresses: impl Addresses + Sync + 'a,
    ) -> Material<'a> {
        Material {
            name: name.into(),
            work,
            addresses: Box::new(addresses),
        }
    }

    /// Its name in results.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What one texel asks of each resource.
    #[must_use]
    pub fn work(&self) -> &Work {
        &self.work
    }

    /// Where decodes touch memory.
    #[must_use]
    pub fn addresses(&self) -> &(dyn Addresses + Sync + 'a) {
        &*self.addresses
    }
}

impl fmt::Debug for Material<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Material")
            .field("name", &self.name)
            .field("work", &self.work)
            .finish_non_exhaustive()
    }
}
