//! First hit of a ray and nearest point of a triangle mesh, by a tree of boxes.
//!
//! In: triangles, in mm. Out: for a ray, the first triangle it hits; for a point, its distance to
//! the triangles, exact up to rounding. Cost: O(n log n) to build, about O(log n) a query.
//!
//! No ray slips between two triangles that share an edge, and none hits both of them there: the side
//! on which a ray passes an edge is the sign of one product, which is exactly opposite for the edge
//! taken the other way round, and a ray through the edge is given to one of the two by name.
//! A tree of our own rather than a collision library's, as both queries together are this one small
//! file, on `nalgebra` types, with the same bits on every machine.

use nalgebra::{Point3, Vector3};

use crate::mesh::Mesh;

/// Largest number of triangles in a leaf.
const LEAF: usize = 4;
/// Nodes that wait during a walk: one a level, and halving 2^32 triangles takes 32 levels.
const STACK: usize = 64;
/// How much later a ray may leave a box than computed, so that rounding loses no triangle.
const SLACK: f64 = 1.0 + 1e-12;

/// Where a ray first meets the triangles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Index of the triangle, in the order in which they were given.
    pub face: u32,
    /// Distance along the ray in lengths of its direction.
    pub parameter: f64,
    /// Barycentric coordinates of the point on the triangle; they sum to 1.
    pub weights: [f64; 3],
}

/// A box over a part of the triangles. The left child of an inner node is the node after it.
#[derive(Clone, Copy, Debug)]
struct Node {
    low: Point3<f64>,
    high: Point3<f64>,
    /// First triangle of a leaf, or right child of an inner node.
    first: u32,
    /// Number of triangles of a leaf, 0 for an inner node.
    count: u32,
}

/// A tree of boxes over triangles.
#[derive(Clone, Debug)]
pub struct Bvh {
    nodes: Vec<Node>,
    /// Corners of the triangles, leaf by leaf.
    triangles: Vec<[Point3<f64>; 3]>,
    /// The triangles' indices as they were given.
    faces: Vec<u32>,
}

impl Bvh {
    /// The tree over the faces of a mesh.
    #[must_use]
    pub fn new(mesh: &Mesh) -> Self {
        Self::of_triangles(mesh.faces.iter().map(|face| face.map(|v| mesh.vertices[v as usize])).collect())
    }

    /// The tree over loose triangles; for nearest points these may be segments or points, with
    /// corners that coincide.
    #[must_use]
    pub fn of_triangles(triangles: Vec<[Point3<f64>; 3]>) -> Self {
        let centroids: Vec<Vector3<f64>> =
            triangles.iter().map(|t| (t[0].coords + t[1].coords + t[2].coords) / 3.0).collect();
        let mut faces: Vec<u32> = (0..triangles.len() as u32).collect();
        let mut nodes = Vec::with_capacity(triangles.len());
        if !faces.is_empty() {
            split(&triangles, &centroids, &mut faces, 0, &mut nodes);
        }
        let triangles = faces.iter().map(|&face| triangles[face as usize]).collect();
        Self { nodes, triangles, faces }
    }

    /// First hit of a ray after its origin, whichever side of the triangle it meets.
    #[must_use]
    pub fn first_hit(&self, origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<Hit> {
        // A component of zero would make 0 * infinity of a box that begins at the origin.
        let inverse = direction.map(|d| 1.0 / if d.abs() < 1e-300 { 1e-300 } else { d });
        let mut best: Option<Hit> = None;
        let mut limit = f64::INFINITY;
        let mut stack = Stack::new(&self.nodes, |node| node.entry(origin, &inverse));
        while let Some((index, node, entry)) = stack.pop(&self.nodes) {
            if entry > limit {
                continue;
            }
            if node.count == 0 {
                let left = (index + 1, self.nodes[index as usize + 1].entry(origin, &inverse));
                let right = (node.first, self.nodes[node.first as usize].entry(origin, &inverse));
                stack.push(left, right, limit);
                continue;
            }
            for i in node.first as usize..(node.first + node.count) as usize {
                if let Some((parameter, weights)) = ray_triangle(origin, direction, &self.triangles[i])
                    && parameter < limit
                {
                    limit = parameter;
                    best = Some(Hit { face: self.faces[i], parameter, weights });
                }
            }
        }
        best
    }

    /// Distance from a point to the nearest triangle, mm; infinite if there is none.
    #[must_use]
    pub fn distance(&self, point: &Point3<f64>) -> f64 {
        let mut best = f64::INFINITY;
        let mut stack = Stack::new(&self.nodes, |node| node.distance_squared(point));
        while let Some((index, node, near)) = stack.pop(&self.nodes) {
            if near >= best {
                continue;
            }
            if node.count == 0 {
                let left = (index + 1, self.nodes[index as usize + 1].distance_squared(point));
                let right = (node.first, self.nodes[node.first as usize].distance_squared(point));
                stack.push(left, right, best);
                continue;
            }
            for triangle in &self.triangles[node.first as usize..(node.first + node.count) as usize] {
                best = best.min((point - nearest_on_triangle(point, triangle)).norm_squared());
            }
        }
        best.sqrt()
    }
}

/// Builds the subtree over `faces`, which start at `offset` in leaf order: halves them at the median
/// of their centroids along the longest side.
fn split(
    triangles: &[[Point3<f64>; 3]],
    centroids: &[Vector3<f64>],
    faces: &mut [u32],
    offset: u32,
    nodes: &mut Vec<Node>,
) {
    let infinity = Point3::from(Vector3::repeat(f64::INFINITY));
    let (mut low, mut high) = (infinity, -infinity);
    let (mut least, mut most) = (infinity.coords, -infinity.coords);
    for &face in faces.iter() {
        for corner in &triangles[face as usize] {
            (low, high) = (low.inf(corner), high.sup(corner));
        }
        let centroid = &centroids[face as usize];
        (least, most) = (least.inf(centroid), most.sup(centroid));
    }
    let here = nodes.len();
    nodes.push(Node { low, high, first: offset, count: faces.len() as u32 });
    if faces.len() <= LEAF {
        return;
    }
    let axis = (most - least).imax();
    let half = faces.len() / 2;
    faces.select_nth_unstable_by(half, |&a, &b| {
        centroids[a as usize][axis].total_cmp(&centroids[b as usize][axis]).then(a.cmp(&b))
    });
    let (left, right) = faces.split_at_mut(half);
    split(triangles, centroids, left, offset, nodes);
    nodes[here].first = nodes.len() as u32;
    nodes[here].count = 0;
    split(triangles, centroids, right, offset + half as u32, nodes);
}

impl Node {
    /// Where a ray enters the box, 0 from inside; infinite if it misses.
    fn entry(&self, origin: &Point3<f64>, inverse: &Vector3<f64>) -> f64 {
        let a = (self.low - origin).component_mul(inverse);
        let b = (self.high - origin).component_mul(inverse);
        let (near, far) = (a.inf(&b), a.sup(&b));
        let enter = near.x.max(near.y).max(near.z).max(0.0);
        let leave = far.x.min(far.y).min(far.z);
        if enter <= leave * SLACK { enter } else { f64::INFINITY }
    }

    fn distance_squared(&self, point: &Point3<f64>) -> f64 {
        let below = (self.low - point).sup(&Vector3::zeros());
        let above = (point - self.high).sup(&Vector3::zeros());
        below.norm_squared() + above.norm_squared()
    }
}

/// Nodes still to visit, each with the least value a triangle under it can have; nearest on top.
struct Stack {
    waiting: [(u32, f64); STACK],
    len: usize,
}

impl Stack {
    fn new(nodes: &[Node], value: impl Fn(&Node) -> f64) -> Self {
        let mut stack = Self { waiting: [(0, 0.0); STACK], len: 0 };
        if let Some(root) = nodes.first() {
            stack.add((0, value(root)), f64::INFINITY);
        }
        stack
    }

    fn add(&mut self, node: (u32, f64), limit: f64) {
        if node.1 < limit {
            self.waiting[self.len] = node;
            self.len += 1;
        }
    }

    fn push(&mut self, a: (u32, f64), b: (u32, f64), limit: f64) {
        let (near, far) = if a.1 <= b.1 { (a, b) } else { (b, a) };
        self.add(far, limit);
        self.add(near, limit);
    }

    fn pop<'a>(&mut self, nodes: &'a [Node]) -> Option<(u32, &'a Node, f64)> {
        self.len = self.len.checked_sub(1)?;
        let (index, value) = self.waiting[self.len];
        Some((index, &nodes[index as usize], value))
    }
}

/// Parameter and weights of a ray's hit on a triangle, from the volumes that the ray spans with its
/// edges (Pluecker coordinates).
fn ray_triangle(
    origin: &Point3<f64>,
    direction: &Vector3<f64>,
    triangle: &[Point3<f64>; 3],
) -> Option<(f64, [f64; 3])> {
    let [a, b, c] = triangle.map(|corner| corner - origin);
    let volumes = [(&b, &c), (&c, &a), (&a, &b)].map(|(p, q)| (direction.dot(&p.cross(q)), before(p, q)));
    let [u, v, w] = volumes.map(|(volume, tie)| volume > 0.0 || (volume == 0.0 && tie));
    if u != v || v != w {
        return None;
    }
    let sum = volumes[0].0 + volumes[1].0 + volumes[2].0;
    let weights = volumes.map(|(volume, _)| volume / sum);
    let point = weights[0] * a + weights[1] * b + weights[2] * c;
    let parameter = point.dot(direction) / direction.norm_squared();
    (parameter > 0.0).then_some((parameter, weights))
}

/// An order of points: the tie of a ray through an edge goes to one direction of the edge.
fn before(p: &Vector3<f64>, q: &Vector3<f64>) -> bool {
    (p.x, p.y, p.z) < (q.x, q.y, q.z)
}

/// Nearest point of a triangle, by the region of its plane over which the point lies (Ericson,
/// Real-Time Collision Detection, 2005, section 5.1.5).
fn nearest_on_triangle(point: &Point3<f64>, &[a, b, c]: &[Point3<f64>; 3]) -> Point3<f64> {
    let (ab, ac) = (b - a, c - a);
    let (d1, d2) = (ab.dot(&(point - a)), ac.dot(&(point - a)));
    if d1 <= 0.0 && d2 <= 0.0 {
        return a;
    }
    let (d3, d4) = (ab.dot(&(point - b)), ac.dot(&(point - b)));
    if d3 >= 0.0 && d4 <= d3 {
        return b;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        return a + ab * (d1 / (d1 - d3));
    }
    let (d5, d6) = (ab.dot(&(point - c)), ac.dot(&(point - c)));
    if d6 >= 0.0 && d5 <= d6 {
        return c;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        return a + ac * (d2 / (d2 - d6));
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        return b + (c - b) * ((d4 - d3) / ((d4 - d3) + (d5 - d6)));
    }
    a + ab * (vb / (va + vb + vc)) + ac * (vc / (va + vb + vc))
}

#[cfg(test)]
mod tests;
