//! Latents that settle on an asset's own decode.

use super::integers::decibels_by_isa;
use super::{resumed, run, small, source};
use crate::batch::all_texels;
use crate::engine::{Engine, View};
use crate::import;
use crate::model::Ground;
use crate::sampler::Window;
use crate::settle::{Settling, settle};
use crate::{
    Address, GridSampling, Precision, Progress, Pyramid, Round, Source, TrainConfig, TrainError,
    Trained, TrainingDevice, Watch, watched,
};
use ntmu_isa::Asset;
use ntmu_isa::asset::Parts;
use ntmu_isa::shape::OutputFormat;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};

fn settled(asset: &Asset, source: &Source, rounds: u32) -> (Asset, Vec<Round>) {
    let running = AtomicBool::new(false);
    settle(
        asset,
        source,
        &BTreeMap::new(),
        rounds,
        &running,
        &mut |_| {},
    )
    .unwrap()
}

/// Configurations whose texels read their grids in every way that there is.
fn readings() -> Vec<TrainConfig> {
    let reading = |pyramid, address, sampling| TrainConfig {
        pyramid,
        address,
        sampling: [sampling; 2],
        ..small()
    };
    let (corners, interpolated) = (GridSampling::Corners, GridSampling::Interpolated);
    vec![
        small(),
        reading(Pyramid::NTC, Address::Wrap, corners),
        reading(Pyramid::EVERY_MIP, Address::Clamp, interpolated),
        reading(Pyramid::SINGLE, Address::Mirror, interpolated),
        TrainConfig {
            precision: Precision::Fp16,
            ..reading(Pyramid::new(2, 1).unwrap(), Address::Clamp, corners)
        },
    ]
}

#[test]
fn every_round_brings_the_decode_nearer_and_says_how_near() {
    let source = source(47, 38, 4);
    for config in readings() {
        let config = TrainConfig {
            settle: Some(0),
            ..config
        };
        let trained = run(&source, &config).unwrap();
        assert!(trained.report.settled.is_empty());
        let mut before = decibels_by_isa(&source, &trained.asset);
        for number in 1..=3 {
            let (asset, rounds) = settled(&trained.asset, &source, number);
            let last = rounds.last().unwrap();
            let after = decibels_by_isa(&source, &asset);
            // The same squares, summed in f32 for each texel.
            assert!((after - last.psnr).abs() < 1e-4, "{after} {last:?}");
            // A run this short leaves plenty to find.
            assert!(last.moved > 0 && after > before, "{before} {last:?}");
            before = after;
            let kept = |asset: &Asset| {
                Asset::new(Parts {
                    grids: trained.asset.grids.clone(),
                    ..asset.clone().into_parts()
                })
            };
            assert_eq!(
                kept(&asset).unwrap(),
                trained.asset,
                "more than codes changed"
            );
        }
    }
}

#[test]
fn a_run_settles_as_its_asset_would_afterwards() {
    let source = source(47, 38, 4);
    let with = |settle| TrainConfig { settle, ..small() };
    let unsettled = run(&source, &with(Some(0))).unwrap();
    let (asset, rounds) = settled(&unsettled.asset, &source, 2);
    let trained = run(&source, &with(Some(2))).unwrap();
    assert_eq!(trained.asset.grids, asset.grids);
    assert_eq!(trained.report.settled, rounds);
    let stated = trained.report.psnr_quantised;
    assert!(
        (decibels_by_isa(&source, &asset) - stated).abs() < 1e-7,
        "{stated}"
    );
    let said = |trained: &Trained| {
        let record = &trained.asset.metadata.record;
        let found = record.iter().find(|(key, _)| key == "settle");
        found.map(|(_, value)| value.clone())
    };
    assert_eq!(said(&unsettled).as_deref(), Some("0"));
    assert_eq!(said(&trained).as_deref(), Some("2"));
    // An effort settles by itself while a round brings something.
    let all = run(&source, &with(Some(8))).unwrap().report.settled;
    let psnrs = all.iter().map(|round| round.psnr);
    let before = [unsettled.report.psnr_quantised]
        .into_iter()
        .chain(psnrs.clone());
    let gains: Vec<f64> = psnrs
        .zip(before)
        .map(|(after, before)| after - before)
        .collect();
    let enough = gains.iter().position(|&gain| gain < 0.03).unwrap() + 1;
    let own = run(&source, &with(None)).unwrap();
    assert_eq!(own.report.settled, all[..enough], "{gains:?}");
    assert_eq!(said(&own), Some(enough.to_string()));
}

/// More texels than a batch has, the last of which is not full.
#[test]
fn the_gradient_is_that_of_all_texels_at_once() {
    let source = source(144, 128, 1);
    let config = TrainConfig {
        settle: Some(0),
        ..small()
    };
    let asset = run(&source, &config).unwrap().asset;
    let ground = Ground::new(&config, &source).unwrap();
    let (topology, network) = import::network(&asset).unwrap();
    let embedding = import::embedding(&asset);
    let texels: Vec<_> = all_texels(&ground.texels.sizes).collect();
    let mut engine = Engine::new(&topology, texels.len(), ground.texels.channels);
    engine.batch.texels.copy_from_slice(&texels);
    let seen = [0, 1].map(|g: usize| -> Vec<f32> {
        let format = asset.shape.grids[g].format;
        let codes = asset.grids[g].iter();
        codes.map(|&code| format.value(code) as f32).collect()
    });
    let windows = Window::whole(&ground.positions);
    engine.step(View {
        network: &network,
        embedding,
        positions: &ground.positions,
        windows: &windows,
        seen: [&seen[0], &seen[1]],
        texels: &ground.texels,
    });
    let mut expected = seen.clone().map(|codes| vec![0.0_f32; codes.len()]);
    let [g0, g1] = &mut expected;
    engine.scatter(embedding, [g0, g1]);
    let settling = Settling::new(asset, &ground.texels, &ground.positions).unwrap();
    for (found, expected) in settling.gradient().iter().zip(&expected) {
        let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>().sqrt();
        let reals = |v: &[f32]| v.iter().map(|&x| f64::from(x)).collect::<Vec<_>>();
        let (found, expected) = (reals(found), reals(expected));
        // A batch divides by its own number of texels.
        let factor = norm(&mut found.iter().copied()) / norm(&mut expected.iter().copied());
        let left = found.iter().zip(&expected).map(|(f, e)| f - factor * e);
        let share = norm(&mut { left }) / norm(&mut found.iter().copied());
        // The rounding of sums in f32, of 18,432 texels at most.
        assert!(share < 1e-5, "{share:e}");
    }
}

/// Stops the run once a round is over.
struct AfterARound<'a>(&'a AtomicBool);

impl Watch for AfterARound<'_> {
    fn observe(&mut self, _progress: &Progress) {}

    fn settled(&mut self, _round: &Round) {
        self.0.store(true, Ordering::Relaxed);
    }
}

#[test]
fn a_run_stopped_between_rounds_and_resumed_equals_the_uninterrupted_run() {
    let source = source(47, 38, 4);
    let config = TrainConfig {
        settle: Some(3),
        ..small()
    };
    let whole = run(&source, &config).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.checkpoint");
    let stop = AtomicBool::new(false);
    let device = TrainingDevice::flex();
    let watch = &mut AfterARound(&stop);
    let stopped = watched(&source, &config, &device, Some(&path), false, &stop, watch);
    let error = stopped.unwrap_err();
    assert!(
        matches!(&error, TrainError::Stopped { checkpoint: Some(p), .. } if *p == path),
        "{error}"
    );
    let resumed = resumed(&source, &config, &path).unwrap();
    assert_eq!(resumed.asset, whole.asset);
    assert_eq!(resumed.report.settled, whole.report.settled);
}

#[test]
fn a_set_that_the_asset_is_not_of_is_refused_by_field() {
    let of = |width, height, mips| source(width, height, mips);
    let config = TrainConfig {
        settle: Some(0),
        ..small()
    };
    let asset = run(&of(24, 16, 3), &config).unwrap().asset;
    let mut other = of(24, 16, 3);
    other.outputs[0] = OutputFormat::Unorm16;
    let weights: BTreeMap<_, _> = [("nothing".to_owned(), 1.0)].into();
    let none = BTreeMap::new();
    for (source, weights, field) in [
        (of(24, 17, 3), &none, "mips"),
        (of(24, 16, 2), &none, "mips"),
        (other, &none, "outputs"),
        (of(24, 16, 3), &weights, "nothing"),
    ] {
        let running = AtomicBool::new(false);
        let refused = settle(&asset, &source, weights, 1, &running, &mut |_| {});
        let said = refused.unwrap_err().to_string();
        assert!(said.contains(field), "{said}");
    }
}
