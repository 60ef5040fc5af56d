//! Device: what computes the steps of a run.
//!
//! A backend belongs to the run, not to the configuration: it decides how fast an asset is made
//! and in which order sums are taken, not what is asked for. On [`Backend::Flex`] equal runs give
//! equal bytes on any number of threads. On a GPU every sum of this crate has a fixed order too
//! and nothing is added atomically, but burn chooses its matrix and convolution kernels by adapter
//! and driver, with `vulkan` by measuring them; so two runs agree to the rounding of f32 and no
//! further. The report, and the record of an asset made so, name the backend and the adapter.

use crate::error::TrainError;
use burn_tensor::Device;
use serde::{Deserialize, Serialize};

/// What computes the steps of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Backend {
    /// The processor: this crate's own kernels.
    #[default]
    Flex,
    /// burn's WGSL kernels through wgpu: any adapter, a software one too. Feature `wgpu`.
    Wgpu,
    /// burn's SPIR-V kernels on Vulkan, fused and tuned on the machine: GPUs only. Feature
    /// `vulkan`.
    Vulkan,
    /// burn's CUDA kernels, which this version of the trainer cannot have.
    Cuda,
}

impl Backend {
    /// Every backend that has a name.
    pub const ALL: [Backend; 4] = [Backend::Flex, Backend::Wgpu, Backend::Vulkan, Backend::Cuda];

    /// The name in commands and reports.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Backend::Flex => "flex",
            Backend::Wgpu => "wgpu",
            Backend::Vulkan => "vulkan",
            Backend::Cuda => "cuda",
        }
    }

    /// The backend of a name.
    ///
    /// # Errors
    /// When there is none of that name.
    pub fn by_name(name: &str) -> Result<Backend, TrainError> {
        let found = Backend::ALL.into_iter().find(|b| b.name() == name);
        let names = Backend::ALL.map(Backend::name).join(", ");
        found.ok_or_else(|| TrainError::config("backend", name, names))
    }

    /// The backends of this build.
    pub fn available() -> impl Iterator<Item = Backend> {
        Backend::ALL
            .into_iter()
            .filter(|backend| backend.missing().is_none())
    }

    /// Why this build does not have the backend.
    const fn missing(self) -> Option<&'static str> {
        match self {
            Backend::Flex => None,
            Backend::Wgpu if cfg!(feature = "vulkan") => Some(
                "this build has burn's SPIR-V compiler, which replaces the WGSL one; vulkan is what \
                 it offers, and a build with the feature train-wgpu alone offers wgpu",
            ),
            Backend::Wgpu if cfg!(feature = "wgpu") => None,
            Backend::Wgpu => Some("it comes with the feature train-wgpu"),
            Backend::Vulkan if cfg!(feature = "vulkan") => None,
            Backend::Vulkan => Some("it comes with the feature train-vulkan"),
            Backend::Cuda => Some(
                "burn 0.22 downloads LLVM while it builds for CUDA, so no feature brings it; vulkan \
                 runs on the same GPUs",
            ),
        }
    }

    /// Makes the backend ready; the first call decides the adapter for the whole process.
    ///
    /// # Errors
    /// When this build does not have the backend, when no adapter serves it, and when `vulkan`
    /// finds an adapter that is a processor: burn's SPIR-V kernels crash Mesa's lavapipe.
    pub fn open(self) -> Result<TrainingDevice, TrainError> {
        if let Some(reason) = self.missing() {
            return Err(self.refused(reason));
        }
        let (device, adapter) = match self {
            Backend::Flex | Backend::Cuda => (Device::flex(), None),
            Backend::Wgpu | Backend::Vulkan => {
                let (device, adapter) = adapter::open().map_err(|e| self.refused(e))?;
                (device, Some(adapter))
            }
        };
        Ok(TrainingDevice {
            backend: self,
            adapter,
            device,
        })
    }

    fn refused(self, reason: impl Into<String>) -> TrainError {
        TrainError::Backend {
            backend: self.name(),
            reason: reason.into(),
        }
    }
}

/// A backend that is ready.
#[derive(Clone, Debug)]
pub struct TrainingDevice {
    backend: Backend,
    adapter: Option<String>,
    device: Device,
}

impl TrainingDevice {
    /// The processor, which is always there.
    #[must_use]
    pub fn flex() -> TrainingDevice {
        TrainingDevice {
            backend: Backend::Flex,
            adapter: None,
            device: Device::flex(),
        }
    }

    /// The graph that a GPU runs, on the processor: what the tests of a run use.
    #[cfg(test)]
    pub(crate) fn graph_on_flex() -> TrainingDevice {
        TrainingDevice {
            backend: Backend::Wgpu,
            adapter: Some("the processor".to_owned()),
            device: Device::flex(),
        }
    }

    /// Its backend.
    #[must_use]
    pub const fn backend(&self) -> Backend {
        self.backend
    }

    /// Name, API and driver of its adapter; a processor has none.
    #[must_use]
    pub fn adapter(&self) -> Option<&str> {
        self.adapter.as_deref()
    }

    pub(crate) const fn tensors(&self) -> &Device {
        &self.device
    }

    /// Backend and adapter in one line.
    #[must_use]
    pub fn name(&self) -> String {
        match &self.adapter {
            Some(adapter) => format!("{} on {adapter}", self.backend.name()),
            None => self.backend.name().to_owned(),
        }
    }
}

#[cfg(any(feature = "wgpu", feature = "vulkan"))]
mod adapter {
    use burn_tensor::Device;
    use burn_tensor::wgpu::{WgpuBackend, wgpu::DeviceType};
    use std::sync::OnceLock;

    /// The adapter that wgpu prefers, and its name. burn keeps one device for the process and
    /// refuses to make it twice, hence the cell.
    pub(super) fn open() -> Result<(Device, String), String> {
        static OPENED: OnceLock<Result<(Device, String), String>> = OnceLock::new();
        OPENED.get_or_init(first).clone()
    }

    fn first() -> Result<(Device, String), String> {
        let vulkan = cfg!(feature = "vulkan");
        let api = if vulkan {
            WgpuBackend::Vulkan
        } else {
            WgpuBackend::Auto
        };
        let options = Device::wgpu_options().graphics_api(api);
        let (device, setup) = options.init_with_setup().map_err(|e| e.to_string())?;
        let info = setup.adapter.get_info();
        let name = format!("{}, {}, {}", info.name, info.backend, info.driver_info);
        if vulkan && info.device_type == DeviceType::Cpu {
            return Err(format!(
                "the adapter is a processor ({name}), on which burn's SPIR-V kernels crash; a build \
                 with the feature train-wgpu runs there"
            ));
        }
        Ok((device, name))
    }
}

#[cfg(not(any(feature = "wgpu", feature = "vulkan")))]
mod adapter {
    use burn_tensor::Device;

    /// Never called: such a build has no backend with an adapter.
    pub(super) fn open() -> Result<(Device, String), String> {
        Err("this build has no backend with an adapter".to_owned())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_backend_is_offered_or_says_what_brings_it() {
        for backend in Backend::ALL {
            assert_eq!(Backend::by_name(backend.name()).unwrap(), backend);
            if Backend::available().any(|b| b == backend) {
                continue;
            }
            let error = backend.open().unwrap_err().to_string();
            let brings = match backend {
                Backend::Flex => panic!("{error}"),
                Backend::Wgpu => "train-wgpu",
                Backend::Vulkan => "train-vulkan",
                Backend::Cuda => "LLVM",
            };
            assert!(error.contains(brings), "{error}");
        }
        let error = Backend::by_name("metal").unwrap_err().to_string();
        assert!(error.contains("flex, wgpu, vulkan, cuda"), "{error}");
    }

    #[test]
    fn the_processor_is_always_there() {
        let device = Backend::Flex.open().unwrap();
        assert_eq!((device.backend(), device.adapter()), (Backend::Flex, None));
        assert_eq!(device.name(), "flex");
    }
}
