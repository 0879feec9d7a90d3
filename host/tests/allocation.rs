//! Once a workspace is warm, the stages of the core and of the host allocate nothing for another pair.

use allocation_counter::measure;
use host::calibration::{Lens, StereoCamera};
use host::reconstruct::{Front, Mode, Options, Profile, Radius, Skeleton, Workspace};
use host::render::render;
use host::shape::Shape;
use host::view::Calibrated;
use nalgebra::{Rotation3, Vector3};

/// Cameras of a rectified pair.
fn straight() -> StereoCamera {
    StereoCamera::rectified(320, 240, 375.0, 60.0)
}

/// Cameras whose pictures have to be resampled.
fn turned() -> StereoCamera {
    let mut pair = straight();
    pair.rotation = Rotation3::from_euler_angles(0.01, 0.1, -0.01).into_inner();
    pair.translation = Vector3::new(-60.0, 1.0, 4.0);
    let mut lens = [0.0; 12];
    lens[0] = -0.1;
    pair.left.lens = Lens::Polynomial(lens);
    pair
}

#[test]
fn a_warm_workspace_allocates_nothing() {
    let default = Options::default();
    let ways = [
        ("default", straight(), default),
        ("rectified", turned(), default),
        ("nurbs", straight(), Options { skeleton: Skeleton::Nurbs, ..default }),
        ("boundary", straight(), Options { radius: Radius::Boundary, ..default }),
        ("device", straight(), Options { profile: Profile::Device, ..default }),
        ("front", turned(), Options { front: Front::Grey, ..default }),
        ("gated front", straight(), Options { front: Front::Auto, ..default }),
        ("paper", straight(), Options { mode: Mode::Paper { omega: 3 }, ..default }),
    ];
    // Allocations are counted on the thread that measures, so that one has to do all the work.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    for (name, calibration, options) in ways {
        let images = render(&Shape::Torus.mesh(3.0), &Calibrated::pair(&calibration));
        let views = [&images[0], &images[1]];
        pool.install(|| {
            let mut workspace = Workspace::default();
            let mut make = || {
                let made = workspace.reconstruct(views, &calibration, &options, &mut ());
                workspace.recycle(made.unwrap_or_else(|refusal| panic!("{name}: {refusal}")));
            };
            assert!(measure(&mut make).count_total > 0, "{name}: nothing is counted");
            // Some lists change places from pair to pair: both of them must have grown.
            make();
            assert_eq!(measure(&mut make).count_total, 0, "{name}");
        });
    }
}
