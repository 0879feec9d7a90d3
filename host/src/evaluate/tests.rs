use super::*;
use crate::shape::Shape;
use crate::view::Pinhole;

#[test]
fn timing() {
    for shape in [Shape::Torus, Shape::Teapot] {
        let truth = shape.mesh(shape.cell());
        let mut model = truth.clone();
        for v in &mut model.vertices {
            *v += nalgebra::Vector3::new(1.0, 0.5, -2.0);
        }
        let t = std::time::Instant::now();
        let e = evaluate(&model, &truth, &Pinhole::pair(), &Options::default());
        println!("{:?} {}", t.elapsed(), serde_json::to_string(&e).unwrap());
    }
}
