//! Text for people: names on the left, values on the right.

use std::fmt::Write;

/// Width of the names.
const NAMES: usize = 12;

/// A heading and rows under it.
#[derive(Debug, Default)]
pub(super) struct Table(String);

impl Table {
    /// A table under a heading.
    pub(super) fn new(heading: &str) -> Self {
        Self(format!("{heading}\n"))
    }

    /// Adds a row.
    pub(super) fn row(&mut self, name: &str, value: &str) {
        // Writing to a string does not fail.
        let _ = writeln!(self.0, "  {name:NAMES$}  {value}");
    }

    /// The text, a line each row.
    pub(super) fn text(&self) -> &str {
        &self.0
    }
}
