//! A study small enough to know every figure of it.

mod page;
mod parts;

use super::MapPicture;
use crate::quality::{Figures, MapQuality, Quality};
use crate::study::{
    AssetStudy, Charge, EngineStudy, Findings, InBetween, LevelBytes, OracleStudy, Study,
    SweepPoint, TimingRow, TwinStudy, Variant, VariantOutcome, Variants,
};
use ndarray::Array3;
use ntmu_conformance::claims::{Channel, Distance};
use std::collections::BTreeMap;

fn charge(cause: &str, cycles: u64) -> Charge {
    Charge {
        cause: cause.to_owned(),
        cycles,
    }
}

fn row(unit: &str, layout: &str, ledger: Vec<Charge>) -> TimingRow {
    let cycles = ledger.iter().map(|charge| charge.cycles).sum();
    TimingRow {
        unit: unit.to_owned(),
        identity: format!("{unit}@0123456789ab"),
        layout: layout.to_owned(),
        access: "blocks".to_owned(),
        scene: "blocks:mip=0".to_owned(),
        pixels: 160,
        texels: 160,
        cycles,
        cycles_per_block: cycles as f64 / 10.0,
        block_cycles_p50: 44.4,
        block_cycles_p99: 55.5,
        closed_form_per_block: 31.41,
        critical_path_per_block: 30.33,
        without_cache_per_block: 99.44,
        infinite_cache_per_block: 35.55,
        bytes_per_block_without_cache: 888.81,
        bytes_per_block_infinite_cache: 21.71,
        levels: LevelBytes {
            latent_cache: 765.4,
            second_level: 0.0,
            memory: 26.26,
            weights: 0.92,
        },
        bytes_per_block: 27.18,
        hit_rate: 0.9371,
        mac_utilisation: 0.6113,
        mtexels_per_second: 1234.56,
        bottleneck: "MAC array".to_owned(),
        ledger,
    }
}

fn figures(psnr: f64, ssim: f64) -> Figures {
    Figures { psnr, ssim }
}

fn study() -> Study {
    let map = MapQuality {
        map: "color".to_owned(),
        encoding: "srgb",
        mips: vec![figures(34.567, 0.91234), figures(f64::INFINITY, 1.0)],
        overall: figures(35.11, 0.92),
        angles: None,
        perceptual: None,
    };
    Study {
        asset: AssetStudy {
            name: "brick-wall".to_owned(),
            size: (8, 4),
            mips: 2,
            channels: 3,
            texels: 40,
            latent_bits: [3, 5],
            precision: "w7a8".to_owned(),
            profile: "nt-d3d11@0123456789abcdef".to_owned(),
            macs_per_texel: 5376,
            grid_bytes: 36_864,
            parameter_bytes: 5712,
            bppc: 0.5774,
        },
        quality: Some(Quality {
            maps: vec![map],
            mips: vec![figures(33.33, 0.8765), figures(32.22, 0.8654)],
            overall: figures(31.11, 0.8543),
            sizes: vec![(8, 4), (4, 2)],
            masked_share: None,
        }),
        oracle: OracleStudy {
            codes: 786_429,
            histogram: vec![(-1, 4210), (0, 777_017), (1, 5202)],
            max: 1.83,
            rms: 0.2961,
            typical: 0.2914,
            bound: 41.7,
        },
        engine: EngineStudy {
            path: "some path".to_owned(),
            texels: 512,
            differing: 0,
        },
        claims: Findings {
            profile: "nt-d3d11@0123456789abcdef".to_owned(),
            texels: 512,
            overflowing: 0,
            not_naive: 0,
            stages: BTreeMap::from([(
                "inputs".to_owned(),
                Distance {
                    lane: 3,
                    found: 0.49,
                    bound: 0.5,
                },
            )]),
            channels: vec![Channel {
                observed_max: 1.83,
                worst: 41.7,
                observed_rms: 0.2961,
                predicted_rms: 0.2914,
            }],
        },
        twin: TwinStudy::Ran {
            adapter: "some adapter".to_owned(),
            codes: 786_429,
            differing: 0,
            first: None,
        },
        timing: vec![
            row(
                "small",
                "linear",
                vec![charge("compute", 400), charge("latent-miss", 57)],
            ),
            row(
                "small",
                "tiles-4",
                vec![charge("weight-fill", 3), charge("compute", 401)],
            ),
        ],
        lab: None,
        sweep: [
            (4, 8, 34.25, 0.577),
            (4, 6, 33.5, 0.561),
            (3, 8, 29.75, 0.455),
        ]
        .map(|(latent_bits, weight_bits, psnr, bppc)| SweepPoint {
            latent_bits,
            weight_bits,
            psnr,
            bppc,
        })
        .to_vec(),
        in_between: vec![InBetween {
            lod: 0.5,
            way: "two decodes",
            psnr: 30.5,
            decodes: 8.0,
        }],
        variants: Variants {
            texels: 32_768,
            psnr: Some(31.12),
            tried: vec![
                Variant {
                    name: "<gemmlowp>".to_owned(),
                    outcome: VariantOutcome::Decoded {
                        differing: 6021,
                        codes: 786_429,
                        largest: 3,
                        psnr: Some(31.09),
                        bppc: 0.577,
                    },
                },
                Variant {
                    name: "fp16 layers".to_owned(),
                    outcome: VariantOutcome::Impossible {
                        reason: "layer 2: found a table".to_owned(),
                    },
                },
            ],
        },
    }
}

fn ramp(channels: usize, rows: usize, columns: usize) -> Array3<f32> {
    let texels = (channels * rows * columns) as f32;
    let mut next = 0.0;
    Array3::from_shape_simple_fn((channels, rows, columns), || {
        next += 1.0;
        next / texels
    })
}

fn picture<'a>(source: Option<&'a Array3<f32>>, decoded: &'a Array3<f32>) -> MapPicture<'a> {
    MapPicture {
        map: "color",
        source: source.map(|texels| texels.view()),
        decoded: decoded.view(),
    }
}
