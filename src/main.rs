//! `ntmu`: the command line of the neural texture unit's model.

#![forbid(unsafe_code)]

mod cmd;
mod console;
mod files;

use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments = cmd::Arguments::parse();
    match arguments.run() {
        Ok(Verdict::Fine) => ExitCode::SUCCESS,
        Ok(Verdict::Failed) => ExitCode::from(1),
        Err(error) => {
            console::complain(&error);
            ExitCode::from(2)
        }
    }
}

/// What a command found, when it could do its work.
#[must_use]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Verdict {
    /// All is as it should be.
    Fine,
    /// The command's check failed.
    Failed,
}
