//! Places that cannot be written and checkpoints of something else.

use super::{done, encode, folder, read, run};
use std::process::Command;

const SHORT: [&str; 2] = ["--steps", "0+40+20"];

#[cfg(target_os = "linux")]
#[test]
fn a_folder_that_takes_no_files_is_named_before_the_work() {
    let folder = folder();
    // Not even root can make a file there.
    for (place, flags) in [
        ("/proc/a.ntx", vec![]),
        ("a.ntx", vec!["--checkpoint", "/proc/a.checkpoint"]),
        ("a.ntx", vec!["--log", "/proc/a.jsonl"]),
        ("a.ntx", vec!["--preview", "/proc/looks"]),
    ] {
        let flags = [&SHORT[..], &flags].concat();
        let (code, said) = run(folder.path(), &encode(place, &flags));
        assert_eq!(code, Some(2), "{said}");
        assert!(said.contains("/proc/"), "{said}");
        assert!(!said.contains("loss"), "it trained: {said}");
    }
}

/// Runs under a limit on the size of a file, which a write meets as it would a full disk: with an
/// error instead of the signal, because the shell ignores that.
#[cfg(unix)]
fn limited(folder: &std::path::Path, arguments: &[&str], blocks: u32) -> (Option<i32>, String) {
    let script = format!("trap '' XFSZ; ulimit -f {blocks}; exec \"$0\" \"$@\"");
    let output = Command::new("sh")
        .args(["-c", &script, env!("CARGO_BIN_EXE_ntmu")])
        .args(arguments)
        .current_dir(folder)
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    (output.status.code(), said)
}

#[cfg(unix)]
#[test]
fn a_checkpoint_that_does_not_fit_stops_the_run_and_leaves_the_good_one() {
    let folder = folder();
    let folder = folder.path();
    let (code, said) = limited(folder, &encode("a.ntx", &SHORT), 8);
    assert_eq!(code, Some(2), "{said}");
    assert!(said.contains("a.ntx.checkpoint"), "{said}");
    let left: Vec<_> = std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| !["set", "plan.toml", "small.toml"].contains(&name.as_str()))
        .collect();
    assert!(left.is_empty(), "{left:?}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_log_on_a_full_disk_stops_the_run_with_a_checkpoint_from_which_it_goes_on() {
    let folder = folder();
    let folder = folder.path();
    let steps = ["--steps", "0+400+200"];
    done(folder, &encode("whole.ntx", &steps));
    let full = [&steps[..], &["--log", "/dev/full"]].concat();
    let (code, said) = run(folder, &encode("a.ntx", &full));
    assert_eq!(code, Some(2), "{said}");
    assert!(
        said.contains("/dev/full") && said.contains("a.ntx.checkpoint"),
        "{said}"
    );
    let resume = [&steps[..], &["--resume"]].concat();
    done(folder, &encode("a.ntx", &resume));
    assert!(read(folder, "a.ntx") == read(folder, "whole.ntx"));
}

#[cfg(target_os = "linux")]
#[test]
fn a_checkpoint_of_another_set_or_configuration_and_a_foreign_or_cut_file_are_refused() {
    let folder = folder();
    let folder = folder.path();
    // A log that cannot be written stops the run, which leaves a checkpoint.
    let stopped = encode("a.ntx", &["--steps", "0+400+200", "--log", "/dev/full"]);
    let (code, said) = run(folder, &stopped);
    assert_eq!(code, Some(2), "{said}");
    let checkpoint = folder.join("a.ntx.checkpoint");
    let good = std::fs::read(&checkpoint).unwrap();
    let steps = ["--steps", "0+400+200", "--resume"];
    let other_set = [
        "encode",
        "--built-in",
        "-o",
        "a.ntx",
        "--preset",
        "hw-16",
        "--config",
        "small.toml",
    ];
    for arguments in [
        encode("a.ntx", &[&steps[..], &["--seed", "2"]].concat()),
        encode("a.ntx", &[&steps[..], &["--weight", "normal=2"]].concat()),
        encode("a.ntx", &["--steps", "0+400+201", "--resume"]),
        [&other_set[..], &steps].concat(),
    ] {
        let (code, said) = run(folder, &arguments);
        assert_eq!(code, Some(2), "{arguments:?}: {said}");
        assert!(
            said.contains("the same configuration and texture set"),
            "{said}"
        );
    }
    for bytes in [
        &good[..good.len() / 2],
        b"another file, long enough to be one",
        b"",
    ] {
        std::fs::write(&checkpoint, bytes).unwrap();
        let (code, said) = run(folder, &encode("a.ntx", &steps));
        assert_eq!(code, Some(2), "{said}");
        assert!(said.contains("a.ntx.checkpoint: found"), "{said}");
        assert!(!folder.join("a.ntx").exists());
    }
    std::fs::write(&checkpoint, good).unwrap();
    done(folder, &encode("a.ntx", &steps));
}
