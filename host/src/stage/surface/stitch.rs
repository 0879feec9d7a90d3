//! Patches to one mesh: vertices on the same lattice edge become one.

use std::collections::HashMap;

use super::tetrahedra::Patch;
use crate::mesh::Mesh;

/// Joins patches whose vertices carry the names of their lattice edges. Vertices and faces keep the order
/// of the patches.
pub(super) fn join(patches: Vec<Patch>) -> Mesh {
    let mut mesh = Mesh::default();
    let mut by_name: HashMap<u64, u32> = HashMap::new();
    by_name.reserve(patches.iter().map(|patch| patch.vertices.len()).sum());
    for patch in patches {
        let joined: Vec<u32> = patch
            .names
            .iter()
            .zip(&patch.vertices)
            .map(|(&name, &vertex)| {
                *by_name.entry(name).or_insert_with(|| {
                    mesh.vertices.push(vertex);
                    mesh.vertices.len() as u32 - 1
                })
            })
            .collect();
        mesh.faces.extend(patch.faces.iter().map(|face| face.map(|corner| joined[corner as usize])));
    }
    mesh
}
