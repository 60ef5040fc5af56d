//! Gpu: one device without a window, and how work reaches it and comes back.

use crate::error::TwinError;
use wgpu::util::{BufferInitDescriptor, DeviceExt};

/// The environment variable that names the adapter: any part of its name, in any case.
pub const ADAPTER_VARIABLE: &str = "WGPU_ADAPTER_NAME";

/// Storage buffers that the shader with taps binds.
const STORAGE_BUFFERS: u32 = 8;

/// Who answers.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdapterInfo {
    /// The adapter's name, as its driver gives it.
    pub name: String,
    /// `vulkan`, `metal`, `dx12`.
    pub backend: String,
    /// The driver's name and version.
    pub driver: String,
    /// It is the CPU in disguise.
    pub is_software: bool,
}

/// One device without a window. Clones share it.
#[derive(Clone, Debug)]
pub struct Gpu {
    device: wgpu::Device,
    queue: wgpu::Queue,
    info: AdapterInfo,
}

impl Gpu {
    /// Opens the adapter that `WGPU_ADAPTER_NAME` names; without it the first of discrete,
    /// integrated, virtual, other and software adapters. `WGPU_BACKEND` restricts the backends.
    ///
    /// # Errors
    /// [`TwinError::NoAdapter`] when none serves, [`TwinError::NoDevice`] when it does not open.
    pub fn open() -> Result<Gpu, TwinError> {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        // Validation layers and debug labels only where the environment asks for them.
        descriptor.flags = wgpu::InstanceFlags::empty();
        let descriptor = descriptor.with_env();
        let backends = descriptor.backends;
        let instance = wgpu::Instance::new(descriptor);
        let adapter = choose(pollster::block_on(instance.enumerate_adapters(backends)))?;

        let info = describe(&adapter.get_info());
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("ntmu twin"),
            required_limits: adapter.limits(),
            ..Default::default()
        }))
        .map_err(|error| TwinError::NoDevice {
            adapter: info.name.clone(),
            reason: error.to_string(),
        })?;
        Ok(Gpu {
            device,
            queue,
            info,
        })
    }

    /// Who answers.
    #[must_use]
    pub fn adapter(&self) -> &AdapterInfo {
        &self.info
    }

    /// Bytes that one storage binding may have.
    pub(crate) fn max_binding_bytes(&self) -> u64 {
        let limits = self.device.limits();
        let binding = limits.max_storage_buffer_binding_size;
        // The shader counts bytes in 32 bits.
        binding
            .min(limits.max_buffer_size)
            .min(u64::from(u32::MAX) - 3)
    }

    /// Workgroups along one dimension of a dispatch.
    pub(crate) fn max_workgroups(&self) -> u32 {
        self.device.limits().max_compute_workgroups_per_dimension
    }

    /// A read-only buffer with these words.
    ///
    /// # Errors
    /// [`TwinError::TooLarge`] when it could not be bound.
    pub(crate) fn upload<T: bytemuck::NoUninit>(
        &self,
        part: &str,
        contents: &[T],
        usage: wgpu::BufferUsages,
    ) -> Result<wgpu::Buffer, TwinError> {
        let contents: &[u8] = bytemuck::cast_slice(contents);
        self.check_size(part, contents.len() as u64)?;
        self.guarded("an upload", || {
            self.device.create_buffer_init(&BufferInitDescriptor {
                label: Some(part),
                contents,
                usage,
            })
        })
    }

    /// Refuses a binding that is too large.
    pub(crate) fn check_size(&self, part: &str, bytes: u64) -> Result<(), TwinError> {
        let allowed = self.max_binding_bytes();
        if bytes > allowed {
            return Err(TwinError::TooLarge {
                part: part.to_owned(),
                found: bytes,
                allowed,
            });
        }
        Ok(())
    }

    /// A buffer that the shader writes and [`Gpu::run`] reads back.
    ///
    /// # Errors
    /// [`TwinError::Device`] when there is no memory for it.
    pub(crate) fn results(&self, words: u64) -> Result<wgpu::Buffer, TwinError> {
        self.buffer(
            words * 4,
            wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC,
        )
    }

    fn buffer(&self, size: u64, usage: wgpu::BufferUsages) -> Result<wgpu::Buffer, TwinError> {
        self.guarded("an allocation", || {
            self.device.create_buffer(&wgpu::BufferDescriptor {
                label: None,
                size,
                usage,
                mapped_at_creation: false,
            })
        })
    }

    /// The pipeline of one entry point.
    ///
    /// # Errors
    /// [`TwinError::Device`] when the text or the driver's compiler fails.
    pub(crate) fn pipeline(
        &self,
        source: String,
        entry_point: &str,
    ) -> Result<wgpu::ComputePipeline, TwinError> {
        self.guarded("compiling", || {
            let module = self
                .device
                .create_shader_module(wgpu::ShaderModuleDescriptor {
                    label: Some("ntmu"),
                    source: wgpu::ShaderSource::Wgsl(source.into()),
                });
            self.device
                .create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                    label: Some(entry_point),
                    layout: None,
                    module: &module,
                    entry_point: Some(entry_point),
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    cache: None,
                })
        })
    }

    /// Runs a pipeline pass after pass, each over its bindings (number and buffer, group 0), and
    /// reads back `results`.
    ///
    /// # Errors
    /// [`TwinError::Device`] when the device refuses or loses the work.
    pub(crate) fn run(
        &self,
        pipeline: &wgpu::ComputePipeline,
        passes: &[Vec<(u32, &wgpu::Buffer)>],
        workgroups: u32,
        results: &wgpu::Buffer,
    ) -> Result<Vec<i32>, TwinError> {
        let size = results.size();
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let readable = self.buffer(size, usage)?;
        self.guarded("a dispatch", || {
            let layout = pipeline.get_bind_group_layout(0);
            let mut encoder = self.device.create_command_encoder(&Default::default());
            for bindings in passes {
                let entries: Vec<_> = bindings
                    .iter()
                    .map(|&(binding, buffer)| wgpu::BindGroupEntry {
                        binding,
                        resource: buffer.as_entire_binding(),
                    })
                    .collect();
                let group = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
                    label: None,
                    layout: &layout,
                    entries: &entries,
                });
                let mut pass = encoder.begin_compute_pass(&Default::default());
                pass.set_pipeline(pipeline);
                pass.set_bind_group(0, &group, &[]);
                pass.dispatch_workgroups(workgroups, 1, 1);
            }
            encoder.copy_buffer_to_buffer(results, 0, &readable, 0, size);
            self.queue.submit([encoder.finish()])
        })?;
        self.read(&readable)
    }

    fn read(&self, readable: &wgpu::Buffer) -> Result<Vec<i32>, TwinError> {
        let failed = |reason: String| TwinError::Device {
            during: "reading back",
            reason,
        };
        let (sender, receiver) = std::sync::mpsc::channel();
        self.guarded("reading back", || {
            readable.map_async(wgpu::MapMode::Read, .., move |outcome| {
                // The receiver waits below.
                let _ = sender.send(outcome);
            });
        })?;
        self.device
            .poll(wgpu::PollType::wait_indefinitely())
            .map_err(|error| failed(error.to_string()))?;
        // Another thread's poll may be the one that delivers it.
        receiver
            .recv()
            .map_err(|error| failed(error.to_string()))?
            .map_err(|error| failed(error.to_string()))?;
        let view = readable
            .get_mapped_range(..)
            .map_err(|error| failed(error.to_string()))?;
        // Bytes first: the mapping promises no alignment.
        Ok(bytemuck::pod_collect_to_vec(&view[..]))
    }

    /// Runs `work` with every error of the device caught, which would end the process otherwise.
    fn guarded<T>(&self, during: &'static str, work: impl FnOnce() -> T) -> Result<T, TwinError> {
        let scopes = [
            wgpu::ErrorFilter::OutOfMemory,
            wgpu::ErrorFilter::Internal,
            wgpu::ErrorFilter::Validation,
        ]
        .map(|filter| self.device.push_error_scope(filter));
        let made = work();
        // Scopes close in the reverse of the order in which they were opened.
        let errors: Vec<_> = scopes
            .into_iter()
            .rev()
            .filter_map(|scope| pollster::block_on(scope.pop()))
            .collect();
        match errors.first() {
            None => Ok(made),
            Some(error) => Err(TwinError::Device {
                during,
                reason: error.to_string(),
            }),
        }
    }
}

fn describe(info: &wgpu::AdapterInfo) -> AdapterInfo {
    AdapterInfo {
        name: info.name.clone(),
        backend: info.backend.to_str().to_owned(),
        driver: format!("{} {}", info.driver, info.driver_info)
            .trim()
            .to_owned(),
        is_software: info.device_type == wgpu::DeviceType::Cpu,
    }
}

/// The adapter to use of those that are there.
fn choose(adapters: Vec<wgpu::Adapter>) -> Result<wgpu::Adapter, TwinError> {
    let named = std::env::var(ADAPTER_VARIABLE).ok();
    let mut found = Vec::new();
    let mut best: Option<(u8, wgpu::Adapter)> = None;
    for adapter in adapters {
        let info = adapter.get_info();
        if let Some(reason) = refusal(&adapter, named.as_deref()) {
            let backend = info.backend.to_str();
            found.push(format!("{} on {backend} ({reason})", info.name));
            continue;
        }
        let rank = rank(info.device_type);
        if best.as_ref().is_none_or(|(other, _)| rank < *other) {
            best = Some((rank, adapter));
        }
    }
    best.map(|(_, adapter)| adapter)
        .ok_or_else(|| TwinError::NoAdapter {
            wanted: named.map_or("one with compute shaders".to_owned(), |name| {
                format!("one named {name:?} ({ADAPTER_VARIABLE}) with compute shaders")
            }),
            found,
        })
}

/// Why an adapter does not serve, if it does not.
fn refusal(adapter: &wgpu::Adapter, named: Option<&str>) -> Option<&'static str> {
    let name = adapter.get_info().name.to_lowercase();
    let capabilities = adapter.get_downlevel_capabilities();
    if named.is_some_and(|wanted| !name.contains(&wanted.to_lowercase())) {
        Some("another name")
    } else if !capabilities
        .flags
        .contains(wgpu::DownlevelFlags::COMPUTE_SHADERS)
    {
        Some("no compute shaders")
    } else if adapter.limits().max_storage_buffers_per_shader_stage < STORAGE_BUFFERS {
        Some("too few storage buffers")
    } else {
        None
    }
}

/// Lower is better.
const fn rank(device_type: wgpu::DeviceType) -> u8 {
    match device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}
