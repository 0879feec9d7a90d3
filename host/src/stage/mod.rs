//! The stages that follow the core, in the order in which data flows through them.

pub mod rectify;
pub mod surface;
