//! Path: which instructions the engine computes with.

use super::kernel::Kernels;

/// A set of instructions that the engine has kernels for. All give the same codes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Path {
    /// Plain Rust; on every processor.
    Scalar,
    /// x86-64 with AVX2 and FMA.
    Avx2,
    /// x86-64 with AVX-512 F, BW and VNNI.
    Avx512Vnni,
    /// 64-bit Arm.
    Neon,
}

impl Path {
    /// Every path, the fastest of an architecture last.
    pub const ALL: [Path; 4] = [Path::Scalar, Path::Avx2, Path::Avx512Vnni, Path::Neon];

    /// The name in tables and JSON.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Path::Scalar => "scalar",
            Path::Avx2 => "avx2",
            Path::Avx512Vnni => "avx512-vnni",
            Path::Neon => "neon",
        }
    }

    /// The paths that this processor can run, the fastest last; [`Path::Scalar`] is always there.
    #[must_use]
    pub fn available() -> Vec<Path> {
        Path::ALL
            .into_iter()
            .filter(|&path| Kernels::new(path).is_some())
            .collect()
    }
}
