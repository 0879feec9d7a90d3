//! The memory of reconstructions, one after the other, and the chain of their stages in it.

use super::grow::Described;
use super::options::{core_settings, settings};
use super::{Clock, Front, Growth, Mode, Options, Reconstruction, Refusal, Unmeasured, grey};
use crate::calibration::StereoCamera;
use crate::memory::Storage;
use crate::mesh::Mesh;
use crate::mesh::body::Bodies;
use crate::stage::front::{self, Pool, Sight};
use crate::stage::rectify::{PixelBox, Rectification, RectifiedCamera, RectifyError, device_images};
use crate::stage::surface::{Mesher, RoundCone};
use image::GrayImage;
use nalgebra::{Point2, Point3, Vector3};
use shared::camera::PairModel;
use shared::fixed::PX;
use shared::pipeline::{self, Finding, Memory, Observer, Outcome, Settings, Side};
use shared::stage::binarise::{Polarity, Threshold};
use shared::stage::depth::Optics;
use std::mem::take;

/// Cells along the diagonal of a mesh at most, unless the user says otherwise.
const MAX_CELLS: f64 = 300.0;
/// The finest and the coarsest cell by default, px: a limb breaks where its radius is less than 0.84 cells, and the
/// creases between limbs are rounded by up to a cell.
const CELL_PX: [f64; 2] = [2.0, 3.0];
/// What a contour point may be wrong by, px.
const SAG: f64 = 0.03;
/// Edges of faces, in cells.
const EDGE_CELLS: f64 = 0.6;

/// What a reconstruction needs in passing. It grows with the first pairs; the core's stages and the host's then
/// allocate nothing for a pair as large as those, if what was made of the last one is given back ([`Self::recycle`]).
#[derive(Default)]
pub struct Workspace {
    storage: Storage,
    /// The rectified pair, if it is not the raw one.
    images: [GrayImage; 2],
    growth: Growth,
    mesher: Mesher,
    bodies: Bodies,
    mesh: Mesh,
    /// Of the visible side.
    pool: Pool,
    /// Of the skeleton.
    radii: Vec<f64>,
    clock: Clock,
}

/// The raw pictures of a pair that a device has described.
#[derive(Clone, Debug)]
pub struct Seen {
    /// Left and right picture.
    pub pictures: [GrayImage; 2],
    /// Levels between object and background in them.
    pub levels: [u8; 2],
}

/// What is known of a solid beside its round cones, which stand in [`Growth`].
struct Solid {
    /// What the core says.
    outcome: Outcome,
    /// The rectified cameras, in whose axes it is.
    camera: RectifiedCamera,
    /// Whether the images had to be resampled.
    resampled: bool,
}

impl Workspace {
    /// As [`reconstruct`](super::reconstruct); the images stay the caller's.
    ///
    /// # Errors
    /// A [`Refusal`] that says what is wrong and what to do.
    pub fn reconstruct(
        &mut self,
        views: [&GrayImage; 2],
        calibration: &StereoCamera,
        options: &Options,
        observer: &mut impl Observer,
    ) -> Result<Reconstruction, Refusal> {
        let solid = self.solid(views, calibration, options, observer)?;
        let resampled = take(&mut self.images);
        let images = if solid.resampled { resampled.each_ref() } else { views };
        let made = self.finish(solid, Ok(images), options);
        self.images = resampled;
        made
    }

    /// As [`reconstruct_shape`](super::reconstruct_shape); where its pictures were `seen`, its visible side may be
    /// measured. Pictures in which the object is another are left aside.
    ///
    /// # Errors
    /// As [`Self::reconstruct`].
    pub fn reconstruct_shape(
        &mut self,
        (memory, outcome): (&mut Memory<'_>, Outcome),
        seen: Option<Seen>,
        model: &PairModel,
        options: &Options,
        observer: &mut impl Observer,
    ) -> Result<Reconstruction, Refusal> {
        self.clock.start();
        model.check().map_err(RectifyError::from)?;
        pipeline::resume(memory, &outcome, model.into(), observer).map_err(Finding::from)?;
        self.clock.lap("core");
        let solid = Solid { outcome, camera: model.into(), resampled: model.eyes.is_some() };
        grow(&mut self.growth, memory, &solid, options, &mut self.clock)?;
        let images = match seen {
            Some(seen) if options.front != Front::Balls => {
                self.see(seen, &solid.outcome, model, options).ok_or(Unmeasured::OtherPictures)
            }
            _ => Err(Unmeasured::NoPictures),
        };
        self.finish(solid, images.as_ref().map(<[_; 2]>::each_ref).map_err(|why| *why), options)
    }

    /// The rectified pictures of a shape, with their masks in the core's memory; nothing if they are none of its
    /// device's, or the object in them has not the areas that it found.
    fn see(
        &mut self,
        seen: Seen,
        outcome: &Outcome,
        model: &PairModel,
        options: &Options,
    ) -> Option<[GrayImage; 2]> {
        let size = (u32::from(model.width), u32::from(model.height));
        if seen.pictures.iter().any(|picture| picture.dimensions() != size) {
            return None;
        }
        let images = device_images(model, seen.pictures).ok()?;
        for side in [Side::Left, Side::Right] {
            let threshold = Threshold::Fixed(seen.levels[side as usize]);
            // The level is told, but not on which side of it the object is.
            let found = [Polarity::BrightObject, Polarity::DarkObject].into_iter().any(|polarity| {
                let settings = Settings { threshold, polarity, ..core_settings(model.into(), options) };
                let (image, storage) = (&images[side as usize], &mut self.storage);
                object_box(image, side, &settings, storage).is_ok()
                    && storage.masks().is_ok_and(|masks| {
                        masks[side as usize].count() == outcome.areas[side as usize] as usize
                    })
            });
            if !found {
                return None;
            }
        }
        self.clock.lap("rectify");
        Some(images)
    }

    /// The solid of a pair, without its surface.
    fn solid(
        &mut self,
        views: [&GrayImage; 2],
        calibration: &StereoCamera,
        options: &Options,
        observer: &mut impl Observer,
    ) -> Result<Solid, Refusal> {
        self.clock.start();
        calibration.left.check_size(views[0].width(), views[0].height())?;
        calibration.right.check_size(views[1].width(), views[1].height())?;
        let rectification = rectification(views, calibration, options, &mut self.storage)?;
        let (camera, resampled) = (rectification.camera(), !rectification.is_identity());
        let images = rectification.images_into(views, &mut self.images)?;
        self.clock.lap("rectify");

        let (width, height) = images[0].dimensions();
        self.storage.fit(width as usize, height as usize).map_err(Finding::from)?;
        let mut memory = self.storage.lend();
        let [left, right] = images.map(grey);
        let outcome = pipeline::run(&mut memory, left?, right?, &settings(&camera, options), observer)?;
        self.clock.lap("core");
        let solid = Solid { outcome, camera, resampled };
        grow(&mut self.growth, &memory, &solid, options, &mut self.clock)?;
        Ok(solid)
    }

    /// Give back the lists of what was made and is done with, for the next pair.
    pub fn recycle(&mut self, made: Reconstruction) {
        self.mesh = made.mesh;
        if let Some(front) = made.front {
            self.pool.recycle(front.confidence);
        }
        self.growth.skeleton = made.skeleton;
        self.growth.boundary = made.boundary;
        self.clock.laps = made.times;
    }

    /// From the solid to its surface, and everything to the left camera's axes. The rectified images are those of
    /// a pair whose masks are still in the core's memory.
    fn finish(
        &mut self,
        solid: Solid,
        images: Result<[&GrayImage; 2], Unmeasured>,
        options: &Options,
    ) -> Result<Reconstruction, Refusal> {
        let Solid { outcome, camera, resampled } = solid;
        let cones = &self.growth.cones;
        self.radii.clone_from(&self.growth.skeleton.radii);
        let coarser = if options.draft { 2.0 } else { 1.0 };
        let cell = options.cell.unwrap_or_else(|| coarser * default_cell(&camera, cones, &mut self.radii));
        self.mesher.surface(cones, cell, &mut self.mesh)?;
        let dropped = self.bodies.keep_largest(&mut self.mesh);
        self.clock.lap("surface");
        let (measured, unmeasured) = match (options.front, images) {
            (Front::Balls, _) => (None, None),
            (_, Err(why)) => (None, Some(why)),
            (_, Ok(images)) => {
                let masks = self.storage.masks().map_err(Finding::from)?;
                let rows = f64::from(outcome.vertical_offset) / 256.0;
                let sight = Sight { images, masks, camera: &camera, rows };
                let measured =
                    front::measure(&self.pool, &mut self.mesh, &sight, options.front == Front::Auto);
                self.clock.lap("front");
                (Some(measured), None)
            }
        };
        let turned = |points: &mut [Point3<f64>]| {
            points.iter_mut().for_each(|point| *point = camera.to_left_camera(*point));
        };
        turned(&mut self.growth.skeleton.points);
        turned(&mut self.growth.boundary.points);
        turned(&mut self.mesh.vertices);
        Ok(Reconstruction {
            mesh: take(&mut self.mesh),
            front: measured,
            unmeasured,
            skeleton: take(&mut self.growth.skeleton),
            boundary: take(&mut self.growth.boundary),
            outcome,
            camera,
            resampled,
            cell,
            cones: self.growth.cones.len(),
            dropped: (dropped.bodies, dropped.volume),
            times: take(&mut self.clock.laps),
        })
    }
}

/// From what the core leaves in its memory to the solid.
fn grow(
    growth: &mut Growth,
    memory: &Memory<'_>,
    solid: &Solid,
    options: &Options,
    clock: &mut Clock,
) -> Result<(), Refusal> {
    let Solid { outcome, camera, .. } = solid;
    match options.mode {
        Mode::Default => growth.grow(camera, &Described::of(memory, outcome), options, clock),
        Mode::Paper { .. } => growth.grow_as_paper(camera, memory),
    }
    clock.lap("grow");
    if growth.cones.is_empty() {
        let erased = |f: &Finding| matches!(f, Finding::SkeletonErased(_));
        return Err(outcome.findings.iter().find(|f| erased(f)).map_or(Refusal::Behind, |f| (*f).into()));
    }
    Ok(())
}

/// How to rectify: around the object, whose box in both raw images must be known for that.
fn rectification(
    [left, right]: [&GrayImage; 2],
    calibration: &StereoCamera,
    options: &Options,
    storage: &mut Storage,
) -> Result<Rectification, Refusal> {
    if let Some(untouched) = Rectification::untouched(calibration) {
        return Ok(untouched);
    }
    // What a camera is set to does not matter where the object lies.
    let settings = core_settings(Optics { focal: PX, disparity_offset: 0 }, options);
    let boxes = [
        object_box(left, Side::Left, &settings, storage)?,
        object_box(right, Side::Right, &settings, storage)?,
    ];
    Ok(Rectification::around(calibration, boxes)?)
}

/// The box of the object in an image, whose mask then stands in the core's memory.
fn object_box(
    image: &GrayImage,
    side: Side,
    settings: &Settings,
    storage: &mut Storage,
) -> Result<PixelBox, Finding> {
    let grey = grey(image)?;
    storage.fit(grey.size().width, grey.size().height)?;
    let Memory { eyes, scratch, kernels, .. } = storage.lend();
    let mask = &mut *eyes[side as usize].mask;
    let found = pipeline::object_box(side, grey, (mask, scratch), (settings, &kernels))?;
    let corner = |p: shared::point::Pixel| Point2::new(f64::from(p.u), f64::from(p.v));
    Ok(PixelBox { min: corner(found.min), max: corner(found.max) })
}

/// The mesh's grid spacing by default, mm: [`cell_px`] at the nearest ball, but no more than [`MAX_CELLS`] along the
/// diagonal, which only a model that is wrong would have.
fn default_cell(camera: &RectifiedCamera, cones: &[RoundCone], radii: &mut [f64]) -> f64 {
    let balls = || cones.iter().flat_map(|c| c.centres.into_iter().zip(c.radii));
    let depth = balls().map(|(c, _)| c.z).fold(f64::INFINITY, f64::min);
    let low =
        balls().fold(Point3::from([f64::INFINITY; 3]), |low, (c, r)| low.inf(&(c - Vector3::repeat(r))));
    let high =
        balls().fold(Point3::from([-f64::INFINITY; 3]), |high, (c, r)| high.sup(&(c + Vector3::repeat(r))));
    let pixel = depth / camera.f;
    (cell_px(radii, pixel) * pixel).max((high - low).norm() / MAX_CELLS)
}

/// The grid spacing in pixels of `pixel` mm, for the radii of a skeleton, mm, which are put into another order.
///
/// The edges of faces are 0.6 cells long, and the middle of one stays behind a ball by its square over eight radii.
/// That is what a contour may be wrong by, [`SAG`], at 0.82 times the root of the radius, all in pixels. The radius
/// is that which nineteen of twenty points of the skeleton exceed, so that the thinner limbs decide.
fn cell_px(radii: &mut [f64], pixel: f64) -> f64 {
    let twentieth = radii.len() / 20;
    if radii.is_empty() {
        return CELL_PX[0];
    }
    let (_, &mut thin, _) = radii.select_nth_unstable_by(twentieth, f64::total_cmp);
    ((8.0 * SAG * thin / pixel).sqrt() / EDGE_CELLS).clamp(CELL_PX[0], CELL_PX[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thick_limbs_have_wide_faces_and_thin_ones_keep_theirs() {
        let pixel = 0.5;
        // The tip of a limb is less than a twentieth of it.
        let cell = |px: f64| cell_px(&mut [vec![1e-3; 4], vec![px * pixel; 96]].concat(), pixel);
        assert_eq!([1.0, 5.0, 40.0].map(cell), [2.0, 2.0, 3.0]);
        let between = cell(9.0);
        assert!((0.6 * between).powi(2) / (8.0 * 9.0) < 0.03 + 1e-9 && between > 2.4, "{between}");
        assert_eq!(cell_px(&mut [], pixel), 2.0);
    }
}
