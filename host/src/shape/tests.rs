use super::*;

#[test]
fn pictures() {
    use std::time::Instant;
    for shape in Shape::ALL {
        let t = Instant::now();
        let mesh = shape.mesh(shape.cell());
        let t1 = t.elapsed();
        let t = Instant::now();
        let images = crate::render::render(&mesh, &crate::view::Pinhole::pair());
        println!("{shape:12} {:6} faces mesh {:?} render {:?}", mesh.faces.len(), t1, t.elapsed());
        for (image, side) in images.iter().zip(["left", "right"]) {
            image.save(format!("/tmp/shapes_{shape}_{side}.png")).unwrap();
        }
    }
}
