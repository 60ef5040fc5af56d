#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use super::codec::{Codec, Effort};
use super::plan::{Plan, SetPlace};
use super::{Evaluation, Event, PointResult, Shard, identity, summarise};
use crate::built_in;
use crate::rival::packing::Scalars;
use crate::{brick_wall, evaluate::EvaluateError};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

const PLAN: &str = r#"
name = "two"
sets = ["built-in 16", "built-in 32"]
[[curve]]
name = "BC"
codec = "bc"
scalars = ["together", "alone"]
"#;

fn parse(text: &str) -> Result<Plan, EvaluateError> {
    Plan::parse(Path::new("plans/x.toml"), text)
}

/// Runs the points that are open; the labels finished and failed, in their order.
fn run(evaluation: &Evaluation, stop_after: usize) -> (Vec<String>, Vec<String>) {
    let mut open = evaluation.chosen(&[], None);
    open.retain(|point| evaluation.result(point).unwrap().is_none());
    let stop = AtomicBool::new(false);
    let (mut finished, mut failed) = (Vec::new(), Vec::new());
    let observed = evaluation.run(&open, &stop, &mut |event| match event {
        Event::Finished { point, .. } => {
            finished.push(point.label.clone());
            stop.store(finished.len() == stop_after, Ordering::SeqCst);
        }
        Event::Failed { point, .. } => failed.push(point.label.clone()),
        Event::Begun { .. } | Event::Part { .. } => {}
    });
    observed.unwrap();
    (finished, failed)
}

#[test]
fn a_plan_is_its_sets_and_one_codec_a_rate() {
    let text = r#"
        name = "p"
        seed = 7
        sets = ["built-in", "built-in 64", "walls/a"]
        [[curve]]
        name = "N"
        codec = "neural"
        presets = ["cntc-16", "cntc-32"]
        effort = "medium"
        config = { uniform_mips = 0.5 }
        [[curve]]
        name = "A"
        codec = "astc"
        blocks = ["12x12", "6x6"]
    "#;
    let plan = parse(text).unwrap();
    assert_eq!(
        plan.sets,
        [
            SetPlace::BuiltIn {
                size: built_in::SIZE
            },
            SetPlace::BuiltIn { size: 64 },
            SetPlace::Folder("plans/walls/a".into()),
        ]
    );
    let labels: Vec<String> = plan
        .curves
        .iter()
        .flat_map(|curve| curve.codecs.iter().map(Codec::to_string))
        .collect();
    assert_eq!(labels, ["cntc-16", "cntc-32", "astc-12x12", "astc-6x6"]);
    let Codec::Neural(neural) = &plan.curves[0].codecs[0] else {
        panic!("{plan:?}");
    };
    assert_eq!(neural.effort, Some(Effort::Name("medium".to_owned())));
    assert_eq!((neural.seed, neural.config.len()), (7, 1));
    let Codec::Astc { quality, .. } = plan.curves[1].codecs[0] else {
        panic!("{plan:?}");
    };
    assert_eq!(quality.to_string(), "exhaustive");
}

#[test]
fn what_is_no_plan_is_refused_with_the_place() {
    let curve = "[[curve]]\nname = 'b'\ncodec = 'bc'\n";
    for (text, word) in [
        ("", "missing field"),
        (
            "name = 'p'\nsets = []\n[[curve]]\nname='b'\ncodec='bc'",
            "0 sets",
        ),
        (
            &format!("name='p'\nsets=['built-in']\n{curve}rate = 1"),
            "rate",
        ),
        (
            &format!("name='p'\nsets=['built-in x']\n{curve}"),
            "built-in x",
        ),
        (
            &format!("name='p'\nsets=['built-in 17']\n{curve}"),
            "a power of two",
        ),
        (
            &format!("name='p'\nsets=['$NTMU_NO_SUCH/a']\n{curve}"),
            "not set",
        ),
        (
            &format!("name='p'\nsets=['built-in']\n{curve}{curve}"),
            "no other curve",
        ),
        (
            "name='p'\nsets=['built-in']\n[[curve]]\nname='a'\ncodec='astc'\nblocks=['7x7']",
            "7x7",
        ),
        (
            "name='p'\nsets=['built-in']\n[[curve]]\nname='n'\ncodec='neural'\npresets=['big']",
            "cntc-16",
        ),
        (
            "name='p'\nsets=['built-in']\n[[curve]]\nname='a'\ncodec='astc'\nblocks=[]",
            "without a rate",
        ),
    ] {
        let message = parse(text).unwrap_err().to_string();
        assert!(message.contains(word), "{text}: {message}");
        assert!(message.starts_with("plans/x.toml"), "{message}");
    }
}

#[test]
fn an_identity_depends_on_texels_maps_and_configuration_and_on_nothing_else() {
    let set = brick_wall::generate(16, 1);
    let print = identity::fingerprint(&set);
    let mut renamed = set.clone();
    renamed.name = "another".to_owned();
    assert_eq!(identity::fingerprint(&renamed), print);
    let mut changed = set.clone();
    changed.texels[0][[0, 3, 3]] += 1.0 / 255.0;
    assert_ne!(identity::fingerprint(&changed), print);
    let mut deeper = set;
    deeper.maps[0].bit_depth = 16;
    assert_ne!(identity::fingerprint(&deeper), print);
    let [together, alone] =
        [Scalars::Together, Scalars::Alone].map(|scalars| Codec::Bc { scalars });
    let id = identity::identity(&print, &together);
    assert_eq!(id.len(), 16);
    assert_eq!(identity::identity(&print, &together), id);
    assert_ne!(identity::identity(&print, &alone), id);
    assert_ne!(identity::identity("0", &together), id);
}

#[cfg(feature = "train")]
#[test]
fn a_backend_that_is_not_there_is_refused_before_the_work_and_makes_another_point() {
    let point = |backend: &str| {
        let plan = parse(&format!(
            "name='p'\nsets=['built-in 16']\n[[curve]]\nname='n'\ncodec='neural'\npresets=['hw-16']\n{backend}"
        ));
        let folder = tempfile::tempdir().unwrap();
        let evaluation = Evaluation::new(plan.unwrap(), folder.path()).unwrap();
        let point = evaluation.chosen(&[], None)[0].clone();
        let problem = evaluation.check(&point).err().map(|e| e.to_string());
        (point.id, problem)
    };
    let (id, problem) = point("");
    assert_eq!(problem, None);
    // This version of the trainer has it in no build.
    let (other, problem) = point("backend='cuda'");
    assert_ne!(id, other);
    let problem = problem.unwrap();
    assert!(problem.contains("cuda"), "{problem}");
    let problem = point("backend='abacus'").1.unwrap();
    assert!(
        problem.contains("abacus") && problem.contains("flex"),
        "{problem}"
    );
}

#[test]
fn finished_points_are_not_made_again_and_what_was_stopped_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    let evaluation = Evaluation::new(parse(PLAN).unwrap(), folder.path()).unwrap();
    let labels: Vec<&str> = evaluation.points.iter().map(|p| p.label.as_str()).collect();
    // Two sets of one name are told apart.
    assert_eq!(labels.len(), 4);
    assert_ne!(evaluation.sets[0].name, evaluation.sets[1].name);
    let (first, failed) = run(&evaluation, 1);
    assert_eq!(
        (first.as_slice(), failed.len()),
        (&[labels[0].to_owned()][..], 0)
    );
    let place = evaluation.place(&evaluation.points[0]).result;
    let bytes = std::fs::read(&place).unwrap();
    let (rest, _) = run(&evaluation, usize::MAX);
    assert_eq!(rest, labels[1..]);
    assert_eq!(std::fs::read(&place).unwrap(), bytes);
    assert_eq!(run(&evaluation, usize::MAX).0.len(), 0);
    // Nothing but results is left.
    assert_eq!(
        std::fs::read_dir(folder.path().join("points"))
            .unwrap()
            .count(),
        4
    );
    assert_eq!(
        std::fs::read_dir(folder.path().join("unfinished"))
            .unwrap()
            .count(),
        0
    );
}

#[test]
fn a_damaged_result_is_named_and_stops_only_its_own_point() {
    let folder = tempfile::tempdir().unwrap();
    let evaluation = Evaluation::new(parse(PLAN).unwrap(), folder.path()).unwrap();
    run(&evaluation, 1);
    let place = evaluation.place(&evaluation.points[0]).result;
    std::fs::write(&place, "{").unwrap();
    let points: Vec<_> = evaluation.points.iter().collect();
    let error = evaluation.result(points[0]).unwrap_err().to_string();
    assert!(error.contains(place.to_str().unwrap()), "{error}");
    let (mut finished, mut failed) = (0, 0);
    let stop = AtomicBool::new(false);
    let mut observer = |event: Event<'_>| match event {
        Event::Finished { .. } => finished += 1,
        Event::Failed { .. } => failed += 1,
        Event::Begun { .. } | Event::Part { .. } => {}
    };
    evaluation.run(&points, &stop, &mut observer).unwrap();
    assert_eq!((finished, failed), (3, 1));
}

#[test]
fn shards_share_the_points_out_and_only_narrows_them() {
    let folder = tempfile::tempdir().unwrap();
    let evaluation = Evaluation::new(parse(PLAN).unwrap(), folder.path()).unwrap();
    for count in 1..=5 {
        let mut all: Vec<&str> = (0..count)
            .flat_map(|index| evaluation.chosen(&[], Some(Shard { index, count })))
            .map(|point| point.id.as_str())
            .collect();
        all.sort_unstable();
        let mut expected: Vec<&str> = evaluation.points.iter().map(|p| p.id.as_str()).collect();
        expected.sort_unstable();
        assert_eq!(all, expected);
    }
    let alone = evaluation.chosen(&["bc-alone".to_owned()], None);
    assert_eq!(alone.len(), 2);
    let id = evaluation.points[3].id.clone();
    assert_eq!(evaluation.chosen(&[id], None), [&evaluation.points[3]]);
    assert_eq!(
        "2/3".parse::<Shard>().unwrap(),
        Shard { index: 2, count: 3 }
    );
    for bad in ["", "3/3", "1", "a/b", "-1/2", "0/0"] {
        bad.parse::<Shard>().unwrap_err();
    }
}

#[test]
fn a_summary_has_every_point_and_what_is_missing() {
    let folder = tempfile::tempdir().unwrap();
    let evaluation = Evaluation::new(parse(PLAN).unwrap(), folder.path()).unwrap();
    run(&evaluation, 3);
    let summary = summarise(&evaluation).unwrap();
    assert_eq!(summary.missing, [evaluation.points[3].label.clone()]);
    assert!(summary.mean.is_none());
    run(&evaluation, usize::MAX);
    let summary = summarise(&evaluation).unwrap();
    assert!(summary.missing.is_empty());
    let mean = summary.mean.as_ref().unwrap();
    let rate = |set: usize, row: usize| summary.sets[set].rows[row].result.bppc;
    assert_eq!(
        mean.curves[0].points[1].bppc,
        (rate(0, 1) + rate(1, 1)) / 2.0
    );
    summary.write(&evaluation).unwrap();
    let text = std::fs::read_to_string(folder.path().join("results.md")).unwrap();
    for row in summary.sets.iter().flat_map(|set| &set.rows) {
        assert!(
            text.contains(&format!("| {:.4} |", row.result.bppc)),
            "{text}"
        );
    }
    for set in &evaluation.sets {
        let curve = folder.path().join(format!("curves/{}.BC.json", set.name));
        let curve = std::fs::read_to_string(curve).unwrap();
        let curve = crate::curve::Curve::from_json(&curve).unwrap();
        assert_eq!(curve.results()["bppc"].len(), 2);
        assert!(
            folder
                .path()
                .join(format!("plots/{}.psnr.svg", set.name))
                .is_file()
        );
    }
    assert!(folder.path().join("results.json").is_file());
}

#[test]
fn curves_of_one_point_each_are_compared_with_the_first() {
    let text = PLAN.replace("\"together\", ", "")
        + "[[curve]]\nname = \"BC together\"\ncodec = \"bc\"\nscalars = [\"together\"]\n";
    let folder = tempfile::tempdir().unwrap();
    let evaluation = Evaluation::new(parse(&text).unwrap(), folder.path()).unwrap();
    run(&evaluation, usize::MAX);
    let summary = summarise(&evaluation).unwrap();
    let mut sums = [0.0; 2];
    for set in &summary.sets {
        assert!(set.bd.is_none());
        let [first, second] = &set.rows[..] else {
            panic!("{:?}", set.rows);
        };
        let change = first.change.unwrap();
        assert_eq!((change.rate, change.psnr), (0.0, 0.0));
        let change = second.change.unwrap();
        let rate = 100.0 * (second.result.bppc - first.result.bppc) / first.result.bppc;
        assert!((change.rate - rate).abs() < 1e-9, "{change:?} {rate}");
        let psnr = second.result.psnr.unwrap() - first.result.psnr.unwrap();
        assert!((change.psnr - psnr).abs() < 1e-9, "{change:?} {psnr}");
        assert!(rate != 0.0 && psnr != 0.0);
        sums[0] += rate / 2.0;
        sums[1] += psnr / 2.0;
    }
    let text = summary.markdown();
    assert!(
        text.contains(&format!("| {:+.1} % | {:+.2} dB |", sums[0], sums[1])),
        "{text}"
    );
    assert!(!text.contains("BD-rate"), "{text}");
    // With a second rate on one of them they are curves again.
    let whole = Evaluation::new(parse(PLAN).unwrap(), folder.path()).unwrap();
    run(&whole, usize::MAX);
    let rows = summarise(&whole).unwrap().sets.remove(0).rows;
    assert!(rows.iter().all(|row| row.change.is_none()));
}

#[test]
fn a_result_is_read_back_as_it_was_written() {
    let folder = tempfile::tempdir().unwrap();
    let evaluation = Evaluation::new(parse(PLAN).unwrap(), folder.path()).unwrap();
    let mut written = None;
    let points = evaluation.chosen(&["bc-alone".to_owned()], Some(Shard { index: 0, count: 2 }));
    let stop = AtomicBool::new(false);
    let mut observer = |event: Event<'_>| {
        if let Event::Finished { result, .. } = event {
            written = Some(result.clone());
        }
    };
    evaluation.run(&points, &stop, &mut observer).unwrap();
    let read = PointResult::read(&evaluation.place(points[0]).result).unwrap();
    assert_eq!(read, written);
    let result = read.unwrap();
    assert_eq!(result.set.fingerprint, evaluation.sets[0].fingerprint);
    assert!(result.machine.cores >= 1 && !result.encoder.is_empty());
}
