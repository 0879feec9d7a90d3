//! The stages that follow the core, in the order in which data flows through them.

pub mod balls;
pub mod rectify;
pub mod refine;
pub mod smooth;
pub mod solid;
pub mod surface;
pub mod triangulate;
