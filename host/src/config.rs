//! The configuration file `ossature.toml`, read into names and values that know where they stand.
//!
//! Names are those of the command line's long options. Above the first table they are meant for every command,
//! in a table `[replay]` or `[device.grab]` for that command. This file knows TOML alone; what names and values mean
//! is checked by the parser of the command line ([`crate::command`]).

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

use toml::Spanned;
use toml::de::{DeTable, DeValue};

/// Name of the file that is looked for.
pub const NAME: &str = "ossature.toml";

/// A configuration as it stands in its file.
#[derive(Debug)]
pub struct Config {
    /// The file, as it is told.
    pub path: PathBuf,
    /// Its tables in the order of the file; the first is what stands above them.
    pub tables: Vec<Table>,
}

/// The entries of one table.
#[derive(Debug)]
pub struct Table {
    /// Names of the command and its action; none for all commands.
    pub command: Vec<String>,
    /// Where its name stands.
    pub place: Place,
    /// What it holds, in the order of the file.
    pub entries: Vec<Entry>,
}

/// A name and its value.
#[derive(Debug)]
pub struct Entry {
    /// The name.
    pub name: String,
    /// Where the name stands.
    pub place: Place,
    /// The value.
    pub value: Value,
    /// Where the value stands.
    pub value_place: Place,
}

/// A value, in the words of the command line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Value {
    /// Whether a switch is on.
    Switch(bool),
    /// Text or a number.
    One(String),
    /// Several of them.
    Many(Vec<String>),
}

/// Where something stands in a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    /// The file.
    pub file: PathBuf,
    /// Line, counted from 1.
    pub line: usize,
    /// Character in the line, counted from 1.
    pub column: usize,
}

impl fmt::Display for Place {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "{}:{}:{}", self.file.display(), self.line, self.column)
    }
}

/// Why a configuration is refused.
#[derive(Debug, thiserror::Error)]
pub enum ConfigError {
    /// The file could not be read.
    #[error("the configuration {} cannot be read (--no-config does without)", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// Something in it is wrong.
    #[error("{place}: {what}")]
    Wrong {
        /// Where.
        place: Place,
        /// What, and what to do.
        what: String,
    },
}

impl ConfigError {
    /// Something is wrong at a place.
    pub fn at(place: &Place, what: impl Into<String>) -> Self {
        Self::Wrong { place: place.clone(), what: what.into() }
    }
}

/// The file of a folder, or else of the nearest folder above it that has one.
#[must_use]
pub fn find(folder: &Path) -> Option<PathBuf> {
    let here = Path::new(NAME);
    if folder.join(here).is_file() {
        return Some(here.to_path_buf());
    }
    folder.ancestors().map(|folder| folder.join(NAME)).find(|path| path.is_file())
}

impl Config {
    /// Reads a file.
    ///
    /// # Errors
    ///
    /// If it cannot be read, is not TOML, or holds what is no value of an option.
    pub fn read(path: &Path) -> Result<Self, ConfigError> {
        let unreadable = |source| ConfigError::Unreadable { path: path.to_path_buf(), source };
        Self::parse(path, &std::fs::read_to_string(path).map_err(unreadable)?)
    }

    /// Reads the text of a file, which errors call `path`.
    ///
    /// # Errors
    ///
    /// If it is not TOML, or holds what is no value of an option.
    pub fn parse(path: &Path, text: &str) -> Result<Self, ConfigError> {
        let reader = Reader { path, text };
        let root = DeTable::parse(text).map_err(|error| {
            let words = error.message().lines().collect::<Vec<_>>().join(", ");
            ConfigError::at(
                &reader.place(error.span().map_or(0, |span| span.start)),
                format!("not TOML: {words}"),
            )
        })?;
        let mut tables = Vec::new();
        reader.table(Vec::new(), reader.place(0), root.get_ref(), &mut tables)?;
        Ok(Self { path: path.to_path_buf(), tables })
    }

    /// The folder that relative paths in it start at.
    #[must_use]
    pub fn folder(&self) -> &Path {
        self.path.parent().unwrap_or(Path::new(""))
    }
}

/// The text, for places.
struct Reader<'a> {
    path: &'a Path,
    text: &'a str,
}

impl Reader<'_> {
    fn place(&self, offset: usize) -> Place {
        let before = self.text.get(..offset).unwrap_or(self.text);
        let line_start = before.rfind('\n').map_or(0, |at| at + 1);
        Place {
            file: self.path.to_path_buf(),
            line: before.matches('\n').count() + 1,
            column: before[line_start..].chars().count() + 1,
        }
    }

    /// Adds a table and those within it.
    fn table(
        &self,
        command: Vec<String>,
        place: Place,
        table: &DeTable<'_>,
        tables: &mut Vec<Table>,
    ) -> Result<(), ConfigError> {
        let mut pairs: Vec<_> = table.iter().collect();
        pairs.sort_by_key(|(name, _)| name.span().start);
        let index = tables.len();
        tables.push(Table { command, place, entries: Vec::new() });
        for (name, value) in pairs {
            let (place, name) = (self.place(name.span().start), name.get_ref().to_string());
            if let DeValue::Table(inner) = value.get_ref() {
                let command = [tables[index].command.as_slice(), &[name]].concat();
                self.table(command, place, inner, tables)?;
                continue;
            }
            let value_place = self.place(value.span().start);
            let value = self.value(value)?;
            tables[index].entries.push(Entry { name, place, value, value_place });
        }
        Ok(())
    }

    fn value(&self, value: &Spanned<DeValue<'_>>) -> Result<Value, ConfigError> {
        match value.get_ref() {
            DeValue::Boolean(on) => Ok(Value::Switch(*on)),
            DeValue::Array(all) => {
                all.iter().map(|one| self.one(one)).collect::<Result<_, _>>().map(Value::Many)
            }
            _ => self.one(value).map(Value::One),
        }
    }

    /// Text or a number, as the command line takes it.
    fn one(&self, value: &Spanned<DeValue<'_>>) -> Result<String, ConfigError> {
        let refused = |what: &str| ConfigError::at(&self.place(value.span().start), what);
        match value.get_ref() {
            DeValue::String(text) => Ok(text.to_string()),
            DeValue::Float(number) => Ok(number.as_str().to_owned()),
            DeValue::Integer(number) => i64::from_str_radix(number.as_str(), number.radix())
                .map(|number| number.to_string())
                .map_err(|_| refused("the number is too large")),
            other => {
                Err(refused(&format!("{} is no value of an option; give text or a number", kind(other))))
            }
        }
    }
}

fn kind(value: &DeValue<'_>) -> &'static str {
    match value {
        DeValue::Boolean(_) => "a truth value in a list",
        DeValue::Datetime(_) => "a date",
        DeValue::Array(_) => "a list in a list",
        _ => "a table in a list",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parse(text: &str) -> Result<Config, ConfigError> {
        Config::parse(Path::new("a.toml"), text)
    }

    #[test]
    fn entries_know_their_table_and_their_place() {
        let text = "# A desk.\nthreshold = 1_28\njson = true\n[replay]\n  focal = 7.5e2\n[device.grab]\nout = 'p\u{e4}ir'\n\
                    [capture]\ndevice = [\"/dev/video0\", \"/dev/video2\"]\n";
        let config = parse(text).unwrap();
        let all: Vec<String> = config
            .tables
            .iter()
            .flat_map(|table| {
                let name = table.command.join(".");
                table
                    .entries
                    .iter()
                    .map(move |e| format!("{name} {} {:?} {}", e.name, e.value, e.value_place))
            })
            .collect();
        let expected = [
            r#" threshold One("128") a.toml:2:13"#,
            " json Switch(true) a.toml:3:8",
            r#"replay focal One("7.5e2") a.toml:5:11"#,
            "device.grab out One(\"p\u{e4}ir\") a.toml:7:7",
            r#"capture device Many(["/dev/video0", "/dev/video2"]) a.toml:9:10"#,
        ];
        assert_eq!(all, expected);
    }

    #[test]
    fn what_is_wrong_is_told_with_its_place() {
        for (text, told) in [
            ("focal =\n", "a.toml:1:8: not TOML: "),
            ("\u{e4} = 1\n", "a.toml:1:1: not TOML: "),
            ("a = 1\nb = 1979-05-27\n", "a.toml:2:5: a date is no value of an option"),
            ("a = [1, [2]]\n", "a.toml:1:9: a list in a list is no value"),
            ("a = 99999999999999999999\n", "a.toml:1:5: "),
            ("a = 1\na = 2\n", "a.toml:2:1: not TOML: "),
        ] {
            let error = parse(text).unwrap_err().to_string();
            assert!(error.starts_with(told) && error.lines().count() == 1, "{error}");
        }
    }

    #[test]
    fn the_nearest_file_counts() {
        let top = tempfile::tempdir().unwrap();
        let low = top.path().join("a/b");
        std::fs::create_dir_all(&low).unwrap();
        std::fs::write(top.path().join(NAME), "").unwrap();
        assert_eq!(find(&low), Some(top.path().join(NAME)));
        std::fs::write(top.path().join("a").join(NAME), "").unwrap();
        assert_eq!(find(&low), Some(top.path().join("a").join(NAME)));
        std::fs::write(low.join(NAME), "").unwrap();
        assert_eq!(find(&low), Some(NAME.into()));
    }
}
