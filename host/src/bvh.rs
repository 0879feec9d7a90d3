//! First hit of a ray and nearest point of a triangle mesh, by a tree of boxes.
//!
//! In: triangles, in mm. Out: for a ray, the first triangle it hits; for a point, its distance to
//! the triangles, exact up to rounding. Cost: O(n log n) to build, about O(log n) a query.
//!
//! No ray slips between two triangles that share an edge, and none hits both of them there: the side
//! on which a ray passes an edge is the sign of one product, which is exactly opposite for the edge
//! taken the other way round, and a ray through the edge is given to one of the two by name. (A ray
//! that meets a vertex to the last bit may still miss.)
//! A tree of our own rather than a collision library's, as both queries together are this one small
//! file, on `nalgebra` types, with the same bits on every machine.

use nalgebra::{Point3, Vector3};

use crate::mesh::Mesh;

/// Largest number of triangles in a leaf.
const LEAF: usize = 4;
/// Bins along a side among which a box is divided.
const BINS: usize = 8;
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
    bounds: Bounds,
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
        let corners = |face: &[u32; 3]| face.map(|v| mesh.vertices[v as usize]);
        let triangles: Vec<_> = mesh.faces.iter().map(corners).collect();
        Self::of_triangles(&triangles)
    }

    /// The tree over loose triangles; for nearest points these may be segments or points, with
    /// corners that coincide.
    #[must_use]
    pub fn of_triangles(triangles: &[[Point3<f64>; 3]]) -> Self {
        let item = |(face, corners): (usize, &[Point3<f64>; 3])| {
            let bounds = Bounds::of(corners);
            Item { bounds, middle: nalgebra::center(&bounds.low, &bounds.high), face: face as u32 }
        };
        let mut items: Vec<Item> = triangles.iter().enumerate().map(item).collect();
        let mut nodes = Vec::with_capacity(items.len());
        if !items.is_empty() {
            build(&mut items, 0, &mut nodes);
        }
        let faces: Vec<u32> = items.iter().map(|item| item.face).collect();
        let triangles = faces.iter().map(|&face| triangles[face as usize]).collect();
        Self { nodes, triangles, faces }
    }

    /// First hit of a ray after its origin, whichever side of the triangle it meets.
    #[must_use]
    pub fn first_hit(&self, origin: &Point3<f64>, direction: &Vector3<f64>) -> Option<Hit> {
        // A component of zero would make 0 * infinity of a box that begins at the origin.
        let inverse = direction.map(|d| 1.0 / if d.abs() < 1e-300 { 1e-300 } else { d });
        let ray = Ray { origin, direction, inverse };
        let mut best = Best { hit: None, parameter: f64::INFINITY };
        if let Some(root) = self.nodes.first()
            && root.bounds.entry(&ray) < best.parameter
        {
            self.cast(0, &ray, &mut best);
        }
        best.hit
    }

    /// Looks for a hit before the best one among the triangles under a node. Calls itself to the depth
    /// of the tree; a stack of its own would have to be cleared for every ray.
    fn cast(&self, index: u32, ray: &Ray, best: &mut Best) {
        let node = &self.nodes[index as usize];
        if node.count == 0 {
            let child = |index: u32| (index, self.nodes[index as usize].bounds.entry(ray));
            for (index, entry) in sorted(child(index + 1), child(node.first)) {
                if entry < best.parameter {
                    self.cast(index, ray, best);
                }
            }
            return;
        }
        for i in node.first as usize..(node.first + node.count) as usize {
            if let Some((parameter, weights)) = ray_triangle(ray, &self.triangles[i])
                && parameter < best.parameter
            {
                *best = Best { hit: Some(Hit { face: self.faces[i], parameter, weights }), parameter };
            }
        }
    }

    /// Distance from a point to the nearest triangle, mm; infinite if there is none.
    #[must_use]
    pub fn distance(&self, point: &Point3<f64>) -> f64 {
        let mut square = f64::INFINITY;
        if !self.nodes.is_empty() {
            self.approach(0, point, &mut square);
        }
        square.sqrt()
    }

    /// Lowers `square`, the least square of a distance so far, to that of the triangles under a node.
    fn approach(&self, index: u32, point: &Point3<f64>, square: &mut f64) {
        let node = &self.nodes[index as usize];
        if node.count == 0 {
            let child = |index: u32| (index, self.nodes[index as usize].bounds.distance_squared(point));
            for (index, least) in sorted(child(index + 1), child(node.first)) {
                if least < *square {
                    self.approach(index, point, square);
                }
            }
            return;
        }
        for triangle in &self.triangles[node.first as usize..(node.first + node.count) as usize] {
            *square = square.min((point - nearest_on_triangle(point, triangle)).norm_squared());
        }
    }
}

/// A ray and the inverses of its direction's components.
struct Ray<'a> {
    origin: &'a Point3<f64>,
    direction: &'a Vector3<f64>,
    inverse: Vector3<f64>,
}

/// The first hit so far.
struct Best {
    hit: Option<Hit>,
    /// Its parameter; infinite without a hit.
    parameter: f64,
}

/// The lower value first.
fn sorted(a: (u32, f64), b: (u32, f64)) -> [(u32, f64); 2] {
    if a.1 <= b.1 { [a, b] } else { [b, a] }
}

/// A box, grown to hold what is added to it.
#[derive(Clone, Copy, Debug)]
struct Bounds {
    low: Point3<f64>,
    high: Point3<f64>,
}

impl Bounds {
    const EMPTY: Self = Self {
        low: Point3::new(f64::INFINITY, f64::INFINITY, f64::INFINITY),
        high: Point3::new(f64::NEG_INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY),
    };

    fn of(points: &[Point3<f64>]) -> Self {
        points.iter().fold(Self::EMPTY, |bounds, p| bounds.with(&Self { low: *p, high: *p }))
    }

    fn with(&self, other: &Self) -> Self {
        Self { low: self.low.inf(&other.low), high: self.high.sup(&other.high) }
    }

    /// Where a ray enters the box, 0 from inside; infinite if it misses.
    fn entry(&self, ray: &Ray) -> f64 {
        let (mut enter, mut leave) = (0.0_f64, f64::INFINITY);
        for axis in 0..3 {
            let a = (self.low[axis] - ray.origin[axis]) * ray.inverse[axis];
            let b = (self.high[axis] - ray.origin[axis]) * ray.inverse[axis];
            let (near, far) = if a < b { (a, b) } else { (b, a) };
            enter = if near > enter { near } else { enter };
            leave = if far < leave { far } else { leave };
        }
        if enter <= leave * SLACK { enter } else { f64::INFINITY }
    }

    /// Square of the distance from a point, 0 from inside.
    fn distance_squared(&self, point: &Point3<f64>) -> f64 {
        let outside = |axis: usize| {
            let below = self.low[axis] - point[axis];
            let above = point[axis] - self.high[axis];
            let out = if below > above { below } else { above };
            if out > 0.0 { out * out } else { 0.0 }
        };
        outside(0) + outside(1) + outside(2)
    }

    /// Half the area of its surface, which is in proportion to the rays that meet it.
    fn half_area(&self) -> f64 {
        let side = (self.high - self.low).sup(&Vector3::zeros());
        side.x * side.y + side.y * side.z + side.z * side.x
    }
}

/// What the tree is built from: a triangle's box, the middle of it, and its number.
struct Item {
    bounds: Bounds,
    middle: Point3<f64>,
    face: u32,
}

/// Builds the subtree over `items`, which start at `offset` in leaf order.
fn build(items: &mut [Item], offset: u32, nodes: &mut Vec<Node>) {
    let bounds = items.iter().fold(Bounds::EMPTY, |all, item| all.with(&item.bounds));
    let here = nodes.len();
    nodes.push(Node { bounds, first: offset, count: items.len() as u32 });
    if items.len() <= LEAF {
        return;
    }
    let half = divide(items);
    let (left, right) = items.split_at_mut(half);
    build(left, offset, nodes);
    nodes[here].first = nodes.len() as u32;
    nodes[here].count = 0;
    build(right, offset + half as u32, nodes);
}

/// Puts the items of the left child first and returns their number: of the planes between bins along
/// the longest side, the one with the least sum of boxes' areas times their items (MacDonald and Booth
/// 1990); the median if they leave a child nearly empty, so that the tree stays shallow.
fn divide(items: &mut [Item]) -> usize {
    let middles = items.iter().fold(Bounds::EMPTY, |all, item| all.with(&Bounds::of(&[item.middle])));
    let axis = (middles.high - middles.low).imax();
    let scale = BINS as f64 / (middles.high - middles.low)[axis];
    let bin = |item: &Item| (((item.middle[axis] - middles.low[axis]) * scale) as usize).min(BINS - 1);
    let mut bins = [(Bounds::EMPTY, 0usize); BINS];
    for item in items.iter() {
        let (bounds, count) = &mut bins[bin(item)];
        *bounds = bounds.with(&item.bounds);
        *count += 1;
    }
    let side = |bins: &[(Bounds, usize)]| {
        let (bounds, count) = bins.iter().fold((Bounds::EMPTY, 0), |(b, n), bin| (b.with(&bin.0), n + bin.1));
        (count, bounds.half_area() * count as f64)
    };
    let cost = |plane: usize| (plane, side(&bins[..plane]).1 + side(&bins[plane..]).1);
    let least = (1..BINS).map(cost).min_by(|a, b| a.1.total_cmp(&b.1));
    let plane = least.map_or(1, |(plane, _)| plane);
    let count = side(&bins[..plane]).0;
    if count.min(items.len() - count) >= items.len() / 8 {
        items.sort_by_key(|item| bin(item) >= plane);
        return count;
    }
    let half = items.len() / 2;
    items.select_nth_unstable_by(half, |a, b| {
        a.middle[axis].total_cmp(&b.middle[axis]).then(a.face.cmp(&b.face))
    });
    half
}

/// Parameter and weights of a ray's hit on a triangle, from the volumes that the ray spans with its
/// edges (Pluecker coordinates).
fn ray_triangle(ray: &Ray, triangle: &[Point3<f64>; 3]) -> Option<(f64, [f64; 3])> {
    let direction = ray.direction;
    let [a, b, c] = triangle.map(|corner| corner - ray.origin);
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
