//! Plans: every kind of stage does its part.

use super::{resumed, run, small, source, stopped_at, usual};
use crate::plan::{Arithmetic, Plan, Shown, Train};
use crate::{Mips, Precision, TrainConfig};

/// One stage of a plan, as TOML.
fn stage(train: &str, steps: u64, latents: &str, numbers: &str) -> String {
    format!(
        "[[stage]]\ntrain = {train:?}\nsteps = {steps}\nlatents = {latents:?}\nnumbers = \
         {numbers:?}\nwarm_up = 10\n"
    )
}

fn plan(stages: &[String]) -> TrainConfig {
    let text = format!("name = \"test\"\n{}", stages.concat());
    TrainConfig {
        plan: Some(Plan::parse(&text).unwrap()),
        ..small()
    }
}

#[test]
fn an_encoder_learns_with_noise_with_rounded_latents_and_in_the_numbers_of_the_decode() {
    let source = source(64, 64, 5);
    for precision in [Precision::Int8, Precision::Fp16] {
        for (latents, numbers) in [
            ("noise", "real"),
            ("rounded", "real"),
            ("rounded", "deployed"),
        ] {
            let quality = |steps| {
                let config = TrainConfig {
                    precision,
                    ..plan(&[stage("encoder", steps, latents, numbers)])
                };
                run(&source, &config).unwrap().report.psnr_quantised
            };
            let (short, long) = (quality(2), quality(150));
            assert!(long > short + 2.0, "{latents} {numbers}: {short} {long}");
        }
    }
}

#[test]
fn a_synthesizer_stage_leaves_the_latents_and_improves_the_asset() {
    let source = source(64, 64, 4);
    let before = run(&source, &plan(&[stage("latents", 60, "noise", "real")])).unwrap();
    for numbers in ["real", "deployed"] {
        let stages = [
            stage("latents", 60, "noise", "real"),
            stage("synthesizer", 150, "rounded", numbers),
        ];
        let after = run(&source, &plan(&stages)).unwrap();
        assert_eq!(after.asset.grids, before.asset.grids, "{numbers}");
        assert!(after.report.psnr_quantised > before.report.psnr_quantised + 0.5);
    }
}

#[test]
fn latents_learn_rounded_in_reals() {
    let source = source(64, 64, 4);
    let quality = |steps| {
        let config = plan(&[stage("latents", steps, "rounded", "real")]);
        run(&source, &config).unwrap().report.psnr_quantised
    };
    assert!(quality(200) > quality(5) + 4.0);
}

#[test]
fn the_plan_of_an_effort_written_out_makes_the_same_latents_and_layers() {
    let source = source(48, 40, 4);
    let generated = TrainConfig {
        effort: 0,
        plan: None,
        ..small()
    };
    let first = run(&source, &generated).unwrap();
    let steps: [u64; 3] = first.report.steps.clone().try_into().unwrap();
    let written = TrainConfig {
        plan: Some(usual(steps)),
        ..generated
    };
    let second = run(&source, &written).unwrap();
    assert_eq!(first.asset.grids, second.asset.grids);
    assert_eq!(first.asset.layers, second.asset.layers);
}

#[test]
fn the_short_paper_plan_runs_with_and_without_its_encoder() {
    let source = source(64, 64, 4);
    for plan in [
        Plan::by_name("paper-short").unwrap(),
        Plan::by_name("paper-short").unwrap().without_encoder(),
    ] {
        let steps = vec![2; plan.stage.len()];
        let mut plan = plan.with_steps(&steps).unwrap();
        for stage in &mut plan.stage {
            stage.batch = Some(768);
        }
        let config = TrainConfig {
            plan: Some(plan),
            ..small()
        };
        let report = run(&source, &config).unwrap().report;
        assert_eq!(report.steps, [2, 0, 0, 0, 0, 2, 2]);
    }
}

#[test]
fn a_plan_for_larger_sets_alone_is_refused() {
    let mut config = plan(&[stage("latents", 3, "noise", "real")]);
    config.plan.as_mut().unwrap().stage[0].least_side = 65;
    let error = run(&source(64, 64, 2), &config).unwrap_err().to_string();
    assert!(error.contains("least_side"), "{error}");
}

#[test]
fn a_target_that_is_reached_ends_the_run_and_one_that_is_not_is_said() {
    let source = source(64, 64, 4);
    let with = |target| TrainConfig {
        target_psnr: Some(target),
        plan: Some(usual([0, 800, 200])),
        ..small()
    };
    let mut seen = Vec::new();
    let stop = std::sync::atomic::AtomicBool::new(false);
    let mut observer = |p: &crate::Progress| {
        if let Some(psnr) = p.deployed_psnr {
            seen.push((p.done, psnr));
        }
    };
    let reached = crate::train(
        &source,
        &with(18.0),
        &crate::TrainingDevice::flex(),
        None,
        false,
        &stop,
        &mut observer,
    )
    .unwrap();
    assert_eq!(reached.report.reached, Some(true));
    let (done, psnr) = *seen.last().unwrap();
    // What was measured is what was written.
    assert_eq!(psnr.to_bits(), reached.report.psnr_quantised.to_bits());
    assert!(done < 1000 && psnr >= 18.0, "{seen:?}");
    assert!(seen[..seen.len() - 1].iter().all(|(_, psnr)| *psnr < 18.0));
    let missed = run(&source, &with(90.0)).unwrap().report;
    assert_eq!(missed.reached, Some(false));
    // Looking does not change what is made.
    let plain = TrainConfig {
        target_psnr: None,
        ..with(0.0)
    };
    let plain = run(&source, &plain).unwrap().report;
    assert_eq!(
        plain.psnr_quantised.to_bits(),
        missed.psnr_quantised.to_bits()
    );
}

#[test]
fn a_budget_of_time_fixes_steps_with_which_the_run_can_be_repeated() {
    let source = source(64, 64, 4);
    let timed = TrainConfig {
        seconds: Some(2.0),
        plan: Some(usual([20, 3000, 1000])),
        ..small()
    };
    let first = run(&source, &timed).unwrap();
    let steps: [u64; 3] = first.report.steps.clone().try_into().unwrap();
    assert!(steps.iter().all(|&n| n > 0));
    let repeated = TrainConfig {
        seconds: None,
        plan: Some(usual(steps)),
        settle: Some(first.report.settled.len() as u32),
        ..timed
    };
    assert_eq!(run(&source, &repeated).unwrap().asset, first.asset);
}

#[test]
fn a_run_that_a_time_gave_smaller_batches_keeps_them_when_it_is_resumed() {
    let source = source(512, 512, 3);
    let effort = TrainConfig {
        plan: None,
        effort: 70,
        batch: 16128,
        ..small()
    };
    let timed = TrainConfig {
        seconds: Some(3.0),
        ..effort.clone()
    };
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.checkpoint");
    stopped_at(&source, &timed, &path, 20, false);
    let resumed = resumed(&source, &timed, &path).unwrap();
    let stage = resumed.report.stages[0].stage;
    let unfitted = effort.stages(&[(512, 512)]).unwrap();
    assert!(stage.batch < unfitted[1].batch, "the time was enough");
    let steps: [u64; 3] = resumed.report.steps.clone().try_into().unwrap();
    let repeated = TrainConfig {
        batch: stage.batch as u32,
        plan: Some(effort.usual_plan(steps)),
        settle: Some(resumed.report.settled.len() as u32),
        ..effort
    };
    assert_eq!(run(&source, &repeated).unwrap().asset, resumed.asset);
}

#[test]
fn the_usual_plan_is_what_it_always_was() {
    let stages = usual([1, 2, 3]).stage;
    let of = |i: usize| (stages[i].train, stages[i].latents, stages[i].numbers);
    assert_eq!(of(0), (Train::Encoder, Shown::Noise, Arithmetic::Real));
    assert_eq!(of(1), (Train::Latents, Shown::Noise, Arithmetic::Real));
    assert_eq!(
        of(2),
        (Train::Latents, Shown::Rounded, Arithmetic::Deployed)
    );
    assert_eq!([stages[1].part, stages[2].part], [[0.0, 0.5], [0.5, 1.0]]);
    assert!(stages.iter().all(|s| s.mips == Mips::Corners));
}
