//! Closed, metric 3D models of textureless objects from one stereo pair each.
//!
//! Every length is in millimetres, in the axes of the left camera: x right, y down, z forward.
//!
//! What is not given is taken from `ossature.toml` in this folder or the nearest above it (`host config --help`).
//! With --json, results and errors are JSON on standard output (docs/json.md); progress, warnings and the sentence of
//! an error go to standard error. Colours and bars are for terminals; NO_COLOR and --color are heeded.
//!
//! Exit codes: 0 done; 1 refused or failed; 2 wrong usage, of the command line or of the configuration; 130 ended
//! at once by a second Ctrl-C.
//!
//! Examples:
//!   host demo                               try it: no camera, no files needed
//!   host replay left.png right.png --calib calib.yaml
//!   host replay recordings/ --out models    every pair in a folder
//!   host listen --calib calib.yaml          models from a camera device
//!   host render mesh.obj --out pair         a pair of any mesh that you have
//!   host evaluate model.ply truth.ply       how far a model is from the truth
//!   host convert model.ply model.glb        other formats: STL, OBJ, GLB, SWC
//!   host list-devices                       cameras and boards that are plugged in
//!   host capture --device /dev/video0 --calib calib.yaml
//!   host experiments                        the paper's experiments, rerun
//!   host config replay                      what it would take, and from where

pub mod calibrate;
pub mod capture;
pub mod completions;
pub mod demo;
pub mod device;
pub mod evaluate;
pub mod experiments;
pub mod inspect;
pub mod list_devices;
pub mod fleet;
pub mod listen;
pub mod looks;
pub mod batch;
mod color;
pub mod config;
mod connect;
pub mod convert;
mod crew;
mod line;
pub mod man;
mod model;
pub mod options;
mod publish;
pub mod render;
pub mod replay;
mod scene;
pub mod subscribe;
mod table;
mod timings;
mod view;

use std::error::Error;
use std::ffi::OsString;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};

use clap::{ColorChoice, Parser, Subcommand};
use serde_json::json;

use line::Line;

/// Why a command did not do what it was asked.
pub type Failure = Box<dyn Error + Send + Sync>;

/// The command line.
#[derive(Debug, Parser)]
#[command(
    name = "host",
    version,
    about = "Closed, metric 3D models of textureless objects from one stereo pair each"
)]
#[command(long_about = page(include_str!("mod.rs")))]
pub struct Cli {
    #[command(subcommand)]
    command: Command,
    #[command(flatten)]
    everywhere: Everywhere,
}

/// What holds for every command.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Everywhere")]
pub struct Everywhere {
    /// Take what is not given here from this file [default: ossature.toml here, or in the nearest folder above]
    #[arg(long, global = true, value_name = "FILE", env = "OSSATURE_CONFIG", hide_env_values = true)]
    config: Option<PathBuf>,
    /// Take nothing from a file
    #[arg(long, global = true)]
    no_config: bool,
    /// Whether to colour what is written
    #[arg(
        long,
        global = true,
        value_enum,
        default_value = "auto",
        hide_possible_values = true,
        value_name = "auto|always|never"
    )]
    color: ColorChoice,
}

/// What can be asked for.
#[derive(Debug, Subcommand)]
enum Command {
    /// Models from recorded pairs
    #[command(long_about = page(include_str!("replay.rs")))]
    Replay(replay::Args),
    /// Models from more recorded pairs than one machine should make
    #[command(long_about = page(include_str!("batch.rs")))]
    Batch(batch::Args),
    /// Models from a camera
    #[command(long_about = page(include_str!("capture.rs")))]
    Capture(capture::Args),
    /// Cameras and boards that are plugged in
    #[command(long_about = page(include_str!("list_devices.rs")))]
    ListDevices(list_devices::Args),
    /// Whether a calibration is right
    #[command(long_about = page(include_str!("calibrate.rs")))]
    Calibrate(calibrate::Args),
    /// Models from a camera device
    #[command(long_about = page(include_str!("listen.rs")))]
    Listen(listen::Args),
    /// What live boards publish: kept, or shown
    #[command(long_about = page(include_str!("subscribe.rs")))]
    Subscribe(subscribe::Args),
    /// Live boards: which there are, and orders to them
    #[command(long_about = page(include_str!("fleet.rs")))]
    Fleet(fleet::Args),
    /// A camera device: who it is, its calibration, its settings, its pictures
    #[command(long_about = page(include_str!("device.rs")))]
    Device(device::Args),
    /// A model from a built-in pair, held against the truth
    #[command(long_about = page(include_str!("demo.rs")))]
    Demo(demo::Args),
    /// A stereo pair of any mesh
    #[command(long_about = page(include_str!("render.rs")))]
    Render(render::Args),
    /// How far a model is from the truth
    #[command(long_about = page(include_str!("evaluate.rs")))]
    Evaluate(evaluate::Args),
    /// A model or a skeleton in another format
    #[command(long_about = page(include_str!("convert.rs")))]
    Convert(convert::Args),
    /// The paper's experiments on built-in shapes
    #[command(long_about = page(include_str!("experiments.rs")))]
    Experiments(experiments::Args),
    /// One stage of one view, drawn and timed
    #[command(long_about = page(include_str!("inspect.rs")))]
    Inspect(inspect::Args),
    /// Every value, and where it comes from
    #[command(long_about = page(include_str!("config.rs")))]
    Config(config::Args),
    /// Completions for a shell
    #[command(long_about = page(include_str!("completions.rs")))]
    Completions(completions::Args),
    /// Manual pages
    #[command(long_about = page(include_str!("man.rs")))]
    Man(man::Args),
}

/// Does what a command line asks for, the program's name first; says why not, and gives the exit code.
#[must_use]
pub fn main(arguments: Vec<OsString>) -> ExitCode {
    color::choose(color::typed(&arguments));
    let wants_json = |words: &[OsString]| {
        words.iter().take_while(|word| *word != "--").any(|word| word == "--json" || word == "--json=true")
    };
    let (mut json, mut line) = (wants_json(&arguments), Line::default());
    let result = Line::read(arguments).map_err(Failure::from).and_then(|read| {
        line = read;
        json = wants_json(&line.arguments);
        line.cli()?.run()
    });
    let Err(failure) = result else { return ExitCode::SUCCESS };
    let Some(usage) = failure.downcast_ref::<clap::Error>() else {
        note(&format!("error: {}", words_of(&*failure)));
        return ExitCode::FAILURE;
    };
    if json && usage.use_stderr() {
        // The failure itself matters more than that it cannot be told here.
        let _ = say_json_line(&json!({ "error": sentence_of(usage) }));
    }
    // When nobody listens there is nobody to tell.
    let _ = usage.print();
    line.origins(&usage.to_string()).iter().for_each(|origin| note(&format!("note: {origin}")));
    u8::try_from(usage.exit_code()).map_or(ExitCode::FAILURE, ExitCode::from)
}

/// What the parser says, in one line.
fn sentence_of(usage: &clap::Error) -> String {
    let text = usage.to_string();
    let text = text.split("\n\nUsage:").next().unwrap_or_default();
    let text = text.split("\n\nFor more information").next().unwrap_or_default();
    let lines = text.trim_start_matches("error: ").lines().map(str::trim).filter(|line| !line.is_empty());
    lines.collect::<Vec<_>>().join(" ")
}

impl Cli {
    /// Does what the command line asks for.
    ///
    /// # Errors
    ///
    /// A [`clap::Error`] for wrong usage; otherwise a sentence for the user.
    pub fn run(&self) -> Result<(), Failure> {
        color::choose(self.everywhere.color);
        match &self.command {
            Command::Replay(args) => replay::run(args),
            Command::Batch(args) => told(args.json, batch::run(args, &self.everywhere)),
            Command::Capture(args) => capture::run(args),
            Command::ListDevices(args) => told(args.json, list_devices::run(args)),
            Command::Calibrate(args) => calibrate::run(args),
            Command::Listen(args) => told(args.json, listen::run(args)),
            Command::Subscribe(args) => told(args.json, subscribe::run(args)),
            Command::Fleet(args) => told(args.json, fleet::run(args)),
            Command::Device(args) => told(args.json, device::run(args)),
            Command::Demo(args) => told(args.json, demo::run(args)),
            Command::Render(args) => told(args.json, render::run(args)),
            Command::Evaluate(args) => told(args.json, evaluate::run(args)),
            Command::Convert(args) => told(args.json, convert::run(args)),
            Command::Experiments(args) => told(args.json, experiments::run(args)),
            Command::Inspect(args) => told(args.json, inspect::run(args)),
            Command::Config(args) => told(args.json, config::run(args, &self.everywhere)),
            Command::Completions(args) => completions::run(args),
            Command::Man(args) => told(args.json, man::run(args)),
        }
    }
}

/// A failure and its causes in one sentence; a cause that is told already is left out.
#[must_use]
pub fn words_of(failure: &(dyn Error + 'static)) -> String {
    let mut words = failure.to_string();
    let mut cause = failure.source();
    while let Some(error) = cause {
        let more = error.downcast_ref().map_or_else(|| error.to_string(), of_system);
        if !words.contains(&more) {
            words = format!("{words}: {more}");
        }
        cause = error.source();
    }
    words
}

/// What the system says, for people; with what to do where that is clear. Sentences of our own are of no such kind.
fn of_system(error: &io::Error) -> String {
    use io::ErrorKind;
    match error.kind() {
        ErrorKind::NotFound => "there is no such file or folder".into(),
        ErrorKind::PermissionDenied => "you may not; look at who owns it".into(),
        ErrorKind::AlreadyExists => "what has that name is no folder; name another".into(),
        ErrorKind::NotADirectory => "a file is where a folder should be; name another".into(),
        ErrorKind::IsADirectory => "it is a folder".into(),
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded => {
            "there is no room; make some and try again".into()
        }
        ErrorKind::InvalidData if error.get_ref().is_none() => "it is no text".into(),
        ErrorKind::ReadOnlyFilesystem => "nothing can be written there; name another folder".into(),
        _ => error.to_string(),
    }
}

/// Writes to standard output, styles only where they are wanted. That nobody reads on (`| head`) is no failure.
fn say(text: &str) -> Result<(), Failure> {
    let mut out = anstream::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != io::ErrorKind::BrokenPipe => {
            Err(format!("cannot write to standard output: {error}").into())
        }
        _ => Ok(()),
    }
}

/// Writes a JSON document to standard output.
fn say_json(value: &serde_json::Value) -> Result<(), Failure> {
    say(&format!("{value:#}\n"))
}

/// Writes a line of JSON to standard output.
fn say_json_line(value: &serde_json::Value) -> Result<(), Failure> {
    say(&format!("{value}\n"))
}

/// Passes a result on; a failure is a line of JSON too, if JSON was asked for. Wrong usage is told by [`main`].
fn told<T>(json: bool, result: Result<T, Failure>) -> Result<T, Failure> {
    if let Err(failure) = &result
        && json
        && !failure.is::<clap::Error>()
    {
        // The failure itself matters more than that it cannot be told here.
        let _ = say_json_line(&json!({ "error": words_of(&**failure) }));
    }
    result
}

/// Set by Ctrl-C and by the signals that ask a program to end; the second one ends it. A process has one, however
/// many commands it runs.
fn interruption() -> Result<Arc<AtomicBool>, Failure> {
    static STOP: LazyLock<Result<Arc<AtomicBool>, ctrlc::Error>> = LazyLock::new(|| {
        let stop = Arc::new(AtomicBool::new(false));
        let set = Arc::clone(&stop);
        let handler = move || {
            if set.swap(true, Ordering::Relaxed) {
                // As a shell tells a program that Ctrl-C ended.
                std::process::exit(130);
            }
        };
        ctrlc::set_handler(handler).map(|()| stop)
    });
    let stop = STOP.as_ref().map_err(|error| format!("cannot listen to Ctrl-C: {error}"))?;
    Ok(Arc::clone(stop))
}

/// A path in words. Not every path is text, and JSON is.
fn shown(path: &Path) -> String {
    path.display().to_string()
}

/// Writes a line to standard error, if anybody listens.
fn note(line: &str) {
    let _ = writeln!(anstream::stderr(), "{}", color::line(line));
}

/// The help page at the head of a source file: its `//!` lines. Paragraphs become one line each, which is
/// wrapped to the terminal; indented lines stay as they are.
fn page(source: &str) -> String {
    let mut page = String::new();
    for line in source.lines().map_while(|line| line.strip_prefix("//!")) {
        let line = line.strip_prefix(' ').unwrap_or(line);
        let flows = !(line.is_empty() || line.starts_with(' ') || page.is_empty() || page.ends_with('\n'));
        page.push_str(if flows { " " } else { "" });
        page.push_str(line);
        if line.is_empty() {
            page.push_str(if page.ends_with('\n') { "\n" } else { "\n\n" });
        } else if line.starts_with(' ') || line.ends_with(':') {
            page.push('\n');
        }
    }
    page
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_sound() {
        line::command().debug_assert();
    }

    #[test]
    fn help_is_the_head_of_the_file() {
        let source = "//! One\n//! two.\n//!\n//! Examples:\n//!   a\n//!   b\n\nuse x;\n//! not this\n";
        assert_eq!(page(source), "One two.\n\nExamples:\n  a\n  b\n");
    }

    #[test]
    fn causes_are_told_once() {
        let cause = io::Error::other("disk full");
        let export = crate::export::ExportError::Io { path: "a".into(), source: cause };
        assert_eq!(words_of(&export), "cannot write a: disk full");
        let told = crate::calibration::CalibrationError::Unreadable {
            path: "b".into(),
            source: io::Error::other("gone"),
        };
        assert_eq!(words_of(&told), "cannot read the calibration b: gone");
    }
}
