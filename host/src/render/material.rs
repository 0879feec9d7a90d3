//! What a surface does with light: its texture, and how it shines.
//!
//! In: a point of the surface, its normal, and where it is seen from. Out: how bright it is, in grey levels
//! before the sensor has its say. Lambert's law, times a solid texture (a function of the point, so both
//! eyes see the same marks on the same spot), plus the highlight of Blinn (1977).

use std::str::FromStr;

use nalgebra::{Matrix3, Point3, Vector3};
use thiserror::Error;

use crate::random::Random;

/// Grey value of a white object where it is turned away from the light.
pub(super) const DARKEST: f64 = 140.0;
/// Grey value of a white object where it faces the light.
pub(super) const BRIGHTEST: f64 = 245.0;
/// Direction towards the light, of about unit length.
pub(super) const LIGHT: Vector3<f64> = Vector3::new(-0.35, -0.55, -0.76);

/// Axes of the textures, turned so that no flat face of a shape lies in a plane of theirs.
const AXES: Matrix3<f64> = Matrix3::new(
    2.0 / 3.0,
    -1.0 / 3.0,
    2.0 / 3.0, //
    2.0 / 3.0,
    2.0 / 3.0,
    -1.0 / 3.0, //
    -1.0 / 3.0,
    2.0 / 3.0,
    2.0 / 3.0,
);

/// How a surface answers light. The default is plain and dull.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Material {
    /// The marks on it.
    pub texture: Texture,
    /// Brightness of the highlight where it mirrors the light, grey levels over 255: 0 is dull.
    pub gloss: f64,
    /// How narrow the highlight is: the exponent of Blinn's cosine, 1 and more.
    pub shininess: f64,
}

/// Marks of two shades, the lighter white.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Texture {
    /// Their form.
    pub pattern: Pattern,
    /// Their size, mm: positive, and no less than a millionth of how far the object reaches.
    pub size: f64,
    /// How much darker the darker ones are: 0 not at all, 1 black.
    pub contrast: f64,
}

/// The form of a texture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Pattern {
    /// None.
    #[default]
    Plain,
    /// Cubes, alternately light and dark.
    Checks,
    /// Soft blots at random.
    Clouds,
}

impl Pattern {
    /// All of them, with their names.
    pub const NAMES: [(&str, Self); 3] =
        [("plain", Self::Plain), ("checks", Self::Checks), ("clouds", Self::Clouds)];
}

/// There is no pattern of this name.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("there is no texture {0:?}; there are plain, checks and clouds")]
pub struct UnknownPattern(String);

impl FromStr for Pattern {
    type Err = UnknownPattern;

    fn from_str(name: &str) -> Result<Self, UnknownPattern> {
        let known = Self::NAMES.iter().find(|known| known.0 == name);
        known.map(|known| known.1).ok_or_else(|| UnknownPattern(name.to_owned()))
    }
}

impl Material {
    /// Grey level of a point, mm, with a normal and a direction to the eye, both of any length.
    pub(super) fn grey(&self, point: &Point3<f64>, normal: &Vector3<f64>, eye: &Vector3<f64>) -> f64 {
        let length = normal.norm().max(f64::MIN_POSITIVE);
        let cosine = normal.dot(&LIGHT) / length;
        let diffuse = DARKEST + (BRIGHTEST - DARKEST) * cosine.clamp(0.0, 1.0);
        diffuse * self.texture.albedo(point) + self.highlight(normal, length, eye)
    }

    fn highlight(&self, normal: &Vector3<f64>, length: f64, eye: &Vector3<f64>) -> f64 {
        if self.gloss <= 0.0 {
            return 0.0;
        }
        let halfway = LIGHT.normalize() + eye.normalize();
        let cosine = normal.dot(&halfway) / (length * halfway.norm().max(f64::MIN_POSITIVE));
        255.0 * self.gloss * libm::pow(cosine.clamp(0.0, 1.0), self.shininess)
    }
}

impl Texture {
    /// Part of the light that a point, mm, sends back.
    fn albedo(&self, point: &Point3<f64>) -> f64 {
        let at = || AXES * point.coords / self.size;
        let dark = match self.pattern {
            Pattern::Plain => return 1.0,
            Pattern::Checks => f64::from(at().map(|x| x.floor() as i64).sum().rem_euclid(2) as u8),
            Pattern::Clouds => clouds(at()),
        };
        1.0 - self.contrast * dark
    }
}

/// Noise on a grid of unit cubes, smooth between its points, stretched so that it fills 0..=1.
fn clouds(at: Vector3<f64>) -> f64 {
    let cube = at.map(|x| x.floor() as i64);
    let within = at.map(|x| x - x.floor());
    let smooth = within.map(|t| t * t * (3.0 - 2.0 * t));
    let mut sum = 0.0;
    for corner in 0..8 {
        let ahead = Vector3::new(corner >> 2 & 1, corner >> 1 & 1, corner & 1);
        let weight = smooth.zip_map(&ahead, |t, ahead| if ahead == 1 { t } else { 1.0 - t }).product();
        sum += weight * uniform_at(cube + ahead);
    }
    // Mixtures crowd the middle.
    (0.5 + 2.0 * (sum - 0.5)).clamp(0.0, 1.0)
}

/// A number in `[0, 1)` that the cube determines.
fn uniform_at(cube: Vector3<i64>) -> f64 {
    let seed = cube.iter().fold(0, |seed, &x| Random::new(seed ^ x.cast_unsigned()).bits());
    Random::new(seed).uniform()
}
