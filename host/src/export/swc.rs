//! SWC (Cannon et al. 1998, "An on-line archive of reconstructed hippocampal neurons"): a skeleton as a
//! list of points, each with its radius and the point that it hangs on.
//!
//! Lines are `number type x y z radius parent`, mm, numbered from 1, a parent before its children and -1
//! for a root. Points of branches that meet in the same place become one, and
//! so do edges between the same two. The format knows trees alone: an
//! edge that closes a ring is left out, and a comment names its ends.

use std::collections::HashMap;
use std::io::Write;
use std::path::Path;

use super::{ExportError, TITLE, write_whole};
use crate::curves::Curves;

/// "Undefined": none of the parts of a neuron.
const TYPE: u32 = 0;

/// Writes curves with radii.
///
/// # Errors
///
/// If the file cannot be written, or points have no radius.
pub fn write_curves(path: &Path, curves: &Curves) -> Result<(), ExportError> {
    if curves.radii.len() != curves.points.len() {
        let what = "the format needs a radius a point: a skeleton has them, a boundary has not".into();
        return Err(ExportError::Content { path: path.to_path_buf(), what });
    }
    let forest = Forest::of(curves);
    write_whole(path, |file| {
        writeln!(file, "# {TITLE}")?;
        for (number, &(point, parent)) in (1..).zip(&forest.order) {
            let (p, radius) = (curves.points[point].map(|x| x as f32), curves.radii[point] as f32);
            let parent = parent.map_or("-1".to_owned(), |place| (place + 1).to_string());
            writeln!(file, "{number} {TYPE} {} {} {} {radius} {parent}", p.x, p.y, p.z)?;
        }
        forest.rings.iter().try_for_each(|[a, b]| writeln!(file, "# ring: {} {}", a + 1, b + 1))
    })
}

/// Trees that span the curves.
#[derive(Default)]
struct Forest {
    /// A point, and the place here of the one that it hangs on.
    order: Vec<(usize, Option<usize>)>,
    /// Places of the ends of edges that close a ring.
    rings: Vec<[usize; 2]>,
}

impl Forest {
    fn of(curves: &Curves) -> Self {
        let joined = joined(curves);
        let mut neighbours = vec![Vec::new(); curves.points.len()];
        for &[a, b] in &curves.edges {
            let [a, b] = [a, b].map(|end| joined[end as usize]);
            if a != b {
                neighbours[a].push(b);
                neighbours[b].push(a);
            }
        }
        neighbours.iter_mut().for_each(|list: &mut Vec<usize>| {
            list.sort_unstable();
            list.dedup();
        });
        let mut forest = Self::default();
        let mut place = vec![None; curves.points.len()];
        // Ends first, so that a line begins at an end.
        let ends = (0..joined.len()).filter(|&p| neighbours[p].len() == 1);
        for root in ends.chain(0..joined.len()).filter(|&p| joined[p] == p).collect::<Vec<_>>() {
            let mut open = vec![(root, None)];
            while let Some((point, parent)) = open.pop() {
                if let Some(there) = place[point] {
                    // Reached before: the edge closes a ring, and is met once from either end.
                    if let Some(from) = parent.filter(|&from| from > there) {
                        forest.rings.push([there, from]);
                    }
                    continue;
                }
                let here = forest.order.len();
                place[point] = Some(here);
                forest.order.push((point, parent));
                let came_from = parent.map(|p: usize| forest.order[p].0);
                open.extend(
                    neighbours[point].iter().filter(|&&n| Some(n) != came_from).map(|&n| (n, Some(here))),
                );
            }
        }
        forest
    }
}

/// For each point the first one in the same place.
fn joined(curves: &Curves) -> Vec<usize> {
    let mut first = HashMap::new();
    let place = |i: usize| curves.points[i].coords.map(f64::to_bits);
    (0..curves.points.len()).map(|i| *first.entry(place(i)).or_insert(i)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    fn written(curves: &Curves) -> Vec<String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("skeleton.swc");
        write_curves(&path, curves).unwrap();
        std::fs::read_to_string(path).unwrap().lines().skip(1).map(str::to_owned).collect()
    }

    fn curves(xs: &[f64], edges: &[[u32; 2]]) -> Curves {
        let points = xs.iter().map(|&x| Point3::new(x, 0.0, 0.5)).collect();
        Curves { points, radii: vec![2.0; xs.len()], edges: edges.to_vec() }
    }

    #[test]
    fn branches_that_meet_are_one_tree() {
        let three = curves(&[0.0, 1.0, 1.0, 2.0, 1.0, 5.0], &[[0, 1], [2, 3], [4, 5]]);
        assert_eq!(
            written(&three),
            ["1 0 0 0 0.5 2 -1", "2 0 1 0 0.5 2 1", "3 0 5 0 0.5 2 2", "4 0 2 0 0.5 2 2"]
        );
    }

    #[test]
    fn a_ring_is_opened_and_said() {
        let ring = curves(&[0.0, 1.0, 2.0, 3.0], &[[0, 1], [1, 2], [2, 0]]);
        let lines = written(&ring);
        assert_eq!(lines.len(), 5, "{lines:?}");
        assert_eq!(lines[4], "# ring: 1 3");
        assert_eq!(lines.iter().filter(|line| line.ends_with(" -1")).count(), 2);
    }

    #[test]
    fn a_boundary_has_no_radii() {
        let folder = tempfile::tempdir().unwrap();
        let flat = Curves { radii: Vec::new(), ..curves(&[0.0], &[]) };
        let error = write_curves(&folder.path().join("b.swc"), &flat).unwrap_err().to_string();
        assert!(error.contains("needs a radius a point"), "{error}");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
