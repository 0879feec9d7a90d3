//! What the user knows about the scene, applied to both views before anything else looks at them.
//!
//! In: the views of a pair as they were taken, and their calibration. Out: views in which the object stands
//! out, and a calibration for them.
//!
//! * A background, the same scene without the object, is taken away: what remains is the absolute
//!   difference, in which the object is bright whatever it was before.
//! * A region cuts both views to the same rectangle; principal points move with it, so the model stays where
//!   it was. What is outside counts neither for the threshold nor for the background's tone.

use std::fmt;
use std::path::Path;
use std::str::FromStr;

use image::GrayImage;
use serde::Serialize;

use super::find::{FindError, find};
use super::picture::PictureError;
use super::{Layout, Views};
use crate::calibration::{CalibrationError, Camera, StereoCamera};

/// Shortest side of a region, px: a smaller one holds no object that is accepted.
const MIN_SIDE: u32 = 16;

/// A rectangle of both views, px.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Region {
    /// First column.
    pub x: u32,
    /// First row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Region {
    /// Whether all of it lies in views of this size, px.
    #[must_use]
    pub fn is_within(&self, width: u32, height: u32) -> bool {
        let ends =
            |start: u32, length: u32, side: u32| start.checked_add(length).is_some_and(|end| end <= side);
        ends(self.x, self.width, width) && ends(self.y, self.height, height)
    }
}

impl fmt::Display for Region {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{},{},{},{}", self.x, self.y, self.width, self.height)
    }
}

impl FromStr for Region {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let sides: Option<Vec<u32>> = text.split(',').map(|side| side.trim().parse().ok()).collect();
        match sides.as_deref() {
            Some(&[x, y, width, height]) if width >= MIN_SIDE && height >= MIN_SIDE => {
                Ok(Self { x, y, width, height })
            }
            _ => Err(format!("give X,Y,W,H in pixels, at least {MIN_SIDE} wide and high")),
        }
    }
}

/// What was done to the views, for the report.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Known {
    /// Whether a background was taken away.
    pub background: bool,
    /// The region that was looked at.
    pub region: Option<Region>,
}

/// Why views cannot be worked on.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// Not of one scene.
    #[error(
        "the background is {}x{} px but the {eye} view {}x{}; take both with the same camera at one size",
        background.0, background.1, view.0, view.1
    )]
    Background {
        /// Which view.
        eye: &'static str,
        /// The background's size, px.
        background: (u32, u32),
        /// The view's, px.
        view: (u32, u32),
    },
    /// The region reaches beyond the view.
    #[error(
        "the region ends at column {right} and row {bottom}, but a view has {width}x{height} px; give a smaller --roi"
    )]
    Region {
        /// One past its last column.
        right: u64,
        /// One past its last row.
        bottom: u64,
        /// Columns of the view.
        width: u32,
        /// Rows of the view.
        height: u32,
    },
    /// The views do not belong to the calibration.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
}

/// Why there is no background.
#[derive(Debug, thiserror::Error)]
pub enum BackgroundError {
    /// Nothing is named so.
    #[error(transparent)]
    Find(#[from] FindError),
    /// More than one pair is.
    #[error(
        "{named} holds {count} pairs, but one is to be the background; give one image with both views, LEFT,RIGHT or \
         a folder with one pair"
    )]
    Many {
        /// What was named.
        named: String,
        /// Pairs that it holds.
        count: usize,
    },
    /// An image cannot be read.
    #[error(transparent)]
    Picture(#[from] PictureError),
}

/// The views of an empty scene: an image that holds both, a folder with one pair, or `left.png,right.png`.
///
/// # Errors
///
/// See [`BackgroundError`].
pub fn background(named: &str, layout: Option<Layout>) -> Result<Views, BackgroundError> {
    let files = named.split_once(',').filter(|_| !Path::new(named).exists());
    let inputs =
        files.map_or_else(|| vec![named.to_owned()], |(left, right)| vec![left.into(), right.into()]);
    let layout = layout.filter(|_| inputs.len() == 1);
    match find(&inputs, layout)?.pairs.as_slice() {
        [pair] => Ok(pair.load()?),
        pairs => Err(BackgroundError::Many { named: named.into(), count: pairs.len() }),
    }
}

/// What is known.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Left and right view of the empty scene.
    pub background: Option<[GrayImage; 2]>,
    /// Where the object is.
    pub region: Option<Region>,
}

impl Scene {
    /// The views to work on, and their calibration.
    ///
    /// # Errors
    ///
    /// See [`SceneError`].
    pub fn apply(
        &self,
        views: [GrayImage; 2],
        calibration: &StereoCamera,
    ) -> Result<([GrayImage; 2], StereoCamera), SceneError> {
        for (camera, view) in [(&calibration.left, &views[0]), (&calibration.right, &views[1])] {
            camera.check_size(view.width(), view.height())?;
        }
        let mut views = views;
        for (eye, view) in views.iter_mut().enumerate() {
            let Some(background) = &self.background else { break };
            take_away(["left", "right"][eye], view, &background[eye])?;
        }
        let Some(region) = &self.region else { return Ok((views, *calibration)) };
        let [left, right] = [(&views[0], calibration.left), (&views[1], calibration.right)]
            .map(|(view, camera)| cut(region, view, camera));
        let ((left, left_camera), (right, right_camera)) = (left?, right?);
        Ok(([left, right], StereoCamera { left: left_camera, right: right_camera, ..*calibration }))
    }
}

fn take_away(eye: &'static str, view: &mut GrayImage, background: &GrayImage) -> Result<(), SceneError> {
    if view.dimensions() != background.dimensions() {
        return Err(SceneError::Background {
            eye,
            background: background.dimensions(),
            view: view.dimensions(),
        });
    }
    for (value, empty) in view.iter_mut().zip(background.iter()) {
        *value = value.abs_diff(*empty);
    }
    Ok(())
}

fn cut(region: &Region, view: &GrayImage, camera: Camera) -> Result<(GrayImage, Camera), SceneError> {
    let Region { x, y, width, height } = *region;
    if !region.is_within(view.width(), view.height()) {
        let (right, bottom) = (u64::from(x) + u64::from(width), u64::from(y) + u64::from(height));
        return Err(SceneError::Region { right, bottom, width: view.width(), height: view.height() });
    }
    let (cx, cy) = (camera.cx - f64::from(x), camera.cy - f64::from(y));
    let part = image::imageops::crop_imm(view, x, y, width, height).to_image();
    Ok((part, Camera { width, height, cx, cy, ..camera }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reconstruct::{Options, reconstruct};
    use crate::render::render;
    use crate::shape::Shape;
    use crate::view::Calibrated;
    use image::Luma;
    use nalgebra::center;

    fn camera() -> StereoCamera {
        StereoCamera::rectified(320, 240, 375.0, 60.0)
    }

    fn capsule() -> [GrayImage; 2] {
        render(&Shape::Capsule.mesh(4.0), &Calibrated::pair(&camera())).try_into().unwrap()
    }

    /// Size and middle of the model, mm.
    fn model(views: &[GrayImage; 2], camera: &StereoCamera) -> [f64; 6] {
        let made =
            reconstruct(views[0].clone(), views[1].clone(), camera, &Options::default(), &mut ()).unwrap();
        let [low, high] = made.mesh.bounds().unwrap();
        let (size, middle) = (high - low, center(&low, &high));
        [size.x, size.y, size.z, middle.x, middle.y, middle.z]
    }

    fn assert_near(got: [f64; 6], wanted: [f64; 6], mm: f64) {
        for (got, wanted) in got.iter().zip(wanted) {
            assert!((got - wanted).abs() < mm, "{got} is not {wanted}");
        }
    }

    #[test]
    fn an_object_on_a_desk_is_found_by_what_it_hides() {
        let plain = model(&capsule(), &camera());
        // A desk with stripes, a bright half and, at the side, paper as bright as the object.
        let desk = GrayImage::from_fn(320, 240, |u, v| {
            let paper = u > 250;
            Luma([if paper { 220 } else { 10 + (u / 40 % 2) as u8 * 12 + (v > 120) as u8 * 8 }])
        });
        // The renderer's object is brighter by far than the stripes that it hides.
        let put = |view: &GrayImage| {
            GrayImage::from_fn(320, 240, |u, v| Luma([view[(u, v)].0[0].max(desk[(u, v)].0[0])]))
        };
        let views = capsule().each_ref().map(put);
        let options = Options::default();
        let bare = reconstruct(views[0].clone(), views[1].clone(), &camera(), &options, &mut ());
        let far = |made: &crate::reconstruct::Reconstruction| {
            let [low, high] = made.mesh.bounds().unwrap();
            (high.x - low.x - plain[0]).abs() > 5.0
        };
        assert!(bare.as_ref().is_err() || bare.as_ref().is_ok_and(far), "the desk alone must not do");
        let scene = Scene { background: Some([desk.clone(), desk.clone()]), region: None };
        let (cleared, calibration) = scene.apply(views, &camera()).unwrap();
        assert_near(model(&cleared, &calibration), plain, 2.0);
    }

    #[test]
    fn a_region_leaves_the_model_where_it_is() {
        let mut views = capsule();
        let plain = model(&capsule(), &camera());
        // Something else, much larger, at the side.
        for view in &mut views {
            for v in 0..240 {
                for u in 0..60 {
                    view.put_pixel(u, v, Luma([255]));
                }
            }
        }
        let scene = Scene { background: None, region: Some("64,2,250,234".parse().unwrap()) };
        let (cut, calibration) = scene.apply(views, &camera()).unwrap();
        assert_eq!(cut[0].dimensions(), (250, 234));
        assert_near(model(&cut, &calibration), plain, 0.2);
    }

    #[test]
    fn what_does_not_fit_is_told() {
        let told = |scene: Scene| scene.apply(capsule(), &camera()).unwrap_err().to_string();
        let large = Scene { background: None, region: Some("300,0,30,30".parse().unwrap()) };
        assert!(told(large).contains("column 330"));
        let other = Scene { background: Some([GrayImage::new(4, 4), GrayImage::new(4, 4)]), region: None };
        assert!(told(other).contains("4x4 px but the left view 320x240"));
        let huge: Region = format!("{0},{0},{0},{0}", u32::MAX).parse().unwrap();
        assert!(told(Scene { background: None, region: Some(huge) }).contains("smaller --roi"));
        for text in ["", "1,2,3", "1,2,3,4", "a,0,20,20", "-1,0,20,20", "0,0,20,20,20"] {
            assert!(text.parse::<Region>().is_err(), "{text}");
        }
        let wrong = StereoCamera::rectified(640, 480, 750.0, 60.0);
        assert!(Scene::default().apply(capsule(), &wrong).unwrap_err().to_string().contains("640x480"));
    }

    #[test]
    fn a_background_is_one_pair() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name).display().to_string();
        for name in ["left_1.png", "right_1.png", "left_2.png", "right_2.png"] {
            GrayImage::new(4, 2).save(path(name)).unwrap();
        }
        let both = format!("{},{}", path("left_1.png"), path("right_1.png"));
        assert_eq!(background(&both, None).unwrap().images[1].dimensions(), (4, 2));
        let error = background(&path(""), None).unwrap_err().to_string();
        assert!(error.contains("holds 2 pairs"), "{error}");
        GrayImage::new(8, 2).save(path("both.png")).unwrap();
        assert_eq!(background(&path("both.png"), None).unwrap().images[0].dimensions(), (4, 2));
        assert!(background(&path("none.png"), None).is_err());
    }
}
