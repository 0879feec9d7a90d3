//! The stages that follow the core, in the order in which data flows through them.

pub mod rectify;
pub mod balls;
pub mod curve;
pub mod refine;
pub mod smooth;
pub mod solid;
pub mod simplify;
pub mod triangulate;
pub mod surface;
pub mod front;
