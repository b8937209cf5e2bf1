//! Speed of the methods on the diffuse box, on one thread: samples per second (paths, light and camera paths, or
//! mutations) and rays per second.

#![allow(missing_docs, clippy::expect_used)]

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use pathblend::integrators::{Budget, Method, Settings, render};
use pathblend::load;
use std::path::Path;

fn methods(criterion: &mut Criterion) {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes/box/scene.xml");
    let options = load::Options { size: Some([128, 128]), ..load::Options::default() };
    let scene = load::read(&file, &options).expect("the box loads").scene;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let settings = Settings { seed: 1, max_depth: 10, features: true, budget: Budget::Passes(4) };
    for method in [Method::Path, Method::Bdpt, Method::Sppm, Method::Mmlt] {
        let run = || pool.install(|| render(&scene, method, &settings, |_| {}));
        let counts = run().counts;
        let mut group = criterion.benchmark_group("box 128x128, depth 10, one thread");
        group.sample_size(10);
        for (unit, count) in [("samples", counts.samples), ("rays", counts.rays)] {
            group.throughput(Throughput::Elements(count));
            group.bench_function(BenchmarkId::new(method.name(), unit), |b| b.iter(run));
        }
    }
}

criterion_group!(benches, methods);
criterion_main!(benches);
