//! The verb `experiment`, and options of chains as the command line takes them.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use assert_cmd::Command;
use std::fs;
use std::path::Path;

fn pathblend(folder: &Path, arguments: &[&str]) -> (bool, String, String) {
    let mut command = Command::cargo_bin("pathblend").expect("the binary");
    let output = command.current_dir(folder).args(arguments).output().expect("it starts");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.success(), text(&output.stdout), text(&output.stderr))
}

fn scene(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name).join("scene.xml").display().to_string()
}

fn recipe(changed: impl Fn(String) -> String) -> String {
    changed(format!(
        "size = [12, 8]\nseeds = 2\ntimes = [0.02, 0.05]\nreference = {{ integrator = \"bdpt\", time = 0.1 }}\n\
        [[variants]]\nname = \"plain\"\nintegrator = \"mmlt\"\n\
        [[variants]]\nname = \"tries\"\nintegrator = \"rjmlt\"\n\
        mutations = {{ jumps = \"always\", large_steps = {{ tries_from = 4 }}, small_step = {{ kelemen = {{ least = 0.001, \
        most = 0.02 }} }} }}\n\
        [[scenes]]\nfile = {:?}\n",
        scene("box")
    ))
}

#[test]
fn experiments_are_made_once() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("small.toml"), recipe(|text| text)).unwrap();
    let (success, table, log) = pathblend(folder.path(), &["experiment", "small.toml", "-o", "out"]);
    assert!(success, "{log}");
    assert_eq!(log.matches("reference").count(), 1);
    assert_eq!(log.matches("seed").count(), 8, "two seeds, two times, two variants: {log}");
    assert!(table.contains("| box | 0.05 |") && table.contains("technique change"), "{table}");
    for file in ["box-error.svg", "box-acceptance.svg"] {
        let text = fs::read_to_string(folder.path().join("out").join(file)).unwrap();
        assert!(text.starts_with("<svg") && text.contains("plain") && text.contains("tries"), "{file}");
    }
    // A line that was cut off is made again, and nothing else.
    let runs = folder.path().join("out/runs.jsonl");
    let text = fs::read_to_string(&runs).unwrap();
    fs::write(&runs, &text[..text.len() - 40]).unwrap();
    let (success, again, log) = pathblend(folder.path(), &["experiment", "small.toml", "-o", "out", "--json"]);
    assert!(success && log.lines().count() == 1, "{log}");
    assert_eq!(again.lines().count(), 8);
    let run: serde_json::Value = serde_json::from_str(again.lines().next().unwrap()).unwrap();
    assert!(run["mse"].as_f64().unwrap() > 0.0 && run["acceptance"]["small_step"][0]["length"] == 3, "{run}");
}

/// Another reference is another truth: nothing of the errors against the first is kept.
#[test]
fn another_reference_is_made_anew() {
    let folder = tempfile::tempdir().unwrap();
    for time in ["time = 0.1", "time = 0.2"] {
        fs::write(folder.path().join("small.toml"), recipe(|text| text.replace("time = 0.1", time))).unwrap();
        let (success, _, log) = pathblend(folder.path(), &["experiment", "small.toml", "-o", "out"]);
        assert!(success && log.lines().count() == 9, "{log}");
    }
}

#[test]
fn bad_recipes_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let twice = format!("[[scenes]]\nfile = {:?}\n[[scenes]]\n", scene("box"));
    let cases: [(&str, &str, &[&str]); 10] = [
        ("[[scenes]]\n", &twice, &["two scenes", "`box`"]),
        ("seeds = 2", "seeds = 1", &["seeds", "at least 2"]),
        ("[0.02, 0.05]", "[]", &["times"]),
        ("[0.02, 0.05]", "[-1.0]", &["times"]),
        ("\"bdpt\", time", "\"sppm\", time", &["reference", "without bias"]),
        ("\"tries\"", "\"plain\"", &["two variants", "`plain`"]),
        ("jumps = \"always\"", "jump = 1.5", &["`tries`", "technique jump is 1.5", "0 to 1"]),
        ("jumps = \"always\"", "hops = 3", &["hops", "line 11"]),
        ("size = [12, 8]", "size = [12]", &["line 1"]),
        ("seeds = 2", "seeds = 2\nclasses = \"SXS\"", &["`classes`", "L, D, S and E"]),
    ];
    for (from, to, parts) in cases {
        fs::write(folder.path().join("bad.toml"), recipe(|text| text.replace(from, to))).unwrap();
        let (success, _, message) = pathblend(folder.path(), &["experiment", "bad.toml", "-o", "out"]);
        assert!(!success && parts.iter().all(|part| message.contains(part)), "{to}: {message}");
        assert!(message.contains("bad.toml") && !message.contains("panicked"), "{message}");
    }
}

#[test]
fn bad_options_of_chains_are_refused_before_any_work() {
    let folder = tempfile::tempdir().unwrap();
    let cases: [(&[&str], &[&str]); 9] = [
        (&["--large-step", "0"], &["large step is 0", "above 0"]),
        (&["--large-step", "1.5"], &["large step is 1.5"]),
        (&["--jump", "-0.1"], &["technique jump is -0.1"]),
        (&["--jump", "0.8"], &["0.3", "0.8", "more than 1"]),
        (&["--large-step", "0.8", "--jump", "0.3"], &["0.8", "0.3", "more than 1"]),
        (&["--step-size", "0"], &["small steps is 0"]),
        (&["--small-step", "kelemen", "--step-size", "0.9"], &["small steps is 0.9"]),
        (&["--film-steps", "-3"], &["film-steps"]),
        (&["--film-steps", "far"], &["expected aspect, shares or a number of pixels"]),
    ];
    for (options, parts) in cases {
        let scene = scene("box");
        let arguments: Vec<&str> = ["render", &scene, "-i", "rjmlt", "--passes", "1", "-o", "x.exr"].to_vec();
        let (success, _, message) = pathblend(folder.path(), &[&arguments, options].concat());
        assert!(!success && parts.iter().all(|part| message.contains(part)), "{options:?}: {message}");
        assert!(!folder.path().join("x.exr").exists() && !message.contains("panicked"));
    }
}

/// Where only mirrors meet only light from a point there is nothing to find: a black image, soon.
#[test]
fn chains_without_any_path_end() {
    let folder = tempfile::tempdir().unwrap();
    let text = "<scene version='3.0.0'><sensor type='perspective'><float name='fov' value='45'/><film type='hdrfilm'>\
        <integer name='width' value='8'/><integer name='height' value='8'/></film></sensor>\
        <shape type='sphere'><point name='center' x='0' y='0' z='4'/><bsdf type='conductor'/></shape>\
        <emitter type='point'><point name='position' x='0' y='3' z='0'/></emitter></scene>";
    fs::write(folder.path().join("mirror.xml"), text).unwrap();
    for method in ["pssmlt", "mmlt", "rjmlt", "mlt", "fused"] {
        for more in [&["--direct", "chains"][..], &["--tries-from", "2"], &["--controlled-steps"]] {
            let arguments = ["render", "mirror.xml", "-i", method, "--passes", "3", "-o", "x.exr"];
            let (success, _, message) = pathblend(folder.path(), &[&arguments, more].concat());
            assert!(success, "{method}: {message}");
            let image = pathblend::image::Image::read(&folder.path().join("x.exr")).unwrap();
            assert!(image.colour.iter().all(|v| *v == 0.0), "{method}");
        }
    }
}
