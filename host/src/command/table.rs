//! Text for people: names on the left, values on the right.

use std::fmt::Write;

use nalgebra::Vector3;

use super::color::{BOLD, WARNING};

/// Width of the names.
const NAMES: usize = 12;

/// A heading and rows under it.
#[derive(Debug, Default)]
pub(super) struct Table(String);

impl Table {
    /// A table under a heading.
    pub(super) fn new(heading: &str) -> Self {
        Self(format!("{BOLD}{heading}{BOLD:#}\n"))
    }

    /// Adds a row.
    pub(super) fn row(&mut self, name: &str, value: &str) {
        // Writing to a string does not fail.
        let _ = writeln!(self.0, "  {name:NAMES$}  {value}");
    }

    /// Adds a row with what should be known.
    pub(super) fn warning(&mut self, sentence: &str) {
        let _ = writeln!(self.0, "  {WARNING}{:NAMES$}{WARNING:#}  {sentence}", "warning");
    }

    /// The text, a line each row.
    pub(super) fn text(&self) -> &str {
        &self.0
    }
}

/// A number of things in words.
pub(super) fn count(number: usize, one: &str, many: &str) -> String {
    format!("{number} {}", if number == 1 { one } else { many })
}

/// A share of one as a percentage.
pub(super) fn percent(share: f64) -> String {
    format!("{:.2} %", 100.0 * share)
}

/// The sides of a box, mm.
pub(super) fn sides(size: Vector3<f64>) -> String {
    format!("{:.1} mm wide, {:.1} high, {:.1} deep", size.x, size.y, size.z)
}
