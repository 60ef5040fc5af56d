//! Twin: one asset on one device.

use crate::error::TwinError;
use crate::gpu::{AdapterInfo, Gpu};
use crate::pack::{self, Packed};
use crate::part::{parts, work};
use crate::source::{WORKGROUP, source};
use crate::taps::{TapLayout, Taps};
use crate::variant::Variant;
use ntmu_isa::Asset;
use ntmu_isa::shape::Shape;
use std::sync::OnceLock;

/// Products of bytes, or what takes as long, of one dispatch at most, unless one workgroup has more:
/// drivers of devices that show pictures stop work that takes seconds.
const DISPATCH_WORK: u64 = 1 << 32;

/// Texels of one dispatch at most: bounds what the host keeps beside the answer.
const DISPATCH_TEXELS: u64 = 1 << 20;

/// Bytes of vectors or of taps of one dispatch at most.
const DISPATCH_BYTES: u64 = 1 << 26;

/// x, y, mip, as in `wgsl/bindings.wgsl`.
type RequestWords = [u32; 3];

/// One asset on one device, decoded by the shaders.
#[derive(Debug)]
pub struct Twin {
    gpu: Gpu,
    shape: Shape,
    variant: Variant,
    /// Of one texel; see [`DISPATCH_WORK`].
    work: u64,
    layout: TapLayout,
    /// Header, grids, rows and weights with their bindings.
    buffers: Vec<(u32, wgpu::Buffer)>,
    /// What each pass runs, in order.
    parts: Vec<wgpu::Buffer>,
    decode: wgpu::ComputePipeline,
    /// Compiled when taps are first asked for.
    decode_taps: OnceLock<wgpu::ComputePipeline>,
}

impl Twin {
    /// Uploads an asset to the device that [`Gpu::open`] chooses.
    ///
    /// # Errors
    /// [`TwinError::NoAdapter`] where there is none; otherwise as [`Twin::on`].
    pub fn new(asset: &Asset) -> Result<Twin, TwinError> {
        Twin::on(&Gpu::open()?, asset)
    }

    /// Uploads an asset to a device that is open already.
    ///
    /// # Errors
    /// [`TwinError::TooLarge`] when a grid is larger than the device can bind (at least 128 MiB,
    /// usually gigabytes); [`TwinError::Device`] when the device fails.
    pub fn on(gpu: &Gpu, asset: &Asset) -> Result<Twin, TwinError> {
        // Before they are packed, which takes as much memory again.
        for grid in 0..2 {
            gpu.check_size(&format!("grid {grid}"), pack::grid_bytes(asset, grid))?;
        }
        let layout = TapLayout::of(asset);
        let packed = Packed::of(asset, &layout);
        let storage = wgpu::BufferUsages::STORAGE;
        let [first, second] = &packed.grids;
        let buffers = vec![
            (
                0,
                gpu.upload("header", &packed.header, wgpu::BufferUsages::UNIFORM)?,
            ),
            (2, gpu.upload("grid 0", first, storage)?),
            (3, gpu.upload("grid 1", second, storage)?),
            (4, gpu.upload("rows", &packed.rows, storage)?),
            (5, gpu.upload("weights", &packed.weights, storage)?),
        ];
        let variant = Variant::of(asset);
        Ok(Twin {
            gpu: gpu.clone(),
            shape: asset.shape.clone(),
            variant,
            work: work(asset),
            layout,
            buffers,
            parts: parts(asset)
                .iter()
                .map(|part| gpu.upload("part", &part.words(), wgpu::BufferUsages::UNIFORM))
                .collect::<Result<_, _>>()?,
            decode: gpu.pipeline(source(&variant, false), "decode")?,
            decode_taps: OnceLock::new(),
        })
    }

    /// Who answers.
    #[must_use]
    pub fn adapter(&self) -> &AdapterInfo {
        self.gpu.adapter()
    }

    /// The channel codes of every texel of a mip: row after row, the channels of a texel together.
    ///
    /// # Errors
    /// [`TwinError::Request`] when the chain has no such mip, [`TwinError::Device`] when the device
    /// fails.
    pub fn mip(&self, mip: u8) -> Result<Vec<i32>, TwinError> {
        self.check(0, (0, 0, mip))?;
        let (width, height) = self.shape.mip_size(mip);
        let texels = u64::from(width) * u64::from(height);
        self.decode(texels, |index| {
            let width = u64::from(width);
            [
                (index % width) as u32,
                (index / width) as u32,
                u32::from(mip),
            ]
        })
    }

    /// The channel codes of each texel (x, y, mip), in the order of the requests.
    ///
    /// # Errors
    /// [`TwinError::Request`] for the first that does not exist, [`TwinError::Device`] when the
    /// device fails.
    pub fn texels(&self, requests: &[(u32, u32, u8)]) -> Result<Vec<i32>, TwinError> {
        self.check_all(requests)?;
        self.decode(requests.len() as u64, |index| {
            words(requests[index as usize])
        })
    }

    /// Every intermediate value of each texel (x, y, mip), in the order of the requests.
    ///
    /// # Errors
    /// As [`Twin::texels`].
    pub fn taps(&self, requests: &[(u32, u32, u8)]) -> Result<Vec<Taps>, TwinError> {
        self.check_all(requests)?;
        let pipeline = self.taps_pipeline()?;
        let texel_words = u64::from(self.layout.words);
        let room = DISPATCH_BYTES.min(self.gpu.max_binding_bytes());
        let chunk = self.chunk().min(room / (4 * texel_words)).max(1);
        let mut taps = Vec::with_capacity(requests.len());
        for requests in requests.chunks(chunk as usize) {
            let texels = requests.len() as u64;
            let uploaded = self.upload(requests.iter().map(|&request| words(request)))?;
            let codes = self
                .gpu
                .results(texels * u64::from(self.shape.channel_count()))?;
            let results = self.gpu.results(texels * texel_words)?;
            let vectors = self.vectors(texels)?;
            let own = [(1, &uploaded), (6, &codes), (7, &results), (9, &vectors)];
            let passes = self.passes(&own);
            let read = self
                .gpu
                .run(pipeline, &passes, workgroups(texels), &results)?;
            taps.extend(
                requests
                    .iter()
                    .zip(read.chunks_exact(texel_words as usize))
                    .map(|(&request, words)| self.layout.read(request, words)),
            );
        }
        Ok(taps)
    }

    fn taps_pipeline(&self) -> Result<&wgpu::ComputePipeline, TwinError> {
        if let Some(pipeline) = self.decode_taps.get() {
            return Ok(pipeline);
        }
        let pipeline = self.gpu.pipeline(source(&self.variant, true), "decode")?;
        Ok(self.decode_taps.get_or_init(|| pipeline))
    }

    /// Decodes `texels` requests, dispatch by dispatch.
    fn decode(
        &self,
        texels: u64,
        request: impl Fn(u64) -> RequestWords,
    ) -> Result<Vec<i32>, TwinError> {
        let channels = u64::from(self.shape.channel_count());
        let chunk = self.chunk();
        let mut codes = Vec::with_capacity((texels * channels) as usize);
        let mut start = 0;
        while start < texels {
            let end = texels.min(start + chunk);
            let uploaded = self.upload((start..end).map(&request))?;
            let results = self.gpu.results((end - start) * channels)?;
            let vectors = self.vectors(end - start)?;
            let passes = self.passes(&[(1, &uploaded), (6, &results), (9, &vectors)]);
            let groups = workgroups(end - start);
            codes.extend(self.gpu.run(&self.decode, &passes, groups, &results)?);
            start = end;
        }
        Ok(codes)
    }

    /// Texels of one dispatch: at least a workgroup.
    fn chunk(&self) -> u64 {
        let texel_bytes = (4 * u64::from(self.shape.channel_count()))
            .max(size_of::<RequestWords>() as u64)
            .max(16 * u64::from(self.variant.texel_elements()));
        let group = u64::from(WORKGROUP);
        (DISPATCH_WORK / self.work)
            .min(DISPATCH_TEXELS)
            .min(self.gpu.max_binding_bytes().min(DISPATCH_BYTES) / texel_bytes)
            .min(u64::from(self.gpu.max_workgroups()) * group)
            .max(group)
    }

    fn upload(
        &self,
        requests: impl Iterator<Item = RequestWords>,
    ) -> Result<wgpu::Buffer, TwinError> {
        let requests: Vec<RequestWords> = requests.collect();
        self.gpu
            .upload("requests", &requests, wgpu::BufferUsages::STORAGE)
    }

    /// The vectors of a dispatch.
    fn vectors(&self, texels: u64) -> Result<wgpu::Buffer, TwinError> {
        self.gpu
            .results(texels * 4 * u64::from(self.variant.texel_elements()))
    }

    /// The bindings of every pass: the asset's, a dispatch's own, and the pass's part.
    fn passes<'a>(&'a self, own: &[(u32, &'a wgpu::Buffer)]) -> Vec<Vec<(u32, &'a wgpu::Buffer)>> {
        let pass = |part| {
            let asset = self.buffers.iter().map(|(binding, b)| (*binding, b));
            asset
                .chain(own.iter().copied())
                .chain([(8, part)])
                .collect()
        };
        self.parts.iter().map(pass).collect()
    }

    fn check_all(&self, requests: &[(u32, u32, u8)]) -> Result<(), TwinError> {
        requests
            .iter()
            .enumerate()
            .try_for_each(|(index, &request)| self.check(index, request))
    }

    fn check(&self, index: usize, found: (u32, u32, u8)) -> Result<(), TwinError> {
        let (x, y, mip) = found;
        let mip_count = self.shape.mip_count;
        let allowed = if mip >= mip_count {
            format!("mips 0..={}", mip_count - 1)
        } else {
            let (width, height) = self.shape.mip_size(mip);
            if x < width && y < height {
                return Ok(());
            }
            format!("x 0..={} and y 0..={}", width - 1, height - 1)
        };
        Err(TwinError::Request {
            index,
            found,
            allowed,
        })
    }
}

fn words((x, y, mip): (u32, u32, u8)) -> RequestWords {
    [x, y, u32::from(mip)]
}

fn workgroups(texels: u64) -> u32 {
    texels.div_ceil(u64::from(WORKGROUP)) as u32
}
