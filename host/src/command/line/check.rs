//! Whether a configuration fits the commands: every table and every entry is tried on the parser, by itself.

use clap::error::{ContextKind, ContextValue};
use clap::{Arg, ArgAction, Command, Error};

use super::{is_switch, option, runnable};
use crate::config::{Config, ConfigError, Entry, Value};

/// Whether every entry is one that its commands can take.
pub(super) fn check(root: &Command, config: &Config) -> Result<(), ConfigError> {
    for table in &config.tables {
        let command = command_of(root, &table.command).map_err(|what| ConfigError::at(&table.place, what))?;
        for entry in &table.entries {
            let holders: Vec<(&Command, &Arg)> = runnable(command)
                .into_iter()
                .filter_map(|command| Some((command, option(command, &entry.name)?)))
                .collect();
            let Some(&(first, arg)) = holders.first() else { return Err(unknown(command, entry)) };
            let takes = |arg: &Arg| arg.get_value_names().map(<[_]>::to_vec);
            if let Some((other, _)) = holders.iter().find(|(_, other)| takes(other) != takes(arg)) {
                let table = |command| path_of(command).split(' ').skip(1).collect::<Vec<_>>().join(".");
                let (name, first, other) = (&entry.name, table(first), table(other));
                let what = format!(
                    "`{name}` is not the same for every command: put it into [{first}], [{other}] or the like"
                );
                return Err(ConfigError::at(&entry.place, what));
            }
            check_value(arg, entry)?;
        }
    }
    Ok(())
}

/// The command that some names lead to.
///
/// # Errors
///
/// A sentence about the first name that leads nowhere.
pub(in crate::command) fn command_of<'a>(root: &'a Command, names: &[String]) -> Result<&'a Command, String> {
    names.iter().try_fold(root, |command, name| {
        command.find_subcommand(name).ok_or_else(|| {
            let there = command.get_subcommands().map(Command::get_name).filter(|name| *name != "help");
            let there: Vec<&str> = there.collect();
            let error = command.clone().try_get_matches_from([command.get_name(), name]).err();
            let hint = suggested(error.as_ref(), ContextKind::SuggestedSubcommand);
            let hint = hint.unwrap_or_else(|| match there.as_slice() {
                [] => format!("{} has no commands of its own", command.get_name()),
                there => format!("there are: {}", there.join(", ")),
            });
            format!("there is no command `{name}`; {hint}")
        })
    })
}

fn unknown(command: &Command, entry: &Entry) -> ConfigError {
    let meant = runnable(command).into_iter().find_map(|command| {
        let typed = [command.get_name().to_owned(), format!("--{}=0", entry.name)];
        suggested(command.clone().try_get_matches_from(typed).err().as_ref(), ContextKind::SuggestedArg)
    });
    let path = path_of(command);
    let hint = meant.unwrap_or_else(|| format!("names are those of the options in `{path} --help`"));
    ConfigError::at(&entry.place, format!("there is no option `{}`; {hint}", entry.name))
}

/// What is typed for a command of a root that was built.
fn path_of(command: &Command) -> &str {
    command.get_bin_name().unwrap_or_else(|| command.get_name())
}

fn check_value(arg: &Arg, entry: &Entry) -> Result<(), ConfigError> {
    let name = &entry.name;
    let refused = |what: String| Err(ConfigError::at(&entry.value_place, what));
    let values = match (is_switch(arg), &entry.value) {
        (true, Value::Switch(_)) => return Ok(()),
        (true, _) => return refused(format!("`{name}` is a switch: give true or false")),
        (false, Value::Switch(_)) => return refused(format!("`{name}` is no switch: give {}", takes(arg))),
        (false, Value::One(one)) => std::slice::from_ref(one),
        (false, Value::Many(all)) if matches!(arg.get_action(), ArgAction::Append) => all.as_slice(),
        (false, Value::Many(_)) => {
            return refused(format!("`{name}` takes one value, no list: give {}", takes(arg)));
        }
    };
    let alone =
        Arg::new("value").long("value").action(ArgAction::Set).value_parser(arg.get_value_parser().clone());
    let scratch = Command::new("host").arg(alone);
    for value in values {
        let Err(error) =
            scratch.clone().try_get_matches_from(["host".to_owned(), format!("--value={value}")])
        else {
            continue;
        };
        let why = std::error::Error::source(&error).map(ToString::to_string);
        let hint = suggested(Some(&error), ContextKind::SuggestedValue);
        let why = hint.or(why).unwrap_or_else(|| format!("give {}", takes(arg)));
        return refused(format!("`{name}` cannot be `{value}`: {why}"));
    }
    Ok(())
}

/// What an option takes.
pub(in crate::command) fn takes(arg: &Arg) -> String {
    let possible: Vec<String> =
        arg.get_possible_values().iter().map(|value| value.get_name().to_owned()).collect();
    if possible.is_empty() {
        let names = arg.get_value_names().unwrap_or_default().iter().map(ToString::to_string);
        return names.collect::<Vec<_>>().join(" ");
    }
    possible.join("|")
}

/// What the parser thinks was meant.
fn suggested(error: Option<&Error>, kind: ContextKind) -> Option<String> {
    let meant = match error?.get(kind)? {
        ContextValue::String(one) => one.clone(),
        ContextValue::Strings(all) => all.join(", "),
        _ => return None,
    };
    Some(format!("did you mean `{}`?", meant.trim_start_matches("--")))
}
