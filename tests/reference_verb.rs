//! `reference` and `merge` as a user meets them: interrupted, resumed, stopped by error or time, and given the wrong files.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use assert_cmd::Command;
use pathblend::image::{Image, Layer};
use pathblend::integrators::{Budget, Keep, Method, ReferenceError, Settings, reference, render};
use pathblend::load;
use pathblend::scene::Scene;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).join("scene.xml")
}

fn scene(name: &str) -> Scene {
    let options = load::Options { size: Some([24, 16]), ..load::Options::default() };
    load::read(&file(name), &options).unwrap().scene
}

fn pathblend(folder: &Path, arguments: &[&str]) -> Command {
    let mut command = Command::cargo_bin("pathblend").unwrap();
    command.current_dir(folder).args(arguments);
    command
}

/// Fails with exit code 2 and a message that contains all of `parts`; leaves the folder as it was.
#[track_caller]
fn fails(mut command: Command, folder: &Path, parts: &[&str]) {
    let list = || {
        let mut names: Vec<_> = fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name()).collect();
        names.sort();
        names
    };
    let before = list();
    let output = command.output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{message}");
    for part in parts {
        assert!(message.contains(part), "`{part}` is not in: {message}");
    }
    assert!(!message.contains("panicked"), "{message}");
    assert_eq!(before, list(), "left something behind, or took it away");
}

/// Runs `reference` on the box and gives what it printed.
#[track_caller]
fn refer(folder: &Path, more: &[&str]) -> Value {
    let output = refer_command(folder, more).arg("--json").output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

fn refer_command(folder: &Path, more: &[&str]) -> Command {
    let mut command = pathblend(folder, &["reference", "--size", "24x16", "-o", "out.exr"]);
    command.arg(file("box")).args(more);
    command
}

#[track_caller]
fn render_box(folder: &Path, out: &str, more: &[&str]) {
    let size = if more.contains(&"--size") { &[][..] } else { &["--size", "24x16"] };
    pathblend(folder, &["render", "-o", out]).arg(file("box")).args(size).args(more).assert().success();
}

fn read(folder: &Path, name: &str) -> Image {
    Image::read(&folder.join(name)).unwrap()
}

#[test]
fn a_resumed_render_is_the_same_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["box", "spheres"] {
        let scene = scene(name);
        for method in [Method::Path, Method::Bdpt, Method::Sppm, Method::Vcm] {
            let path = folder.path().join(format!("{name}-{}", method.name()));
            let keep = Keep { path: &path, every: Duration::from_secs(60) };
            let settings = |passes| Settings {
                seed: 5,
                max_depth: scene.max_depth,
                features: true,
                budget: Budget::Passes(passes),
                ..Settings::default()
            };
            let whole = render(&scene, method, &settings(37), |_| {});
            // The second stop lies within a batch.
            for passes in [1, 18, 34] {
                assert_eq!(reference(&scene, method, &settings(passes), keep, |_| {}).unwrap().passes, passes);
            }
            let resumed = reference(&scene, method, &settings(37), keep, |_| {}).unwrap();
            assert!(whole.image.colour == resumed.image.colour, "{method:?} on {name}");
            assert!(whole.image.layers == resumed.image.layers, "{method:?} on {name}");
            let counts = |outcome: &pathblend::integrators::Outcome| (outcome.counts.samples, outcome.counts.rays);
            assert_eq!(counts(&whole), counts(&resumed), "{method:?} on {name}");
            assert_eq!((whole.health, whole.noise), (resumed.health, resumed.noise));
        }
    }
}

#[test]
fn a_killed_reference_goes_on_and_stops_where_it_would_have() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let mut child = std::process::Command::new(env!("CARGO_BIN_EXE_pathblend"))
        .current_dir(path)
        .args(["reference", "--size", "24x16", "-o", "out.exr", "--error", "0.001%", "-i", "vcm", "--seed", "4"])
        .args(["--checkpoint-every", "100ms"])
        .arg(file("box"))
        .spawn()
        .unwrap();
    let start = Instant::now();
    while !path.join("out.exr.checkpoint").is_file() && start.elapsed() < Duration::from_secs(60) {
        std::thread::sleep(Duration::from_millis(20));
    }
    std::thread::sleep(Duration::from_millis(300));
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(!path.join("out.exr").exists());
    // Stopped at once by time, with what the killed run had left.
    let found = refer(path, &["--error", "0.001%", "--time", "1ms", "-i", "vcm", "--seed", "4"]);
    assert_eq!((&found["reached"], &found["integrator"], &found["seed"]), (&false.into(), &"vcm".into(), &4.into()));
    let passes = found["passes"].as_u64().unwrap();
    assert!(passes > 1 && found["error"]["relative"].as_f64().unwrap() > 1e-5, "{found}");
    render_box(path, "whole.exr", &["-i", "vcm", "--seed", "4", "--passes", &passes.to_string()]);
    let (whole, resumed) = (read(path, "whole.exr"), read(path, "out.exr"));
    assert!(whole.colour == resumed.colour && whole.layers == resumed.layers);
    assert_eq!(resumed.manifest["passes"], passes);
    assert_eq!(resumed.manifest["budget"]["error"], 1e-5);
}

#[test]
fn a_reference_stops_when_its_error_is_small_and_can_be_made_better() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let first = refer(path, &["--error", "30%"]);
    assert_eq!((&first["reached"], &first["integrator"]), (&true.into(), &"bdpt".into()), "the box has no mirrors");
    let error = |found: &Value, name: &str| found["error"][name].as_f64().unwrap();
    assert!(error(&first, "relative").max(error(&first, "halves")) <= 0.3 && error(&first, "relative_trimmed") > 0.0);
    let again = refer(path, &["--error", "30%"]);
    assert_eq!(again["passes"], first["passes"], "nothing is left to do");
    let better = refer(path, &["--error", "3%", "--threads", "1"]);
    assert!(better["passes"].as_u64() > first["passes"].as_u64(), "{better}");
    let image = read(path, "out.exr");
    fs::remove_file(path.join("out.exr.checkpoint")).unwrap();
    let afresh = refer(path, &["--error", "3%", "--threads", "2"]);
    assert_eq!(better["passes"], afresh["passes"], "the way does not matter");
    assert!(image.layers == read(path, "out.exr").layers);
    assert_eq!(image.manifest["error"], read(path, "out.exr").manifest["error"]);
    let output = refer_command(path, &["--error", "3%"]).output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    assert!(text.contains("3 % reached") && text.contains("two halves"), "{text}");
}

#[test]
fn the_method_follows_the_scene_and_chains_are_refused() {
    use pathblend::integrators::usual_method;
    assert_eq!(usual_method(&scene("box")), Method::Bdpt);
    assert_eq!(usual_method(&scene("spheres")), Method::Vcm);
    let folder = tempfile::tempdir().unwrap();
    fails(refer_command(folder.path(), &["--error", "5%", "-i", "mmlt"]), folder.path(), &["mmlt", "chains", "vcm"]);
    let scene = scene("box");
    let settings =
        Settings { seed: 1, max_depth: 3, features: false, budget: Budget::Passes(1), ..Settings::default() };
    let keep = Keep { path: &folder.path().join("x"), every: Duration::from_secs(60) };
    let refused = reference(&scene, Method::Mmlt, &settings, keep, |_| {});
    assert!(matches!(refused, Err(ReferenceError::Method(Method::Mmlt))));
}

#[test]
fn wrong_errors_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for bad in ["0%", "200%", "-1%", "0.5", "small", "nan%", ""] {
        fails(refer_command(folder.path(), &[&format!("--error={bad}")]), folder.path(), &["--error", "0.5%"]);
    }
    fails(refer_command(folder.path(), &[]), folder.path(), &["--error"]);
    fails(refer_command(folder.path(), &["--error", "5%", "--time", "never"]), folder.path(), &["--time"]);
}

#[test]
fn a_checkpoint_that_does_not_fit_is_refused_and_kept() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    refer(path, &["--error", "50%"]);
    let checkpoint = path.join("out.exr.checkpoint");
    let sound = fs::read(&checkpoint).unwrap();
    let image = fs::read(path.join("out.exr")).unwrap();
    #[track_caller]
    fn refused(path: &Path, more: &[&str], parts: &[&str]) {
        let parts = [&["out.exr.checkpoint", "delete it to start afresh"], parts].concat();
        fails(refer_command(path, &[&["--error", "50%"], more].concat()), path, &parts);
    }
    refused(path, &["--seed", "7"], &["seed is 0, expected 7"]);
    refused(path, &["-i", "path"], &["method is bdpt, expected path"]);
    refused(path, &["--max-depth", "3"], &["longest path", "expected 3"]);
    refused(path, &["--no-features"], &["film is with path layers, expected without"]);
    let mut other = pathblend(path, &["reference", "--size", "16x16", "--error", "50%", "-o", "out.exr"]);
    other.arg(file("box"));
    fails(other, path, &["its scene is"]);
    assert_eq!(fs::read(&checkpoint).unwrap(), sound);

    let damage = |bytes: &[u8], parts: &[&str]| {
        fs::write(&checkpoint, bytes).unwrap();
        refused(path, &[], parts);
        assert_eq!(fs::read(&checkpoint).unwrap(), bytes, "the file is left alone");
    };
    for length in [sound.len() - 1, sound.len() / 2, 60, 30, 25] {
        damage(&sound[..length], &["truncated"]);
    }
    damage(&[&sound[..], b"x"].concat(), &["damaged"]);
    for place in [sound.len() - 1, sound.len() / 2, 70, 40] {
        let mut bytes = sound.clone();
        bytes[place] ^= 1;
        damage(&bytes, &["damaged", "checksum"]);
    }
    let mut newer = sound.clone();
    newer[b"pathblend checkpoint ".len()] = b'2';
    damage(&newer, &["version 2", "expected 1"]);
    damage(b"", &["not a checkpoint"]);
    damage(b"hello", &["not a checkpoint"]);
    assert_eq!(fs::read(path.join("out.exr")).unwrap(), image, "the image of before stays");
    fs::write(&checkpoint, &sound).unwrap();
    refer(path, &["--error", "50%"]);
}

fn variance(image: &Image) -> &ndarray::Array3<f32> {
    let Some(Layer::Colour(variance)) = image.layers.get("variance") else { panic!("no variance") };
    variance
}

#[test]
fn merged_runs_are_the_mean_of_all_passes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    for (seed, passes) in [("1", "8"), ("2", "24"), ("3", "32")] {
        render_box(path, &format!("{seed}.exr"), &["--seed", seed, "--passes", passes]);
    }
    let output = pathblend(path, &["merge", "1.exr", "2.exr", "3.exr", "-o", "all.exr", "--json"]).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    for name in ["integrator", "seeds", "wall_s", "cpu_s", "samples", "rays", "passes", "health", "error"] {
        assert!(found.get(name).is_some(), "{name} is missing: {found}");
    }
    assert_eq!(found["passes"], 64);
    assert_eq!(found["samples"], 64 * 24 * 16);
    assert_eq!(found["seeds"][1], serde_json::json!({ "seed": 2, "passes": 24 }));
    let (all, [a, b, c]) = (read(path, "all.exr"), ["1.exr", "2.exr", "3.exr"].map(|name| read(path, name)));
    let close = |found: f32, expected: f32| (found - expected).abs() <= 1e-6 * expected.abs().max(1e-20);
    for (at, found) in all.colour.indexed_iter() {
        let mean = (a.colour[at] + 3.0 * b.colour[at] + 4.0 * c.colour[at]) / 8.0;
        assert!(close(*found, mean), "{found} is not {mean}");
        let [va, vb, vc] = [&a, &b, &c].map(|image| variance(image)[at]);
        let expected = (va + 9.0 * vb + 16.0 * vc) / 64.0;
        assert!(close(variance(&all)[at], expected), "{at:?}");
    }
    let plane = |image: &Image| match image.layers.get("path_LDDE") {
        Some(Layer::Luminance(plane)) => plane[[8, 12]],
        _ => panic!("no plane"),
    };
    assert!(close(plane(&all), (plane(&a) + 3.0 * plane(&b) + 4.0 * plane(&c)) / 8.0));
    // Both estimates of the error, from the variances and from two degrees of freedom times 384 pixels.
    let error = |name: &str| found["error"][name].as_f64().unwrap();
    assert!((error("runs") / error("relative") - 1.0).abs() < 0.3, "{found}");

    // In two steps it is the same but for rounding, and the seeds are remembered.
    pathblend(path, &["merge", "1.exr", "2.exr", "-o", "some.exr"]).assert().success();
    pathblend(path, &["merge", "3.exr", "some.exr", "-o", "all2.exr"]).assert().success();
    let again = read(path, "all2.exr");
    assert!(again.colour.iter().zip(&all.colour).all(|(x, y)| close(*x, *y)));
    assert_eq!(again.manifest["seeds"].as_array().unwrap().len(), 3);
    fails(pathblend(path, &["merge", "2.exr", "some.exr", "-o", "x.exr"]), path, &["some.exr", "seed 2", "2.exr"]);
}

#[test]
fn runs_that_do_not_fit_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    render_box(path, "a.exr", &["--passes", "2"]);
    #[track_caller]
    fn refused(path: &Path, other: &str, parts: &[&str]) {
        fails(pathblend(path, &["merge", "a.exr", other, "-o", "x.exr"]), path, parts);
    }
    render_box(path, "size.exr", &["--passes", "2", "--seed", "1", "--size", "8x8"]);
    refused(path, "size.exr", &["size.exr", "8 × 8", "24 × 16", "a.exr"]);
    render_box(path, "method.exr", &["--passes", "2", "--seed", "1", "-i", "path"]);
    refused(path, "method.exr", &["method.exr", "method path", "bdpt"]);
    render_box(path, "depth.exr", &["--passes", "2", "--seed", "1", "--max-depth", "2"]);
    refused(path, "depth.exr", &["depth.exr", "longest path 2"]);
    render_box(path, "bare.exr", &["--passes", "2", "--seed", "1", "--no-features"]);
    refused(path, "bare.exr", &["bare.exr", "path layers absent", "present"]);
    pathblend(path, &["render", "-o", "scene.exr", "--size", "24x16", "--passes", "2", "--seed", "1"])
        .arg(file("spheres"))
        .assert()
        .success();
    refused(path, "scene.exr", &["scene.exr", "scene "]);
    render_box(path, "same.exr", &["--passes", "3"]);
    refused(path, "same.exr", &["same.exr", "seed 0", "a.exr"]);
    refused(path, "a.exr", &["seed 0"]);
    refused(path, "missing.exr", &["missing.exr"]);
    Image::new(24, 16).write(&path.join("foreign.exr"), &pathblend::image::WriteOptions::default()).unwrap();
    refused(path, "foreign.exr", &["foreign.exr", "`passes`", "manifest"]);
    let bytes = fs::read(path.join("a.exr")).unwrap();
    fs::write(path.join("cut.exr"), &bytes[..bytes.len() / 2]).unwrap();
    refused(path, "cut.exr", &["cut.exr", "truncated"]);
    fails(pathblend(path, &["merge", "a.exr", "-o", "x.exr"]), path, &["at least two", "found 1"]);
    fails(pathblend(path, &["merge", "-o", "x.exr"]), path, &["IMAGES"]);
    fails(pathblend(path, &["merge", "a.exr", "depth.exr", "-o", "a.exr"]), path, &["a.exr", "input"]);
}

#[test]
fn help_has_examples() {
    for verb in ["reference", "merge"] {
        let output = pathblend(Path::new("."), &[verb, "--help"]).output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(text.contains(&format!("Example: pathblend {verb}")), "{text}");
    }
}
