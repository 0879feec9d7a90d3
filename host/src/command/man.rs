//! Manual pages: one for the program, one a command.
//!
//! Examples:
//!   host man ~/.local/share/man/man1
//!   man host-replay

use std::path::PathBuf;

use serde_json::json;

use super::{Failure, line, of_system, say, say_json, shown};

/// Arguments of `man`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Folder for the pages, which is created if it is missing
    folder: PathBuf,
    /// Print one JSON document instead of text
    #[arg(long)]
    pub(super) json: bool,
}

/// Writes the pages.
///
/// # Errors
///
/// If the folder or a page cannot be written.
pub fn run(args: &Args) -> Result<(), Failure> {
    let told = |error| format!("cannot write {}: {}", shown(&args.folder), of_system(&error));
    std::fs::create_dir_all(&args.folder).map_err(told)?;
    clap_mangen::generate_to(line::command(), &args.folder).map_err(told)?;
    let folder = shown(&args.folder);
    if args.json { say_json(&json!({ "folder": folder })) } else { say(&format!("{folder}\n")) }
}
