//! The stages, in the order in which data flows through them. A stage may use the foundation and the
//! output type of an earlier stage, never a later one; only `pipeline` names more than one neighbour.
//!
//! | stage | from | to | paper |
//! |---|---|---|---|
//! | [`warp`] | a raw row | its rectified row | - |
//! | [`binarise`] | grey | histogram, level, mask | 3.2 |
//! | [`clean`] | mask | its largest component, without pinholes | 3 |
//! | [`boundary`] | mask | boundary pixels | 3.2 |
//! | [`contour`] | mask and grey | loops of sub-pixel points with normals | 3.2 |
//! | [`distance`] | mask | distance to the background | 4.2 |
//! | [`parallel_thinning`], [`sequential_thinning`], [`thinning`] | mask | skeleton | 3.1 |
//! | [`graph`] | skeleton | nodes and edges | 2.2 |
//! | [`prune`] | graph and distance | the branches that matter | 2.2 |
//! | [`hull`] | extents of rows | convex hull | 4.1.1 |
//! | [`invariants`] | four vertices | area ratios | 4.1.2 |
//! | [`plane`] | matched points | affine map, disparity plane | 4.1.2 |
//! | [`correspond`] | two hulls | which vertex is which | 4.1.2, 4.1.3 |
//! | [`nearest`] | two sets of points and a map | pairs | 4.1.3 |
//! | [`rows`] | two contours and a plane | the disparity of contour points | - |
//! | [`medial`] | contour | medial balls with their contacts | 2.1 |
//! | [`depth`] | balls and matches | the disparity of balls | 4.2 |
//! | [`branch`] | graph, balls, depths | samples along each edge | 2.2 |
//! | [`nurbs`] | samples | curves | 2.2 |

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
