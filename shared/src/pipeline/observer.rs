//! Looking on while the pipeline runs.

use super::{Branch, Side};
use crate::bitmap::{Bitmap, Grey, Plane};
use crate::point::PixelPoint;
use crate::stage::binarise::{Histogram, Tone};
use crate::stage::clean::Components;
use crate::stage::contour::{ContourLoop, ContourPoint};
use crate::stage::correspond::{CutMatch, VertexMatch};
use crate::stage::depth::BallDepth;
use crate::stage::graph::Graph;
use crate::stage::medial::MedialBall;
use crate::stage::nearest::Pair;
use crate::stage::nurbs::Control;
use crate::stage::parallel_thinning;
use crate::stage::prune;
use crate::stage::rows::{ContourMatch, RowStatistics};

/// What passes by on the way, for pictures, timings and records.
pub enum Product<'a> {
    /// The filtered image, its histogram, the level and the object's side of it.
    Threshold(Grey<'a>, &'a Histogram, u8, Tone),
    /// The cleaned mask and what was cleaned away.
    Mask(&'a Bitmap<'a>, Components),
    /// A minus its erosion.
    Boundary(&'a Bitmap<'a>),
    /// The contour in loops.
    Contour(&'a [ContourPoint], &'a [ContourLoop]),
    /// Distance to the background, 1/16 px.
    Distance(&'a Plane<'a, u16>),
    /// The thinned mask, one pixel wide.
    Skeleton(&'a Bitmap<'a>, parallel_thinning::Report),
    /// The skeleton that pruning left, and its graph.
    Graph(&'a Bitmap<'a>, &'a Graph<'a>, prune::Report),
    /// Vertices of the convex hull, in the coordinates that are matched: right rows moved by the
    /// vertical offset.
    Hull(&'a [PixelPoint]),
    /// The hulls, cut and matched.
    Cuts(&'a CutMatch),
    /// The hulls' vertices, matched the paper's way.
    Vertices(&'a VertexMatch),
    /// Each left contour point's partner.
    Rows(&'a [ContourMatch], RowStatistics),
    /// Balls of the left view and their depths.
    Balls(&'a [MedialBall], &'a [BallDepth]),
    /// Pairs of points, left and right: boundary and skeleton.
    Pairs(&'a [Pair], &'a [Pair]),
    /// The curves of the skeleton are fitted.
    Curves(&'a [Branch], &'a [Control]),
}

/// Looks on while the pipeline runs.
pub trait Observer {
    /// A stage has made something; products of the pair come with `None`.
    fn saw(&mut self, side: Option<Side>, product: Product<'_>);

    /// Whether the right eye is to be thinned for it, though the default method has no use for that.
    fn wants_both_skeletons(&self) -> bool {
        false
    }
}

/// Nobody looks on.
impl Observer for () {
    fn saw(&mut self, _: Option<Side>, _: Product<'_>) {}
}
