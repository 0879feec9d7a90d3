//! Every value that a command would take, and where it comes from.
//!
//! What is not given on the command line is taken from `ossature.toml`: the one in this folder, or else in the
//! nearest folder above it, or the file of --config or OSSATURE_CONFIG. Its names are those of the options. A table
//! is for the command of its name (`replay`, `device.grab`); what stands above the first table is for every command
//! that has the option. Switches are true or false; an option that may be given twice takes a list. A relative path
//! starts at the folder of the file:
//!
//!   polarity = "dark"
//!   calib = "rig/calib.yaml"
//!   capture.device = ["/dev/video0", "/dev/video2"]
//!   capture.no-pictures = true
//!
//! The default is below the file, its common part below the command's table, and the file below the command line.
//! What is typed puts aside what the file says of it, and whatever contradicts it. A switch that the file turns on is
//! turned off by --NAME=false.
//!
//! The whole file is checked, whatever the command: a name that is none, or a value that the option would not
//! take, is refused with its line and column.
//!
//! Examples:
//!   host config --init                      write a file with every name in it, to be filled in
//!   host config                             every command
//!   host config device grab --json
//!   host config -- replay left.png right.png --threshold 90

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::parser::ValueSource;
use clap::{Arg, ArgMatches, Command};
use serde_json::{Map, Value, json};

use super::line::{self, Line};
use super::options::usage;
use super::table::Table;
use super::{Everywhere, Failure, of_system, say, say_json, shown};
use crate::config::{NAME, Place};
use crate::output::beside;

/// Arguments of `config`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// The command, and its action if it has some [default: all of them]
    command: Vec<String>,
    /// A whole command line, as it would be typed behind `host`
    #[arg(last = true, value_name = "LINE", conflicts_with = "command")]
    line: Vec<OsString>,
    /// Write a new file with every name in it [default: ossature.toml]
    #[arg(
        long,
        value_name = "FILE",
        num_args = 0..=1,
        default_missing_value = NAME,
        conflicts_with_all = ["command", "line"]
    )]
    init: Option<PathBuf>,
    /// Print one JSON document instead of text
    #[arg(long)]
    pub(super) json: bool,
}

/// Where a value comes from.
enum Origin {
    CommandLine,
    File(Place),
    Default,
}

/// An option and its value.
struct Setting {
    name: String,
    /// As it would be typed; none if there is none.
    values: Vec<String>,
    /// In words, where a default is no value.
    note: Option<String>,
    is_switch: bool,
    is_list: bool,
    origin: Origin,
}

/// Tells the values.
///
/// # Errors
///
/// If there is no such command, or something is wrong with the configuration.
pub fn run(args: &Args, everywhere: &Everywhere) -> Result<(), Failure> {
    if let Some(path) = &args.init {
        begin(path)?;
        return if args.json {
            say_json(&json!({ "file": shown(path) }))
        } else {
            say(&format!("{}\n", shown(path)))
        };
    }
    let mut root = line::command();
    root.build();
    let command = line::command_of(&root, &args.command).map_err(|what| usage(&what))?;
    let lines = if args.line.is_empty() {
        let way = |command| names(&root, command).into_iter().map(OsString::from).collect();
        line::runnable(command).into_iter().map(way).collect()
    } else {
        vec![args.line.clone()]
    };
    let (mut file, mut told) = (None, Vec::new());
    for typed in lines {
        let line = Line::read([program(everywhere), typed].concat())?;
        let (command, matches) = line.values(&root)?;
        let settings = line::options(command).map(|arg| setting(arg, &matches, &line)).collect::<Vec<_>>();
        told.push((names(&root, command).join(" "), settings));
        file = line.config;
    }
    if args.json { say_json(&as_json(file.as_deref(), &told)) } else { say(&as_text(file.as_deref(), &told)) }
}

/// The program, and the configuration that it was told to read.
pub(super) fn program(everywhere: &Everywhere) -> Vec<OsString> {
    let mut program = vec![OsString::from("host")];
    match &everywhere.config {
        _ if everywhere.no_config => program.push("--no-config".into()),
        Some(path) => program.extend(["--config".into(), path.into()]),
        None => {}
    }
    program
}

/// The names that lead to a command.
fn names(root: &Command, command: &Command) -> Vec<String> {
    let path = command.get_bin_name().unwrap_or_default();
    path.split(' ')
        .skip(root.get_bin_name().unwrap_or_default().split(' ').count())
        .map(str::to_owned)
        .collect()
}

fn setting(arg: &Arg, matches: &ArgMatches, line: &Line) -> Setting {
    let id = arg.get_id();
    let added = line.added.iter().find(|added| added.id == *id);
    let origin = match (added, matches.value_source(id.as_str())) {
        (Some(added), _) => Origin::File(added.place.clone()),
        (None, Some(ValueSource::CommandLine)) => Origin::CommandLine,
        _ => Origin::Default,
    };
    let values = matches.get_raw(id.as_str()).into_iter().flatten();
    Setting {
        name: arg.get_long().unwrap_or_default().to_owned(),
        values: values.map(|value| value.to_string_lossy().into_owned()).collect(),
        note: default_in_words(arg),
        is_switch: line::is_switch(arg),
        is_list: line::is_list(arg),
        origin,
    }
}

/// What the help says of a default that is no value: `[default: ...]`.
fn default_in_words(arg: &Arg) -> Option<String> {
    let help = arg.get_help()?.to_string();
    let (_, words) = help.rsplit_once("[default: ")?;
    words.split(']').next().map(str::to_owned)
}

fn as_text(file: Option<&Path>, told: &[(String, Vec<Setting>)]) -> String {
    let mut text = file.map_or_else(|| format!("no {NAME}\n"), |file| format!("{}\n", shown(file)));
    for (command, settings) in told {
        let mut table = Table::new(&format!("\n{command}"));
        let shown = |setting: &Setting| match setting.values.as_slice() {
            [] => setting.note.clone().unwrap_or_else(|| "-".into()),
            all => all.join(" "),
        };
        let width = settings.iter().map(|setting| shown(setting).chars().count()).max().unwrap_or_default();
        for setting in settings {
            let origin = match &setting.origin {
                Origin::CommandLine => "command line".to_owned(),
                Origin::File(place) => place.to_string(),
                Origin::Default => "default".to_owned(),
            };
            table.row(&format!("{:<16}", setting.name), &format!("{:<width$}  {origin}", shown(setting)));
        }
        text.push_str(table.text());
    }
    text
}

fn as_json(file: Option<&Path>, told: &[(String, Vec<Setting>)]) -> Value {
    let setting = |setting: &Setting| {
        let value = match setting.values.as_slice() {
            [] => Value::Null,
            [one] if setting.is_switch => (one == "true").into(),
            [one] if !setting.is_list => one.as_str().into(),
            all => all.into(),
        };
        match &setting.origin {
            Origin::CommandLine => json!({ "value": value, "from": "command line" }),
            Origin::File(place) => {
                json!({ "value": value, "from": "file", "line": place.line, "column": place.column })
            }
            Origin::Default => json!({ "value": value, "from": "default" }),
        }
    };
    let commands = told.iter().map(|(command, settings)| {
        let settings: Map<String, Value> =
            settings.iter().map(|one| (one.name.clone(), setting(one))).collect();
        (command.clone(), settings.into())
    });
    json!({ "file": file.map(shown), "commands": commands.collect::<Map<String, Value>>() })
}

/// Writes a new file with every name in it.
fn begin(path: &Path) -> Result<(), Failure> {
    let told = |error: std::io::Error| match error.kind() {
        std::io::ErrorKind::AlreadyExists => {
            format!("{} is there already: edit it, or name another behind --init", shown(path))
        }
        _ => format!("cannot write {}: {}", shown(path), of_system(&error)),
    };
    let file = beside(path, template().as_bytes()).map_err(told)?;
    file.persist_noclobber(path).map_err(|error| told(error.error))?;
    Ok(())
}

/// Every name, commented out, with its help.
fn template() -> String {
    let mut root = line::command();
    root.build();
    let mut text = String::from(
        "# What `host` takes where its command line says nothing; `host config` shows what comes of it.\n\
         # Above the first table: for every command that has the option, such as\n\
         # polarity = \"dark\"\n",
    );
    add_tables(&root, &root, &[], &mut text);
    text
}

/// Adds the options of a command and of those below it, but for what is said above already.
fn add_tables(root: &Command, command: &Command, above: &[&str], text: &mut String) {
    let here = line::options(command).filter(|arg| !above.contains(&arg.get_id().as_str()));
    for (number, arg) in here.enumerate() {
        let names = names(root, command);
        if number == 0 && !names.is_empty() {
            text.push_str(&format!("\n[{}]\n", names.join(".")));
        }
        let help = arg.get_help().map(ToString::to_string).unwrap_or_default();
        text.push_str(&format!("# {help}\n# {} = {}\n", arg.get_long().unwrap_or_default(), sample(arg)));
    }
    let everywhere =
        line::options(command).filter(|arg| arg.is_global_set()).map(|arg| arg.get_id().as_str());
    let everywhere: Vec<&str> = everywhere.collect();
    for inner in command.get_subcommands().filter(|inner| inner.get_name() != "help") {
        add_tables(root, inner, &everywhere, text);
    }
}

/// The default of an option, or what it might be.
fn sample(arg: &Arg) -> String {
    if line::is_switch(arg) {
        return "false".into();
    }
    let default = arg.get_default_values().first().map(|value| value.to_string_lossy().into_owned());
    let sample = default.unwrap_or_else(|| line::takes(arg));
    if sample.parse::<f64>().is_ok() { sample } else { format!("\"{sample}\"") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_to_begin_with_is_sound_once_it_is_filled_in() {
        let template = template();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(NAME);
        let read = |text: &str| {
            std::fs::write(&path, text).unwrap();
            Line::read(vec!["host".into(), "--config".into(), path.clone().into(), "demo".into()])
        };
        assert!(read(&template).unwrap().added.is_empty());
        // Defaults are values that can be given: none is refused, and each is where it was put.
        let has_default = |line: &&str| {
            let sample =
                line.split_once(" = ").map(|(_, sample)| sample.trim_matches('"')).unwrap_or_default();
            ["false", "auto", "otsu", "bright", "edt"].contains(&sample) || sample.parse::<f64>().is_ok()
        };
        let filled: Vec<&str> = template
            .lines()
            .map(|line| {
                Some(line).filter(has_default).and_then(|line| line.strip_prefix("# ")).unwrap_or(line)
            })
            .collect();
        assert!(filled.iter().filter(|line| line.contains(" = ") && !line.starts_with('#')).count() > 40);
        let given = read(&filled.join("\n")).unwrap().added;
        let given: Vec<&str> = given.iter().map(|added| added.id.as_str()).collect();
        assert_eq!(given, ["no_report", "json", "color"]);
    }
}
