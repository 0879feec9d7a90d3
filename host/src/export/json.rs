//! NURBS as JSON (docs/exports.md): what other programs need to draw a skeleton's branches exactly, with the radius as
//! a fourth coordinate. No format of CAD has that coordinate (docs/decisions/0021-exports.md).

use std::path::Path;

use serde::Serialize;

use super::{AXES, ExportError, write_bytes};
use crate::curves::spline::Spline;

/// By which such a file is known.
pub const FORMAT: &str = "ossature-curves";
/// Version of the fields.
const FORMAT_VERSION: u32 = 1;

#[derive(Serialize)]
struct Document<'a> {
    format: &'static str,
    format_version: u32,
    unit: &'static str,
    axes: &'static str,
    /// What the numbers of a control point are.
    coordinates: [&'static str; 4],
    curves: &'a [Spline],
}

/// Writes curves.
///
/// # Errors
///
/// If the file cannot be written.
pub fn write_splines(path: &Path, curves: &[Spline]) -> Result<(), ExportError> {
    let document = Document {
        format: FORMAT,
        format_version: FORMAT_VERSION,
        unit: "mm",
        axes: AXES,
        coordinates: ["x", "y", "z", "radius"],
        curves,
    };
    // Numbers are finite and names strings: nothing here can fail to be JSON.
    let mut text = serde_json::to_vec_pretty(&document).unwrap_or_default();
    text.push(b'\n');
    write_bytes(path, &text)
}
