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
    let settings =
        Settings { seed: 1, max_depth: 10, features: true, budget: Budget::Passes(4), ..Settings::default() };
    for method in [Method::Path, Method::Bdpt, Method::Sppm, Method::Vcm, Method::Pssmlt, Method::Mmlt, Method::Rjmlt] {
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

/// The box as it is, and with every colour as a bitmap: the same picture, so that the difference is the price of looking
/// textures up; with 512 × 512 pixels that of memory beyond the near cache too.
fn textures(criterion: &mut Criterion) {
    let folder = tempfile::tempdir().expect("a folder");
    let text = include_str!("../scenes/box/scene.xml");
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().expect("a thread");
    let settings =
        Settings { seed: 1, max_depth: 10, features: false, budget: Budget::Passes(8), ..Settings::default() };
    let mut group = criterion.benchmark_group("box 128x128, path, one thread");
    group.sample_size(20);
    for (name, side) in [("constant", None), ("bitmaps of 16x16", Some(16)), ("bitmaps of 512x512", Some(512))] {
        let file = folder.path().join("scene.xml");
        let text = side.map_or_else(|| text.to_owned(), |side| textured(text, side, folder.path()));
        std::fs::write(&file, text).expect("a scene");
        let options = load::Options { size: Some([128, 128]), ..load::Options::default() };
        let scene = load::read(&file, &options).expect("the box loads").scene;
        let run = || pool.install(|| render(&scene, Method::Path, &settings, |_| {}));
        group.throughput(Throughput::Elements(run().counts.rays));
        group.bench_function(BenchmarkId::new(name, "rays"), |b| b.iter(run));
    }
}

/// A scene whose reflectances are bitmaps of `side` × `side` pixels, written to `folder`.
fn textured(text: &str, side: u32, folder: &Path) -> String {
    let colour = |value: &str| {
        let rgb: Vec<u8> =
            value.split(',').map(|v| (255.0 * v.trim().parse::<f64>().expect("a number")) as u8).collect();
        let name = format!("{}_{side}.png", value.replace([',', ' '], "_"));
        let pixels = image::RgbImage::from_pixel(side, side, image::Rgb([rgb[0], rgb[1], rgb[2]]));
        pixels.save(folder.join(&name)).expect("a picture");
        let raw = "<boolean name=\"raw\" value=\"true\"/>";
        format!(
            "<texture type=\"bitmap\" name=\"reflectance\"><string name=\"filename\" value=\"{name}\"/>{raw}</texture>"
        )
    };
    let mut textured = String::new();
    let mut rest = text;
    const BEFORE: &str = "<rgb name=\"reflectance\" value=\"";
    while let Some((head, tail)) = rest.split_once(BEFORE) {
        let (value, tail) = tail.split_once("\"/>").expect("the end of the element");
        textured += head;
        textured += &colour(value);
        rest = tail;
    }
    textured + rest
}

criterion_group!(benches, methods, textures);
criterion_main!(benches);
