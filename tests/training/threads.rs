//! The number of threads changes nothing.

use super::{encode, folder, read};
use std::process::Command;

#[test]
fn one_two_and_three_threads_make_the_same_bytes_encoder_stages_and_settling_included() {
    let folder = folder();
    let made = ["1", "2", "3"].map(|threads| {
        let name = format!("{threads}.ntx");
        let output = Command::new(env!("CARGO_BIN_EXE_ntmu"))
            .args(encode(&name, &["--plan", "plan.toml", "--settle", "2"]))
            .current_dir(folder.path())
            .env("RAYON_NUM_THREADS", threads)
            .output()
            .unwrap();
        assert!(output.status.success(), "{output:?}");
        read(folder.path(), &name)
    });
    assert!(made[0] == made[1] && made[1] == made[2]);
}
