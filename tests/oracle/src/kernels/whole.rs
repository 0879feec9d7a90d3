//! Whole chains: from a pair to what a device sends, to the core's description, to a mesh on disk; and the
//! surface of many balls.

use super::{Entry, Kernel, Scope, shown, step};
use crate::images::{Image, grey};
use crate::raster::Random;
use host::export::ply::write_mesh;
use host::memory::Storage;
use host::mesh::Mesh;
use host::reconstruct::{Options, Workspace};
use host::stage::surface::{Mesher, RoundCone};
use nalgebra::Point3;
use shared::pipeline::{Settings, run};

pub(super) fn entries() -> Vec<Entry> {
    let entry = |name, setup: fn(&Image) -> Box<dyn Kernel>| Entry::new(name, Scope::Pipeline, setup);
    vec![
        entry("shape/full", |image| shape(image, Settings::new(image.optics))),
        entry("shape/device", |image| shape(image, Settings::device(image.optics))),
        entry("mesh", mesh),
        Entry::new("balls_to_mesh", Scope::Alone, |_| surface_of_balls()),
    ]
}

/// What the core describes, with all that it can or as a device.
fn shape(image: &Image, settings: Settings) -> Box<dyn Kernel> {
    let (size, pair) = (image.size(), image.pair.clone());
    let mut storage = Storage::new(size.width, size.height).unwrap();
    step(
        None,
        move |outcome| {
            let [left, right] = pair.each_ref().map(grey);
            *outcome = Some(run(&mut storage.lend(), left, right, &settings, &mut ()).unwrap());
        },
        |outcome| shown(outcome),
    )
}

/// From the cameras' pictures to a closed mesh on disk.
fn mesh(image: &Image) -> Box<dyn Kernel> {
    let (raw, camera) = (image.raw.clone(), image.camera);
    let folder = tempfile::tempdir().unwrap();
    let mut workspace = Workspace::default();
    step(
        folder.path().join("model.ply"),
        move |path| {
            let _kept = &folder;
            let views = raw.each_ref();
            let model = workspace.reconstruct(views, &camera, &Options::default(), &mut ()).unwrap();
            write_mesh(path, &model.mesh, &[]).unwrap();
            workspace.recycle(model);
        },
        |path| std::fs::read(path).unwrap_or_default(),
    )
}

/// 500 balls along a walk within the unit cube: centres and radii.
pub fn balls() -> Vec<([f64; 3], f64)> {
    let mut random = Random(500);
    let mut share = || random.below(1 << 20) as f64 / f64::from(1 << 20);
    let mut at = [0.5; 3];
    (0..500)
        .map(|_| {
            at = at.map(|x: f64| (x + 0.12 * (share() - 0.5)).clamp(0.15, 0.85));
            (at, 0.03 + 0.05 * share())
        })
        .collect()
}

/// Their surface, at a cell with which it is as true as the surface nets of 128^3 points and has as many
/// vertices: middles of faces lie 0.076 / 128 off the balls (the square root of the mean square by area; the
/// mean is 0.044 / 128) with 65,858 vertices, those of the surface nets 0.077 / 128 (0.059 / 128) with 69,176.
fn surface_of_balls() -> Box<dyn Kernel> {
    let cones: Vec<_> = balls()
        .into_iter()
        .map(|(centre, radius)| RoundCone { centres: [Point3::from(centre); 2], radii: [radius; 2] })
        .collect();
    step(
        (Mesher::default(), Mesh::default()),
        move |(mesher, mesh)| mesher.surface(&cones, 1.4 / 128.0, mesh).unwrap(),
        |(_, mesh)| {
            let counts = [mesh.vertices.len(), mesh.faces.len()];
            counts.iter().flat_map(|n| (*n as u64).to_le_bytes()).collect()
        },
    )
}
