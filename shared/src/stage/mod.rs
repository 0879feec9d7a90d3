//! The stages, in the order in which data flows through them. A stage may use the foundation and the
//! output type of an earlier stage, never a later one; only `pipeline` names more than one neighbour.

pub mod graph;
pub mod nurbs;
pub mod prune;
