//! The committed vectors: what the suites make, to the byte, and true.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use ntmu_conformance::device::{Device, ModelDevice};
use ntmu_conformance::emit::{check, from_json, to_json};
use ntmu_conformance::oracle::position::RealAxis;
use ntmu_conformance::suite::container::Container;
use ntmu_conformance::synthetic::{self, arbitrary_spec};
use ntmu_conformance::vector::{Answer, Expectation, Query, VectorFile};
use ntmu_conformance::{flag, naive, run, suite};
use ntmu_isa::rescale::Multiplier;
use std::collections::BTreeSet;
use std::path::PathBuf;

/// The largest that all committed files may be together, in bytes.
const LIMIT: usize = 1_500_000;

fn folder() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("vectors/v2")
}

/// Compares a committed file with what is made now; `NTMU_BLESS=1` writes it, but never where `CI`
/// is set.
fn golden(name: &str, made: &str) {
    let path = folder().join(name);
    if std::env::var_os("NTMU_BLESS").is_some_and(|bless| bless == "1") {
        assert!(
            std::env::var_os("CI").is_none(),
            "CI does not change what it is to check"
        );
        // In one step, because other tests read the file meanwhile.
        let aside = std::env::temp_dir().join(format!("ntmu-{}-{name}", std::process::id()));
        std::fs::write(&aside, made).expect("a place for temporary files");
        std::fs::rename(&aside, &path)
            .or_else(|_| std::fs::copy(&aside, &path).map(drop))
            .expect("a folder that can be written to");
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    let mut lines = committed.lines().zip(made.lines()).enumerate();
    let differs = lines.find(|(_, (committed, made))| committed != made);
    let clip = |line: &str| line.chars().take(300).collect::<String>();
    let shown = differs.map(|(n, (c, m))| format!("line {}:\n- {}\n+ {}", n + 1, clip(c), clip(m)));
    assert!(
        committed == made,
        "{} is not what the suite makes. {}\nIf the bits are meant to change: \
         NTMU_BLESS=1 cargo test -p ntmu-conformance --test vectors",
        path.display(),
        shown.unwrap_or_else(|| format!(
            "{} and {} lines",
            committed.lines().count(),
            made.lines().count()
        ))
    );
}

fn committed() -> Vec<VectorFile> {
    let files = suite::all().expect("the suites are made");
    let read = |file: &VectorFile| {
        let path = folder().join(format!("{}.json", file.suite));
        from_json(&std::fs::read_to_string(path).expect("committed")).expect("a vector file")
    };
    files.iter().map(read).collect()
}

#[test]
fn committed_files_are_what_the_suites_make() {
    let files = suite::all().unwrap();
    let mut bytes = 0;
    for file in &files {
        let text = to_json(file).unwrap();
        golden(&format!("{}.json", file.suite), &text);
        bytes += text.len();
    }
    assert!(bytes < LIMIT, "{bytes}");
    let names = std::fs::read_dir(folder()).unwrap();
    let names: BTreeSet<String> = names
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    assert_eq!(
        names,
        files
            .iter()
            .map(|file| format!("{}.json", file.suite))
            .collect()
    );
}

#[test]
fn a_file_returns_from_its_text() {
    for file in suite::all().unwrap() {
        let text = to_json(&file).unwrap();
        assert_eq!(from_json(&text).unwrap(), file);
        assert_eq!(to_json(&from_json(&text).unwrap()).unwrap(), text);
        assert!(!text.contains('\r') && text.ends_with("\n}\n"));
    }
}

/// Every number of a file, to show that none is a float.
fn numbers(value: &serde_json::Value, visit: &mut impl FnMut(&serde_json::Number)) {
    match value {
        serde_json::Value::Number(number) => visit(number),
        serde_json::Value::Array(items) => items.iter().for_each(|item| numbers(item, visit)),
        serde_json::Value::Object(fields) => fields.values().for_each(|item| numbers(item, visit)),
        serde_json::Value::Null | serde_json::Value::Bool(_) | serde_json::Value::String(_) => {}
    }
}

#[test]
fn every_number_of_every_file_is_an_integer() {
    for file in suite::all().unwrap() {
        let value = serde_json::from_str(&to_json(&file).unwrap()).unwrap();
        let mut count = 0;
        numbers(&value, &mut |number| {
            assert!(number.is_i64(), "{number}");
            count += 1;
        });
        assert!(count > 0);
    }
}

#[test]
fn a_file_that_breaks_its_own_promise_is_refused() {
    let file = suite::texel::suite().unwrap();
    assert!(check(&file).is_ok());
    let broken = |change: &dyn Fn(&mut VectorFile)| {
        let mut file = file.clone();
        change(&mut file);
        check(&file).unwrap_err().to_string()
    };
    assert!(broken(&|f| f.schema.push('x')).starts_with("schema"));
    assert!(broken(&|f| f.case_count += 1).starts_with("case_count"));
    assert!(broken(&|f| f.profile.choices.lod_bits = 7).starts_with("profile.identity"));
    assert!(broken(&|f| f.assets[0].profile.choices.lod_bits = 3).contains("lod_bits"));
    assert!(broken(&|f| f.assets[0].ntx[70] ^= 1).contains("crc32"));
    assert!(broken(&|f| f.cases[1].id = f.cases[0].id.clone()).starts_with("cases.id"));
    assert!(broken(&|f| f.cases[0].flags.push("Unheard".into())).contains("flags"));
    assert!(broken(&|f| f.cases[0].answer = None).starts_with("texel-"));
    assert!(broken(&|f| f.cases[0].result = Expectation::Refuse).starts_with("texel-"));
    assert!(broken(&|f| f.cases.iter_mut().for_each(|c| c.flags.clear())).starts_with("notes"));
    assert!(broken(&|f| f.assets[0].name.clear()).contains("request"));
    let text = to_json(&file).unwrap();
    for unknown in ["{\"id\"", "{\"texel\": {\"asset\"", "{\"asset\""] {
        let at = unknown.rfind('{').unwrap() + 1;
        let more = format!("{}\"more\": 1,{}", &unknown[..at], &unknown[at..]);
        assert!(
            from_json(&text.replacen(&unknown.replace(": ", ":"), &more, 1)).is_err(),
            "{unknown}"
        );
    }
}

#[test]
fn every_flag_is_used_and_explained() {
    let used: BTreeSet<String> = suite::all()
        .unwrap()
        .into_iter()
        .flat_map(|file| file.notes.into_keys())
        .collect();
    let known: BTreeSet<String> = flag::ALL.iter().map(|flag| flag.name.to_owned()).collect();
    assert_eq!(used, known);
}

#[test]
fn the_model_passes_every_committed_case() {
    let mut calls = 0;
    let summary = run(&committed(), &mut ModelDevice, &mut |_| calls += 1);
    for case in summary.suites.iter().flat_map(|suite| &suite.cases) {
        assert_eq!(
            case.outcome,
            ntmu_conformance::runner::Outcome::Pass,
            "{}",
            case.comment
        );
    }
    assert!(summary.conforms());
    assert_eq!(calls, summary.totals().0);
}

#[test]
fn committed_taps_are_the_models_and_those_of_the_naive_evaluation() {
    let files = committed();
    let texel = files.iter().find(|file| file.suite == "texel").unwrap();
    for case in &texel.cases {
        let Query::Texel(query) = &case.request else {
            panic!("{}", case.id)
        };
        let record = texel
            .assets
            .iter()
            .find(|asset| asset.name == query.asset)
            .unwrap();
        let asset = ntmu_isa::Asset::from_bytes(&record.ntx).unwrap();
        assert_eq!(record.profile, asset.profile.into());
        let request = ntmu_model::Request::new(&asset.shape, query.x, query.y, query.mip).unwrap();
        assert_eq!(ModelDevice.taps(&asset, request).unwrap(), case.taps);
        assert_eq!(naive::texel(&asset, request).taps, case.taps);
    }
}

#[test]
fn rescale_answers_follow_the_rules_in_exact_arithmetic() {
    for case in &suite::rescale::suite().unwrap().cases {
        let (Query::Rescale(q), Some(Answer::Value(answer))) = (&case.request, &case.answer) else {
            panic!("{}", case.id);
        };
        let scale = Multiplier::new(q.mantissa, q.shift).unwrap();
        let defined = naive::number::rescale(q.requantizer, i128::from(q.value), scale);
        assert_eq!(i128::from(*answer), defined, "{} {q:?}", case.id);
    }
}

#[test]
fn ties_of_the_rescale_suite_are_ties() {
    let (mut ties, mut doubles) = (0, 0);
    for case in &suite::rescale::suite().unwrap().cases {
        let Query::Rescale(q) = &case.request else {
            panic!("{}", case.id)
        };
        let product = i128::from(q.value) * i128::from(q.mantissa);
        let unit = 1_i128 << q.shift;
        if case.flags.iter().any(|flag| flag == "Tie") {
            ties += 1;
            assert_eq!((2 * product).rem_euclid(2 * unit), unit, "{q:?}");
        }
        if case.flags.iter().any(|flag| flag == "DoubleTie") {
            doubles += 1;
            let first = product + (1_i128 << 30) * i128::from(q.value.signum());
            assert_eq!((2 * first).rem_euclid(2 * unit), unit, "{q:?}");
        }
    }
    assert!(ties > 100 && doubles > 50, "{ties} {doubles}");
}

#[test]
fn position_answers_are_the_oracles() {
    for case in &suite::position::suite().cases {
        let (Query::Position(q), Some(Answer::Position(answer))) = (&case.request, &case.answer)
        else {
            panic!("{}", case.id);
        };
        let real = RealAxis::of(q.texel, q.mip, q.scale_log2, q.snap);
        let found = (
            f64::from(answer.first),
            f64::from(answer.stride),
            f64::from(answer.phase),
        );
        assert_eq!(
            found,
            (real.first, real.stride, real.fraction * 16.0),
            "{q:?}"
        );
        assert_eq!(answer.corners, real.cells(q.cells, q.address_mode), "{q:?}");
    }
}

#[test]
fn a_container_put_together_again_is_the_file() {
    for seed in 0..20 {
        let file = synthetic::asset(&arbitrary_spec(seed), seed)
            .unwrap()
            .to_bytes();
        assert_eq!(Container::parse(&file).unwrap().to_bytes(), file);
    }
}

/// A file that is refused for a CRC-32 alone does not test what its comment says.
#[test]
fn crafted_files_are_refused_for_what_they_hold() {
    let checked = [
        "Version",
        "Table",
        "Reserved",
        "FieldRange",
        "Contradiction",
        "Magic",
    ];
    let mut found = BTreeSet::new();
    for case in &suite::refuse::suite().unwrap().cases {
        let Query::Open(open) = &case.request else {
            panic!("{}", case.id)
        };
        let result = ntmu_isa::Asset::from_bytes(&open.ntx);
        assert_eq!(
            result.is_ok(),
            case.result == Expectation::Exact,
            "{}",
            case.comment
        );
        for flag in &case.flags {
            if let (Some(flag), Err(error)) = (checked.iter().find(|c| *c == flag), &result) {
                found.insert(*flag);
                let is_checksum = matches!(error, ntmu_isa::AssetError::Checksum { .. });
                // A table that points elsewhere or counts less has no right CRC-32 to give.
                assert!(
                    !is_checksum || *flag == "Table",
                    "{}: {error}",
                    case.comment
                );
            }
        }
    }
    assert_eq!(found.len(), checked.len());
}
