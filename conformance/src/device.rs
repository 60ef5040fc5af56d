//! Device: a decoder under test.

use crate::stage::{self, Taps};
use crate::vector::{PositionAnswer, PositionQuery, RescaleQuery};
use ntmu_isa::layout::Layout;
use ntmu_isa::position::AxisPosition;
use ntmu_isa::rescale::Multiplier;
use ntmu_isa::{Asset, Program};
use ntmu_model::Request;
use ntmu_model::exec::Decoder;

/// Why a device gave no answer.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DeviceError {
    /// The device does not offer this, or not for this asset. The case does not count against it.
    #[error("not supported: {reason}")]
    Unsupported {
        /// What is missing.
        reason: String,
    },
    /// The device broke on the request: it crashed, timed out, or answered out of form. The case
    /// fails; the run goes on.
    #[error("{reason}")]
    Failed {
        /// What happened.
        reason: String,
    },
}

impl DeviceError {
    /// The device does not offer this.
    #[must_use]
    pub fn unsupported(reason: impl Into<String>) -> DeviceError {
        DeviceError::Unsupported {
            reason: reason.into(),
        }
    }

    /// The device broke on the request.
    #[must_use]
    pub fn failed(reason: impl Into<String>) -> DeviceError {
        DeviceError::Failed {
            reason: reason.into(),
        }
    }
}

/// A decoder under test: the model, its GPU twin, a program on the other end of a pipe.
///
/// Only [`Device::texel_codes`] must be there; everything else makes a diagnosis finer. Methods
/// take `&mut self`, because a device is a connection and not a function.
pub trait Device {
    /// What to call it in reports.
    fn name(&self) -> String;

    /// The channel codes of texels of one asset: one vector per request, in their order, one code
    /// per channel. The requests come from the asset's own shape.
    ///
    /// # Errors
    /// For the whole batch; the runner then asks for its texels one by one.
    fn texel_codes(
        &mut self,
        asset: &Asset,
        requests: &[Request],
    ) -> Result<Vec<Vec<i32>>, DeviceError>;

    /// The intermediate values of a texel, as many stages as the device has.
    ///
    /// # Errors
    /// By default the device has none.
    fn taps(&mut self, _asset: &Asset, _request: Request) -> Result<Taps, DeviceError> {
        Err(DeviceError::unsupported("taps"))
    }

    /// A rescaling by itself.
    ///
    /// # Errors
    /// By default the device cannot be asked for one.
    fn rescale(&mut self, _query: &RescaleQuery) -> Result<i32, DeviceError> {
        Err(DeviceError::unsupported("rescale"))
    }

    /// A grid position by itself.
    ///
    /// # Errors
    /// By default the device cannot be asked for one.
    fn position(&mut self, _query: &PositionQuery) -> Result<PositionAnswer, DeviceError> {
        Err(DeviceError::unsupported("position"))
    }

    /// Whether bytes are an asset: true to accept, false to refuse.
    ///
    /// # Errors
    /// By default the device reads no files.
    fn open(&mut self, _ntx: &[u8]) -> Result<bool, DeviceError> {
        Err(DeviceError::unsupported("open"))
    }
}

/// The model itself as a device. It passes by construction of the vectors, so running it tests the
/// committed files and the runner; independent of it are the twin and the oracle.
#[derive(Clone, Copy, Debug, Default)]
pub struct ModelDevice;

impl Device for ModelDevice {
    fn name(&self) -> String {
        "model".to_owned()
    }

    fn texel_codes(
        &mut self,
        asset: &Asset,
        requests: &[Request],
    ) -> Result<Vec<Vec<i32>>, DeviceError> {
        let program = Program::compile(asset, Layout::LINEAR);
        let decoder = Decoder::new(asset, &program);
        Ok(requests
            .iter()
            .map(|&request| decoder.texel(request, &mut ()))
            .collect())
    }

    fn taps(&mut self, asset: &Asset, request: Request) -> Result<Taps, DeviceError> {
        let program = Program::compile(asset, Layout::LINEAR);
        let taps = Decoder::new(asset, &program).taps(request);
        Ok(stage::from_model(&taps))
    }

    fn rescale(&mut self, query: &RescaleQuery) -> Result<i32, DeviceError> {
        let scale = Multiplier::new(query.mantissa, query.shift)
            .map_err(|error| DeviceError::failed(error.to_string()))?;
        Ok(query.requantizer.apply(query.value, scale))
    }

    fn position(&mut self, query: &PositionQuery) -> Result<PositionAnswer, DeviceError> {
        let position = AxisPosition::of(query.texel, query.mip, query.scale_log2, query.snap);
        let AxisPosition {
            first,
            stride,
            phase,
            ..
        } = position;
        let corners = position.corners(query.cells, query.address_mode);
        Ok(PositionAnswer {
            first,
            stride,
            phase,
            corners,
        })
    }

    fn open(&mut self, ntx: &[u8]) -> Result<bool, DeviceError> {
        Ok(Asset::from_bytes(ntx).is_ok())
    }
}
