//! Binary glTF 2.0 (Khronos Group, "glTF 2.0 Specification"): what browsers, viewers and phones show.
//!
//! glTF is in metres with y up. A model stands as the left camera sees it: x right, y up, z towards the
//! camera. So (x, y, z) mm become (x, -y, -z) / 1000, a half turn about x, and faces stay outward. Curves
//! are lines, or points where there are no edges, with the radius of each point, metres, as the attribute `_RADIUS`. The
//! confidence of a mesh's vertices is the attribute `_CONFIDENCE`.

use std::path::Path;

use nalgebra::{Point3, Vector3};
use serde_json::{Value, json};

use super::{ExportError, write_bytes};
use crate::curves::Curves;
use crate::mesh::Mesh;

/// The format's axes, as a model stands in them.
const AXES: &str = "x right, y up, z towards the left camera";
/// Component types and targets of the specification.
const UNSIGNED_INT: u32 = 5125;
const FLOAT: u32 = 5126;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;
/// Primitive modes of the specification.
const POINTS: u32 = 0;
const LINES: u32 = 1;
const TRIANGLES: u32 = 4;

/// Writes a mesh, with normals, so that it looks as smooth as it is, and with how well each vertex is known, 0 to 1,
/// unless there is nothing.
///
/// # Errors
///
/// If the file cannot be written, or is longer than the 4 GB that the format can say.
pub fn write_mesh(path: &Path, mesh: &Mesh, confidence: &[f64]) -> Result<(), ExportError> {
    let mut buffer = Buffer::default();
    let mut attributes = json!({
        "POSITION": buffer.positions(&mesh.vertices),
        "NORMAL": buffer.vectors(&normals(mesh)),
    });
    if !confidence.is_empty() {
        attributes["_CONFIDENCE"] = buffer.scalars(confidence.iter().map(|value| *value as f32));
    }
    let indices = buffer.indices(mesh.faces.as_flattened());
    let primitive = json!({ "attributes": attributes, "indices": indices, "mode": TRIANGLES, "material": 0 });
    buffer.write(path, "model", &primitive)
}

/// Writes curves.
///
/// # Errors
///
/// As [`write_mesh`].
pub fn write_curves(path: &Path, curves: &Curves) -> Result<(), ExportError> {
    let mut buffer = Buffer::default();
    let mut attributes = json!({ "POSITION": buffer.positions(&curves.points) });
    if !curves.radii.is_empty() {
        attributes["_RADIUS"] = buffer.scalars(curves.radii.iter().map(|r| (r / 1000.0) as f32));
    }
    let mut primitive = json!({ "attributes": attributes, "mode": POINTS, "material": 0 });
    if !curves.edges.is_empty() {
        primitive["indices"] = buffer.indices(curves.edges.as_flattened());
        primitive["mode"] = json!(LINES);
    }
    buffer.write(path, "curves", &primitive)
}

/// A direction or a place in the format's axes, lengths as they are.
fn turned(v: Vector3<f64>) -> [f32; 3] {
    [v.x as f32, -v.y as f32, -v.z as f32]
}

/// Unit normals of the vertices: those of the faces around each, weighed by area.
fn normals(mesh: &Mesh) -> Vec<Vector3<f64>> {
    let mut normals = vec![Vector3::zeros(); mesh.vertices.len()];
    for (face, corners) in mesh.faces.iter().enumerate() {
        let normal = mesh.area_normal(face);
        corners.iter().for_each(|&corner| normals[corner as usize] += normal);
    }
    // A vertex without faces still needs one of unit length.
    normals.iter().map(|n| n.try_normalize(0.0).unwrap_or(-Vector3::z())).collect()
}

/// The binary part, and what stands where in it.
#[derive(Default)]
struct Buffer {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Buffer {
    /// Adds values of `type_`, four bytes a component; returns the accessor's index.
    fn accessor(
        &mut self,
        type_: &str,
        component: u32,
        target: u32,
        components: impl Iterator<Item = [u8; 4]>,
    ) -> Value {
        let start = self.bytes.len();
        self.bytes.extend(components.flatten());
        let length = self.bytes.len() - start;
        let view = json!({ "buffer": 0, "byteOffset": start, "byteLength": length, "target": target });
        let count = length / if type_ == "VEC3" { 12 } else { 4 };
        self.views.push(view);
        self.accessors.push(json!({
            "bufferView": self.views.len() - 1, "componentType": component, "count": count, "type": type_,
        }));
        json!(self.accessors.len() - 1)
    }

    fn scalars(&mut self, values: impl Iterator<Item = f32>) -> Value {
        self.accessor("SCALAR", FLOAT, ARRAY_BUFFER, values.map(f32::to_le_bytes))
    }

    fn vectors(&mut self, vectors: &[Vector3<f64>]) -> Value {
        let components = vectors.iter().flat_map(|&v| turned(v)).map(f32::to_le_bytes);
        self.accessor("VEC3", FLOAT, ARRAY_BUFFER, components)
    }

    /// Positions, mm, with their bounds, which the specification asks for.
    fn positions(&mut self, points: &[Point3<f64>]) -> Value {
        let metres: Vec<_> = points.iter().map(|p| p.coords / 1000.0).collect();
        let index = self.vectors(&metres);
        let bound = |take: fn(f32, f32) -> f32| {
            metres.iter().map(|&p| turned(p)).reduce(|a, b| [0, 1, 2].map(|axis| take(a[axis], b[axis])))
        };
        if let (Some(accessor), Some(low), Some(high)) =
            (self.accessors.last_mut(), bound(f32::min), bound(f32::max))
        {
            accessor["min"] = json!(low);
            accessor["max"] = json!(high);
        }
        index
    }

    fn indices(&mut self, indices: &[u32]) -> Value {
        self.accessor("SCALAR", UNSIGNED_INT, ELEMENT_ARRAY_BUFFER, indices.iter().map(|i| i.to_le_bytes()))
    }

    /// Writes the file: a header, the JSON, the binary part; each padded to four bytes.
    fn write(self, path: &Path, name: &str, primitive: &Value) -> Result<(), ExportError> {
        let root = json!({
            "asset": { "version": "2.0", "generator": "Ossature", "extras": { "unit": "m", "axes": AXES } },
            "scene": 0,
            "scenes": [{ "nodes": [0] }],
            "nodes": [{ "mesh": 0, "name": name }],
            "meshes": [{ "primitives": [primitive], "name": name }],
            // Without a material viewers take bare metal, which is black where there is nothing to reflect.
            "materials": [{ "pbrMetallicRoughness": {
                "baseColorFactor": [0.8, 0.8, 0.8, 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.7,
            } }],
            "buffers": [{ "byteLength": self.bytes.len() }],
            "bufferViews": self.views,
            "accessors": self.accessors,
        });
        let mut json = root.to_string().into_bytes();
        json.resize(json.len().next_multiple_of(4), b' ');
        let total = 12 + 8 + json.len() + 8 + self.bytes.len();
        let too_long = || ExportError::Content {
            path: path.to_path_buf(),
            what: format!("{total} bytes are more than the format can say"),
        };
        let length = |n: usize| u32::try_from(n).map_err(|_| too_long());
        let mut file = Vec::with_capacity(total);
        file.extend(b"glTF");
        file.extend([2, length(total)?].map(u32::to_le_bytes).as_flattened());
        for (kind, chunk) in [(b"JSON", &json), (b"BIN\0", &self.bytes)] {
            file.extend(length(chunk.len())?.to_le_bytes());
            file.extend(kind);
            file.extend(chunk);
        }
        write_bytes(path, &file)
    }
}
