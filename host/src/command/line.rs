//! From what was typed to what is run: the command line, and under it the configuration file.
//!
//! Clap's definition of the commands is the one list of names and values. An entry of the file is checked as an
//! argument of its own, so that what is wrong is told with its place, and then put behind what was typed. Left out
//! is what was typed too, and what contradicts it: the default is below the file, the file below the command line.

mod check;

use std::any::TypeId;
use std::cmp::Reverse;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use clap::builder::ValueHint;
use clap::error::ErrorKind;
use clap::parser::ValueSource;
use clap::{Arg, ArgAction, ArgMatches, Command, CommandFactory, Error, FromArgMatches, Id};

use super::{Cli, words_of};
use crate::config::{self, Config, ConfigError, Place, Table, Value};
pub(super) use check::{command_of, takes};

/// What was typed, and what the configuration adds to it.
#[derive(Debug, Default)]
pub(super) struct Line {
    /// For the parser.
    pub(super) arguments: Vec<OsString>,
    pub(super) added: Vec<Added>,
    /// The configuration that was read.
    pub(super) config: Option<PathBuf>,
}

/// An option that the configuration gives.
#[derive(Debug)]
pub(super) struct Added {
    pub(super) id: Id,
    /// With its hyphens.
    option: String,
    pub(super) place: Place,
}

/// The definition of the command line, as it is shown: the examples of a page come behind its options.
pub(super) fn command() -> Command {
    fn examples_last(mut command: Command) -> Command {
        let page = command.get_long_about().map(ToString::to_string).unwrap_or_default();
        if let Some((about, examples)) = page.split_once("\n\nExamples:\n") {
            let examples = format!("Examples:\n{}", examples.trim_end());
            command = command.long_about(about.to_owned()).after_help(examples);
        }
        command.mut_subcommands(examples_last)
    }
    examples_last(Cli::command()).max_term_width(100)
}

/// The definition as it is read: any switch may be given a value, as in `--report=false`.
fn parser() -> Command {
    fn switches(command: Command) -> Command {
        let with_value = |arg: Arg| match arg.get_action() {
            ArgAction::SetTrue => arg
                .action(ArgAction::Set)
                .num_args(0..=1)
                .require_equals(true)
                .default_missing_value("true")
                .default_value("false")
                .value_parser(clap::value_parser!(bool))
                .value_name("true|false"),
            _ => arg,
        };
        command.mut_args(with_value).mut_subcommands(switches)
    }
    switches(command())
}

/// The definition without anything that has to be given.
fn relaxed() -> Command {
    fn relax(command: Command) -> Command {
        command.subcommand_required(false).mut_args(|arg| arg.required(false)).mut_subcommands(relax)
    }
    let mut relaxed = relax(parser());
    relaxed.build();
    relaxed
}

impl Line {
    /// Adds to what was typed what the configuration says.
    ///
    /// # Errors
    ///
    /// If there is anything wrong with the configuration; also to print help, or the version.
    pub(super) fn read(arguments: Vec<OsString>) -> Result<Self, Error> {
        let Ok(typed) = parser().ignore_errors(true).try_get_matches_from(&arguments) else {
            command().try_get_matches_from(&arguments)?;
            return Ok(Self { arguments, ..Self::default() });
        };
        let Some(path) = configuration(&typed) else { return Ok(Self { arguments, ..Self::default() }) };
        let mut root = parser();
        root.build();
        let read = Config::read(&path).and_then(|config| check::check(&root, &config).map(|()| config));
        let wrong = |error: ConfigError| Error::raw(ErrorKind::ValueValidation, words_of(&error) + "\n");
        let config = read.map_err(wrong)?;
        let mut line = Self { arguments, added: Vec::new(), config: Some(path) };
        line.add(&root, &typed, &config);
        Ok(line)
    }

    /// Adds the entries for the command that was typed.
    fn add(&mut self, root: &Command, typed: &ArgMatches, config: &Config) {
        let (names, command, typed) = chosen(root, typed);
        let is_typed = |id: &&Id| typed.value_source(id.as_str()) == Some(ValueSource::CommandLine);
        let mut said: Vec<Id> = typed.ids().filter(is_typed).cloned().collect();
        let mut tables: Vec<&Table> =
            config.tables.iter().filter(|table| names.starts_with(&table.command)).collect();
        tables.sort_by_key(|table| Reverse(table.command.len()));
        let mut more = Vec::new();
        for table in tables {
            let above = said.clone();
            for entry in &table.entries {
                let Some(arg) = option(command, &entry.name) else { continue };
                if above.iter().any(|id| id == arg.get_id() || contradict(command, id, arg)) {
                    continue;
                }
                said.push(arg.get_id().clone());
                more.extend(as_arguments(arg, &entry.value, config.folder()));
                let option = format!("--{}", entry.name);
                self.added.push(Added { id: arg.get_id().clone(), option, place: entry.place.clone() });
            }
        }
        let end = self.arguments.iter().position(|argument| argument == "--");
        let end = end.unwrap_or(self.arguments.len());
        self.arguments.splice(end..end, more);
    }

    /// What is to be run.
    ///
    /// # Errors
    ///
    /// Wrong usage.
    pub(super) fn cli(&self) -> Result<Cli, Error> {
        let read = parser().try_get_matches_from(&self.arguments);
        if read
            .as_ref()
            .is_err_and(|error| error.kind() == ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand)
        {
            command().try_get_matches_from(&self.arguments)?;
        }
        Cli::from_arg_matches(&read?)
    }

    /// The command of a definition, and the values of all its options, whether it could be run with them or not.
    ///
    /// # Errors
    ///
    /// If they contradict each other.
    pub(super) fn values<'a>(&self, root: &'a Command) -> Result<(&'a Command, ArgMatches), Error> {
        let mut matches = relaxed().try_get_matches_from(&self.arguments)?;
        let mut command = root;
        while let Some((name, inner)) = matches.remove_subcommand() {
            matches = inner;
            command = command.find_subcommand(&name).unwrap_or(command);
        }
        Ok((command, matches))
    }

    /// Where the options that a sentence speaks of come from, if they were not typed.
    pub(super) fn origins(&self, sentence: &str) -> Vec<String> {
        let spoken_of = self.added.iter().filter(|added| {
            let ends =
                |rest: &str| !rest.starts_with(|next: char| next.is_ascii_alphanumeric() || next == '-');
            sentence.split(added.option.as_str()).skip(1).any(ends)
        });
        spoken_of
            .map(|added| format!("{} stands in {}; --no-config leaves it out", added.option, added.place))
            .collect()
    }
}

/// The configuration to be read, if any.
fn configuration(typed: &ArgMatches) -> Option<PathBuf> {
    if typed.get_one("no_config").copied().unwrap_or(false) {
        return None;
    }
    let named = typed.get_one::<PathBuf>("config").cloned();
    named.or_else(|| config::find(&std::env::current_dir().ok()?))
}

/// The command that was typed, by the names on the way to it.
fn chosen<'a>(root: &'a Command, typed: &'a ArgMatches) -> (Vec<String>, &'a Command, &'a ArgMatches) {
    let (mut names, mut command, mut matches) = (Vec::new(), root, typed);
    while let Some((name, inner)) = matches.subcommand() {
        let Some(found) = command.find_subcommand(name) else { break };
        names.push(name.to_owned());
        (command, matches) = (found, inner);
    }
    (names, command, matches)
}

/// The options of a command that a configuration can give.
pub(super) fn options(command: &Command) -> impl Iterator<Item = &Arg> {
    let about_files = |arg: &Arg| matches!(arg.get_id().as_str(), "config" | "no_config" | "init");
    command.get_arguments().filter(move |arg| {
        let asks = matches!(
            arg.get_action(),
            ArgAction::Help | ArgAction::HelpShort | ArgAction::HelpLong | ArgAction::Version
        );
        arg.get_long().is_some() && !asks && !about_files(arg)
    })
}

fn option<'a>(command: &'a Command, name: &str) -> Option<&'a Arg> {
    options(command).find(|arg| arg.get_long() == Some(name))
}

/// Whether an option may be given more than once.
pub(super) fn is_list(arg: &Arg) -> bool {
    matches!(arg.get_action(), ArgAction::Append)
}

/// Whether an option is on or off.
pub(super) fn is_switch(arg: &Arg) -> bool {
    matches!(arg.get_action(), ArgAction::SetTrue) || arg.get_value_parser().type_id() == TypeId::of::<bool>()
}

/// A command and all below it that can be run, but for the help on them.
pub(super) fn runnable(command: &Command) -> Vec<&Command> {
    let inner = command.get_subcommands().filter(|inner| inner.get_name() != "help");
    let below: Vec<&Command> = inner.flat_map(runnable).collect();
    if below.is_empty() { vec![command] } else { below }
}

fn contradict(command: &Command, said: &Id, arg: &Arg) -> bool {
    let of =
        |one: &Arg, other: &Id| command.get_arg_conflicts_with(one).iter().any(|arg| arg.get_id() == other);
    let said_arg = command.get_arguments().find(|arg| arg.get_id() == said);
    of(arg, said) || said_arg.is_some_and(|said| of(said, arg.get_id()))
}

/// What would have been typed for a value of an option, with paths that start at a folder.
pub(super) fn as_arguments(arg: &Arg, value: &Value, folder: &Path) -> Vec<OsString> {
    let option = format!("--{}", arg.get_long().unwrap_or_default());
    let in_folder = |text: &String| -> OsString {
        let path = folder.join(text);
        if arg.get_value_parser().type_id() == TypeId::of::<PathBuf>() {
            path.into()
        } else if arg.get_value_hint() == ValueHint::AnyPath {
            // A path or a word, or two paths.
            let one = |part: &str| Some(folder.join(part)).filter(|path| path.exists());
            let parts =
                text.split(',').map(|part| one(part).map_or_else(|| part.into(), PathBuf::into_os_string));
            parts.collect::<Vec<OsString>>().join(",".as_ref())
        } else {
            text.into()
        }
    };
    let with = |value: OsString| {
        let mut argument = OsString::from(format!("{option}="));
        argument.push(value);
        argument
    };
    match value {
        Value::Switch(true) => vec![option.into()],
        Value::Switch(false) => Vec::new(),
        Value::One(text) => vec![with(in_folder(text))],
        Value::Many(all) => all.iter().map(|text| with(in_folder(text))).collect(),
    }
}
