//! What leaves the program as files.
//!
//! * [`ply`]: meshes (`model.ply`), point clouds and curves (`boundary.ply`, `skeleton.ply`) as binary
//!   little-endian PLY, which every mesh viewer reads.
//! * [`stl`]: meshes for printing; [`obj`]: meshes and curves for modelling; [`glb`]: both for showing.
//! * [`swc`]: skeletons for those who study trees and neurons; [`json`]: their branches as NURBS.
//!
//! Lengths are millimetres in the left camera's axes, but in [`glb`], which says metres. A file is written beside its
//! final name and renamed when it is complete, so that nothing half-written ever stands under that name.

pub mod glb;
pub mod json;
pub mod obj;
pub mod ply;
pub mod stl;
pub mod swc;

use std::{
    io::{self, BufWriter, Write},
    path::{Path, PathBuf},
};

use thiserror::Error;

use crate::curves::spline::Spline;
use crate::geometry::Geometry;
use crate::unfinished::{self, Durable};

/// The axes of everything but [`glb`].
const AXES: &str = "left camera: x right, y down, z forward";

/// What a file in millimetres says of itself, in whatever place its format has for it.
const TITLE: &str = "Ossature; unit mm; axes of the left camera: x right, y down, z forward";

/// Why a file was not written.
#[derive(Debug, Error)]
pub enum ExportError {
    /// The system refused.
    #[error("cannot write {}", path.display())]
    Io {
        /// The final name.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// What is to be written contradicts itself or the format.
    #[error("cannot write {}: {what}", path.display())]
    Content {
        /// The final name.
        path: PathBuf,
        /// The contradiction.
        what: String,
    },
}

impl ExportError {
    /// The same of a file that was to become `path`.
    pub(crate) fn of(self, path: &Path) -> Self {
        let path = path.to_path_buf();
        match self {
            Self::Io { source, .. } => Self::Io { path, source },
            Self::Content { what, .. } => Self::Content { path, what },
        }
    }
}

/// Writes a geometry in the format that the file's extension names: `ply`, `stl`, `obj`, `glb` or `swc`, and waits
/// until it is on the disk. Returns what the format has no place for: the `confidence` of vertices, if they have one.
///
/// # Errors
///
/// If the extension is none of these, the format cannot hold this geometry, or the file cannot be written.
pub fn write(path: &Path, geometry: &Geometry) -> Result<Option<&'static str>, ExportError> {
    durably(path, |hidden| format(hidden, geometry))
}

fn format(path: &Path, geometry: &Geometry) -> Result<Option<&'static str>, ExportError> {
    let extension = path.extension().and_then(|extension| extension.to_str()).map(str::to_ascii_lowercase);
    let refuse = |what: &str| Err(ExportError::Content { path: path.to_path_buf(), what: what.to_owned() });
    let left_out = |confidence: &[f64]| (!confidence.is_empty()).then_some("confidence");
    let written = match (extension.as_deref(), geometry) {
        (Some("ply"), Geometry::Mesh { mesh, confidence }) => {
            let known = [("confidence", &confidence[..])];
            ply::write_known_mesh(path, mesh, if confidence.is_empty() { &[] } else { &known }, &[TITLE])
        }
        (Some("ply"), Geometry::Curves(curves)) => ply::write_curves(path, curves, &[TITLE]),
        (Some("stl"), Geometry::Mesh { mesh, confidence }) => {
            return stl::write_mesh(path, mesh).map(|()| left_out(confidence));
        }
        (Some("obj"), Geometry::Mesh { mesh, confidence }) => {
            return obj::write_mesh(path, mesh).map(|()| left_out(confidence));
        }
        (Some("obj"), Geometry::Curves(curves)) => obj::write_curves(path, curves),
        (Some("glb"), Geometry::Mesh { mesh, confidence }) => glb::write_mesh(path, mesh, confidence),
        (Some("glb"), Geometry::Curves(curves)) => glb::write_curves(path, curves),
        (Some("swc"), Geometry::Curves(curves)) => swc::write_curves(path, curves),
        (Some("stl"), _) => refuse("STL holds triangles alone; curves go into .ply, .obj, .glb or .swc"),
        (Some("swc"), _) => refuse("SWC holds skeletons alone; meshes go into .ply, .stl, .obj or .glb"),
        (Some("json"), _) => {
            refuse("JSON holds NURBS alone, which a folder of results has, or its report.json")
        }
        _ => refuse("its name must end in .ply, .stl, .obj, .glb, .swc or .json"),
    };
    written.map(|()| None)
}

/// Writes NURBS, which JSON alone holds with their radii, and waits until they are on the disk.
///
/// # Errors
///
/// If the extension is not `json`, or the file cannot be written.
pub fn write_splines(path: &Path, curves: &[Spline]) -> Result<(), ExportError> {
    if !has_extension(path, "json") {
        let what = "NURBS go into .json alone".to_owned();
        return Err(ExportError::Content { path: path.to_path_buf(), what });
    }
    durably(path, |hidden| json::write_splines(hidden, curves))
}

fn durably<T>(path: &Path, write: impl FnOnce(&Path) -> Result<T, ExportError>) -> Result<T, ExportError> {
    let failed = |source| ExportError::Io { path: path.to_path_buf(), source };
    let file = Durable::new(path).map_err(failed)?;
    let written = write(&file.hidden()).map_err(|error| error.of(path))?;
    file.finish().map_err(failed)?;
    Ok(written)
}

/// Whether a file's name ends so, in whatever case.
pub(crate) fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|other| other.eq_ignore_ascii_case(extension))
}

/// Creates or replaces the file `path` by `bytes`, all or nothing.
fn write_bytes(path: &Path, bytes: &[u8]) -> Result<(), ExportError> {
    write_whole(path, |file| file.write_all(bytes))
}

/// Creates or replaces the file `path` by what `write` writes, all or nothing.
pub(crate) fn write_whole(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&mut tempfile::NamedTempFile>) -> io::Result<()>,
) -> Result<(), ExportError> {
    let failed = |source| ExportError::Io { path: path.to_path_buf(), source };
    let mut file = unfinished::beside(path).map_err(failed)?;
    let mut buffered = BufWriter::new(&mut file);
    write(&mut buffered).and_then(|()| buffered.flush()).map_err(failed)?;
    drop(buffered);
    file.persist(path).map_err(|error| failed(error.error))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh.ply");
        std::fs::write(&path, "old").unwrap();
        let error = write_whole(&path, |file| {
            file.write_all(b"new")?;
            Err(io::Error::other("full"))
        });
        assert!(error.unwrap_err().to_string().contains("mesh.ply"));
        assert_eq!(std::fs::read(&path).unwrap(), b"old");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        write_whole(&path, |file| file.write_all(b"new")).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"new");
    }

    #[test]
    fn a_missing_folder_is_a_sentence_with_the_path() {
        let error = write_whole(Path::new("/no/such/folder/mesh.ply"), |_| Ok(())).unwrap_err();
        assert_eq!(error.to_string(), "cannot write /no/such/folder/mesh.ply");
    }
}
