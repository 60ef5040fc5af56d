//! Choices: what a configuration picks from a list, as its files name it.

use ntmu_isa::embed::Wave;
use ntmu_isa::position::{AddressMode, CornerSnap};
use ntmu_isa::shape::Sampling;
use serde::{Deserialize, Serialize};

pub use ntmu_isa::preset::ActivationKind;

/// Where the first corner lies when the stride is more than one cell; see
/// [`ntmu_isa::position::CornerSnap`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Snap {
    /// The cell just below the texel centre.
    Cell,
    /// The multiple of the stride just below the texel centre.
    Stride,
}

impl From<Snap> for CornerSnap {
    fn from(snap: Snap) -> CornerSnap {
        match snap {
            Snap::Cell => CornerSnap::Cell,
            Snap::Stride => CornerSnap::Stride,
        }
    }
}

impl From<CornerSnap> for Snap {
    fn from(snap: CornerSnap) -> Snap {
        match snap {
            CornerSnap::Cell => Snap::Cell,
            CornerSnap::Stride => Snap::Stride,
        }
    }
}

/// What a corner outside the grid means; see [`ntmu_isa::position::AddressMode`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Address {
    /// The grid repeats.
    Wrap,
    /// The grid repeats, every other copy reversed.
    Mirror,
    /// The edge cell continues.
    Clamp,
}

impl From<Address> for AddressMode {
    fn from(address: Address) -> AddressMode {
        match address {
            Address::Wrap => AddressMode::Wrap,
            Address::Mirror => AddressMode::Mirror,
            Address::Clamp => AddressMode::Clamp,
        }
    }
}

impl From<AddressMode> for Address {
    fn from(address: AddressMode) -> Address {
        match address {
            AddressMode::Wrap => Address::Wrap,
            AddressMode::Mirror => Address::Mirror,
            AddressMode::Clamp => Address::Clamp,
        }
    }
}

/// The form of the waves; see [`ntmu_isa::embed::Wave`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WaveForm {
    /// Continuous, as in the NTC paper.
    Triangle,
    /// With a fall at the period's end, as in NVIDIA's RTX SDK.
    Saw,
}

impl From<WaveForm> for Wave {
    fn from(form: WaveForm) -> Wave {
        match form {
            WaveForm::Triangle => Wave::Triangle,
            WaveForm::Saw => Wave::Saw,
        }
    }
}

impl From<Wave> for WaveForm {
    fn from(form: Wave) -> WaveForm {
        match form {
            Wave::Triangle => WaveForm::Triangle,
            Wave::Saw => WaveForm::Saw,
        }
    }
}

/// What a grid gives the synthesizer; see [`ntmu_isa::shape::Sampling`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GridSampling {
    /// The four corners one after the other.
    Corners,
    /// One latent a channel, interpolated among the four corners.
    Interpolated,
}

impl From<GridSampling> for Sampling {
    fn from(sampling: GridSampling) -> Sampling {
        match sampling {
            GridSampling::Corners => Sampling::Corners,
            GridSampling::Interpolated => Sampling::Interpolated,
        }
    }
}

impl From<Sampling> for GridSampling {
    fn from(sampling: Sampling) -> GridSampling {
        match sampling {
            Sampling::Corners => GridSampling::Corners,
            Sampling::Interpolated => GridSampling::Interpolated,
        }
    }
}

/// The arithmetic of a layer; see [`ntmu_isa::layer::Parameters`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Precision {
    /// Integers: weights of [`crate::TrainConfig::weight_bits`], activations of
    /// [`crate::TrainConfig::activation_bits`].
    Int8,
    /// Halves, summed in f32.
    Fp16,
}

impl Precision {
    /// The name in configurations and errors.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Precision::Int8 => "int8",
            Precision::Fp16 => "fp16",
        }
    }
}
