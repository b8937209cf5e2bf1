//! The methods on the scenes of this repository: against Mitsuba 3, against each other class by class, and against
//! themselves on other numbers of threads.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use common::METHODS;
use pathblend::image::{Image, Layer, luminance};
use pathblend::integrators::{Budget, Method, Settings, render};
use pathblend::load;
use pathblend::scene::Scene;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

const SCENES: [&str; 12] =
    ["box", "spheres", "plates", "door", "torus", "ring", "lamp", "gallery", "pool", "bokeh", "porch", "window"];
/// Side of the references, and of the tiles that they are compared in.
const SIDE: usize = 64;
const TILE: usize = 16;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn scene(name: &str, size: [usize; 2]) -> Scene {
    let file = root().join("scenes").join(name).join("scene.xml");
    let options = load::Options { size: Some(size), ..load::Options::default() };
    let mut scene = load::read(&file, &options).expect("own scenes load").scene;
    scene.max_depth = 9;
    scene
}

fn image(scene: &Scene, method: Method, seed: u64, passes: u64) -> Image {
    let settings = Settings {
        seed,
        max_depth: scene.max_depth,
        features: true,
        budget: Budget::Passes(passes),
        ..Settings::default()
    };
    render(scene, method, &settings, |_| {}).image
}

/// Mean luminance of each tile.
fn tiles(colour: &ndarray::Array3<f32>) -> Vec<f64> {
    let per_side = SIDE / TILE;
    let mut sums = vec![0.0; per_side * per_side];
    for y in 0..SIDE {
        for x in 0..SIDE {
            let pixel = luminance([colour[[y, x, 0]], colour[[y, x, 1]], colour[[y, x, 2]]]);
            sums[y / TILE * per_side + x / TILE] += f64::from(pixel) / (TILE * TILE) as f64;
        }
    }
    sums
}

/// Mean and standard error of `values`.
fn moments(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    let variance = values.map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

/// Tile means of the image by Mitsuba and the variances of these means.
fn reference(name: &str) -> (Vec<f64>, Vec<f64>) {
    let read = |file: String| Image::read(&root().join("tests/reference").join(file)).expect("a reference").colour;
    let mean = tiles(&read(format!("{name}.exr")));
    // Pixels of a box-filtered image are independent; channels are taken as fully correlated, which errs to the safe
    // side: the variance of a luminance is then the squared luminance of the deviations.
    let deviations = read(format!("{name}_var.exr")).mapv(f32::sqrt);
    let squares = ndarray::Array3::from_shape_fn(deviations.dim(), |(y, x, _)| {
        let d = luminance([deviations[[y, x, 0]], deviations[[y, x, 1]], deviations[[y, x, 2]]]);
        d * d
    });
    let variance = tiles(&squares).into_iter().map(|v| v / (TILE * TILE) as f64).collect();
    (mean, variance)
}

/// No correct program fails this more than once in 10⁴ runs: 160 comparisons by 9 standard errors of which most comes
/// from 16 runs (Student's t with 15 degrees of freedom: 2·10⁻⁷ each). Half a percent is granted beside noise for half
/// floats, Mitsuba's single precision and the noise that heavy tails hide from a variance.
#[test]
fn path_tracing_agrees_with_mitsuba_on_every_scene() {
    for name in SCENES {
        agrees_with_mitsuba(name, name, Method::Path, 24);
    }
}

/// Caustics as Mitsuba's light tracer finds them, without what is seen in mirrors and through glass.
#[test]
fn light_tracing_agrees_with_mitsuba_where_there_are_caustics() {
    for name in ["spheres", "torus", "ring", "lamp", "pool"] {
        agrees_with_mitsuba(name, &format!("{name}_light"), Method::Light, 48);
    }
}

#[track_caller]
fn agrees_with_mitsuba(name: &str, file: &str, method: Method, passes: u64) {
    let scene = scene(name, [SIDE, SIDE]);
    let runs: Vec<Vec<f64>> = (0..16).map(|seed| tiles(&image(&scene, method, seed, passes).colour)).collect();
    let (expected, variance) = reference(file);
    let mut worst = 0f64;
    for tile in 0..expected.len() {
        let (mean, error) = moments(runs.iter().map(|run| run[tile]));
        let error = (error * error + variance[tile]).sqrt();
        let difference = (mean - expected[tile]).abs();
        worst = worst.max((difference - 0.005 * expected[tile]) / error.max(f64::MIN_POSITIVE));
        assert!(
            difference <= 9.0 * error + 0.005 * expected[tile],
            "{name}, tile {tile}: {mean}, Mitsuba {}: {:.1} standard errors",
            expected[tile],
            difference / error
        );
    }
    println!("{file}: worst tile {worst:.1} standard errors beyond half a percent");
}

fn layers(image: &Image) -> BTreeMap<String, f64> {
    let mean = |layer: &ndarray::Array2<f32>| layer.iter().map(|v| f64::from(*v)).sum::<f64>() / layer.len() as f64;
    let mut means = BTreeMap::new();
    for (name, layer) in &image.layers {
        if let Layer::Luminance(layer) = layer {
            means.insert(name.clone(), mean(layer));
        }
    }
    means.insert("all".to_owned(), means.values().sum());
    means
}

#[test]
fn classes_add_up_to_the_image() {
    for method in METHODS {
        let image = image(&scene("spheres", [32, 32]), method, 1, 2);
        for ((y, x, c), _) in image.colour.indexed_iter().filter(|((_, _, c), _)| *c == 0) {
            let colour = [c, 1, 2].map(|c| image.colour[[y, x, c]]);
            let sum: f32 = image
                .layers
                .values()
                .map(|layer| match layer {
                    Layer::Luminance(layer) => layer[[y, x]],
                    Layer::Colour(_) => 0.0,
                })
                .sum();
            assert!((sum - luminance(colour)).abs() <= 1e-5 * sum.max(1e-3), "{method:?} at {x}, {y}");
        }
    }
}

#[test]
fn the_number_of_threads_does_not_show() {
    for name in ["spheres", "bokeh"] {
        let scene = scene(name, [40, 24]);
        for method in METHODS {
            let on = |threads: usize| {
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
                let image = pool.install(|| image(&scene, method, 7, 3));
                (image.colour, image.layers)
            };
            let one = on(1);
            assert!(one == on(2) && one == on(5), "{method:?} on {name}");
        }
    }
}

/// Mean and standard error of each class's light.
type Classes = BTreeMap<String, (f64, f64)>;

fn classes(scene: &Scene, method: Method, passes: u64, runs: u64) -> Classes {
    let runs: Vec<BTreeMap<String, f64>> = (0..runs).map(|seed| layers(&image(scene, method, seed, passes))).collect();
    let class = |name: &str| moments(runs.iter().map(|run| run.get(name).copied().unwrap_or(0.0)));
    let names: BTreeSet<&String> = runs.iter().flat_map(|run| run.keys()).collect();
    names.into_iter().map(|name| (name.clone(), class(name))).collect()
}

fn class(of: &Classes, name: &str) -> (f64, f64) {
    of.get(name).copied().unwrap_or((0.0, 0.0))
}

/// How far classes are from where they should be, in standard errors.
#[derive(Default)]
struct Deviations {
    count: usize,
    /// The worst class: its name, its standard errors, its relative deviation.
    worst: (String, f64, f64),
}

impl Deviations {
    fn add(&mut self, class: &str, z: f64, relative: f64) {
        self.count += 1;
        if z > self.worst.1 {
            self.worst = (class.to_owned(), z, relative);
        }
    }
}

/// The classes with a thousandth of the light at least.
fn large(classes: &Classes) -> impl Iterator<Item = (&String, &(f64, f64))> {
    classes.iter().filter(|(_, class)| class.0 >= 1e-3 * classes["all"].0)
}

/// The worst deviations of each method on each scene, printed as they come.
struct Table(Vec<(&'static str, Method, Deviations)>);

impl Table {
    fn new() -> Self {
        println!("| scene | method | classes | worst | z | deviation | mean ratio |\n|---|---|---|---|---|---|---|");
        Self(Vec::new())
    }

    fn add(&mut self, scene: &'static str, method: Method, ratio: f64, deviations: Deviations) {
        let Deviations { count, worst: (class, z, relative) } = &deviations;
        let (method_name, percent) = (method.name(), 100.0 * relative);
        println!("| {scene} | {method_name} | {count} | {class} | {z:.1} | {percent:+.2} % | {ratio:.4} |");
        self.0.push((scene, method, deviations));
    }

    fn check(self) {
        for (name, method, Deviations { worst: (class, z, _), .. }) in self.0 {
            assert!(z < 9.0, "{name}, {}: class {class} is {z:.1} standard errors off", method.name());
        }
    }
}

/// Classes that carry a thousandth of the light by bdpt, all scenes, against the methods without chains: prints the table
/// that it checks. Takes some forty minutes of one core.
///
/// Of `sppm` and `vcm` it is judged how the bias falls: ten times the passes shrink the radius to 10^(−1/6) of it, and the
/// bias at least in proportion, where it comes from borders.
#[test]
#[ignore = "long: cargo test --release --test own_scenes -- --ignored --nocapture"]
fn methods_agree_class_by_class_on_every_scene() {
    let mut table = Table::new();
    for name in SCENES {
        let scene = scene(name, [48, 48]);
        let bdpt = classes(&scene, Method::Bdpt, 80, 16);
        let all = bdpt["all"].0;
        let path = classes(&scene, Method::Path, 250, 16);
        let mut deviations = Deviations::default();
        for (word, &(truth, error)) in large(&bdpt) {
            // What only a point light makes, no walk from the camera finds.
            if name != "bokeh" || !(word.contains("LS") || word == "all") {
                let (mean, own) = class(&path, word);
                deviations.add(word, (mean - truth).abs() / error.hypot(own), mean / truth - 1.0);
            }
        }
        table.add(name, Method::Path, path["all"].0 / all, deviations);
        for method in [Method::Sppm, Method::Vcm] {
            let [few, many] = [(100, 16), (1000, 8)].map(|(passes, runs)| classes(&scene, method, passes, runs));
            let mut deviations = Deviations::default();
            for (word, &(truth, error)) in large(&bdpt) {
                let ((few, error_few), (many, error_many)) = (class(&few, word), class(&many, word));
                let excess = (many - truth).abs() - 0.8 * (few - truth).abs();
                deviations.add(word, excess / error.hypot(error_many).hypot(0.8 * error_few), many / truth - 1.0);
            }
            table.add(name, method, many["all"].0 / all, deviations);
        }
    }
    table.check();
}

/// The same of the methods with chains. Takes some ten minutes of one core.
///
/// Those classes are judged of which bdpt knows the light to a percent. The others have one technique only and hardly ever
/// find light by it; a chain that comes upon one stays for longer than these runs last, so that most runs miss it and
/// their spread says nothing of that.
#[test]
#[ignore = "long: cargo test --release --test own_scenes -- --ignored --nocapture"]
fn chains_agree_class_by_class_on_every_scene() {
    let mut table = Table::new();
    for name in SCENES {
        let scene = scene(name, [48, 48]);
        let bdpt = classes(&scene, Method::Bdpt, 80, 16);
        for method in [Method::Mmlt, Method::Rjmlt, Method::Mlt, Method::Fused] {
            let found = classes(&scene, method, 150, 16);
            let mut deviations = Deviations::default();
            for (word, &(truth, error)) in large(&bdpt).filter(|(_, (truth, error))| *error < 0.01 * truth) {
                let (mean, own) = class(&found, word);
                deviations.add(word, (mean - truth).abs() / error.hypot(own), mean / truth - 1.0);
            }
            table.add(name, method, found["all"].0 / bdpt["all"].0, deviations);
        }
    }
    table.check();
}

/// The bias of photon mapping shrinks as its radius does.
#[test]
fn the_bias_of_photon_mapping_shrinks_with_passes() {
    let scene = scene("ring", [SIDE, SIDE]);
    let truth: Vec<f64> = {
        let runs: Vec<Vec<f64>> = (100..108).map(|seed| tiles(&image(&scene, Method::Bdpt, seed, 24).colour)).collect();
        (0..runs[0].len()).map(|tile| moments(runs.iter().map(|run| run[tile])).0).collect()
    };
    // Root mean squared deviation of the tile means of eight averaged runs: mostly bias.
    let bias = |passes: u64| {
        let runs: Vec<Vec<f64>> = (0..8).map(|seed| tiles(&image(&scene, Method::Sppm, seed, passes).colour)).collect();
        let squares = (0..truth.len()).map(|tile| (moments(runs.iter().map(|run| run[tile])).0 - truth[tile]).powi(2));
        (squares.sum::<f64>() / truth.len() as f64).sqrt()
    };
    let (few, many) = (bias(2), bias(64));
    println!("deviation from bdpt: {few:.5} after 2 passes, {many:.5} after 64");
    assert!(many < 0.6 * few, "{few} after 2 passes, {many} after 64");
}

#[test]
fn every_scene_has_its_reference() {
    for name in SCENES {
        for file in [format!("scenes/{name}/scene.xml"), format!("tests/reference/{name}.exr")] {
            assert!(PathBuf::from(root()).join(&file).is_file(), "{file}");
        }
    }
}
