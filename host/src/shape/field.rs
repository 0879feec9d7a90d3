//! Signed functions of simple solids, in mm, and how they blend.
//!
//! All are negative inside and have slope at most 1, so that a value bounds the distance to the
//! surface from below; blends keep both. Only sums, products, quotients and square roots are used:
//! the same bits on every machine. Formulas after Quilez, "Distance functions" (iquilezles.org).

use nalgebra::{Point3, Vector2, Vector3};

/// The convex hull of two balls, neither within the other.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tapered {
    pub(super) ends: [Point3<f64>; 2],
    pub(super) radii: [f64; 2],
}

impl Tapered {
    /// Distance.
    pub(super) fn at(&self, p: &Point3<f64>) -> f64 {
        let axis = self.ends[1] - self.ends[0];
        let length2 = axis.norm_squared();
        let taper = self.radii[0] - self.radii[1];
        let slant2 = length2 - taper * taper;
        let from = p - self.ends[0];
        let y = from.dot(&axis);
        let z = y - length2;
        let x2 = (from * length2 - axis * y).norm_squared();
        let (y2, z2) = (y * y * length2, z * z * length2);
        let k = taper.signum() * taper * taper * x2;
        if z.signum() * slant2 * z2 > k {
            (x2 + z2).sqrt() / length2 - self.radii[1]
        } else if y.signum() * slant2 * y2 < k {
            (x2 + y2).sqrt() / length2 - self.radii[0]
        } else {
            ((x2 * slant2 / length2).sqrt() + y * taper) / length2 - self.radii[0]
        }
    }
}

/// A bent tube: round cones from each point of a line to the next.
#[derive(Clone, Debug)]
pub(super) struct Tube {
    pieces: Vec<Tapered>,
    low: Point3<f64>,
    high: Point3<f64>,
}

impl Tube {
    /// The tube along a line of `[x, y, z, radius]`.
    pub(super) fn new(line: &[[f64; 4]]) -> Self {
        let infinity = Vector3::repeat(f64::INFINITY).into();
        let mut tube = Self { pieces: Vec::new(), low: infinity, high: -infinity };
        for pair in line.windows(2) {
            let ends = [&pair[0], &pair[1]].map(|q| Point3::new(q[0], q[1], q[2]));
            let radii = [pair[0][3], pair[1][3]];
            for (end, radius) in ends.iter().zip(radii) {
                tube.low = tube.low.inf(&(end - Vector3::repeat(radius)));
                tube.high = tube.high.sup(&(end + Vector3::repeat(radius)));
            }
            tube.pieces.push(Tapered { ends, radii });
        }
        tube
    }

    /// Distance.
    pub(super) fn at(&self, p: &Point3<f64>) -> f64 {
        self.pieces.iter().map(|piece| piece.at(p)).fold(f64::INFINITY, f64::min)
    }

    /// A lower bound of the distance: that to the box around it, and none within the box.
    pub(super) fn at_least(&self, p: &Point3<f64>) -> f64 {
        let outside = (self.low - p).sup(&(p - self.high)).sup(&Vector3::zeros()).norm();
        if outside > 0.0 { outside } else { f64::NEG_INFINITY }
    }
}

/// A solid of revolution.
#[derive(Clone, Debug)]
pub(super) struct Revolution(Vec<Side>);

/// A straight piece of the outline in height and radius.
#[derive(Clone, Copy, Debug)]
struct Side {
    from: Vector2<f64>,
    along: Vector2<f64>,
    inverse_square: f64,
}

impl Revolution {
    /// The solid whose outline in the half plane is a line of `[height, radius]`, upwards from the
    /// axis to the axis.
    pub(super) fn new(line: &[[f64; 2]]) -> Self {
        let side = |pair: &[[f64; 2]]| {
            let (from, along) = (Vector2::from(pair[0]), Vector2::from(pair[1]) - Vector2::from(pair[0]));
            Side { from, along, inverse_square: 1.0 / along.norm_squared() }
        };
        Self(line.windows(2).map(side).collect())
    }

    /// Distance at a height along the axis and a radius from it.
    pub(super) fn at(&self, height: f64, radius: f64) -> f64 {
        let mut nearest = f64::INFINITY;
        let mut inside = false;
        for Side { from, along, inverse_square } in &self.0 {
            let offset = Vector2::new(height, radius) - from;
            let t = (offset.dot(along) * inverse_square).clamp(0.0, 1.0);
            nearest = nearest.min((offset - t * along).norm_squared());
            // A ray away from the axis leaves the solid where it crosses the outline.
            let spans = (offset.x < 0.0) != (offset.x < along.x);
            inside ^= spans && from.y + along.y * (offset.x / along.x) > radius;
        }
        if inside { -nearest.sqrt() } else { nearest.sqrt() }
    }
}

/// An ellipsoid around the origin with half axes `half`; a bound, not the distance.
pub(super) fn ellipsoid(p: &Vector3<f64>, half: &Vector3<f64>) -> f64 {
    (p.component_div(half).norm() - 1.0) * half.min()
}

/// Both solids, the crease between them filled over about `width` mm.
pub(super) fn union(a: f64, b: f64, width: f64) -> f64 {
    let overlap = (width - (a - b).abs()).max(0.0);
    a.min(b) - overlap * overlap / (4.0 * width)
}

/// What two solids share, the edge between them rounded over about `width` mm.
pub(super) fn intersection(a: f64, b: f64, width: f64) -> f64 {
    -union(-a, -b, width)
}

/// A smooth line through all points, `pieces` straight pieces a span (Catmull and Rom 1974). A point
/// given twice makes a corner.
pub(super) fn smooth_line<const N: usize>(points: &[[f64; N]], pieces: usize) -> Vec<[f64; N]> {
    let at = |i: usize| points[i.saturating_sub(1).min(points.len() - 1)];
    let mut line = Vec::with_capacity(points.len() * pieces);
    for span in 1..points.len() {
        let [p, q, r, s] = [at(span - 1), at(span), at(span + 1), at(span + 2)];
        if q == r {
            continue;
        }
        for piece in 0..pieces {
            let t = piece as f64 / pieces as f64;
            line.push(std::array::from_fn(|i| {
                let curve =
                    2.0 * p[i] - 5.0 * q[i] + 4.0 * r[i] - s[i] + t * (3.0 * (q[i] - r[i]) + s[i] - p[i]);
                q[i] + 0.5 * t * (r[i] - p[i] + t * curve)
            }));
        }
    }
    line.extend(points.last());
    line
}
