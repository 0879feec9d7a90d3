use super::*;
use clap::Parser;
use image::Luma;
use shared::arena::Arena;
use shared::bitmap::{Bitmap, Size};
use shared::stage::boundary::{Element, boundary};
use shared::stage::distance::{self, distance};
use shared::stage::parallel_thinning;
use shared::stage::thinning::thin;

#[derive(Parser)]
struct Cli {
    #[command(flatten)]
    args: Args,
}

fn args(words: &[&str]) -> Args {
    Cli::parse_from([&["inspect"], words].concat()).args
}

/// A key: a ring with a shaft and two teeth, on a width that is no multiple of a word.
fn key() -> GrayImage {
    GrayImage::from_fn(97, 40, |u, v| {
        let (x, y) = (f64::from(u) - 20.0, f64::from(v) - 18.0);
        let ring = (6.0..14.0).contains(&x.hypot(y));
        let shaft = (30..90).contains(&u) && (15..22).contains(&v);
        let teeth = (v > 20 && v < 31) && ((70..76).contains(&u) || (82..88).contains(&u));
        Luma([if ring || shaft || teeth { 255 } else { 0 }])
    })
}

fn pixels(image: &GrayImage) -> Vec<(u32, u32)> {
    image.enumerate_pixels().filter(|(.., p)| p.0[0] != 0).map(|(u, v, _)| (u, v)).collect()
}

fn set(bitmap: &Bitmap<'_>) -> Vec<(u32, u32)> {
    bitmap.pixels().map(|p| (p.u.into(), p.v.into())).collect()
}

#[test]
fn thinning_is_the_cores_for_every_rule() {
    let image = key();
    let size = Size::new(97, 40).unwrap();
    for (name, rule) in crate::report::words::RULES {
        let made = make(&args(&["--stage", "thinning", "--rule", name, "--repeat", "2", "key.png"]), &image)
            .unwrap();
        let mut words = vec![0; size.words()];
        let mut bitmap = Bitmap::new(size, &mut words).unwrap();
        pixels(&image).into_iter().for_each(|(u, v)| bitmap.put(u as usize, v as usize, true));
        let mut data = vec![0; size.pixels()];
        let mut parabolas = vec![distance::Parabola::default(); distance::scratch_parabolas(97)];
        let plane = distance(&bitmap, &mut data, &mut parabolas).unwrap();
        thin(&mut bitmap, (rule, parallel_thinning::thin), &plane, Arena::new(&mut vec![7; 1 << 15]))
            .unwrap();
        assert_eq!(pixels(&made.rasters.skeleton), set(&bitmap), "{name}");
        assert_eq!(made.times.len(), 2);
    }
}

#[test]
fn boundary_and_distance_are_the_cores() {
    let image = key();
    let size = Size::new(97, 40).unwrap();
    let (mut words, mut out) = (vec![0; size.words()], vec![0; size.words()]);
    let mut bitmap = Bitmap::new(size, &mut words).unwrap();
    pixels(&image).into_iter().for_each(|(u, v)| bitmap.put(u as usize, v as usize, true));
    let made = make(&args(&["--stage", "boundary", "key.png"]), &image).unwrap();
    assert_eq!(pixels(&made.rasters.boundary), set(&boundary(&bitmap, Element::Square, &mut out).unwrap()));
    let made = make(&args(&["--stage", "distance", "key.png"]), &image).unwrap();
    let mut data = vec![0; size.pixels()];
    let mut parabolas = vec![distance::Parabola::default(); distance::scratch_parabolas(97)];
    distance(&bitmap, &mut data, &mut parabolas).unwrap();
    assert_eq!(made.rasters.distance.as_raw(), &data);
}

#[test]
fn every_stage_can_be_drawn() {
    for stage in Stage::value_variants() {
        let name = stage.to_possible_value().unwrap();
        let made = make(&args(&["--stage", name.get_name(), "key.png"]), &key()).unwrap();
        assert!(draw(*stage, &made).is_some(), "{stage:?}");
    }
}

#[test]
fn files_come_out_as_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).display().to_string();
    key().save(path("key.png")).unwrap();
    run(&args(&["--stage", "distance", "--json", "--raw", &path("raw.png"), &path("key.png")])).unwrap();
    assert!(matches!(image::open(path("raw.png")).unwrap(), DynamicImage::ImageLuma16(_)));
    run(&args(&["--stage", "binarise", "--raw", &path("mask.png"), &path("key.png")])).unwrap();
    assert_eq!(image::open(path("mask.png")).unwrap().to_luma8(), key());
    let error = run(&args(&[
        "--stage",
        "binarise",
        "--out",
        &path("a.png"),
        "--raw",
        &path("none/b.png"),
        &path("key.png"),
    ]));
    assert!(error.unwrap_err().to_string().contains("b.png") && !folder.path().join("a.png").exists());
    let error = run(&args(&["--stage", "hull", "--raw", &path("no.png"), &path("key.png")])).unwrap_err();
    assert!(error.downcast_ref::<clap::Error>().is_some());
}
