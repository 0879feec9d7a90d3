//! Round cones to a closed surface.

use nalgebra::Point3;

/// The convex hull of two balls: the piece of the solid between neighbouring samples of the curve
/// skeleton. With equal ends it is one ball.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RoundCone {
    /// Centres of the two balls, mm.
    pub centres: [Point3<f64>; 2],
    /// Their radii, mm.
    pub radii: [f64; 2],
}
