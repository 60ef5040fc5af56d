//! The GPU twin as a device under test.

use ntmu_conformance::stage::{GridPart, LayerPart, Stage, Taps};
use ntmu_conformance::{Device, DeviceError};
use ntmu_isa::Asset;
use ntmu_model::Request;
use ntmu_shaders::{Gpu, Twin, TwinError};

/// A twin on one adapter. It keeps the last asset uploaded, because vectors come asset by asset.
pub struct TwinDevice {
    gpu: Gpu,
    twin: Option<(Asset, Twin)>,
}

impl TwinDevice {
    /// The device on the adapter that [`Gpu::open`] chooses.
    ///
    /// # Errors
    /// When no adapter serves.
    pub fn open() -> Result<TwinDevice, TwinError> {
        Ok(TwinDevice {
            gpu: Gpu::open()?,
            twin: None,
        })
    }

    fn twin(&mut self, asset: &Asset) -> Result<&Twin, DeviceError> {
        if self.twin.as_ref().is_none_or(|(held, _)| held != asset) {
            let twin = Twin::on(&self.gpu, asset).map_err(failed)?;
            self.twin = Some((asset.clone(), twin));
        }
        let held = self.twin.as_ref().map(|(_, twin)| twin);
        held.ok_or_else(|| DeviceError::failed("no asset is uploaded"))
    }
}

fn failed(error: TwinError) -> DeviceError {
    match error {
        TwinError::TooLarge { .. } => DeviceError::unsupported(error.to_string()),
        TwinError::NoAdapter { .. }
        | TwinError::NoDevice { .. }
        | TwinError::Request { .. }
        | TwinError::Device { .. } => DeviceError::failed(error.to_string()),
    }
}

fn place(request: Request) -> (u32, u32, u8) {
    (request.x(), request.y(), request.mip())
}

impl Device for TwinDevice {
    fn name(&self) -> String {
        let info = self.gpu.adapter();
        format!("twin on {}, {}, {}", info.name, info.backend, info.driver)
    }

    fn texel_codes(
        &mut self,
        asset: &Asset,
        requests: &[Request],
    ) -> Result<Vec<Vec<i32>>, DeviceError> {
        let places: Vec<_> = requests.iter().copied().map(place).collect();
        let codes = self.twin(asset)?.texels(&places).map_err(failed)?;
        Ok(codes
            .chunks_exact(asset.shape.outputs.len())
            .map(<[i32]>::to_vec)
            .collect())
    }

    fn taps(&mut self, asset: &Asset, request: Request) -> Result<Taps, DeviceError> {
        let taps = self.twin(asset)?.taps(&[place(request)]).map_err(failed)?;
        let taps = taps
            .first()
            .ok_or_else(|| DeviceError::failed("no taps came back"))?;
        Ok(by_stage(taps))
    }
}

fn wide<T: Copy + Into<i64>>(values: &[T]) -> Vec<i64> {
    values.iter().map(|&value| value.into()).collect()
}

/// A twin's taps under the names of the stages.
fn by_stage(taps: &ntmu_shaders::Taps) -> Taps {
    let mut stages = Taps::new();
    for (grid, tap) in (0_u8..).zip(&taps.grids) {
        let axis = |a: ntmu_isa::position::AxisPosition| {
            [i64::from(a.first), i64::from(a.stride), i64::from(a.phase)]
        };
        let position = [axis(tap.x), axis(tap.y)].concat();
        let corners = [(0, 0), (1, 0), (0, 1), (1, 1)];
        let cells = corners.iter().flat_map(|&(x, y): &(usize, usize)| {
            [i64::from(tap.columns[x]), i64::from(tap.rows[y])]
        });
        stages.insert(Stage::Grid(grid, GridPart::Position), position);
        stages.insert(Stage::Grid(grid, GridPart::Cells), cells.collect());
        stages.insert(Stage::Grid(grid, GridPart::Codes), wide(&tap.codes));
    }
    stages.insert(Stage::Inputs, wide(&taps.inputs));
    for (layer, tap) in (0_u8..).zip(&taps.layers) {
        stages.insert(
            Stage::Layer(layer, LayerPart::Accumulators),
            wide(&tap.accumulators),
        );
        stages.insert(
            Stage::Layer(layer, LayerPart::Activated),
            wide(&tap.activated),
        );
        if !tap.outputs.is_empty() {
            stages.insert(Stage::Layer(layer, LayerPart::Outputs), wide(&tap.outputs));
        }
    }
    stages.insert(Stage::Channels, wide(&taps.codes));
    stages
}
