//! What a person sees who types these lines, frozen: the console blocks of `transcripts/*.md` and of `docs/json.md`.
//!
//! Each file begins in an empty folder. A line `$ ...` is given to a shell, and what follows is what it writes to
//! both outputs, then its exit code if that is not 0. What differs from run to run is replaced ([`steady`]).
//!
//!     REGENERATE=1 cargo test -p host --test transcripts      # writes them anew; then look at the difference
#![cfg(unix)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::LazyLock;

use regex::Regex;
use tempfile::TempDir;

/// The file as it would be if its commands said what they say now.
fn replayed(text: &str) -> String {
    let folder = TempDir::new().unwrap();
    let (mut now, mut in_console) = (String::new(), false);
    for line in text.lines() {
        if line.starts_with("```") {
            in_console = line == "```console";
        }
        let command = line.strip_prefix("$ ").filter(|_| in_console);
        if !in_console || line == "```console" || command.is_some() {
            now.push_str(&format!("{line}\n"));
        }
        if let Some(command) = command {
            now.push_str(&said(folder.path(), command));
        }
    }
    now
}

/// What a command writes, and its exit code.
fn said(folder: &Path, command: &str) -> String {
    let program = PathBuf::from(env!("CARGO_BIN_EXE_host"));
    let paths = std::env::var("PATH").unwrap_or_default();
    let output = Command::new("sh")
        .args(["-c", &format!("exec 2>&1; {command}")])
        .current_dir(folder)
        .env("PATH", format!("{}:{paths}", program.parent().unwrap().display()))
        .env("LC_ALL", "C")
        .env_remove("OSSATURE_CONFIG")
        .env_remove("CLICOLOR_FORCE")
        .stdin(Stdio::null())
        .output()
        .unwrap();
    let mut text = steady(&String::from_utf8(output.stdout).unwrap(), folder);
    if !text.is_empty() && !text.ends_with('\n') {
        text.push('\n');
    }
    match output.status.code() {
        Some(0) => text,
        code => text + &format!("[exit code {}]\n", code.unwrap()),
    }
}

/// Without what differs: the folder, times, and digits beyond those that are meant.
fn steady(text: &str, folder: &Path) -> String {
    static RULES: LazyLock<Vec<(Regex, &str)>> = LazyLock::new(|| {
        [
            (r"\b\d+\.\d+ s\b", "N s"),
            (r"\bs: \d+\.\d+ to render, \d+\.\d+ for", "s: N to render, N for"),
            (r#"("(?:median_us|\w+_ms|ms)": )[\d.]+"#, "${1}N"),
            (r"(median_us +)[\d.]+", "${1}N"),
            (r"(\d\.\d{3})\d+", "$1"),
            (r"[ \t]+(?m:$)", ""),
        ]
        .map(|(pattern, with)| (Regex::new(pattern).unwrap(), with))
        .into()
    });
    let text = text.replace(&folder.canonicalize().unwrap().display().to_string(), "/home/you");
    let text = text.replace(&folder.display().to_string(), "/home/you");
    let text = text.replace(env!("CARGO_PKG_VERSION"), "VERSION");
    RULES.iter().fold(text, |text, (pattern, with)| pattern.replace_all(&text, *with).into_owned())
}

fn files() -> Vec<PathBuf> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let listed = fs::read_dir(here.join("tests/transcripts")).unwrap();
    let mut files: Vec<PathBuf> = listed.map(|entry| entry.unwrap().path()).collect();
    files.push(here.join("../docs/json.md"));
    files.sort();
    files
}

/// A file that is no longer so, from its first line that differs.
fn check(path: &Path) -> Option<String> {
    let text = fs::read_to_string(path).unwrap();
    let now = replayed(&text);
    if now == text {
        return None;
    }
    if std::env::var_os("REGENERATE").is_some() {
        fs::write(path, now).unwrap();
        return None;
    }
    let same = text.lines().zip(now.lines()).take_while(|(was, is)| was == is).count();
    let from = |text: &str| text.lines().skip(same).take(12).collect::<Vec<_>>().join("\n");
    Some(format!("{} line {}:\n{}\n--- is now\n{}\n", path.display(), same + 1, from(&text), from(&now)))
}

#[test]
fn transcripts_are_still_so() {
    let files = files();
    let different: Vec<String> = std::thread::scope(|scope| {
        let checks: Vec<_> = files.iter().map(|path| scope.spawn(|| check(path))).collect();
        checks.into_iter().filter_map(|check| check.join().unwrap()).collect()
    });
    let different = different.join("\n");
    assert!(
        different.is_empty(),
        "{different}\nIf that is as it should be, run this again with REGENERATE=1."
    );
}

#[test]
fn every_command_has_its_help_and_an_example_in_a_transcript() {
    let folder = TempDir::new().unwrap();
    let all: String = files().iter().map(|path| fs::read_to_string(path).unwrap()).collect();
    let commands = |help: &str| -> Vec<String> {
        let list =
            help.split("Commands:\n").nth(1).and_then(|rest| rest.split("\n\n").next()).unwrap_or_default();
        let names = list.lines().filter_map(|line| line.split_whitespace().next());
        names.filter(|name| *name != "help").map(str::to_owned).collect()
    };
    let mut names = commands(&said(folder.path(), "host --help"));
    assert!(names.len() >= 15, "{names:?}");
    let actions = commands(&said(folder.path(), "host device --help"));
    names.extend(actions.iter().map(|action| format!("device {action}")));
    for name in names {
        let line = format!("$ host {name} --help\n");
        let page = all.split(&line).nth(1).and_then(|rest| rest.split("\n$ ").next());
        assert!(page.is_some_and(|page| page.contains("\nExamples:\n")), "{name}");
    }
}
