//! Loaded scenes against Mitsuba 3: `load_reference/make.py` says how its numbers were obtained.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use glam::{DVec2, DVec3};
use pathblend::camera::Projection;
use pathblend::emitter::Start;
use pathblend::load::{self, Loaded, Options};
use pathblend::scene::Caster;
use serde_json::Value;
use std::path::{Path, PathBuf};

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/load_reference")
}

fn expected(part: &str) -> Vec<Value> {
    let text = std::fs::read_to_string(folder().join("expected.json")).unwrap();
    let json: Value = serde_json::from_str(&text).unwrap();
    json[part].as_array().unwrap().clone()
}

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    let numbers: Vec<_> = value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap()).collect();
    numbers.try_into().unwrap()
}

fn vector(value: &Value) -> DVec3 {
    DVec3::from(numbers(value))
}

fn load(path: &Path, options: &Options) -> Loaded {
    load::read(path, options).unwrap_or_else(|error| panic!("{error}"))
}

fn load_text(text: &str, options: &Options) -> Loaded {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.xml");
    std::fs::write(&path, text).unwrap();
    load(&path, options)
}

#[test]
fn shapes_lie_and_face_as_in_mitsuba() {
    let Loaded { scene, warnings } = load(&folder().join("shapes.xml"), &Options::default());
    assert!(warnings.is_empty(), "{warnings:?}");
    let mut hits = 0;
    for case in expected("shapes") {
        let (origin, direction) = (vector(&case["origin"]), vector(&case["direction"]).normalize());
        let surface = Caster::new(&scene).intersect(origin.into(), direction);
        assert_eq!(surface.is_some(), case.get("position").is_some(), "{case}");
        let Some(surface) = surface else { continue };
        hits += 1;
        // Mitsuba's positions are in single precision, 210 from the origin at most.
        assert!((surface.position - vector(&case["position"])).length() < 2e-4, "{case}: {}", surface.position);
        assert!((surface.frame.normal - vector(&case["normal"])).length() < 1e-3, "{case}: {}", surface.frame.normal);
        assert!(surface.geometric.dot(surface.frame.normal) > 0.0, "{case}");
    }
    assert!(hits > 100, "{hits}");
}

#[test]
fn cameras_look_as_in_mitsuba() {
    let text = std::fs::read_to_string(folder().join("camera.xml")).unwrap();
    for case in expected("cameras") {
        let overrides = case["overrides"].as_object().unwrap();
        let overrides = overrides.iter().map(|(name, value)| (name.clone(), value.as_str().unwrap().to_owned()));
        let options = Options { overrides: overrides.collect(), ..Options::default() };
        let thin = options.overrides.get("sensor").is_some_and(|sensor| sensor == "thinlens");
        let lens = "<float name=\"aperture_radius\" value=\"0.2\"/></sensor>";
        let text = if thin { text.replace("</sensor>", lens) } else { text.clone() };
        let camera = load_text(&text, &options).scene.camera;
        let lens_radius = if thin { 0.2 } else { 0.0 };
        assert_eq!(camera.projection, Projection::Perspective { lens_radius, focus_distance: 3.5 });
        for ray in case["rays"].as_array().unwrap() {
            let (_, direction) = camera.ray(DVec2::from(numbers(&ray["film"])), [0.5; 4]);
            assert!((direction - vector(&ray["direction"])).length() < 1e-5, "{case}: {direction}");
            // Mitsuba starts its rays at the near clipping plane.
            let ahead = vector(&ray["origin"]) - camera.origin;
            assert!((ahead - direction * ahead.length()).length() < 1e-5, "{case}: {}", camera.origin);
        }
    }
}

#[test]
fn light_has_the_colour_that_mitsuba_gives_it() {
    for case in expected("emitters") {
        let emitter = format!("<emitter type=\"constant\">{}</emitter>", case["value"].as_str().unwrap());
        let sensor = "<sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/></sensor>";
        let text = format!("<scene version=\"3.0.0\">{sensor}{emitter}</scene>");
        let scene = load_text(&text, &Options::default()).scene;
        let sky = scene.emitter(scene.environment().unwrap());
        let radiance = sky.radiance(&Start::Infinite { towards: DVec3::Z }, -DVec3::Z).to_rgb();
        for (ours, theirs) in radiance.iter().zip(numbers::<3>(&case["radiance"])) {
            assert!((ours - theirs).abs() < 1e-5, "{case}: {radiance:?}");
        }
    }
}
