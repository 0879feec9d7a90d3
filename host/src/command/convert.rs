//! A model or a skeleton in another format.
//!
//! INPUT is a mesh (PLY, OBJ or STL), curves (PLY, such as skeleton.ply), or a folder of results, of which
//! the model is taken, or the skeleton where the output can only be one. The name of OUTPUT says the format:
//!
//!   .ply   meshes and curves, mm
//!   .stl   meshes, mm: for printing
//!   .obj   meshes and curves, mm: for modelling
//!   .glb   meshes and curves, metres, y up, seen as by the left camera: for browsers and phones
//!   .swc   skeletons with radii, mm: for those who study trees and neurons
//!
//! Nothing is scaled or moved, but that .glb is turned and in metres as its readers expect.
//!
//! Examples:
//!   host convert ossature-demo/torus torus.glb
//!   host convert models/cup/model.ply cup.stl
//!   host convert models/cup/skeleton.ply cup.swc

use std::path::{Path, PathBuf};

use serde_json::json;

use super::table::{Table, count};
use super::{Failure, say, say_json};
use crate::export;
use crate::geometry::Geometry;
use crate::mesh::read::read_geometry;

/// Arguments of `convert`.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Mesh, curves, or folder of results
    input: PathBuf,
    /// File to write: .ply, .stl, .obj, .glb or .swc
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
    let geometry = read_geometry(&input)?;
    export::write(&args.output, &geometry)?;
    let (kind, points, elements) = match &geometry {
        Geometry::Mesh(mesh) => ("mesh", mesh.vertices.len(), ("faces", mesh.faces.len())),
        Geometry::Curves(curves) => ("curves", curves.points.len(), ("edges", curves.edges.len())),
    };
    if args.json {
        let (name, number) = elements;
        return say_json(&json!({
            "input": input.display().to_string(), "output": args.output.display().to_string(), "kind": kind, "vertices": points, name: number,
        }));
    }
    let mut table = Table::new(&args.output.display().to_string());
    let (name, number) = elements;
    table.row(kind, &format!("{}, {number} {name}", count(points, "vertex", "vertices")));
    table.row("from", &input.display().to_string());
    say(table.text())
}

/// The file of a folder of results that the output is made of.
fn result(folder: &Path, output: &Path) -> PathBuf {
    let swc = output.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("swc"));
    folder.join(if swc { "skeleton.ply" } else { "model.ply" })
}
