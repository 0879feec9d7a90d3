//! The stages, in the order in which data flows through them. A stage may use the foundation and the
//! output type of an earlier stage, never a later one; only `pipeline` names more than one neighbour.

// One eye, from raw to rectified.
pub mod warp;

// One eye, in pixels.
pub mod binarise;
pub mod clean;
pub mod boundary;
pub mod contour;
pub mod distance;
pub mod parallel_thinning;
pub mod sequential_thinning;
pub mod thinning;
pub mod graph;
pub mod prune;

// Both eyes: the hulls.
pub mod hull;
pub mod invariants;
pub mod plane;
pub mod correspond;
pub mod nearest;

// Both eyes: depth.
pub mod rows;
pub mod medial;
pub mod depth;
pub mod branch;
pub mod nurbs;
