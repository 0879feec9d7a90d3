//! YAML text to a tree that remembers its lines.
//!
//! In: the text of one file. Out: a [`Document`], whose [`Field`]s give numbers, matrices and text, or
//! an error that names the key and the line. OpenCV's `%YAML:1.0` header is no YAML directive; its
//! line is blanked, so that lines keep their numbers. Non-finite numbers are refused here, once:
//! OpenCV writes `.Nan`, which YAML reads as text.

use std::collections::BTreeMap;
use std::fmt;

use nalgebra::Matrix3;
use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};
use serde_saphyr::Spanned;
use serde_saphyr::options::{DuplicateKeyPolicy, NonFiniteFloatPolicy};

use super::error::{CalibrationError, Place};

/// Nesting of a Kalibr matrix is 4; more is no calibration.
const MAX_DEPTH: usize = 16;

/// One parsed file.
pub(super) struct Document {
    name: String,
    root: Entry,
}

/// A value and the line it begins on, with its key if it has one.
struct Entry {
    line: u64,
    value: Value,
}

enum Value {
    Number(f64),
    Text(String),
    List(Vec<Entry>),
    Map(BTreeMap<String, Entry>),
    Empty,
}

/// A value together with its key and its file, ready to complain.
#[derive(Clone, Copy)]
pub(super) struct Field<'a> {
    file: &'a str,
    key: &'a str,
    entry: &'a Entry,
}

impl Document {
    /// Parses `text`; `name` is what errors call the file.
    pub(super) fn parse(name: &str, text: &str) -> Result<Self, CalibrationError> {
        let options = serde_saphyr::options! {
            duplicate_keys: DuplicateKeyPolicy::Error,
            non_finite_float_policy: NonFiniteFloatPolicy::PassThrough,
            with_snippet: false,
            budget: serde_saphyr::budget! { max_depth: MAX_DEPTH },
        };
        let root: Entry = serde_saphyr::from_str_with_options(&without_opencv_header(text), options)
            .map_err(|error| CalibrationError::NotYaml {
                place: Place { file: name.into(), line: error.location().map_or(0, |at| at.line()) },
                reason: error.to_string(),
            })?;
        Ok(Self { name: name.into(), root })
    }

    /// The whole file as a field.
    pub(super) fn root(&self) -> Field<'_> {
        Field { file: &self.name, key: "", entry: &self.root }
    }
}

impl<'a> Field<'a> {
    /// Where it begins.
    pub(super) fn place(&self) -> Place {
        Place { file: self.file.into(), line: self.entry.line }
    }

    /// The value of the first of `keys` that is there; they are synonyms.
    pub(super) fn find(&self, keys: &[&str]) -> Option<Field<'a>> {
        let Value::Map(map) = &self.entry.value else { return None };
        let (key, entry) = keys.iter().find_map(|&key| map.get_key_value(key))?;
        Some(Field { file: self.file, key, entry })
    }

    /// As [`Self::find`], but a missing key is an error.
    pub(super) fn get(&self, keys: &[&str]) -> Result<Field<'a>, CalibrationError> {
        self.find(keys).ok_or_else(|| CalibrationError::Missing {
            place: self.place(),
            key: keys.first().copied().unwrap_or_default().into(),
        })
    }

    /// A word.
    pub(super) fn text(&self) -> Result<&'a str, CalibrationError> {
        match &self.entry.value {
            Value::Text(text) => Ok(text),
            _ => Err(self.should_be("a word")),
        }
    }

    /// A side of an image, px.
    pub(super) fn side(&self) -> Result<u32, CalibrationError> {
        match self.count()? {
            0 => Err(self.should_be("a positive number of pixels")),
            side => Ok(side),
        }
    }

    /// A number of elements.
    fn count(&self) -> Result<u32, CalibrationError> {
        let number = self.number()?;
        if number.fract() == 0.0 && (0.0..=65_535.0).contains(&number) {
            Ok(number as u32)
        } else {
            Err(self.should_be("a whole number up to 65535"))
        }
    }

    /// A finite number.
    fn number(&self) -> Result<f64, CalibrationError> {
        match &self.entry.value {
            Value::Number(number) if number.is_finite() => Ok(*number),
            Value::Number(_) => Err(self.not_finite()),
            Value::Text(text) if is_non_finite(text) => Err(self.not_finite()),
            _ => Err(self.should_be("a number")),
        }
    }

    /// The elements of a list.
    pub(super) fn items(&self) -> Result<Vec<Field<'a>>, CalibrationError> {
        match &self.entry.value {
            Value::List(items) => Ok(items.iter().map(|entry| Field { entry, ..*self }).collect()),
            _ => Err(self.should_be("a list")),
        }
    }

    /// A list of finite numbers.
    pub(super) fn numbers(&self) -> Result<Vec<f64>, CalibrationError> {
        self.items()?.iter().map(Field::number).collect()
    }

    /// A list of exactly `N` finite numbers.
    pub(super) fn array<const N: usize>(&self) -> Result<[f64; N], CalibrationError> {
        self.numbers()?.try_into().map_err(|_| self.should_be(&format!("a list of {N} numbers")))
    }

    /// The numbers and the shape of a `rows`, `cols`, `data` matrix, row by row.
    pub(super) fn matrix(&self) -> Result<(Vec<f64>, (u32, u32)), CalibrationError> {
        let (rows, cols) = (self.get(&["rows"])?.count()?, self.get(&["cols"])?.count()?);
        let data = Field { key: self.key, ..self.get(&["data"])? }.numbers()?;
        if data.len() as u64 == u64::from(rows) * u64::from(cols) {
            Ok((data, (rows, cols)))
        } else {
            Err(self.should_be(&format!(
                "a {rows}x{cols} matrix, as its rows and cols say, but has {} elements",
                data.len()
            )))
        }
    }

    /// A 3x3 matrix.
    pub(super) fn matrix3(&self) -> Result<Matrix3<f64>, CalibrationError> {
        match self.matrix()? {
            (data, (3, 3)) => Ok(Matrix3::from_row_iterator(data)),
            (_, (rows, cols)) => Err(self.should_be(&format!("a 3x3 matrix, not {rows}x{cols}"))),
        }
    }

    pub(super) fn should_be(&self, expected: &str) -> CalibrationError {
        CalibrationError::Shape { place: self.place(), key: self.key.into(), expected: expected.into() }
    }

    pub(super) fn singular(&self) -> CalibrationError {
        CalibrationError::Singular { place: self.place(), key: self.key.into() }
    }

    pub(super) fn not_a_rotation(&self) -> CalibrationError {
        CalibrationError::NotRotation { place: self.place(), key: self.key.into() }
    }

    fn not_finite(&self) -> CalibrationError {
        CalibrationError::NotFinite { place: self.place(), key: self.key.into() }
    }
}

fn without_opencv_header(text: &str) -> String {
    let text = text.trim_start_matches('\u{feff}');
    match text.strip_prefix("%YAML:") {
        Some(rest) => format!("#{rest}"),
        None => text.into(),
    }
}

fn is_non_finite(text: &str) -> bool {
    let text = text.to_ascii_lowercase();
    matches!(text.trim_start_matches(['+', '-', '.']), "nan" | "inf" | "infinity")
}

impl<'de> Deserialize<'de> for Entry {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let Spanned { value, defined, .. } = Spanned::<Value>::deserialize(deserializer)?;
        Ok(Self { line: defined.line(), value })
    }
}

impl<'de> Deserialize<'de> for Value {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(ValueVisitor)
    }
}

struct ValueVisitor;

impl<'de> Visitor<'de> for ValueVisitor {
    type Value = Value;

    fn expecting(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str("a number, a word, a list or a mapping")
    }

    fn visit_bool<E>(self, value: bool) -> Result<Value, E> {
        Ok(Value::Text(value.to_string()))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Value, E> {
        Ok(Value::Number(value as f64))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Value, E> {
        Ok(Value::Number(value as f64))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Value, E> {
        Ok(Value::Number(value))
    }

    fn visit_str<E>(self, value: &str) -> Result<Value, E> {
        Ok(Value::Text(value.into()))
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Empty)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Value, A::Error> {
        let mut items = Vec::new();
        while let Some(item) = list.next_element()? {
            items.push(item);
        }
        Ok(Value::List(items))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Value, A::Error> {
        let mut entries = BTreeMap::new();
        while let Some((key, entry)) = map.next_entry::<Spanned<String>, Entry>()? {
            entries.insert(key.value, Entry { line: key.defined.line(), ..entry });
        }
        Ok(Value::Map(entries))
    }
}
