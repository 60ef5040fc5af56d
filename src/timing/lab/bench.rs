//! Bench: a scene set up, for unit after unit.

use super::{LabError, Sizes};
use ntmu_isa::layout::Layout;
use ntmu_isa::sampler::Sampler;
use ntmu_isa::{Asset, Program};
use ntmu_model::Material;
use ntmu_model::sampler::Sampled;
use ntmu_model::stream::{
    AccessSpec, DetailKind, Geometry, Interleave, Mips, PixelOrder, SceneSpec, Stream, TexelOrder,
    TexelSpec,
};
use ntmu_model::time::{self, Timing, Unit, Watch};

/// Side of the raster's tiles, in pixels.
pub(super) const TILE: u32 = 8;

/// Texels of mip 0 along a height of the camera: pixels near the camera see mip 0.
const TEXELS_PER_HEIGHT: f64 = 128.0;

/// What the demands of a run are.
#[derive(Clone, Debug)]
pub(super) struct Scene {
    spec: AccessSpec,
    /// Pixels along the side of the screen; a scan has none.
    screen: u32,
}

impl Scene {
    /// One mip in texel-block order.
    pub(super) fn blocks(asset: &Asset, most: u32) -> Scene {
        Scene::scan(TexelOrder::Blocks, first_mip(asset, most))
    }

    /// Texels drawn from the whole chain.
    pub(super) fn random(count: u64) -> Scene {
        Scene::scan(TexelOrder::Random { seed: 1, count }, Mips::All)
    }

    fn scan(order: TexelOrder, mips: Mips) -> Scene {
        Scene {
            spec: AccessSpec::Texels(TexelSpec { order, mips }),
            screen: 0,
        }
    }

    /// A floor without end, looked along.
    pub(super) fn plane(asset: &Asset, screen: u32, order: PixelOrder) -> Scene {
        let geometry = Geometry::Plane {
            height: 1.0,
            pitch: 10.0,
            fov: 60.0,
            size: f64::from(asset.shape.width) / TEXELS_PER_HEIGHT,
        };
        let spec = SceneSpec {
            geometry,
            order,
            detail: DetailKind::Lod,
        };
        Scene {
            spec: AccessSpec::Scene(spec),
            screen,
        }
    }

    /// The floor as a rasteriser walks it.
    pub(super) fn tiled_plane(asset: &Asset, screen: u32) -> Scene {
        Scene::plane(asset, screen, PixelOrder::Tiles { side: TILE })
    }

    /// As text, with the screen.
    pub(super) fn name(&self) -> String {
        match self.spec {
            AccessSpec::Texels(_) | AccessSpec::File(_) => self.spec.to_string(),
            AccessSpec::Scene(_) => {
                format!("{} on {1}×{1} pixels", self.spec, self.screen)
            }
        }
    }
}

/// The first mip that is at most so many texels along either side.
fn first_mip(asset: &Asset, most: u32) -> Mips {
    let fits = |mip: &u8| {
        let (width, height) = asset.shape.mip_size(*mip);
        width.max(height) <= most
    };
    let last = asset.shape.mip_count - 1;
    Mips::One((0..last).find(fits).unwrap_or(last))
}

/// A scene with its materials' samplers.
pub(super) struct Bench {
    scene: Scene,
    sampled: Vec<Sampled>,
    interleave: Interleave,
}

impl Bench {
    /// One material, sampled trilinearly where the scene has samples.
    pub(super) fn new(asset: &Asset, scene: Scene) -> Result<Bench, LabError> {
        Bench::with(asset, scene, Sampler::default(), 1, Interleave::QUADS)
    }

    /// So many copies of the asset, each a material.
    pub(super) fn with(
        asset: &Asset,
        scene: Scene,
        sampler: Sampler,
        copies: usize,
        interleave: Interleave,
    ) -> Result<Bench, LabError> {
        let sampled = Sampled::new(asset.shape.clone(), sampler, asset.profile)?;
        Ok(Bench {
            scene,
            sampled: vec![sampled; copies],
            interleave,
        })
    }

    pub(super) fn scene(&self) -> String {
        self.scene.name()
    }

    /// A run of the asset in a layout, as every material of the scene.
    pub(super) fn time(
        &self,
        asset: &Asset,
        layout: Layout,
        unit: &Unit,
    ) -> Result<Timing, LabError> {
        self.watch(asset, layout, unit, &mut ())
    }

    /// [`Bench::time`], watched.
    pub(super) fn watch(
        &self,
        asset: &Asset,
        layout: Layout,
        unit: &Unit,
        watch: &mut impl Watch,
    ) -> Result<Timing, LabError> {
        let program = Program::compile(asset, layout);
        let name = &asset.metadata.name;
        let materials: Vec<Material> = (0..self.sampled.len())
            .map(|_| Material::new(name, asset, &program))
            .collect();
        self.run(&materials, unit, watch)
    }

    /// A run of any materials, as many as the scene has.
    pub(super) fn run(
        &self,
        materials: &[Material],
        unit: &Unit,
        watch: &mut impl Watch,
    ) -> Result<Timing, LabError> {
        let screen = [self.scene.screen; 2];
        let stream = match &self.scene.spec {
            AccessSpec::Texels(spec) => Stream::texels(spec, &self.sampled)?,
            AccessSpec::Scene(spec) => Stream::scene(spec, screen, &self.sampled, self.interleave)?,
            AccessSpec::File(_) => unreachable!("no scene here is made of a file"),
        };
        let run = time::simulate(unit, materials, &mut stream.demands(), watch);
        Ok(run.unwrap_or_else(|never| match never {}))
    }
}

/// The unit of the experiments on one unit: the middle one.
pub(super) fn middle_unit() -> Unit {
    Unit::console()
}

/// The scan and the floor of the experiments on accesses, by a short name.
pub(super) fn accesses(
    asset: &Asset,
    scan: u32,
    screen: u32,
) -> Result<[(&'static str, Bench); 2], LabError> {
    Ok([
        ("blocks", Bench::new(asset, Scene::blocks(asset, scan))?),
        (
            "plane",
            Bench::new(asset, Scene::tiled_plane(asset, screen))?,
        ),
    ])
}

/// The accesses of [`Sizes`] in full.
pub(super) fn full_accesses(
    asset: &Asset,
    sizes: &Sizes,
) -> Result<[(&'static str, Bench); 2], LabError> {
    accesses(asset, sizes.scan_texels, sizes.screen_pixels)
}
