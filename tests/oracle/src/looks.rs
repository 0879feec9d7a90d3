//! How an object may look to the eyes when the depth of its surface is to be told from grey levels: by the way of its
//! surface, its light and its sensors.

use host::mesh::Mesh;
use host::render::{Material, Noise, Pattern, Sensor, Texture, photograph};
use host::shape::Shape;
use host::view::Pinhole;
use image::GrayImage;

/// A way to look.
#[derive(Clone, Copy, Debug)]
pub struct Look {
    /// Its name in tables.
    pub name: &'static str,
    material: Material,
    /// Of the left and the right eye.
    sensors: [Sensor; 2],
    /// Standard deviation of the noise, grey levels.
    noise: f64,
    /// Of the left eye's noise; the right eye's is the next one.
    pub seed: u64,
    /// How much lower the right eye sees everything, px.
    lower: f64,
}

impl Look {
    /// A dull object without marks, in good light.
    pub fn matte() -> Self {
        let sensors = [Sensor::default(); 2];
        Self { name: "matte", material: Material::default(), sensors, noise: 0.0, seed: 1, lower: 0.0 }
    }

    /// Every way.
    pub fn all() -> Vec<Self> {
        let matte = Self::matte();
        let texture = |pattern| Texture { pattern, size: 12.0, contrast: 0.25 };
        let of = |texture| Material { texture, ..Material::default() };
        let both = |sensor| [sensor; 2];
        let sensor = Sensor::default();
        vec![
            matte,
            Self { name: "checks", material: of(texture(Pattern::Checks)), ..matte },
            Self { name: "clouds", material: of(texture(Pattern::Clouds)), ..matte },
            Self {
                name: "glossy",
                material: Material { gloss: 0.4, shininess: 30.0, ..Material::default() },
                ..matte
            },
            Self { name: "gamma", sensors: both(Sensor { gamma: 2.2, ..sensor }), ..matte },
            Self { name: "noise 2", noise: 2.0, ..matte },
            Self { name: "noise 5", noise: 5.0, ..matte },
            Self { name: "gain", sensors: [sensor, Sensor { gain: 0.9, ..sensor }], ..matte },
            Self { name: "saturated", sensors: both(Sensor { gain: 1.5, ..sensor }), ..matte },
            Self { name: "offset .1", lower: 0.1, ..matte },
            Self { name: "offset .25", lower: 0.25, ..matte },
        ]
    }

    /// What both eyes see of a shape.
    pub fn pair(&self, shape: Shape) -> [GrayImage; 2] {
        self.see(&shape.mesh(shape.cell()))
    }

    /// What both eyes see of a mesh.
    pub fn see(&self, mesh: &Mesh) -> [GrayImage; 2] {
        let [left, mut right] = Pinhole::pair();
        right.principal[1] += self.lower;
        let cameras = [(left, self.sensors[0]), (right, self.sensors[1])];
        let images = photograph(mesh, self.material, &cameras);
        let mut images: [GrayImage; 2] = images.try_into().expect("one image a camera");
        if self.noise > 0.0 {
            for (image, seed) in images.iter_mut().zip(self.seed..) {
                Noise { sigma: self.noise, salt_and_pepper: 0.0, seed }.apply(image);
            }
        }
        images
    }
}
