//! A model or a skeleton in another format.
//!
//! INPUT is a mesh (PLY, OBJ or STL), curves (PLY, such as skeleton.ply), or a folder of results, of which
//! the model is taken, or the skeleton or its curves where the output can only be these. The name of OUTPUT says the
//! format:
//!
//!   .ply   meshes and curves, mm
//!   .stl   meshes, mm: for printing
//!   .obj   meshes and curves, mm: for modelling
//!   .glb   meshes and curves, metres, y up, seen as by the left camera: for browsers and phones
//!   .swc   skeletons with radii, mm: for those who study trees and neurons
//!   .json  the skeleton's branches as NURBS with radii, mm: for those who calculate with them
//!
//! Nothing is scaled or moved, but that .glb is turned and in metres as its readers expect. The confidence of each vertex
//! that --front leaves goes into .ply and .glb; that other formats leave it out is said.
//!
//! Examples:
//!   host convert ossature-demo/torus torus.glb
//!   host convert models/cup/model.ply cup.stl
//!   host convert models/cup/skeleton.ply cup.swc
//!   host convert models/cup curves.json

use std::fs;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde_json::json;

use super::table::{Table, count};
use super::{Failure, say, say_json};
use crate::curves::spline::Spline;
use crate::export;
use crate::geometry::Geometry;
use crate::mesh::read::read_geometry;
use crate::unfinished::{folder_of, sweep};

/// Arguments of `convert`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Mesh, curves, or folder of results
    input: PathBuf,
    /// File to write: .ply, .stl, .obj, .glb, .swc or .json
    output: PathBuf,
    /// Print one JSON document instead of text
    #[arg(long)]
    pub(super) json: bool,
}

/// Reads one file and writes another.
///
/// # Errors
///
/// If the input cannot be read, or the output cannot hold it or be written.
pub fn run(args: &Args) -> Result<(), Failure> {
    let input = if args.input.is_dir() { result(&args.input, &args.output) } else { args.input.clone() };
    sweep(folder_of(&args.output));
    let mut left_out = None;
    let (kind, (points, number), (elements, many)) = if export::has_extension(&input, "json") {
        let curves = splines(&input)?;
        export::write_splines(&args.output, &curves)?;
        let controls = curves.iter().map(|curve| curve.controls.len()).sum();
        ("nurbs", ("control_points", controls), ("curves", curves.len()))
    } else {
        let geometry = read_geometry(&input)?;
        left_out = export::write(&args.output, &geometry)?;
        match &geometry {
            Geometry::Mesh { mesh, .. } => {
                ("mesh", ("vertices", mesh.vertices.len()), ("faces", mesh.faces.len()))
            }
            Geometry::Curves(curves) => {
                ("curves", ("vertices", curves.points.len()), ("edges", curves.edges.len()))
            }
        }
    };
    if args.json {
        let mut told = json!({
            "input": input.display().to_string(),
            "output": args.output.display().to_string(),
            "kind": kind,
            points: number,
            elements: many,
        });
        if let Some(what) = left_out {
            told["left_out"] = json!(what);
        }
        return say_json(&told);
    }
    let mut table = Table::new(&args.output.display().to_string());
    table.row(kind, &format!("{}, {}", counted(number, points), counted(many, elements)));
    if let Some(what) = left_out {
        table.row("left out", &format!("the {what} of each vertex, which .ply and .glb hold"));
    }
    table.row("from", &input.display().to_string());
    say(table.text())
}

/// So many of what JSON calls by this name.
fn counted(number: usize, name: &str) -> String {
    let one = if name == "vertices" { "vertex" } else { name.trim_end_matches('s') };
    count(number, one, name).replace('_', " ")
}

/// The file of a folder of results that the output is made of.
fn result(folder: &Path, output: &Path) -> PathBuf {
    let made_of = [("swc", "skeleton.ply"), ("json", "report.json")];
    let found = made_of.iter().find(|(extension, _)| export::has_extension(output, extension));
    folder.join(found.map_or("model.ply", |(_, file)| file))
}

/// The curves that a report tells of.
fn splines(report: &Path) -> Result<Vec<Spline>, Failure> {
    #[derive(Deserialize)]
    struct Report {
        format: Option<String>,
        curves_mm: Option<Vec<Spline>>,
    }
    let name = report.display();
    let text = fs::read(report).map_err(|error| format!("cannot read {name}: {error}"))?;
    let report: Report =
        serde_json::from_slice(&text).map_err(|error| format!("{name} is no report.json: {error}"))?;
    if report.format.as_deref() == Some(export::json::FORMAT) {
        return Err(format!("{name} has the curves already: copy it").into());
    }
    if let Some(number) = report.curves_mm.iter().flatten().position(|curve| !curve.is_sound()) {
        return Err(format!("curve {number} of {name} is not one: make the model again").into());
    }
    report.curves_mm.ok_or_else(|| {
        format!(
            "{name} tells of no curves in space: it was written in paper mode, which describes each view by itself, or \
             by an earlier version; make the model again"
        )
        .into()
    })
}
