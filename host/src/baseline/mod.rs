//! What a reconstruction is held against: the simplest solids that explain the same silhouettes.
//!
//! Both start from the sub-pixel outlines that the method itself measured ([`Outline`]), know nothing of
//! the truth, and give closed, manifold, outward meshes in rectified axes, mm.

mod hull;
mod inflation;
mod outline;

pub use hull::visual_hull;
pub use inflation::inflation;
pub use outline::Outline;

#[cfg(test)]
mod tests;
