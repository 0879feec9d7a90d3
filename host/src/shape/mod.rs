//! Built-in solids with known truth, to try and to measure the method without a camera.
//!
//! Each is a signed function and a box in the left camera's frame, mm, 450 mm in front of the pair of
//! [`crate::view::Pinhole::pair`] and half way between its eyes.

use std::fmt;
use std::str::FromStr;

use nalgebra::{Matrix3, Point3, Unit, Vector3};

use crate::mesh::Mesh;

pub mod animal;
mod block;
mod field;
pub(crate) mod isosurface;
mod mouse;
mod screwdriver;
mod simple;
mod teapot;

/// Where the solids stand, mm.
const PLACE: Point3<f64> = Point3::new(30.0, 0.0, 450.0);

/// A signed function of a point in mm: negative inside a solid, with slope at most 1.
pub type Field = Box<dyn Fn(&Point3<f64>) -> f64 + Send + Sync>;

/// A built-in solid.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Shape {
    /// A ball of radius 60 mm.
    Sphere,
    /// A torus of radii 40 and 20 mm, its axis towards the cameras.
    Torus,
    /// The same torus, tilted by 30 degrees.
    TorusTilt,
    /// A cylinder of radius 30 mm with round ends, 150 mm long, 20 degrees into depth.
    Capsule,
    /// A screwdriver, 180 mm long, 15 degrees into depth.
    Screwdriver,
    /// A block with a step, seen from a corner.
    Block,
    /// A teapot, 165 mm from handle to spout.
    Teapot,
    /// A computer mouse, 155 mm long.
    Mouse,
    /// An animal on four legs, 185 mm from muzzle to tail, turned by 18 degrees.
    Animal,
}

impl Shape {
    /// Every shape, in the order of lists.
    pub const ALL: [Self; 9] = [
        Self::Sphere,
        Self::Torus,
        Self::TorusTilt,
        Self::Capsule,
        Self::Screwdriver,
        Self::Block,
        Self::Teapot,
        Self::Mouse,
        Self::Animal,
    ];

    /// The name by which a user asks for it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Sphere => "sphere",
            Self::Torus => "torus",
            Self::TorusTilt => "torus_tilt",
            Self::Capsule => "capsule",
            Self::Screwdriver => "screwdriver",
            Self::Block => "block",
            Self::Teapot => "teapot",
            Self::Mouse => "mouse",
            Self::Animal => "animal",
        }
    }

    /// A cell, in mm, at which the mesh shows all parts of the shape in 20,000 to 60,000 faces.
    #[must_use]
    pub const fn cell(self) -> f64 {
        match self {
            Self::Screwdriver => 1.4,
            Self::Animal => 2.0,
            Self::Teapot => 2.2,
            Self::Torus | Self::TorusTilt => 2.25,
            Self::Capsule | Self::Block | Self::Mouse => 2.5,
            Self::Sphere => 3.0,
        }
    }

    /// The signed function.
    #[must_use]
    pub fn field(self) -> Field {
        let Solid { field, turn, .. } = self.solid();
        Box::new(move |point| field(&Point3::from(turn.tr_mul(&(point - PLACE)))))
    }

    /// Lower and upper corner of a box that holds the solid, not always the smallest, mm.
    #[must_use]
    pub fn bounds(self) -> [Point3<f64>; 2] {
        let Solid { low, high, turn, .. } = self.solid();
        let reach = turn.abs() * (high - low) / 2.0;
        let middle = PLACE + turn * nalgebra::center(&low, &high).coords;
        [middle - reach, middle + reach]
    }

    /// The solid's surface: closed, manifold, outward. Vertices lie on it up to a thousandth of
    /// `cell` mm, which is about the length of an edge; the block is exact whatever the cell.
    #[must_use]
    pub fn mesh(self, cell: f64) -> Mesh {
        if self == Self::Block {
            let mut mesh = block::mesh();
            let turn = self.solid().turn;
            for vertex in &mut mesh.vertices {
                *vertex = PLACE + turn * vertex.coords;
            }
            return mesh;
        }
        isosurface::isosurface(&*self.field(), self.bounds(), cell)
    }

    fn solid(self) -> Solid {
        match self {
            Self::Sphere => simple::sphere(),
            Self::Torus => simple::torus(0.0),
            Self::TorusTilt => simple::torus(30.0),
            Self::Capsule => simple::capsule(),
            Self::Screwdriver => screwdriver::solid(),
            Self::Block => block::solid(),
            Self::Teapot => teapot::solid(),
            Self::Mouse => mouse::solid(),
            Self::Animal => animal::solid(),
        }
    }
}

impl fmt::Display for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// No built-in shape has this name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there is no shape `{name}`; the shapes are {}", Shape::ALL.map(Shape::name).join(", "))]
pub struct UnknownShape {
    /// The name asked for.
    pub name: String,
}

impl FromStr for Shape {
    type Err = UnknownShape;

    fn from_str(name: &str) -> Result<Self, UnknownShape> {
        Self::ALL
            .into_iter()
            .find(|shape| shape.name() == name)
            .ok_or_else(|| UnknownShape { name: name.to_owned() })
    }
}

/// A solid in a frame of its own, and how it is turned into the camera's.
struct Solid {
    field: Field,
    low: Point3<f64>,
    high: Point3<f64>,
    turn: Matrix3<f64>,
}

/// Rotation about an axis, right-handed. The sine is `libm`'s: the same bits on every machine.
fn turn(axis: [f64; 3], degrees: f64) -> Matrix3<f64> {
    let axis = Unit::new_normalize(Vector3::from(axis));
    let (sin, cos) = libm::sincos(degrees.to_radians());
    Matrix3::identity() * cos + axis.cross_matrix() * sin + *axis * axis.transpose() * (1.0 - cos)
}

#[cfg(test)]
mod tests;
