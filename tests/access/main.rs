//! Trace files: what is written is read, CSV and Parquet agree, and what is wrong is named.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod agree;
mod damaged;
mod parquet_writer;
mod refused;
mod written;

use ntmu::access::{AccessError, TraceFile};
use ntmu::isa::latent::LatentFormat;
use ntmu::isa::profile::Profile;
use ntmu::isa::sampler::Sampler;
use ntmu::isa::shape::{GridShape, OutputFormat, Sampling, Shape};
use ntmu::model::sampler::Sampled;
use ntmu::model::{Demand, Demands};
use std::path::{Path, PathBuf};
use tempfile::TempDir;

pub(crate) fn shape(width: u32, height: u32) -> Shape {
    let grid = GridShape {
        channels: 1,
        format: LatentFormat::new(4).unwrap(),
        scale_log2: 3,
        sampling: Sampling::Interpolated,
    };
    Shape {
        octaves: 1,
        ..Shape::whole_chain(width, height, [grid; 2], vec![OutputFormat::Unorm8; 3])
    }
}

pub(crate) fn sampled(width: u32, height: u32, sampler: Sampler) -> Sampled {
    Sampled::new(shape(width, height), sampler, Profile::NORMATIVE).unwrap()
}

/// 64 × 32 texels with seven mips, and 16 × 16 with five.
pub(crate) fn materials() -> Vec<Sampled> {
    let anisotropic = Sampler {
        max_anisotropy: 4,
        ..Sampler::default()
    };
    vec![
        sampled(64, 32, Sampler::default()),
        sampled(16, 16, anisotropic),
    ]
}

pub(crate) fn all<D: Demands>(mut demands: D) -> Result<Vec<Demand>, D::Error> {
    let (mut found, mut demand) = (Vec::new(), Demand::default());
    while demands.advance(&mut demand)? {
        found.push(demand.clone());
    }
    Ok(found)
}

pub(crate) fn read(path: &Path, materials: &[Sampled]) -> Result<Vec<Demand>, AccessError> {
    all(TraceFile::open(path, materials)?)
}

pub(crate) fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

pub(crate) fn file(folder: &TempDir, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
    let path = folder.path().join(name);
    // Some file systems wait for the disk where a file is written over.
    if path.exists() {
        std::fs::remove_file(&path).unwrap();
    }
    std::fs::write(&path, bytes).unwrap();
    path
}
