//! Balls: each medial ball of the left view, lifted into space (paper section 4.2; docs/algorithm.md, steps
//! 21 and 24).
//!
//! * **In**: what the core says of the left contour, its medial balls and their disparities.
//! * **Out**: centres and radii in rectified axes, mm.
//! * **Centre**: Z = f B / d. Under perspective the middle of a ball's image lies outside its centre's; the
//!   part of the offset along the chord of the contacts is taken back by f^2 / (f^2 + rho^2), all of it where
//!   the contacts are no diameter.
//! * **Radius**: the paper's rule, the distance to the nearest boundary point, but taken to the viewing
//!   rays of the left boundary, which the depth noise of boundary points does not touch.
//! * **Cost**: a ball's search for its nearest ray is about logarithmic in the contour's length (`runs.rs`); lists
//!   are filled anew, and allocate nothing once they are long enough.

use super::rectify::RectifiedCamera;
use crate::runs::Runs;
use nalgebra::{Point3, Vector2, Vector3};
use shared::fixed::PX;
use shared::point::{Direction, PixelPoint};
use shared::stage::contour::ContourPoint;
use shared::stage::depth::BallDepth;
use shared::stage::medial::MedialBall;
use shared::stage::rows::ContourMatch;

/// A contour point of the left view and what the right view says of it.
#[derive(Clone, Copy, Debug)]
pub struct Edge {
    /// Left image, px.
    pub at: Vector2<f64>,
    /// Outward normal in the left image.
    pub normal: Vector2<f64>,
    /// Outward normal in the right image.
    pub normal_right: Vector2<f64>,
    /// Disparity, px.
    pub disparity: f64,
    /// n_x^2 of the right normal, 0 where nothing is known.
    pub weight: f64,
    /// There is no edge here, the image ends.
    pub border: bool,
}

/// A ball of the solid.
#[derive(Clone, Copy, Debug)]
pub struct Ball {
    /// Centre of its image in the left view, px.
    pub at: Vector2<f64>,
    /// Radius of its image, px.
    pub rho: f64,
    /// Disparity of its centre, px.
    pub disparity: f64,
    /// How well the disparity is known, 0..=1.
    pub weight: f64,
    /// The contour points that it touches.
    pub contacts: [usize; 2],
    /// Its place in its chain: see [`super::solid::Chain`].
    pub place: usize,
    /// Left ray through its centre, z = 1.
    pub ray: Vector3<f64>,
}

impl Ball {
    /// Centre, rectified axes, mm; nothing unless it is in front of the cameras.
    pub fn centre(&self, camera: &RectifiedCamera) -> Option<Point3<f64>> {
        camera.depth(self.disparity).map(|z| Point3::from(self.ray * z))
    }
}

/// Pixels of a fixed-point length.
pub fn px(x: i32) -> f64 {
    f64::from(x) / f64::from(PX)
}

/// Pixels of a fixed-point point.
pub fn px2(p: PixelPoint) -> Vector2<f64> {
    Vector2::new(px(p.u), px(p.v))
}

fn unit(d: Direction) -> Vector2<f64> {
    Vector2::new(f64::from(d.u), f64::from(d.v)) / 16384.0
}

/// Fill `edges` with the contour in pixels.
pub fn edges(points: &[ContourPoint], matches: &[ContourMatch], edges: &mut Vec<Edge>) {
    let edge = |(p, m): (&ContourPoint, &ContourMatch)| Edge {
        at: px2(p.at),
        normal: unit(p.normal),
        normal_right: unit(m.normal_right),
        disparity: px(m.disparity),
        weight: f64::from(m.weight) / 16384.0,
        border: p.border,
    };
    edges.clear();
    edges.extend(points.iter().zip(matches).map(edge));
}

/// Fill `balls` with the medial balls in pixels, with the rays to their centres.
pub fn balls(
    camera: &RectifiedCamera,
    edges: &[Edge],
    (medial, depths): (&[MedialBall], &[BallDepth]),
    balls: &mut Vec<Ball>,
) {
    let ball = |(m, d): (&MedialBall, &BallDepth)| {
        let contacts = m.contacts.map(|k| k as usize);
        let (at, rho) = (px2(m.centre), px(m.rho));
        let chord = edges[contacts[0]].at - edges[contacts[1]].at;
        Ball {
            at,
            rho,
            disparity: px(d.disparity),
            weight: f64::from(d.weight) / 16384.0,
            contacts,
            place: contacts[0],
            ray: centre_ray(camera, at, rho, chord),
        }
    };
    balls.clear();
    balls.extend(medial.iter().zip(depths).map(ball));
}

/// The ray to the centre of a ball whose image has its middle at `at`.
pub(super) fn centre_ray(
    camera: &RectifiedCamera,
    at: Vector2<f64>,
    rho: f64,
    chord: Vector2<f64>,
) -> Vector3<f64> {
    let outside = rho * rho / (camera.f * camera.f + rho * rho);
    let from_axis = at - Vector2::new(camera.cx, camera.cy);
    let length = chord.norm();
    let shift = if length > 1.4 * rho {
        let along = chord / length;
        along * (from_axis.dot(&along) * outside)
    } else {
        from_axis * outside
    };
    let centre = (from_axis - shift) / camera.f;
    Vector3::new(centre.x, centre.y, 1.0)
}

/// The viewing rays of the left boundary, the image's border left out.
#[derive(Debug, Default)]
pub struct Rays {
    /// Of length 1.
    rays: Vec<Vector3<f64>>,
    /// Where they meet the plane at distance 1.
    met: Runs<2>,
    /// Square of the least z of a ray.
    steepest: f64,
}

impl Rays {
    /// Take those of another boundary.
    pub fn build(&mut self, camera: &RectifiedCamera, edges: &[Edge]) {
        self.rays.clear();
        let seen = edges.iter().filter(|e| !e.border);
        self.rays.extend(seen.map(|e| camera.ray(e.at.x, e.at.y).normalize()));
        self.met.build(self.rays.iter().map(|ray| [ray.x / ray.z, ray.y / ray.z]));
        self.steepest = self.rays.iter().map(|ray| ray.z).fold(1.0, f64::min).powi(2);
    }

    /// Distance from a point in front of the camera to the nearest ray, mm: the radius of the ball there. Infinite
    /// without a ray.
    ///
    /// Where p and q are the places at which the ways to the point and along a ray r meet the plane at distance 1,
    /// |p x q| is at least |p - q|, so the distance is at least |p - q| z r_z.
    pub fn distance(&self, centre: &Point3<f64>) -> f64 {
        let at = [centre.x / centre.z, centre.y / centre.z];
        let square = |k: usize| centre.coords.cross(&self.rays[k]).norm_squared();
        let nearest = self.met.nearest(&at, centre.z * centre.z * self.steepest, square);
        nearest.map_or(f64::INFINITY, |(_, square)| square.sqrt())
    }
}

/// Distance from a point to the nearest of others, mm; infinite if there is none. `runs` are those of the points.
pub fn distance_to_points(points: &[Point3<f64>], runs: &Runs<3>, centre: &Point3<f64>) -> f64 {
    let square = |k: usize| (points[k] - centre).norm_squared();
    runs.nearest(&centre.coords.into(), 1.0, square).map_or(f64::INFINITY, |(_, square)| square.sqrt())
}
