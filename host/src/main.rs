//! `host`: parse, run, exit code.

use clap::Parser;
use host::command::inspect;
use std::process::ExitCode;

#[derive(Parser)]
enum Cli {
    /// Run one stage of one view
    Inspect(inspect::Args),
}

fn main() -> ExitCode {
    let Cli::Inspect(args) = Cli::parse();
    let Err(failure) = inspect::run(&args) else { return ExitCode::SUCCESS };
    if let Some(usage) = failure.downcast_ref::<clap::Error>() {
        usage.exit();
    }
    eprintln!("error: {failure}");
    ExitCode::FAILURE
}
