//! Meshes from files: PLY, OBJ and STL, told apart by their extension; and curves from PLY.
//!
//! Polygons become fans of triangles around their first corner. No bytes cause a panic, and no header
//! makes the reader allocate more than the file's own size warrants.

mod obj;
mod ply;
mod stl;

use std::{
    io::{self, Read},
    path::{Path, PathBuf},
};

use thiserror::Error;

use super::Mesh;
use crate::geometry::Geometry;

/// The largest file that is read, bytes: about ten times a binary mesh of a million faces.
const MAX_BYTES: u64 = 1 << 28;

/// Why there is no mesh.
#[derive(Debug, Error)]
pub enum ReadError {
    /// The system refused.
    #[error("cannot read {}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The extension is none of those known.
    #[error("{} is not a mesh by its name; it must end in .ply, .obj or .stl", path.display())]
    Extension {
        /// The file.
        path: PathBuf,
    },
    /// The file is larger than is read.
    #[error("{} has more than {} MB; simplify the mesh first", path.display(), MAX_BYTES >> 20)]
    TooLarge {
        /// The file.
        path: PathBuf,
    },
    /// The bytes are not what the extension says, or end too early.
    #[error("{} is no sound mesh: {what}; mend it or export it again", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong, and where.
        what: String,
    },
}

/// Reads the mesh in the file `path`, with coordinates as they stand there.
///
/// # Errors
///
/// See [`ReadError`]; a mesh without vertices or faces is refused too.
pub fn read(path: &Path) -> Result<Mesh, ReadError> {
    match read_geometry(path)? {
        Geometry::Mesh { mesh, .. } => Ok(mesh),
        Geometry::Curves(_) => {
            Err(ReadError::Content { path: path.to_path_buf(), what: "it has no faces".into() })
        }
    }
}

/// Reads the mesh in the file `path`, or the curves of a PLY file without faces.
///
/// # Errors
///
/// As [`read`].
pub fn read_geometry(path: &Path) -> Result<Geometry, ReadError> {
    format(path)?;
    let bytes = bytes_of(path).map_err(|source| ReadError::Io { path: path.to_path_buf(), source })?;
    if bytes.len() as u64 > MAX_BYTES {
        return Err(ReadError::TooLarge { path: path.to_path_buf() });
    }
    parse(path, &bytes)
}

/// Reads the mesh in the bytes of a file of this name, or the curves of a PLY file without faces.
///
/// # Errors
///
/// As [`read`].
pub fn parse(path: &Path, bytes: &[u8]) -> Result<Geometry, ReadError> {
    let content = |what| ReadError::Content { path: path.to_path_buf(), what };
    format(path)?(bytes).and_then(sound).map_err(content)
}

/// What makes a mesh or curves of bytes, or says what is wrong with them.
type Parse = fn(&[u8]) -> Result<Geometry, String>;

/// What reads bytes of the format that a name says.
fn format(path: &Path) -> Result<Parse, ReadError> {
    let extension = path.extension().and_then(|extension| extension.to_str()).map(str::to_ascii_lowercase);
    match extension.as_deref() {
        Some("ply") => Ok(ply::parse),
        Some("obj") => Ok(|bytes| obj::parse(bytes).map(Geometry::from)),
        Some("stl") => Ok(|bytes| stl::parse(bytes).map(Geometry::from)),
        _ => Err(ReadError::Extension { path: path.to_path_buf() }),
    }
}

/// The file's bytes, or one more than are allowed.
fn bytes_of(path: &Path) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    std::fs::File::open(path)?.take(MAX_BYTES + 1).read_to_end(&mut bytes)?;
    Ok(bytes)
}

fn sound(mut geometry: Geometry) -> Result<Geometry, String> {
    if let Geometry::Mesh { mesh, confidence } = &mut geometry
        && (confidence.len() != mesh.vertices.len() || !confidence.iter().all(|c| (0.0..=1.0).contains(c)))
    {
        // What others call so may be anything: it is not known then.
        confidence.clear();
    }
    let (points, elements, element) = match &geometry {
        Geometry::Mesh { mesh, .. } if mesh.faces.is_empty() => return Err("it has no faces".into()),
        Geometry::Mesh { mesh, .. } => (&mesh.vertices, mesh.faces.as_flattened(), "triangle"),
        Geometry::Curves(curves) => (&curves.points, curves.edges.as_flattened(), "edge"),
    };
    if let Some(vertex) = points.iter().position(|p| p.iter().any(|x| !(*x as f32).is_finite())) {
        return Err(format!("a coordinate of vertex {vertex} is not a finite number"));
    }
    if let Geometry::Curves(curves) = &geometry {
        if points.is_empty() {
            return Err("it has no points".into());
        }
        let whole = curves.radii.is_empty() || curves.radii.len() == points.len();
        if !whole || curves.radii.iter().any(|radius| !(radius.is_finite() && *radius >= 0.0)) {
            return Err("a radius is missing, negative or not a finite number".into());
        }
    }
    match elements.iter().find(|&&corner| corner as usize >= points.len()) {
        Some(corner) => Err(format!("a {element} names vertex {corner}, which is not there")),
        None => Ok(geometry),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_sentences_with_the_path() {
        let folder = tempfile::tempdir().unwrap();
        let told = |name: &str, bytes: &[u8]| {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            read(&path).unwrap_err().to_string().replace(&folder.path().display().to_string(), "F")
        };
        assert_eq!(
            told("a.glb", b""),
            "F/a.glb is not a mesh by its name; it must end in .ply, .obj or .stl"
        );
        assert_eq!(
            told("a.OBJ", b"v 1 2 3\n"),
            "F/a.OBJ is no sound mesh: it has no faces; mend it or export it again"
        );
        assert!(told("a.ply", b"").starts_with("F/a.ply is no sound mesh: "));
        assert!(told("a.stl", b"").starts_with("F/a.stl is no sound mesh: "));
        assert!(read(&folder.path().join("none.ply")).unwrap_err().to_string().starts_with("cannot read "));
    }

    #[test]
    fn what_is_no_confidence_of_ours_is_left_out() {
        let known = |values: [&str; 3]| {
            let [a, b, c] = values;
            let text = format!(
                "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                 property float confidence\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
                 0 0 0 {a}\n1 0 0 {b}\n0 1 0 {c}\n3 0 1 2\n"
            );
            match parse(Path::new("a.ply"), text.as_bytes()).unwrap() {
                Geometry::Mesh { confidence, .. } => confidence,
                Geometry::Curves(_) => panic!("it has a face"),
            }
        };
        assert_eq!(known(["0", "0.5", "1"]), [0.0, 0.5, 1.0]);
        for other in ["nan", "-0.1", "255"] {
            assert!(known(["0", other, "1"]).is_empty(), "{other}");
        }
    }

    #[test]
    fn coordinates_must_be_finite() {
        for x in ["nan", "inf", "1e999"] {
            let text = format!("v {x} 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
            assert!(obj::parse(text.as_bytes()).map(Geometry::from).and_then(sound).is_err(), "{x}");
        }
    }
}
