//! The command line as a user meets it: what it prints, how it fails, and that files appear whole or not at all.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use assert_cmd::Command;
use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

fn pathblend() -> Command {
    Command::cargo_bin("pathblend").unwrap()
}

fn scene(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).join("scene.xml")
}

/// Fails with exit code 2 and one line that contains all of `parts`; leaves the folder as it was.
#[track_caller]
fn fails(command: &mut Command, folder: &Path, parts: &[&str]) {
    let before: Vec<_> = fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name()).collect();
    let output = command.current_dir(folder).output().unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(2), "{message}");
    for part in parts {
        assert!(message.contains(part), "`{part}` is not in: {message}");
    }
    assert!(!message.contains("panicked"), "{message}");
    let after: Vec<_> = fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(before.len(), after.len(), "left something behind: {after:?}");
}

fn render(folder: &Path, method: &str, out: &str, more: &[&str]) -> Value {
    let output = pathblend()
        .current_dir(folder)
        .args(["render", "-i", method, "--json", "-o", out])
        .args(more)
        .args(if more.contains(&"--size") { &[][..] } else { &["--size", "24x16"] })
        .arg(scene("spheres"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn render_prints_the_published_names() {
    let folder = tempfile::tempdir().unwrap();
    for method in ["path", "bdpt", "sppm", "pssmlt", "mmlt", "rjmlt", "mlt", "fused"] {
        let summary = render(folder.path(), method, "a.exr", &["--passes", "2", "--seed", "3"]);
        for name in ["integrator", "seed", "wall_s", "cpu_s", "samples", "rays", "passes", "health"] {
            assert!(summary.get(name).is_some(), "{name} is missing: {summary}");
        }
        assert_eq!(summary["integrator"], method);
        assert_eq!(summary["seed"], 3);
        assert_eq!(summary["passes"], 2);
        assert_eq!(summary["health"], serde_json::json!({ "nonfinite": 0, "negative": 0 }));
    }
    let summary = render(folder.path(), "mmlt", "a.exr", &["--passes", "2"]);
    let small = &summary["acceptance"]["small_step"][0];
    assert_eq!(small["length"], 3);
    assert!(small["proposed"].as_u64().unwrap() >= small["accepted"].as_u64().unwrap());
    let chains = &summary["chains"][0];
    assert!(chains["mean"].as_f64().unwrap() > chains["standard_error"].as_f64().unwrap());
    assert!(chains["chains"] == 16 && chains["failed_inversions"] == 0, "{chains}");
}

#[test]
fn compare_prints_the_published_names() {
    let folder = tempfile::tempdir().unwrap();
    render(folder.path(), "path", "a.exr", &["--passes", "1"]);
    render(folder.path(), "path", "b.exr", &["--passes", "1", "--seed", "5", "--half"]);
    let output = pathblend().current_dir(&folder).args(["compare", "a.exr", "b.exr", "--json"]).output().unwrap();
    let found: Value = serde_json::from_slice(&output.stdout).unwrap();
    for name in ["mse", "rmse", "relmse", "relmse_trimmed", "smape", "mape", "flip", "mean_ratio"] {
        assert!(found[name].as_f64().is_some_and(|v| v > 0.0), "{name}: {found}");
    }
    let output = pathblend().current_dir(&folder).args(["compare", "a.exr", "a.exr"]).output().unwrap();
    assert!(output.status.success());
    assert!(String::from_utf8_lossy(&output.stdout).contains("FLIP (LDR)"));
}

#[test]
fn equal_seeds_give_equal_images_on_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    for (threads, out) in [("1", "1.exr"), ("2", "2.exr"), ("5", "5.exr")] {
        render(folder.path(), "bdpt", out, &["--passes", "2", "--threads", threads]);
    }
    let read = |name: &str| pathblend::image::Image::read(&folder.path().join(name)).unwrap();
    let one = read("1.exr");
    for name in ["2.exr", "5.exr"] {
        let other = read(name);
        assert!(one.colour == other.colour && one.layers == other.layers, "{name}");
    }
}

#[test]
fn auto_renders_blends_and_shows() {
    let folder = tempfile::tempdir().unwrap();
    pathblend()
        .current_dir(&folder)
        .args(["auto", "--size", "32x24", "--time", "1s", "-o", "out.exr", "--keep"])
        .arg(scene("spheres"))
        .assert()
        .success();
    for name in ["out.exr", "out.png", "out_weight.png"] {
        assert!(folder.path().join(name).is_file(), "{name}");
    }
    let blend = pathblend::image::Image::read(&folder.path().join("out.exr")).unwrap();
    let weights = blend.layers.iter().filter(|(name, _)| name.starts_with("weight_")).count();
    assert_eq!(weights, 1, "one weight map");
}

#[test]
fn blend_names_the_file_that_does_not_fit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    render(path, "bdpt", "a.exr", &["--passes", "1"]);
    render(path, "sppm", "b.exr", &["--passes", "1"]);
    let blend = |args: &[&str]| {
        let mut command = pathblend();
        command.arg("blend").args(args).args(["-o", "out.exr"]);
        command
    };
    blend(&["a.exr", "b.exr"]).current_dir(path).assert().success();
    fs::remove_file(path.join("out.exr")).unwrap();
    render(path, "sppm", "small.exr", &["--passes", "1", "--size", "8x8"]);
    fails(&mut blend(&["a.exr", "small.exr"]), path, &["small.exr", "8 × 8", "24 × 16"]);
    render(path, "sppm", "bare.exr", &["--passes", "1", "--no-features"]);
    fails(&mut blend(&["a.exr", "bare.exr"]), path, &["bare.exr", "path_"]);
    let bytes = fs::read(path.join("b.exr")).unwrap();
    fs::write(path.join("cut.exr"), &bytes[..bytes.len() / 2]).unwrap();
    fails(&mut blend(&["a.exr", "cut.exr"]), path, &["cut.exr", "truncated"]);
    fs::write(path.join("model.json"), r#"{"format": "pathblend-forest", "version": 99}"#).unwrap();
    fails(&mut blend(&["a.exr", "b.exr", "--model", "model.json"]), path, &["model.json", "version"]);
    fails(&mut blend(&["a.exr", "missing.exr"]), path, &["missing.exr"]);
    render(path, "sppm", "short.exr", &["--passes", "1", "--max-depth", "2"]);
    fails(&mut blend(&["a.exr", "short.exr"]), path, &["short.exr", "longest path `2`", "`9`"]);
    let mut onto_itself = pathblend();
    onto_itself.args(["blend", "a.exr", "b.exr", "-o", "a.exr"]);
    fails(&mut onto_itself, path, &["a.exr", "input"]);
}

#[test]
fn wrong_use_is_told_before_any_work() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let render = |args: &[&str]| {
        let mut command = pathblend();
        command.arg("render").arg(scene("box")).args(args);
        command
    };
    fails(&mut render(&["-o", "x.png"]), path, &["x.png", ".exr"]);
    fails(&mut render(&["-o", "no/where/x.exr"]), path, &["no/where"]);
    fails(&mut render(&["-o", "x.exr", "--png", "x.exr"]), path, &["x.exr", ".png"]);
    fails(&mut render(&["-o", "x.exr", "--png", "no/where/x.png"]), path, &["no/where"]);
    fails(&mut render(&["-i", "magic", "-o", "x.exr"]), path, &["magic", "bdpt"]);
    fails(&mut render(&["--passes", "0", "-o", "x.exr"]), path, &["--passes"]);
    fails(&mut render(&["--time", "3 parsecs", "-o", "x.exr"]), path, &["--time"]);
    fails(&mut render(&["--size", "0x0", "-o", "x.exr"]), path, &["--size"]);
    fails(&mut render(&["-D", "nothing=1", "-o", "x.exr"]), path, &["nothing"]);
    let mut missing = pathblend();
    missing.args(["render", "missing.xml", "-o", "x.exr"]);
    fails(&mut missing, path, &["missing.xml"]);
}

#[test]
fn bad_scenes_are_pointed_at() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let sensor = "<sensor type='perspective'><float name='fov' value='45'/><film type='hdrfilm'/></sensor>";
    let cases = [
        ("<scene version='3.0.0'>\n  <bsdf type='velvet' id='a'/></scene>", vec!["bad.xml:2:", "velvet", "expected"]),
        (
            "<scene version='3.0.0'>\n<shape type='obj'><string name='filename' value='gone.obj'/></shape></scene>",
            vec!["bad.xml:2:", "gone.obj"],
        ),
        (
            "<scene version='3.0.0'>\n<shape type='sphere'><float name='radius' value='nan'/></shape></scene>",
            vec!["bad.xml:2:"],
        ),
        (
            "<scene version='3.0.0'>\n<shape type='sphere'><string name='radius' value='big'/></shape></scene>",
            vec!["bad.xml:2:", "radius"],
        ),
        ("", vec!["bad.xml"]),
        ("<scene version='3.0.0'>", vec!["bad.xml"]),
        ("<scene version='3.0.0'/>", vec!["bad.xml", "sensor"]),
    ];
    for (text, parts) in cases {
        let text = if text.contains("</scene>") {
            text.replace("</scene>", &format!("{sensor}</scene>"))
        } else {
            text.into()
        };
        fs::write(path.join("bad.xml"), text).unwrap();
        let mut command = pathblend();
        command.args(["render", "bad.xml", "--passes", "1", "-o", "x.exr"]);
        fails(&mut command, path, &parts);
    }
}

/// Legal but dark: a warning, and a black image that is valid.
#[test]
fn a_scene_without_light_is_black() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let text = "<scene version='3.0.0'><sensor type='perspective'><float name='fov' value='45'/><film type='hdrfilm'>\
        <integer name='width' value='8'/><integer name='height' value='8'/></film></sensor>\
        <shape type='sphere'/></scene>";
    fs::write(path.join("dark.xml"), text).unwrap();
    for verb in [
        &["render", "dark.xml", "-i", "mmlt", "--passes", "1", "-o", "x.exr"][..],
        &["auto", "dark.xml", "--time", "1s", "-o", "x.exr"],
    ] {
        let output = pathblend().current_dir(path).args(verb).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        assert!(String::from_utf8_lossy(&output.stderr).contains("warning"));
        let image = pathblend::image::Image::read(&path.join("x.exr")).unwrap();
        assert!(image.colour.iter().all(|v| *v == 0.0));
    }
}

/// A camera inside a closed body of paint sees nothing, and no method gets stuck.
#[test]
fn a_camera_inside_a_wall_sees_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let text = "<scene version='3.0.0'><sensor type='perspective'><float name='fov' value='45'/><film type='hdrfilm'>\
        <integer name='width' value='8'/><integer name='height' value='8'/></film></sensor>\
        <shape type='sphere'><bsdf type='diffuse'/></shape>\
        <shape type='sphere'><point name='center' x='5' y='0' z='0'/><emitter type='area'>\
        <rgb name='radiance' value='1'/></emitter></shape></scene>";
    fs::write(path.join("inside.xml"), text).unwrap();
    for method in ["path", "bdpt", "sppm", "pssmlt", "mmlt", "rjmlt", "mlt", "fused"] {
        pathblend()
            .current_dir(path)
            .args(["render", "inside.xml", "-i", method, "--passes", "2", "-o", "x.exr"])
            .assert()
            .success();
        let image = pathblend::image::Image::read(&path.join("x.exr")).unwrap();
        assert!(image.colour.iter().all(|v| *v == 0.0), "{method}");
    }
}

/// Two recipes that would waste a night, refused at once.
#[test]
fn bad_recipes_are_refused_before_any_render() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path();
    let head = "integrators = ['bdpt', 'sppm']\nsize = [8, 8]\nseeds = [1]\n\
        reference = { integrator = 'bdpt', time = 1.0 }\n";
    let scene = |file: &str| format!("[[scenes]]\nfile = '{file}'\n");
    let cases = [
        (format!("{head}times = [1e20]\n{}{}", scene("a/x.xml"), scene("b/x.xml")), "1e7"),
        (format!("{head}times = [1.0]\n{}{}", scene("a/x.xml"), scene("a/y.xml")), "`a`"),
        (format!("{head}times = [1.0]\n{}", scene("a/x.xml")), "at least 2"),
        (format!("{head}times = [1.0]\ncolour = 3\n{}", scene("a/x.xml")), "colour"),
        (format!("{}times = [1.0]\n", head.replace("integrator = 'bdpt'", "integrator = 'sppm'")), "biased"),
    ];
    for (text, part) in cases {
        let text = if text.contains("[[scenes]]") { text } else { format!("{text}scenes = []\n") };
        fs::write(path.join("recipe.toml"), text).unwrap();
        let mut command = pathblend();
        command.args(["train", "recipe.toml", "-o", "model"]);
        fails(&mut command, path, &[part]);
    }
}

#[test]
fn help_has_an_example_for_each_verb() {
    for verb in ["render", "compare", "train", "blend", "auto"] {
        let output = pathblend().args([verb, "--help"]).output().unwrap();
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(text.contains(&format!("Example: pathblend {verb}")), "{text}");
    }
}
