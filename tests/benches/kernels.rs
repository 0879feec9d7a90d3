//! Each algorithm on its own: `cargo bench -p system-tests --bench kernels [-- FILTER]`, where a filter is a
//! part of `kernel/image`.

use criterion::{Criterion, criterion_group, criterion_main};
use oracle::images;
use oracle::kernels::{self, Scope};
use std::time::Duration;

fn bench(criterion: &mut Criterion) {
    let images = images::all();
    for entry in kernels::all().iter().filter(|entry| entry.scope == Scope::Kernel) {
        let mut group = criterion.benchmark_group(&entry.name);
        group
            .sample_size(20)
            .warm_up_time(Duration::from_millis(100))
            .measurement_time(Duration::from_millis(400));
        for image in &images {
            group.bench_function(&image.name, |bencher| {
                let mut kernel = entry.on(image);
                bencher.iter(|| kernel.run());
            });
        }
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
