//! The stages, in the order in which data flows through them. A stage may use the foundation and the
//! output type of an earlier stage, never a later one; only `pipeline` names more than one neighbour.

pub mod binarise;
pub mod boundary;
pub mod branch;
pub mod clean;
pub mod contour;
pub mod correspond;
pub mod depth;
pub mod distance;
pub mod graph;
pub mod hull;
pub mod invariants;
pub mod medial;
pub mod nearest;
pub mod nurbs;
pub mod plane;
pub mod prune;
pub mod rows;
pub mod thinning;
