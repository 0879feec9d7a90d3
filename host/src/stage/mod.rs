//! The host's stages, in the order in which data flows through them: `rectify` before the core, the others after it.

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
