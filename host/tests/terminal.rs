//! Colours and bars: on a terminal, which is a real one here, and never in a pipe.
#![cfg(unix)]

use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::process::{Command, Stdio};

use nix::pty::{Winsize, openpty};
use tempfile::TempDir;

/// What begins every change of colour or place on a terminal.
const ESCAPE: char = '\u{1b}';

fn host(folder: &Path, args: &[&str], environment: &[(&str, &str)]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_host"));
    command.current_dir(folder).args(args).stdin(Stdio::null()).env("TERM", "xterm-256color");
    // A build machine says that it shows colours whatever the terminal is.
    for name in ["NO_COLOR", "CLICOLOR", "CLICOLOR_FORCE", "CI", "OSSATURE_CONFIG"] {
        command.env_remove(name);
    }
    command.envs(environment.iter().copied());
    command
}

/// What a run writes to a terminal that both of its outputs are.
fn on_terminal(folder: &Path, args: &[&str], environment: &[(&str, &str)]) -> String {
    let size = Winsize { ws_row: 24, ws_col: 100, ws_xpixel: 0, ws_ypixel: 0 };
    let terminal = openpty(&size, None).unwrap();
    let mut command = host(folder, args, environment);
    command.stdout(terminal.slave.try_clone().unwrap()).stderr(terminal.slave);
    let mut child = command.spawn().unwrap();
    // This side of the terminal's end, which would keep it open.
    drop(command);
    let (mut master, mut bytes, mut part) = (File::from(terminal.master), Vec::new(), [0; 4096]);
    // A terminal that nobody writes to any more is an error for who reads it, on Linux.
    while let Ok(count @ 1..) = master.read(&mut part) {
        bytes.extend_from_slice(&part[..count]);
    }
    child.wait().unwrap();
    String::from_utf8_lossy(&bytes).into_owned()
}

fn in_pipe(folder: &Path, args: &[&str], environment: &[(&str, &str)]) -> String {
    let output = host(folder, args, environment).output().unwrap();
    String::from_utf8([output.stdout, output.stderr].concat()).unwrap()
}

/// Lines that print a heading, help, wrong usage, a refusal, and a warning.
const LINES: [&[&str]; 5] = [
    &["config", "man"],
    &["demo", "--help"],
    &["demo", "cube"],
    &["replay", "none.png"],
    &["render", "sphere", "--place", "auto", "--distance", "5000", "--out", "far"],
];

#[test]
fn a_terminal_is_coloured_and_a_pipe_is_not() {
    let folder = TempDir::new().unwrap();
    for args in LINES {
        let seen = on_terminal(folder.path(), args, &[]);
        assert!(seen.contains(ESCAPE), "{args:?}: {seen}");
        let piped = in_pipe(folder.path(), args, &[]);
        assert!(!piped.is_empty() && !piped.contains(ESCAPE), "{args:?}: {piped}");
    }
}

#[test]
fn the_user_decides() {
    let folder = TempDir::new().unwrap();
    for args in LINES {
        let with = |more: &[&'static str]| [args, more].concat();
        for seen in [
            on_terminal(folder.path(), args, &[("NO_COLOR", "1")]),
            on_terminal(folder.path(), args, &[("TERM", "dumb")]),
            on_terminal(folder.path(), &with(&["--color", "never"]), &[]),
        ] {
            assert!(!seen.is_empty() && !seen.contains(ESCAPE), "{args:?}: {seen}");
        }
        assert!(in_pipe(folder.path(), &with(&["--color", "always"]), &[]).contains(ESCAPE), "{args:?}");
    }
    std::fs::write(folder.path().join("ossature.toml"), "color = \"never\"\n").unwrap();
    assert!(!on_terminal(folder.path(), LINES[0], &[]).contains(ESCAPE));
}

#[test]
fn a_bar_is_for_a_terminal() {
    let folder = TempDir::new().unwrap();
    for pair in ["many/a", "many/b"] {
        let args = ["render", "sphere", "--size", "320x240", "--focal", "375", "--out", pair];
        in_pipe(folder.path(), &args, &[]);
    }
    let replay = ["replay", "many", "--jobs", "1"];
    let seen = on_terminal(folder.path(), &replay, &[("NO_COLOR", "1")]);
    assert!(seen.contains("/2 pairs") && seen.contains("2 of 2 pairs have a model"), "{seen}");
    let piped = in_pipe(folder.path(), &replay, &[]);
    assert!(!piped.contains("/2 pairs") && piped.contains("2 of 2 pairs have a model"), "{piped}");
    // What a program reads is the same wherever progress is shown.
    let json = [&replay[..], &["--json"]].concat();
    assert!(in_pipe(folder.path(), &json, &[]).starts_with('{'));
}
