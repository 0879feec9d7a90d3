//! Documents as a newcomer follows them: each command that they show works as shown and prints what is shown.
//!
//! A `console` block is run: lines that begin with `$ ` in order, those of one document in one empty folder, and what
//! stands below a command is what it prints. `cargo run --release -p host --` is the program. Every other line
//! `host ...` in a document may need a camera; the program must understand it. `REGENERATE=1` writes anew what
//! commands print.

use assert_cmd::Command;
use clap::Parser;
use host::command::Cli;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

/// A document in pieces: what is to be run, and everything else as it stands.
enum Piece {
    Text(String),
    /// The line, and what stands below it.
    Command(String, String),
}

fn pieces(document: &str) -> Vec<Piece> {
    let mut pieces = vec![Piece::Text(String::new())];
    let mut console = false;
    for line in document.split_inclusive('\n') {
        let fence = line.starts_with("```");
        if console && line.starts_with("$ ") {
            pieces.push(Piece::Command(line.into(), String::new()));
        } else if fence && console {
            pieces.push(Piece::Text(line.into()));
        } else {
            match pieces.last_mut() {
                Some(Piece::Text(text) | Piece::Command(_, text)) => text.push_str(line),
                None => unreachable!("there is a first piece"),
            }
        }
        console = if fence { !console && line.trim_end() == "```console" } else { console };
    }
    pieces
}

/// What a command prints, standard output first, and its exit code.
fn run(folder: &Path, line: &str) -> (String, Option<i32>) {
    let program = PathBuf::from(Command::cargo_bin("host").unwrap().get_program());
    let command = line.trim_start_matches("$ ").replace("cargo run --release -p host --", "host");
    let path =
        std::env::join_paths([program.parent().unwrap(), Path::new("/usr/bin"), Path::new("/bin")]).unwrap();
    let output =
        Command::new("sh").args(["-c", &command]).current_dir(folder).env("PATH", path).output().unwrap();
    let said = [output.stdout, output.stderr].concat();
    (String::from_utf8(said).unwrap(), output.status.code())
}

/// Without what differs from run to run: the times.
fn lasting(said: &str) -> Vec<String> {
    let timeless = |line: &str| {
        let timed = line.trim_start().starts_with("time ");
        if timed { line.replace(|c: char| c.is_ascii_digit(), "") } else { line.to_owned() }
    };
    said.lines().map(timeless).collect()
}

/// Run all that a document shows.
fn follow(name: &str) {
    let path = root().join(name);
    let folder = TempDir::new().unwrap();
    let mut anew = String::new();
    let mut commands = 0;
    for piece in pieces(&fs::read_to_string(&path).unwrap()) {
        match piece {
            Piece::Text(text) => anew.push_str(&text),
            Piece::Command(line, shown) => {
                commands += 1;
                let (said, code) = run(folder.path(), &line);
                let refused = shown.lines().any(|line| line.starts_with("error: "));
                assert_eq!(code, Some(i32::from(refused)), "{name}: {line}{said}");
                let regenerate = std::env::var_os("REGENERATE").is_some();
                // A command without anything below it is not about what it prints.
                let quiet = shown.trim().is_empty();
                if !quiet && !regenerate {
                    assert_eq!(lasting(&shown), lasting(&said), "{name}: {line}");
                }
                let fresh = regenerate && !quiet && lasting(&shown) != lasting(&said);
                anew.extend([line.as_str(), if fresh { &said } else { &shown }]);
            }
        }
    }
    assert!(commands > 0, "{name} shows no command");
    if std::env::var_os("REGENERATE").is_some() {
        fs::write(path, anew).unwrap();
    }
}

#[test]
fn the_readme_is_true() {
    follow("README.md");
}

#[test]
fn the_tutorial_of_the_desk_is_true() {
    follow("docs/tutorials/desk.md");
}

#[test]
fn the_tutorial_of_the_board_is_true() {
    follow("docs/tutorials/board.md");
}

/// Every Markdown file of the project, but for what builds leave, and for transcripts, which are of wrong usage too and
/// have a test of their own.
fn documents(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let hidden = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
        if path.is_dir() {
            let of_others = hidden || ["target", "transcripts"].iter().any(|name| path.ends_with(name));
            found.extend(if of_others { Vec::new() } else { documents(&path) });
        } else if path.extension().is_some_and(|extension| extension == "md") {
            found.push(path);
        }
    }
    found
}

/// The words of a line as a shell would pass them on: no comment, no pipe, no quotes.
fn words(line: &str) -> Vec<String> {
    let line = [" #", " |", " 2>"].iter().fold(line, |line, end| line.split(end).next().unwrap_or_default());
    line.split_whitespace().map(|word| word.trim_matches(['\'', '"']).to_owned()).collect()
}

#[test]
fn the_program_understands_every_command() {
    let mut understood = 0;
    for path in documents(&root()) {
        let text = fs::read_to_string(&path).unwrap().replace("\\\n", " ");
        let lines = text.lines().map(|line| line.trim_start().trim_start_matches("$ "));
        for line in lines.filter(|line| line.starts_with("host ") && !line.ends_with(['.', ','])) {
            let parsed = Cli::try_parse_from(words(line));
            assert!(parsed.is_ok(), "{}: {line}: {}", path.display(), parsed.unwrap_err());
            understood += 1;
        }
    }
    assert!(understood > 30, "{understood} commands");
}

/// Links to files of the project lead somewhere.
#[test]
fn every_link_leads_somewhere() {
    for path in documents(&root()) {
        let text = fs::read_to_string(&path).unwrap();
        let links = text.split("](").skip(1).filter_map(|rest| rest.split([')', '#', ' ']).next());
        for link in links.filter(|link| !link.is_empty() && !link.contains("://")) {
            assert!(path.parent().unwrap().join(link).exists(), "{}: {link}", path.display());
        }
    }
}
