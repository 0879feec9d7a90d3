//! What a triangle mesh must be to bound a solid, checked face by face and without a line of the code
//! that makes meshes.

use std::collections::{BTreeMap, BTreeSet};

/// What a mesh without fault is like.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Report {
    /// Pieces that hang together by their vertices.
    pub bodies: usize,
    /// Vertices - edges + faces: 2 for each sphere, 0 for each torus.
    pub euler_characteristic: i64,
    /// Volume bounded, cubic units of the vertices.
    pub volume: f64,
    /// Smallest angle of any face, degrees.
    pub smallest_angle: f64,
}

/// The first fault found, in the order of the variants.
#[derive(Clone, Debug, PartialEq)]
pub enum Fault {
    /// There is no face.
    Empty,
    /// A coordinate of the vertex is not a finite number.
    NotFinite(usize),
    /// The face names a vertex that is not there.
    NoSuchVertex(usize),
    /// No face uses the vertex.
    UnusedVertex(usize),
    /// The face names a vertex twice or has no area.
    Degenerate(usize),
    /// The same three corners make an earlier face, whichever way round.
    Duplicate(usize),
    /// Two faces run through the edge in the same direction.
    EdgeTwice(u32, u32),
    /// No face runs through the edge the other way: there is a hole.
    Open(u32, u32),
    /// The faces around the vertex form more than one fan.
    TwoFans(u32),
    /// The volume is not positive: the mesh is inside out.
    Inward(f64),
}

/// Checks that the mesh is closed, manifold at edges and vertices, outward as a whole, and free of
/// degenerate and duplicate faces.
///
/// # Errors
///
/// The first fault.
pub fn check(vertices: &[[f64; 3]], faces: &[[u32; 3]]) -> Result<Report, Fault> {
    check_vertices(vertices, faces)?;
    let smallest_angle = check_faces(vertices, faces)?;
    let after = check_edges(faces)?;
    check_fans(&after)?;
    let volume = faces.iter().map(|&face| volume_from(vertices[0], corners(vertices, face))).sum();
    if volume <= 0.0 {
        return Err(Fault::Inward(volume));
    }
    let edges: usize = after.values().map(BTreeMap::len).sum::<usize>() / 2;
    Ok(Report {
        bodies: count_bodies(&after),
        euler_characteristic: vertices.len() as i64 - edges as i64 + faces.len() as i64,
        volume,
        smallest_angle,
    })
}

/// For each vertex, the ring around it: from each neighbour to the next one.
type Rings = BTreeMap<u32, BTreeMap<u32, u32>>;

fn check_vertices(vertices: &[[f64; 3]], faces: &[[u32; 3]]) -> Result<(), Fault> {
    if faces.is_empty() {
        return Err(Fault::Empty);
    }
    if let Some(bad) = vertices.iter().position(|v| v.iter().any(|x| !x.is_finite())) {
        return Err(Fault::NotFinite(bad));
    }
    if let Some(bad) = faces.iter().position(|face| face.iter().any(|&v| v as usize >= vertices.len())) {
        return Err(Fault::NoSuchVertex(bad));
    }
    let used: BTreeSet<usize> = faces.iter().flatten().map(|&v| v as usize).collect();
    (0..vertices.len()).find(|v| !used.contains(v)).map_or(Ok(()), |unused| Err(Fault::UnusedVertex(unused)))
}

fn check_faces(vertices: &[[f64; 3]], faces: &[[u32; 3]]) -> Result<f64, Fault> {
    let mut seen = BTreeSet::new();
    let mut smallest = 180.0_f64;
    for (index, &face) in faces.iter().enumerate() {
        let angle = smallest_angle(corners(vertices, face));
        // Not a number where two corners fall together.
        if angle.is_nan() || angle <= 0.0 {
            return Err(Fault::Degenerate(index));
        }
        smallest = smallest.min(angle);
        let mut sorted = face;
        sorted.sort_unstable();
        if !seen.insert(sorted) {
            return Err(Fault::Duplicate(index));
        }
    }
    Ok(smallest)
}

fn check_edges(faces: &[[u32; 3]]) -> Result<Rings, Fault> {
    let mut rings = Rings::new();
    for &[a, b, c] in faces {
        for [hub, from, to] in [[a, b, c], [b, c, a], [c, a, b]] {
            if rings.entry(hub).or_default().insert(from, to).is_some() {
                return Err(Fault::EdgeTwice(hub, from));
            }
        }
    }
    for (&hub, ring) in &rings {
        for &from in ring.keys() {
            if !rings[&from].contains_key(&hub) {
                return Err(Fault::Open(hub, from));
            }
        }
    }
    Ok(rings)
}

fn check_fans(rings: &Rings) -> Result<(), Fault> {
    for (&hub, ring) in rings {
        let Some((&first, _)) = ring.first_key_value() else { continue };
        let mut at = ring[&first];
        let mut met = 1;
        while at != first && met <= ring.len() {
            // Closed edges mean that every neighbour is followed by one.
            at = ring[&at];
            met += 1;
        }
        if met != ring.len() {
            return Err(Fault::TwoFans(hub));
        }
    }
    Ok(())
}

fn count_bodies(rings: &Rings) -> usize {
    let mut unseen: BTreeSet<u32> = rings.keys().copied().collect();
    let mut bodies = 0;
    while let Some(first) = unseen.pop_first() {
        bodies += 1;
        let mut open = vec![first];
        while let Some(vertex) = open.pop() {
            open.extend(rings[&vertex].keys().filter(|neighbour| unseen.remove(neighbour)));
        }
    }
    bodies
}

fn corners(vertices: &[[f64; 3]], face: [u32; 3]) -> [[f64; 3]; 3] {
    face.map(|v| vertices[v as usize])
}

fn minus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn volume_from(apex: [f64; 3], face: [[f64; 3]; 3]) -> f64 {
    let [a, b, c] = face.map(|v| minus(v, apex));
    dot(a, cross(b, c)) / 6.0
}

/// In degrees; 0 or not a number for a face without area.
fn smallest_angle([a, b, c]: [[f64; 3]; 3]) -> f64 {
    let at = |p, q, r| {
        let (u, v) = (minus(q, p), minus(r, p));
        let sine = dot(cross(u, v), cross(u, v)).sqrt();
        if sine == 0.0 { 0.0 } else { f64::atan2(sine, dot(u, v)).to_degrees() }
    };
    at(a, b, c).min(at(b, c, a)).min(at(c, a, b))
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [[f64; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    const FACES: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]];

    #[test]
    fn passes_a_tetrahedron() {
        let report = check(&CORNERS, &FACES).unwrap();
        assert_eq!((report.bodies, report.euler_characteristic), (1, 2));
        assert!((report.volume - 1.0 / 6.0).abs() < 1e-15);
        assert!((report.smallest_angle - 45.0).abs() < 1e-9);
    }

    #[test]
    fn finds_each_fault() {
        let with = |change: fn(&mut Vec<[f64; 3]>, &mut Vec<[u32; 3]>)| {
            let (mut vertices, mut faces) = (CORNERS.to_vec(), FACES.to_vec());
            change(&mut vertices, &mut faces);
            check(&vertices, &faces).unwrap_err()
        };
        assert_eq!(with(|_, faces| faces.clear()), Fault::Empty);
        assert_eq!(with(|vertices, _| vertices[2][1] = f64::NAN), Fault::NotFinite(2));
        assert_eq!(with(|_, faces| faces[3][0] = 4), Fault::NoSuchVertex(3));
        assert_eq!(with(|vertices, _| vertices.push([9.0; 3])), Fault::UnusedVertex(4));
        assert_eq!(with(|vertices, _| vertices[3] = [2.0, 0.0, 0.0]), Fault::Degenerate(1));
        assert_eq!(with(|_, faces| faces.push([3, 3, 2])), Fault::Degenerate(4));
        assert_eq!(with(|_, faces| faces.push([2, 3, 0])), Fault::Duplicate(4));
        assert_eq!(with(|_, faces| faces[3] = [1, 0, 3]), Fault::Duplicate(3));
        assert!(matches!(with(|_, faces| faces[3] = [1, 3, 2]), Fault::EdgeTwice(..)));
        assert!(matches!(with(|_, faces| faces.truncate(3)), Fault::Open(..)));
        assert_eq!(
            with(|_, faces| faces.iter_mut().for_each(|face| face.swap(0, 1))),
            Fault::Inward(-1.0 / 6.0)
        );
    }

    #[test]
    fn finds_two_tetrahedra_that_share_a_vertex() {
        let mut vertices = CORNERS.to_vec();
        vertices.extend([[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0]]);
        let mut faces = FACES.to_vec();
        // Three axes mirrored turn it inside out, so its faces are named the other way round.
        faces.extend(FACES.map(|[a, b, c]| [a, c, b].map(|v| if v == 0 { 0 } else { v + 3 })));
        assert_eq!(check(&vertices, &faces), Err(Fault::TwoFans(0)));
    }

    #[test]
    fn counts_bodies() {
        let vertices: Vec<_> = CORNERS.into_iter().chain(CORNERS.map(|[x, y, z]| [x + 5.0, y, z])).collect();
        let faces: Vec<_> = FACES.into_iter().chain(FACES.map(|face| face.map(|v| v + 4))).collect();
        let report = check(&vertices, &faces).unwrap();
        assert_eq!((report.bodies, report.euler_characteristic), (2, 4));
    }
}
