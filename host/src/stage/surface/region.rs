//! Regions of the lattice, which are divided in eight until they are blocks, and the blocks in leaves.

use nalgebra::Point3;

use super::{
    block::{CLEAR, EDGE},
    bundle::Bundle,
    cone::{Group, prepare},
    distance::Distance,
    lattice::{Lattice, MAX_SHIFT, SIDE},
};

/// What all regions have in common.
#[derive(Clone, Copy)]
pub(super) struct Solid<'a> {
    pub(super) lattice: &'a Lattice,
    pub(super) distances: &'a [Distance],
}

/// A region of the lattice that is to be divided.
#[derive(Clone, Copy, Debug)]
pub(super) struct Region {
    /// Its lowest corner, in half cubes.
    pub(super) corner: [i32; 3],
    /// Lattice cubes along its side.
    pub(super) cubes: i32,
}

impl Region {
    pub(super) fn octant(&self, octant: usize) -> Self {
        let half = self.cubes / 2;
        let bit = |axis: usize| (octant >> (2 - axis) & 1) as i32;
        Self { corner: [0, 1, 2].map(|axis| self.corner[axis] + bit(axis) * half * 2), cubes: half }
    }
}

/// How far all that belongs to a region of `cubes` a side is from its middle, in cubes: its points, wherever they are
/// moved to, and the edges of its cubes.
pub(super) const fn reach(cubes: i32) -> f32 {
    0.5 * cubes as f32 * 1.732_051 + MAX_SHIFT as f32
}

/// A region on the way down.
#[derive(Debug, Default)]
pub(super) struct Level {
    pub(super) cones: Vec<u32>,
    groups: Vec<Group>,
}

impl Solid<'_> {
    pub(super) fn middle(&self, region: Region) -> Point3<f64> {
        self.lattice.position(region.corner.map(|along| along + region.cubes))
    }
}

impl Level {
    /// The level's cones, around the middle of `region`, of which it has them.
    pub(super) fn bundle(&mut self, solid: &Solid, region: Region) -> Bundle<'_> {
        let middle = solid.middle(region);
        self.groups.clear();
        prepare(&self.cones, solid.distances, &middle, solid.lattice.cube, &mut self.groups);
        Bundle { cones: &self.cones, groups: &self.groups }
    }
}

/// A region, as seen from the middle of a bundle.
#[derive(Clone, Copy)]
pub(super) struct Around {
    /// Of its middle, cubes.
    pub(super) offset: [f32; 3],
    /// How far all that belongs to it is from its middle, cubes.
    pub(super) reach: f32,
    /// How near to it cones are kept, cubes: of a block those that touch it or come so near that a point at its rim is
    /// not clear of them, and above those that tell which blocks there are.
    pub(super) margin: f32,
}

/// One of the eight children of a region.
pub(super) struct Octant {
    pub(super) region: Region,
    /// As seen from the middle of the parent.
    pub(super) around: Around,
}

impl Octant {
    /// The eight children.
    pub(super) fn all(parent: Region) -> impl Iterator<Item = Self> {
        (0..8).map(move |octant| Self::of(parent, octant))
    }

    pub(super) fn of(parent: Region, octant: usize) -> Self {
        let region = parent.octant(octant);
        let margin = if region.cubes == SIDE { CLEAR } else { EDGE };
        let quarter = parent.cubes as f32 / 4.0;
        let offset = [0, 1, 2].map(|axis| if octant >> (2 - axis) & 1 == 1 { quarter } else { -quarter });
        Self { region, around: Around { offset, reach: reach(region.cubes), margin } }
    }
}
