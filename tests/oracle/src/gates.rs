//! A pair for every gate that a picture can trip, run through the core, and what of it is shown in `docs/gates/`.

mod page;
mod picture;

pub use page::{quoted, renewed};
pub use picture::picture;

use crate::scene::{Pair, draw, drawn_pair, pair, right_moved_down, views};
use host::memory::Storage;
use host::mesh::Mesh;
use host::render::render;
use host::report::record::Record;
use host::report::words::name;
use host::shape::Shape;
use image::{GrayImage, imageops};
use nalgebra::{Point3, Vector3};
use shared::bitmap::{Grey, Size};
use shared::fixed::PX;
use shared::pipeline::{self, Finding, Settings};
use shared::stage::correspond::PaperMatching;
use shared::stage::depth::Optics;
use shared::stage::thinning::Rule;

/// A gate, and what trips it.
pub struct Gate {
    /// The finding's name.
    pub name: &'static str,
    /// Whether it refuses the pair, or warns beside a model.
    pub refuses: bool,
    /// Both pictures.
    pub pair: Pair,
    /// The choices of the run.
    pub settings: Settings,
}

/// What a gate found, and all that was seen before.
pub struct Tripped {
    /// The finding of the gate's name.
    pub finding: Finding,
    /// What the core made on its way.
    pub record: Record,
}

impl Gate {
    /// Run the core on the pair.
    ///
    /// # Errors
    /// What the run says instead, if it does not trip this gate.
    pub fn trip(&self) -> Result<Tripped, String> {
        let mut record = Record::new();
        let said = run(&self.pair, &self.settings, &mut record);
        let found = said.iter().find(|finding| name(finding) == self.name);
        found.map(|&finding| Tripped { finding, record }).ok_or_else(|| format!("{}: {said:?}", self.name))
    }

    fn set(self, settings: Settings) -> Self {
        Self { settings, ..self }
    }
}

/// All that the core says of a pair, refusal or warnings.
fn run([left, right]: &Pair, settings: &Settings, record: &mut Record) -> Vec<Finding> {
    let size = |image: &GrayImage| [image.width(), image.height()].map(|side| side as usize);
    let grey = |image| {
        let [width, height] = size(image);
        Grey::new(Size::new(width, height)?, width, image.as_raw())
    };
    let mut run = || {
        let [width, height] = size(left);
        let mut storage = Storage::new(width, height)?;
        pipeline::run(&mut storage.lend(), grey(left)?, grey(right)?, settings, record)
    };
    run().map_or_else(|refusal| vec![refusal], |outcome| outcome.findings.to_vec())
}

/// Every gate that a picture can trip, by name.
pub fn all() -> Vec<Gate> {
    let settings = Settings::new(Optics { focal: 375 * PX, disparity_offset: 0 });
    let refusal = |name, pair| Gate { name, refuses: true, pair, settings };
    let warning = |name, pair| Gate { name, refuses: false, pair, settings };
    let torus = || pair(Shape::Torus, 2);
    vec![
        warning("ambiguous", turned_coin()),
        refusal("areas-differ", half_hidden(torus())),
        refusal("capacity", comb()),
        refusal("fills-image", pair(Shape::Animal, 2).map(inverted)),
        refusal("no-map", drawn_pair(20.0, 0.0, corner))
            .set(Settings::paper(settings.optics, PaperMatching::default())),
        refusal("no-object", pair(Shape::Teapot, 2).map(darkened)),
        refusal("not-affine", mirrored(pair(Shape::Screwdriver, 2))),
        refusal("not-rectified", moved_down(6.0)),
        refusal("sizes-differ", cropped(torus())),
        warning(
            "second-object",
            seen(&[(Shape::Teapot, 0.7, [12.0, 18.0]), (Shape::Sphere, 0.3, [-60.0, -42.0])]),
        ),
        warning("skeleton-erased", drawn_pair(20.0, 0.0, block))
            .set(Settings { thinning: Rule::ZhangSuen, ..settings }),
        refusal("swapped-eyes", swapped(torus())),
        refusal("too-low", drawn_pair(40.0, 0.0, pencil)),
        warning("touches-border", seen(&[(Shape::Capsule, 1.0, [20.0, -95.0])])),
        refusal(
            "unmatched",
            [draw(320, 240, teeth(7.5)), draw(320, 240, move |u, v| teeth(20.0)(u + 40.0, v))],
        ),
        warning("vertical-offset", moved_down(2.0)),
    ]
}

fn inverted(mut image: GrayImage) -> GrayImage {
    imageops::invert(&mut image);
    image
}

/// As in a room without light.
fn darkened(mut image: GrayImage) -> GrayImage {
    image.iter_mut().for_each(|grey| *grey = 12 + *grey / 48);
    image
}

fn swapped([left, right]: Pair) -> Pair {
    [right, left]
}

fn mirrored([left, right]: Pair) -> Pair {
    [left, imageops::flip_horizontal(&right)]
}

fn cropped([left, right]: Pair) -> Pair {
    [left, imageops::crop_imm(&right, 0, 0, 320, 200).to_image()]
}

/// Something dark before the right eye.
fn half_hidden([left, mut right]: Pair) -> Pair {
    for (u, _, pixel) in right.enumerate_pixels_mut().filter(|(u, ..)| *u > 150) {
        pixel[0] = 12 + (u % 2) as u8;
    }
    [left, right]
}

fn moved_down(rows: f64) -> Pair {
    let [left, _] = pair(Shape::Teapot, 2);
    [left, right_moved_down(Shape::Teapot, 2, rows)]
}

/// A coin with shallow bumps, which was turned a little between the views: its outline fits as well when turned.
pub fn turned_coin() -> Pair {
    let coin = |middle: f64, phase: f64| {
        move |u: f64, v: f64| {
            let (x, y) = (u - middle, v - 120.0);
            x.hypot(y) < 60.0 + 0.6 * (13.0 * y.atan2(x) + phase).sin()
        }
    };
    [draw(320, 240, coin(180.0, 0.0)), draw(320, 240, coin(140.0, 2.0))]
}

/// Shapes, each scaled about its middle and moved right and down, mm.
fn seen(shapes: &[(Shape, f64, [f64; 2])]) -> Pair {
    let mut all = Mesh::default();
    for &(shape, scale, [right, down]) in shapes {
        let mesh = shape.mesh(1.5 * shape.cell());
        let middle = Point3::new(30.0, 0.0, 450.0);
        let first = all.vertices.len() as u32;
        let place = |p: &Point3<f64>| middle + (p - middle) * scale + Vector3::new(right, down, 0.0);
        all.vertices.extend(mesh.vertices.iter().map(place));
        all.faces.extend(mesh.faces.iter().map(|face| face.map(|k| k + first)));
    }
    views(2).map(|view| render(&all, &[view]).remove(0))
}

/// A pencil that lies.
fn pencil(u: f64, v: f64) -> bool {
    (u - 170.0).abs() < 60.0 && (v - 120.0).abs() < 3.0
}

/// A triangle of two short sides along rows and columns, without any more corners.
fn corner(u: f64, v: f64) -> bool {
    u > 119.5 && v > 79.5 && u + v < 290.0
}

/// A square of an even number of pixels.
fn block(u: f64, v: f64) -> bool {
    (u - 169.5).abs() < 24.0 && (v - 119.5).abs() < 24.0
}

/// A block with teeth of this width in the middle.
fn teeth(width: f64) -> impl Fn(f64, f64) -> bool {
    move |u, v| {
        let inside = (u - 170.0).abs() < 60.0 && (v - 120.0).abs() < 60.0;
        inside && (!(75.0..=165.0).contains(&v) || ((u - 110.0) / width).rem_euclid(2.0) < 1.0)
    }
}

/// A comb of so many teeth that its outline is longer than any that is provided for.
fn comb() -> Pair {
    let teeth = |u: f64, v: f64| {
        let inside = (100.0..560.0).contains(&u) && (40.0..440.0).contains(&v);
        inside && (v < 60.0 || (u / 4.0).rem_euclid(2.0) < 1.0)
    };
    [0.0, 40.0].map(|disparity| draw(640, 480, move |u, v| teeth(u + disparity, v)))
}
