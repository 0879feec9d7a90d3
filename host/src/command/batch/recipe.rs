//! How the pairs of a batch are made: the words that go through the queue, and what they mean.

use std::ffi::OsString;
use std::path::Path;

use clap::parser::ValueSource;

use super::super::line::{self, Line};
use super::super::options::{NoCalibration, usage};
use super::super::{Command, Everywhere, Failure, config, replay};
use crate::batch::job::Sum;
use crate::config::Value;
use crate::reconstruct::Options;
use crate::source::scene::Scene;

/// Options of `replay` that say nothing of how a model is made.
const OTHERS: [&str; 7] = ["view", "rate", "jobs", "out", "timings", "json", "color"];

/// How pairs are made.
pub(super) struct Recipe {
    /// What `host replay` would take.
    pub(super) args: replay::Args,
    pub(super) options: Options,
    pub(super) scene: Scene,
    /// A sum over all of it, files and this version too.
    pub(super) sum: String,
}

/// The words for what was typed and what the configuration adds, with paths that hold in any folder.
pub(super) fn words(
    typed: &[OsString],
    folder: &Path,
    everywhere: &Everywhere,
) -> Result<Vec<String>, Failure> {
    let program = config::program(everywhere);
    let line = Line::read([program, vec!["replay".into(), folder.into()], typed.to_vec()].concat())?;
    if let Command::Replay(args) = line.cli()?.command
        && args.input.len() > 1
    {
        return Err(usage(
            "behind -- stand options of `host replay`, and no further files: a batch is one folder",
        ));
    }
    let mut root = line::command();
    root.build();
    let (command, matches) = line.values(&root)?;
    let here = std::env::current_dir()?;
    let mut words = Vec::new();
    for arg in line::options(command) {
        let id = arg.get_id();
        if matches.value_source(id.as_str()) != Some(ValueSource::CommandLine) {
            continue;
        }
        if arg.get_long().is_some_and(|name| OTHERS.contains(&name)) {
            if line.added.iter().any(|added| added.id == *id) {
                continue;
            }
            return Err(usage(&format!(
                "--{} says nothing of how a model is made: leave it out",
                arg.get_long().unwrap_or_default()
            )));
        }
        let raw = matches.get_raw(id.as_str()).into_iter().flatten();
        let mut raw: Vec<String> = raw.map(|value| value.to_string_lossy().into_owned()).collect();
        let value = match (line::is_switch(arg), raw.pop()) {
            (_, None) => continue,
            (true, Some(last)) => Value::Switch(last == "true"),
            (false, Some(last)) if raw.is_empty() => Value::One(last),
            (false, Some(last)) => Value::Many([raw, vec![last]].concat()),
        };
        let told = line::as_arguments(arg, &value, &here);
        words.extend(told.into_iter().map(|word| word.to_string_lossy().into_owned()));
    }
    Ok(words)
}

impl Recipe {
    /// What words mean, for results in `out`.
    ///
    /// # Errors
    ///
    /// If they are none of this version's, or a file that they name cannot be read.
    pub(super) fn read(words: &[String], folder: &Path, out: &Path) -> Result<Self, Failure> {
        let mut arguments: Vec<OsString> = vec!["host".into(), "replay".into(), folder.into()];
        arguments.extend(["--out".into(), out.into()]);
        arguments.extend(words.iter().map(OsString::from));
        let line = Line { arguments, ..Line::default() };
        let Command::Replay(args) = line.cli()?.command else {
            return Err("a batch is of pairs to be replayed".into());
        };
        if args.scene.takes_first() {
            return Err(usage(
                "--background first is of pairs one after the other: name the pair, --background LEFT,RIGHT",
            ));
        }
        let (options, scene) = replay::how(&args)?;
        let mut sum = Sum::default();
        sum.add(env!("CARGO_PKG_VERSION").as_bytes());
        words.iter().for_each(|word| sum.add(word.as_bytes()));
        match args.cameras.file() {
            Ok(None) => {}
            Ok(Some((_, path))) => sum.add(&std::fs::read(path)?),
            // It lies beside the pictures.
            Err(failure) if failure.is::<NoCalibration>() => {}
            Err(failure) => return Err(failure),
        }
        for view in scene.background.iter().flatten() {
            sum.add(view);
        }
        Ok(Self { args, options, scene, sum: sum.finish() })
    }
}
