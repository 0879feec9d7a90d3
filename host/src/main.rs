//! `host`: parse, run, exit code.
//!
//! 0: done. 1: refused or failed, with one sentence on standard error. 2: wrong usage.

use clap::Parser;
use host::command::{Cli, words_of};
use std::io::Write;
use std::process::ExitCode;

fn main() -> ExitCode {
    let Err(failure) = Cli::parse().run() else { return ExitCode::SUCCESS };
    if let Some(usage) = failure.downcast_ref::<clap::Error>() {
        usage.exit();
    }
    // When nobody listens there is nobody to tell.
    let _ = writeln!(std::io::stderr(), "error: {}", words_of(&*failure));
    ExitCode::FAILURE
}
