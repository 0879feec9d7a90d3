//! `host`: parse, run, exit code.
//!
//! 0: done. 1: refused or failed, with one sentence on standard error. 2: wrong usage.

use std::process::ExitCode;

fn main() -> ExitCode {
    host::command::main(std::env::args_os().collect())
}
