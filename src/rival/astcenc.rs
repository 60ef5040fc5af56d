//! Astcenc: Arm's encoder and decoder, run as a program.
//!
//! Debian packages it as `astcenc`; Arm's own archives have one program for each instruction set. All
//! of one version write the same bits (its build option `ASTCENC_INVARIANCE`, on unless someone turns
//! it off), so the fastest that runs is taken.

use super::RivalError;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// The variable that names the program.
pub const VARIABLE: &str = "NTMU_ASTCENC";

/// The names under which it is installed, fastest first.
const NAMES: [&str; 6] = [
    "astcenc-avx2",
    "astcenc-native",
    "astcenc-sse4.1",
    "astcenc-neon",
    "astcenc",
    "astcenc-sse2",
];

/// The program, found and tried.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Astcenc {
    program: PathBuf,
    version: String,
}

impl Astcenc {
    /// The program that [`VARIABLE`] names, or else the first on the `PATH` that runs.
    ///
    /// # Errors
    /// [`RivalError::NoAstcenc`] when there is none.
    pub fn find() -> Result<Astcenc, RivalError> {
        let named = std::env::var_os(VARIABLE).filter(|name| !name.is_empty());
        let path = std::env::var_os("PATH").unwrap_or_default();
        Astcenc::find_in(named.as_deref(), &path)
    }

    /// The same with the variable's value and the `PATH` given.
    ///
    /// # Errors
    /// [`RivalError::NoAstcenc`] when there is none.
    pub fn find_in(named: Option<&OsStr>, path: &OsStr) -> Result<Astcenc, RivalError> {
        let candidates: Vec<PathBuf> = match named {
            Some(name) => vec![PathBuf::from(name)],
            None => NAMES
                .iter()
                .flat_map(|name| std::env::split_paths(path).map(move |folder| folder.join(name)))
                .filter(|candidate| candidate.is_file())
                .collect(),
        };
        let found = candidates.iter().find_map(|program| {
            let output = Command::new(program).arg("-version").output().ok()?;
            let text = String::from_utf8_lossy(&output.stdout).into_owned();
            let version = text.lines().find(|line| line.starts_with("astcenc"))?;
            Some(Astcenc {
                program: program.clone(),
                version: version.trim().to_owned(),
            })
        });
        found.ok_or_else(|| RivalError::NoAstcenc {
            looked_for: match named {
                Some(name) => format!("{} as {VARIABLE} says", Path::new(name).display()),
                None => format!("{} on the PATH", NAMES.join(", ")),
            },
        })
    }

    /// Its own words: `astcenc v4.2.0, 64-bit sse2`.
    #[must_use]
    pub fn version(&self) -> &str {
        &self.version
    }

    /// Runs it.
    pub(super) fn run(&self, arguments: &[OsString]) -> Result<(), RivalError> {
        let mut command = Command::new(&self.program);
        command.args(arguments).arg("-silent");
        let failed = |found: String| {
            let words: Vec<String> = std::iter::once(self.program.as_os_str())
                .chain(arguments.iter().map(OsString::as_os_str))
                .map(|word| word.to_string_lossy().into_owned())
                .collect();
            RivalError::Astcenc {
                command: words.join(" "),
                found,
            }
        };
        let output = command
            .output()
            .map_err(|error| failed(error.to_string()))?;
        if output.status.success() {
            Ok(())
        } else {
            Err(failed(said(&output)))
        }
    }
}

fn said(output: &Output) -> String {
    let texts = [&output.stderr, &output.stdout].map(|text| String::from_utf8_lossy(text));
    let said = texts
        .iter()
        .map(|text| text.trim())
        .find(|text| !text.is_empty());
    format!("{}: {}", output.status, said.unwrap_or("no word"))
}
