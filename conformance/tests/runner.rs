//! The runner against devices that are wrong on purpose.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use ntmu_conformance::device::{Device, DeviceError, ModelDevice};
use ntmu_conformance::runner::{Outcome, Summary, run};
use ntmu_conformance::suite;
use ntmu_conformance::vector::{PositionAnswer, PositionQuery, RescaleQuery, VectorFile};
use ntmu_isa::Asset;
use ntmu_isa::position::{AddressMode, AxisPosition, CornerSnap};
use ntmu_isa::rescale::{Multiplier, Requantizer};
use ntmu_model::Request;

fn against(suites: &[VectorFile], device: &mut dyn Device) -> Summary {
    run(suites, device, &mut |_| {})
}

/// One requantiser's operands, answered by another.
struct Impostor(Requantizer, Requantizer);

impl Device for Impostor {
    fn name(&self) -> String {
        format!("{} as {}", self.0.name(), self.1.name())
    }

    fn texel_codes(&mut self, _: &Asset, _: &[Request]) -> Result<Vec<Vec<i32>>, DeviceError> {
        Err(DeviceError::unsupported("texels"))
    }

    fn rescale(&mut self, query: &RescaleQuery) -> Result<i32, DeviceError> {
        if query.requantizer == self.0 {
            let scale = Multiplier::new(query.mantissa, query.shift)
                .map_err(|error| DeviceError::failed(error.to_string()))?;
            Ok(self.1.apply(query.value, scale))
        } else {
            Err(DeviceError::unsupported(query.requantizer.name()))
        }
    }
}

#[test]
fn every_requantiser_in_the_place_of_another_is_caught() {
    let suites = [suite::rescale::suite().unwrap()];
    for wanted in Requantizer::ALL {
        for used in Requantizer::ALL {
            let summary = against(&suites, &mut Impostor(wanted, used));
            let (passed, failed, unsupported) = summary.totals();
            assert_eq!(failed > 0, wanted != used, "{}", summary.device);
            assert_eq!(summary.conforms(), wanted == used);
            assert_eq!((passed + failed) * 5, passed + failed + unsupported);
        }
    }
}

/// A device whose positions are one thing off.
struct Askew(fn(&PositionQuery) -> PositionAnswer);

impl Device for Askew {
    fn name(&self) -> String {
        "askew".to_owned()
    }

    fn texel_codes(&mut self, _: &Asset, _: &[Request]) -> Result<Vec<Vec<i32>>, DeviceError> {
        Err(DeviceError::unsupported("texels"))
    }

    fn position(&mut self, query: &PositionQuery) -> Result<PositionAnswer, DeviceError> {
        Ok((self.0)(query))
    }
}

fn answer(position: AxisPosition, query: &PositionQuery) -> PositionAnswer {
    let AxisPosition {
        first,
        stride,
        phase,
        ..
    } = position;
    let corners = position.corners(query.cells, query.address_mode);
    PositionAnswer {
        first,
        stride,
        phase,
        corners,
    }
}

#[test]
fn every_wrong_position_rule_is_caught() {
    let wrong: [fn(&PositionQuery) -> PositionAnswer; 5] = [
        // The phase rounded to the nearest sixteenth, in place of floored.
        |q| {
            let mut p = AxisPosition::of(q.texel, q.mip, q.scale_log2, q.snap);
            let centre = ((2 * q.texel + 1) << q.mip) as f64 / f64::from(2 << q.scale_log2) - 0.5;
            p.phase = (16.0 * (centre - f64::from(p.first)) / f64::from(p.stride)).round() as u16;
            answer(p, q)
        },
        // A mask in place of a remainder.
        |q| {
            let p = AxisPosition::of(q.texel, q.mip, q.scale_log2, q.snap);
            let mask = |cell: i32| cell as u32 & (q.cells.next_power_of_two() - 1);
            let corners = [p.first, p.first + p.stride as i32];
            let corners = match q.address_mode {
                AddressMode::Wrap => corners.map(mask),
                AddressMode::Mirror | AddressMode::Clamp => p.corners(q.cells, q.address_mode),
            };
            PositionAnswer {
                corners,
                ..answer(p, q)
            }
        },
        // A mirror that does not repeat the edge.
        |q| {
            let p = AxisPosition::of(q.texel, q.mip, q.scale_log2, q.snap);
            let reflect = |cell: i32| cell.unsigned_abs().min(q.cells - 1);
            let corners = match q.address_mode {
                AddressMode::Mirror => [p.first, p.first + p.stride as i32].map(reflect),
                AddressMode::Wrap | AddressMode::Clamp => p.corners(q.cells, q.address_mode),
            };
            PositionAnswer {
                corners,
                ..answer(p, q)
            }
        },
        // The other snapping rule.
        |q| {
            answer(
                AxisPosition::of(q.texel, q.mip, q.scale_log2, CornerSnap::Cell),
                q,
            )
        },
        // The texel's edge in place of its centre.
        |q| {
            let mut p = AxisPosition::of(q.texel, q.mip, q.scale_log2, q.snap);
            p.phase = p.phase.saturating_sub(1);
            answer(p, q)
        },
    ];
    let suites = [suite::position::suite()];
    let mut honest = Askew(|q| answer(AxisPosition::of(q.texel, q.mip, q.scale_log2, q.snap), q));
    assert!(against(&suites, &mut honest).conforms());
    for (index, wrong) in wrong.into_iter().enumerate() {
        let (_, failed, _) = against(&suites, &mut Askew(wrong)).totals();
        assert!(failed > 0, "rule {index} survives");
    }
}

/// Opens everything, or nothing.
struct Door(bool);

impl Device for Door {
    fn name(&self) -> String {
        "door".to_owned()
    }

    fn texel_codes(&mut self, _: &Asset, _: &[Request]) -> Result<Vec<Vec<i32>>, DeviceError> {
        Err(DeviceError::unsupported("texels"))
    }

    fn open(&mut self, _: &[u8]) -> Result<bool, DeviceError> {
        Ok(self.0)
    }
}

#[test]
fn a_device_that_accepts_everything_or_nothing_fails() {
    let suites = [suite::refuse::suite().unwrap()];
    let controls = 6;
    let open = against(&suites, &mut Door(true)).totals();
    let shut = against(&suites, &mut Door(false)).totals();
    assert_eq!((open.0, shut.1), (controls, controls));
    assert_eq!((open.1, open.2), (shut.0, 0));
    assert!(open.1 > 100);
}

/// Breaks on one texel, whoever asks together with it.
struct Fragile;

impl Device for Fragile {
    fn name(&self) -> String {
        "fragile".to_owned()
    }

    fn texel_codes(
        &mut self,
        asset: &Asset,
        requests: &[Request],
    ) -> Result<Vec<Vec<i32>>, DeviceError> {
        if requests
            .iter()
            .any(|r| (r.x(), r.y(), r.mip()) == (15, 15, 0))
        {
            return Err(DeviceError::failed("broke"));
        }
        ModelDevice.texel_codes(asset, requests)
    }
}

#[test]
fn a_texel_that_breaks_the_device_fails_alone_and_what_is_not_offered_does_not_fail() {
    let suites = suite::all().unwrap();
    let summary = against(&suites, &mut Fragile);
    let texel = summary.suites.iter().find(|s| s.suite == "texel").unwrap();
    let failed: Vec<_> = texel
        .cases
        .iter()
        .filter(|c| c.outcome != Outcome::Pass)
        .collect();
    assert!(!failed.is_empty() && failed.len() == texel.failed);
    for case in failed {
        assert!(
            case.comment.ends_with("(15, 15) of mip 0"),
            "{}",
            case.comment
        );
        assert!(matches!(&case.outcome, Outcome::Fail { reason, .. } if reason == "broke"));
    }
    let cases: usize = suites.iter().map(|s| s.cases.len()).sum();
    assert!(texel.profiles.len() > 1 && texel.profiles.iter().all(|p| p.contains('@')));
    let of_cases: std::collections::BTreeSet<_> = texel.cases.iter().map(|c| &c.profile).collect();
    assert!(texel.profiles.iter().eq(of_cases));
    let (passed, failed, unsupported) = summary.totals();
    assert_eq!(passed + failed + unsupported, cases);
    assert_eq!(unsupported, cases - texel.cases.len());
}

#[test]
fn a_summary_returns_from_its_json() {
    let suites = suite::all().unwrap();
    for summary in [
        against(&suites, &mut Fragile),
        against(
            &suites,
            &mut Impostor(Requantizer::Single, Requantizer::Double),
        ),
    ] {
        let json = serde_json::to_string(&summary).unwrap();
        assert_eq!(serde_json::from_str::<Summary>(&json).unwrap(), summary);
    }
}
