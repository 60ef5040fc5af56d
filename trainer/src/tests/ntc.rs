//! NTC as its paper trains it.

use super::{run, source};
use crate::{Plan, Precision, Preset, Pyramid, TrainConfig};

#[test]
fn every_ntc_profile_trains_by_its_plan_with_three_or_four_matrix_products() {
    let source = source(64, 64, 7);
    for name in ["ntc-0.2", "ntc-0.5", "ntc-1.0", "ntc-2.25"] {
        for hidden in [vec![64; 3], vec![64; 2]] {
            let quality = |steps: u64| {
                let plan = Plan::by_name("ntc").unwrap();
                let steps = [steps - steps / 20, steps / 20];
                let config = TrainConfig {
                    hidden: hidden.clone(),
                    batch: 768,
                    precision: Precision::Fp16,
                    plan: Some(plan.with_steps(&steps).unwrap()),
                    ..Preset::by_name(name).unwrap().config()
                };
                let trained = run(&source, &config).unwrap();
                assert_eq!(trained.asset.shape.pyramid, Pyramid::NTC);
                assert_eq!(trained.asset.shape.level_count(), 3);
                trained.report.psnr_quantised
            };
            let (short, long) = (quality(20), quality(400));
            assert!(long > short + 6.0, "{name}: {short} {long}");
        }
    }
}
