//! A silhouette as a signed distance in its image.
//!
//! In: the closed loops of an outline, px. Out: the distance of any point of the image to it, negative
//! inside, linear between pixels. Inside is where a row has crossed the loops an odd number of times.
//! Cost: O(pixels of the box, times the logarithm of the points).

use nalgebra::{Point2, Point3, Vector2};
use rayon::prelude::*;

use crate::bvh::Bvh;
use crate::report::record::Parts;
use crate::stage::balls::px2;

/// Background sampled around the object's box, px.
const MARGIN: f64 = 4.0;

/// A silhouette.
#[derive(Clone, Debug)]
pub struct Outline {
    low: Point2<f64>,
    high: Point2<f64>,
    columns: usize,
    /// Signed distances at whole pixels from the corner on, row by row.
    values: Vec<f64>,
}

impl Outline {
    /// The silhouette within the loops; nothing if they enclose no pixel's centre.
    #[must_use]
    pub fn new(loops: &[Vec<Point2<f64>>]) -> Option<Self> {
        let first = *loops.iter().flatten().next()?;
        let (low, high) =
            loops.iter().flatten().fold((first, first), |(low, high), p| (low.inf(p), high.sup(p)));
        let corner = low.map(|x| (x - MARGIN).floor());
        let [columns, rows] = [0, 1].map(|k| (high[k] - corner[k] + MARGIN).ceil() as usize + 1);
        let sides: Vec<[Point2<f64>; 2]> = loops.iter().flat_map(|l| sides(l)).collect();
        let flat = |p: Point2<f64>| Point3::new(p.x, p.y, 0.0);
        let tree = Bvh::of_triangles(&sides.iter().map(|&[a, b]| [a, b, b].map(flat)).collect::<Vec<_>>());
        let row = |row: usize| -> Vec<f64> {
            let v = corner.y + row as f64;
            let crossings: Vec<f64> = sides.iter().filter_map(|side| crossing(side, v)).collect();
            let value = |column: usize| {
                let u = corner.x + column as f64;
                let distance = tree.distance(&Point3::new(u, v, 0.0));
                let inside = crossings.iter().filter(|&&x| x < u).count() % 2 == 1;
                if inside { -distance } else { distance }
            };
            (0..columns).map(value).collect()
        };
        let values: Vec<f64> = (0..rows).into_par_iter().flat_map_iter(row).collect();
        let high = corner + Vector2::new((columns - 1) as f64, (rows - 1) as f64);
        values.iter().any(|v| *v < 0.0).then_some(Self { low: corner, high, columns, values })
    }

    /// The silhouette that the core found in an eye's picture.
    #[must_use]
    pub fn of(parts: &Parts) -> Option<Self> {
        let points = |start: usize, len: usize| {
            let own = parts.contour[start..start + len].iter();
            own.map(|point| Point2::from(px2(point.at))).collect()
        };
        Self::new(&parts.loops.iter().map(|l| points(l.start, l.len)).collect::<Vec<_>>())
    }

    /// Signed distance at a point of the image, px; far outside the box, that to the box.
    #[must_use]
    pub fn at(&self, p: &Point2<f64>) -> f64 {
        let inside = p.sup(&self.low).inf(&self.high);
        let place = inside - self.low;
        let (x, y) = (place.x as usize, place.y as usize);
        let (x1, y1) = ((x + 1).min(self.columns - 1), (y + 1).min(self.values.len() / self.columns - 1));
        let (s, t) = (place.x.fract(), place.y.fract());
        let value = |x: usize, y: usize| self.values[y * self.columns + x];
        let across = |y: usize| value(x, y) * (1.0 - s) + value(x1, y) * s;
        across(y) * (1.0 - t) + across(y1) * t + (p - inside).norm()
    }

    /// Lower and upper corner of the box around it, with some background, px.
    #[must_use]
    pub fn bounds(&self) -> [Point2<f64>; 2] {
        [self.low, self.high]
    }

    /// Pixels whose centres are inside.
    pub fn pixels(&self) -> impl Iterator<Item = Point2<f64>> {
        let inside = self.values.iter().enumerate().filter(|(_, value)| **value < 0.0);
        inside.map(|(i, _)| {
            let (x, y) = (i % self.columns, i / self.columns);
            self.low + Vector2::new(x as f64, y as f64)
        })
    }

    /// Middle of the pixels inside.
    #[must_use]
    pub fn centroid(&self) -> Point2<f64> {
        let (sum, count) =
            self.pixels().fold((Point2::origin(), 0.0), |(sum, n), p| (sum + p.coords, n + 1.0));
        sum / f64::max(count, 1.0)
    }
}

/// The sides of a closed loop.
fn sides(points: &[Point2<f64>]) -> impl Iterator<Item = [Point2<f64>; 2]> {
    points.iter().zip(points.iter().cycle().skip(1)).map(|(a, b)| [*a, *b])
}

/// Where a side crosses a row.
fn crossing([a, b]: &[Point2<f64>; 2], v: f64) -> Option<f64> {
    ((a.y < v) != (b.y < v)).then(|| a.x + (b.x - a.x) * (v - a.y) / (b.y - a.y))
}
