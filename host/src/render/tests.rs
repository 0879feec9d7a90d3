use std::f64::consts::PI;

use super::material::{BRIGHTEST, DARKEST, LIGHT};
use super::*;
use crate::shape::Shape;
use crate::view::Pinhole;

/// Semi-axes of a ball's image and, with them, its area: the cone of half angle `alpha` around a ray at
/// `theta` from the optical axis meets the image plane in an ellipse.
fn ellipse_area(view: &Pinhole, middle: &Point3<f64>, radius: f64) -> f64 {
    let axis = middle - view.centre;
    let sin2 = (radius / axis.norm()).powi(2);
    let cos2 = (axis.z / axis.norm()).powi(2);
    let minor = view.focal * (sin2 / (cos2 - sin2)).sqrt();
    let major = view.focal * (sin2 * (1.0 - sin2)).sqrt() / (cos2 - sin2);
    PI * minor * major
}

/// The mesh's chords lose up to 0.06 % of the area, and counting pixels about 0.05 %.
#[test]
fn a_balls_silhouette_has_the_area_of_its_ellipse() {
    let mesh = Shape::Sphere.mesh(3.0);
    let bvh = Bvh::new(&mesh);
    for view in Pinhole::pair() {
        let area = Silhouette::of(&mesh, &bvh, &view).area() as f64;
        let expected = ellipse_area(&view, &Point3::new(30.0, 0.0, 450.0), 60.0);
        assert!((area / expected - 1.0).abs() < 2e-3, "{area} against {expected}");
    }
}

/// A flat face is of one grey, so the sum over its pixels is its area and their mean its middle. It is
/// turned a little, so that its edges cross pixels at all offsets and 4 x 4 rays average out.
#[test]
fn edges_are_right_to_a_hundredth_of_a_pixel() {
    let view = Pinhole::pair()[0];
    let corners = [[200.3, 120.1], [411.9, 148.4], [380.2, 333.7], [187.4, 301.6]];
    let mut vertices = Vec::from(corners.map(|[u, v]| view.centre + 400.0 * view.ray(u, v)));
    vertices.push(view.centre + 500.0 * view.ray(300.0, 230.0));
    let faces = vec![[0, 3, 1], [1, 3, 2], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]];
    let [image] = &render(&Mesh { vertices, faces }, &[view])[..] else { panic!("one view, one image") };

    let grey = DARKEST - (BRIGHTEST - DARKEST) * LIGHT.z;
    let (mut area, mut first) = (0.0, [0.0; 2]);
    for (u, v, pixel) in image.enumerate_pixels() {
        let cover = (f64::from(pixel[0]) - BACKGROUND) / (grey - BACKGROUND);
        area += cover;
        first = [first[0] + cover * f64::from(u), first[1] + cover * f64::from(v)];
    }
    let (mut exact_area, mut exact_first) = (0.0, [0.0; 2]);
    for (i, p) in corners.iter().enumerate() {
        let q = corners[(i + 1) % 4];
        let cross = (p[0] * q[1] - p[1] * q[0]) / 2.0;
        exact_area += cross;
        exact_first = [0, 1].map(|k| exact_first[k] + cross * (p[k] + q[k]) / 3.0);
    }
    let perimeter = 780.0;
    // The flat interior's grey is rounded by up to half a level in 208.
    assert!((area - exact_area).abs() < 0.01 * perimeter + exact_area * 0.5 / 208.0, "{area} {exact_area}");
    for k in 0..2 {
        assert!((first[k] / area - exact_first[k] / exact_area).abs() < 0.01);
    }
}

/// Lambert's law on the exact normal of the ball. The facets themselves would be off by 1.4 levels on
/// the whole; single pixels are off where the mesh has tiny faces.
#[test]
fn a_ball_is_shaded_as_a_ball_and_not_as_facets() {
    let (view, middle) = (Pinhole::pair()[0], Point3::new(30.0, 0.0, 450.0));
    let images = render(&Shape::Sphere.mesh(3.0), &[view]);
    let (mut compared, mut squares) = (0, 0.0);
    for (u, v, pixel) in images[0].enumerate_pixels() {
        let ray = view.ray(f64::from(u), f64::from(v)).normalize();
        let along = middle.coords.dot(&ray);
        let inside = 3600.0 - middle.coords.norm_squared() + along * along;
        if inside < 20.0 * 20.0 {
            continue;
        }
        let normal = (ray * (along - inside.sqrt()) - middle.coords) / 60.0;
        let expected = DARKEST + (BRIGHTEST - DARKEST) * normal.dot(&LIGHT).max(0.0);
        let error = f64::from(pixel[0]) - expected;
        assert!(error.abs() < 8.0, "{u} {v}: {} {expected}", pixel[0]);
        squares += error * error;
        compared += 1;
    }
    let rms = (squares / f64::from(compared)).sqrt();
    assert!(rms < 0.5, "{rms}");
    assert!(compared > 20_000);
}

#[test]
fn a_block_is_flat_up_to_its_edges() {
    let images = render(&Shape::Block.mesh(1.0), &[Pinhole::pair()[0]]);
    let mut counts = [0usize; 256];
    for pixel in images[0].iter() {
        counts[usize::from(*pixel)] += 1;
    }
    let object: usize = counts[140..].iter().sum();
    let mut flat = counts[140..].to_vec();
    flat.sort_unstable_by_key(|&count| std::cmp::Reverse(count));
    // Three faces are seen: three greys, and mixtures on the edges alone.
    assert!(flat[..3].iter().sum::<usize>() as f64 > 0.95 * object as f64);
}

#[test]
fn an_image_is_the_same_for_any_number_of_threads() {
    let mesh = Shape::Mouse.mesh(5.0);
    let images = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads start");
        pool.install(|| render(&mesh, &Pinhole::pair()))
    };
    assert_eq!(images(1), images(2));
}

#[test]
fn nothing_to_see_is_background_and_a_camera_inside_sees_only_object() {
    let [view, _] = Pinhole::pair();
    let empty = render(&Mesh::default(), &[view]);
    assert!(empty[0].iter().all(|&pixel| f64::from(pixel) == BACKGROUND));
    let inside = Pinhole { centre: Point3::new(30.0, 0.0, 450.0), ..view };
    let around = render(&Shape::Sphere.mesh(10.0), &[inside]);
    assert!(around[0].iter().all(|&pixel| f64::from(pixel) >= DARKEST));
}

fn ball_with(material: Material, sensor: Sensor) -> Vec<GrayImage> {
    photograph(&Shape::Sphere.mesh(3.0), material, &Pinhole::pair().map(|view| (view, sensor)))
}

/// Where a ray of the view first meets the ball of the built-in sphere, and the normal there.
fn on_the_ball(view: &Pinhole, u: f64, v: f64) -> Option<[Vector3<f64>; 2]> {
    let (middle, ray) = (Vector3::new(30.0, 0.0, 450.0) - view.centre.coords, view.ray(u, v).normalize());
    let along = middle.dot(&ray);
    let inside = 3600.0 - middle.norm_squared() + along * along;
    // Near the rim a pixel sees many normals.
    (inside > 20.0 * 20.0).then(|| {
        let point = ray * (along - inside.sqrt());
        [view.centre.coords + point, (point - middle) / 60.0]
    })
}

#[test]
fn both_eyes_see_the_same_mark_on_the_same_spot() {
    let plain = ball_with(Material::default(), Sensor::default());
    for pattern in [Pattern::Checks, Pattern::Clouds] {
        let texture = Texture { pattern, size: 12.0, contrast: 0.5 };
        let marked = ball_with(Material { texture, ..Material::default() }, Sensor::default());
        let [left, right] = Pinhole::pair();
        let albedo = |eye: usize, u: u32, v: u32| {
            f64::from(marked[eye].get_pixel(u, v)[0]) / f64::from(plain[eye].get_pixel(u, v)[0])
        };
        let (mut seen, mut alike) = (0, 0);
        let (mut least, mut most) = (1.0_f64, 0.0_f64);
        for (u, v) in (0..640).flat_map(|u| (0..480).map(move |v| (u, v))) {
            let Some([point, _]) = on_the_ball(&left, f64::from(u), f64::from(v)) else { continue };
            let Some((x, y)) = right.project(&point.into()) else { continue };
            if on_the_ball(&right, x, y).is_none() {
                continue;
            }
            let there = albedo(1, x.round() as u32, y.round() as u32);
            let here = albedo(0, u, v);
            (least, most) = (least.min(here), most.max(here));
            seen += 1;
            alike += u32::from((here - there).abs() < 0.06);
        }
        assert!(seen > 15_000 && least < 0.55 && most > 0.97, "{pattern:?}: {seen} {least} {most}");
        // Pixels on the edges of checks are mixed differently.
        assert!(f64::from(alike) > 0.85 * f64::from(seen), "{pattern:?}: {alike} of {seen}");
    }
}

#[test]
fn a_highlight_stands_where_the_normal_is_halfway_between_light_and_eye() {
    let dull = ball_with(Material::default(), Sensor::default());
    let glossy = Material { gloss: 0.35, shininess: 200.0, ..Material::default() };
    let images = ball_with(glossy, Sensor { gain: 0.4, ..Sensor::default() });
    let mut peaks = Vec::new();
    for (eye, view) in Pinhole::pair().iter().enumerate() {
        let gain = |u: u32, v: u32| {
            f64::from(images[eye].get_pixel(u, v)[0]) - 0.4 * f64::from(dull[eye].get_pixel(u, v)[0])
        };
        // The middle of what shines most.
        let (mut sum, mut at) = (0.0, [0.0; 2]);
        for (u, v) in (0..640).flat_map(|u| (0..480).map(move |v| (u, v))) {
            let weight = (gain(u, v) - 25.0).max(0.0);
            sum += weight;
            at = [at[0] + weight * f64::from(u), at[1] + weight * f64::from(v)];
        }
        let at = at.map(|x| x / sum);
        let [_, normal] = on_the_ball(view, at[0], at[1]).expect("on the ball");
        let halfway = (LIGHT.normalize() - view.ray(at[0], at[1]).normalize()).normalize();
        assert!(normal.dot(&halfway) > 0.9995, "{}", normal.dot(&halfway));
        peaks.push(normal);
    }
    // It is not a mark: the two eyes see it on different spots.
    assert!((peaks[0] - peaks[1]).norm() > 0.03);
}

#[test]
fn a_sensor_multiplies_bends_and_clips() {
    let light = vec![0.0, 10.0, 63.75, 127.5, 200.0, 255.0];
    let answer = |sensor: Sensor| sensor.develop([6, 1], light.clone()).into_raw();
    assert_eq!(answer(Sensor::default()), [0, 10, 64, 128, 200, 255]);
    assert_eq!(answer(Sensor { gain: 1.5, ..Sensor::default() }), [0, 15, 96, 191, 255, 255]);
    assert_eq!(answer(Sensor { gamma: 2.0, ..Sensor::default() }), [0, 50, 128, 180, 226, 255]);
}

/// Of a step between two columns: the integral of the Gaussian, which the sum over pixels follows to 0.7 %.
#[test]
fn a_blurred_step_is_the_error_function() {
    let step: Vec<f64> = (0..40 * 40).map(|i| if i % 40 < 20 { 0.0 } else { 200.0 }).collect();
    for sigma in [1.0, 2.5] {
        let image = Sensor { blur: sigma, ..Sensor::default() }.develop([40, 40], step.clone());
        for (u, _, pixel) in image.enumerate_pixels() {
            let expected = 100.0 * (1.0 + libm::erf((f64::from(u) - 19.5) / (sigma * 2.0_f64.sqrt())));
            assert!((f64::from(pixel[0]) - expected).abs() < 2.0, "{u}: {} {expected}", pixel[0]);
        }
    }
}

/// Bounds are four standard errors over 307,200 pixels.
#[test]
fn noise_has_the_asked_for_statistics_and_its_seed_decides_it() {
    let noise = Noise { sigma: 20.0, salt_and_pepper: 0.02, seed: 3 };
    let mut image = GrayImage::from_pixel(640, 480, image::Luma([128]));
    noise.apply(&mut image);
    let share = |test: fn(u8) -> bool| image.iter().filter(|&&p| test(p)).count() as f64 / 307_200.0;
    for share in [share(|p| p == 0), share(|p| p == 255)] {
        assert!((share - 0.01).abs() < 4.0 * 0.00018, "{share}");
    }
    let rest: Vec<f64> = image.iter().filter(|&&p| p != 0 && p != 255).map(|&p| f64::from(p)).collect();
    let mean = rest.iter().sum::<f64>() / rest.len() as f64;
    let variance = rest.iter().map(|p| (p - mean).powi(2)).sum::<f64>() / rest.len() as f64;
    assert!((mean - 128.0).abs() < 4.0 * 0.036, "{mean}");
    // Rounding adds a twelfth to the variance.
    assert!((variance - 400.0 - 1.0 / 12.0).abs() < 4.0 * 1.03, "{variance}");

    let mut again = GrayImage::from_pixel(640, 480, image::Luma([128]));
    noise.apply(&mut again);
    assert_eq!(image, again);
    Noise { seed: 4, ..noise }.apply(&mut again);
    assert_ne!(image, again);
}
