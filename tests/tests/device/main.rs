//! The device's loop on a PC: what it says is what the PC makes of the same pictures, commands are answered,
//! light that changes is followed, and whatever breaks is counted and gone on from.
//!
//! `-- --nocapture` prints the figures.

mod counters;
mod faults;
mod light;
mod orders;
mod pairs;

use firmware::camera::pair::{Module, Pair as Modules};
use firmware::device::{Condition, Event, HEALTH_US};
use firmware::ports::{CameraError, CameraFault, CameraPair, Clock, FlashError, LinkError, Side, Stamps};
use host::calibration::{Camera, Lens, StereoCamera};
use host::shape::Shape as Solid;
use host::stage::rectify::{Eye, Rectification};
use image::{GrayImage, Luma};
use nalgebra::{Point2, Rotation3, Vector3};
use oracle::camera::{Bench as CameraBench, ControlBus, PictureBus, SIZE, Scene, Time, Wiring};
use oracle::core::Core;
use oracle::device::{Bench, Description, Ears, Eyes, Heard, Page, Report, Shared, World};
use oracle::link::{frame, frames};
use oracle::scene::{camera, pair};
use proptest::prelude::*;
use shared::camera::PairModel;
use shared::fixed::PX;
use shared::pipeline::{Finding, Observer, Product, Settings};
use shared::stage::binarise::{Polarity, Threshold};
use shared::stage::depth::Optics;
use shared::wire::{
    self, ErrorCode, ExposureSetting, PairReport, PictureKind, ResetReason, Shape, ToDevice, ToHost,
    calibration_crc,
};

/// The calibration of pictures that are rectified as they are.
fn plain() -> PairModel {
    Rectification::same_size(&camera(2)).unwrap().model()
}

/// What both eyes see of a solid when nothing has to be rectified.
fn scenes(solid: Solid) -> [Scene; 2] {
    pair(solid, 2).map(GrayImage::into_raw)
}

/// Two modules with lenses, not quite alike and not quite parallel.
fn modules() -> StereoCamera {
    let lens = Lens::Polynomial([-0.25, 0.08, 1e-3, -5e-4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let left =
        Camera { width: 320, height: 240, fx: 340.0, fy: 341.0, cx: 162.0, cy: 118.0, skew: 0.0, lens };
    let right = Camera { fx: 338.0, cx: 157.0, cy: 121.0, ..left };
    let turn = Rotation3::from_euler_angles(0.01, 0.04, -0.012);
    StereoCamera {
        left,
        right,
        rotation: turn.into_inner(),
        translation: turn * Vector3::new(-60.0, 0.5, 1.0),
    }
}

/// What the modules see of a solid: each raw pixel shows what the ray through it meets in the rendered pair.
fn raw_scenes(solid: Solid, rectification: &Rectification) -> [Scene; 2] {
    let (f, [cx, cx_right], cy) = {
        let camera = rectification.camera();
        (camera.f, [camera.cx, camera.cx_right], camera.cy)
    };
    let rendered = pair(solid, 2);
    [(Eye::Left, cx, &rendered[0]), (Eye::Right, cx_right, &rendered[1])].map(|(eye, cx, picture)| {
        let at = |x: f64, y: f64| {
            let inside = |x: f64, side: u32| (x.max(0.0) as u32).min(side - 1);
            f64::from(picture.get_pixel(inside(x, 320), inside(y, 240)).0[0])
        };
        let seen = GrayImage::from_fn(320, 240, |u, v| {
            let raw = Point2::new(f64::from(u), f64::from(v));
            let there = rectification.rectified_pixel(eye, raw).unwrap();
            let (x, y) = ((there.x - cx) / f * 375.0 + 159.5, (there.y - cy) / f * 375.0 + 119.5);
            let (s, t) = (x - x.floor(), y - y.floor());
            let mix = |a: f64, b: f64, s: f64| a + (b - a) * s;
            let grey = mix(mix(at(x, y), at(x + 1.0, y), s), mix(at(x, y + 1.0), at(x + 1.0, y + 1.0), s), t);
            Luma([grey.round() as u8])
        });
        seen.into_raw()
    })
}

fn bench(scenes: [Scene; 2]) -> (Bench<Eyes>, Shared<World>) {
    let time = Time::default();
    let (eyes, world) = Eyes::new(scenes, time.clone());
    (Bench::new(eyes, time, &Shared::default()), world)
}

/// A device that describes pairs.
fn running(scenes: [Scene; 2], model: PairModel) -> (Bench<Eyes>, Shared<World>) {
    let (mut bench, world) = bench(scenes);
    assert_eq!(bench.ask(&ToDevice::Calibration(model)), Ok(()));
    assert_eq!(bench.ask(&ToDevice::Start), Ok(()));
    (bench, world)
}

/// How many pairs were dropped, by a device that is stopped: with those that came to their end they are all that were
/// begun, of which the pictures that are asked for at last have the number.
#[track_caller]
fn dropped(bench: &mut Bench<Eyes>) -> u32 {
    assert_eq!(bench.ask(&ToDevice::Stop), Ok(()));
    assert_eq!(bench.ask(&ToDevice::Grab(PictureKind::Grey)), Ok(()));
    bench.pictures(PictureKind::Grey);
    let pair = |heard: &Heard| if let Heard::Rows(pair, ..) = heard { Some(*pair) } else { None };
    let begun = bench.heard.iter().rev().find_map(pair).unwrap();
    let health = bench.health();
    assert_eq!(health.pairs + health.dropped, begun, "{health:?}");
    health.dropped
}
