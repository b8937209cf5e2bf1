//! Blending two images of 1280 × 720 pixels by the built-in model, on as many threads as there are cores.

#![allow(missing_docs, clippy::expect_used)]

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use pathblend::blend::{self, Classes, Input};
use pathblend::integrators::{Budget, Method, Settings, render};
use pathblend::load;
use std::path::Path;

fn pairs(criterion: &mut Criterion) {
    let model = blend::builtin().expect("the built-in model");
    let mut group = criterion.benchmark_group("blend 1280x720");
    group.sample_size(20);
    // Ten path classes, and hundreds.
    for name in ["box", "spheres"] {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).join("scene.xml");
        let options = load::Options { size: Some([1280, 720]), ..load::Options::default() };
        let scene = load::read(&file, &options).expect("the scene loads").scene;
        let settings =
            Settings { seed: 1, max_depth: 10, features: true, budget: Budget::Passes(2), ..Settings::default() };
        let [a, b] = [Method::Bdpt, Method::Sppm].map(|method| render(&scene, method, &settings, |_| {}).image);
        let run = || blend::apply(&model, Input::new("a", &a), Input::new("b", &b), Classes::Drop).expect("they fit");
        group.throughput(Throughput::Elements(1280 * 720));
        group.bench_function(BenchmarkId::new(name, "pixels"), |b| b.iter_with_large_drop(run));
    }
}

criterion_group!(benches, pairs);
criterion_main!(benches);
