//! Scenes of pbrt as they come out in Mitsuba's format.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use assert_cmd::Command;
use pathblend::image::{Image, WriteOptions};
use pathblend::import::{Change, ImportError, Options, Report, import};
use pathblend::integrators::{Budget, Method, Settings, render};
use pathblend::load;
use std::fs;
use std::path::{Path, PathBuf};

fn sample(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/pbrt").join(name)
}

/// Converts a file of `tests/pbrt`: the result and the report.
fn convert(name: &str) -> (String, Report) {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.xml");
    let report = import(&sample(name), &output, &Options::default()).unwrap();
    for file in &report.files {
        assert!(folder.path().join(file).is_file(), "{}", file.display());
    }
    (fs::read_to_string(output).unwrap(), report)
}

/// Converts a text, which stands in a folder of its own.
fn convert_text(text: &str, options: &Options) -> Result<(String, Report), String> {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("s.pbrt"), text).unwrap();
    let output = folder.path().join("out.xml");
    let result = import(&folder.path().join("s.pbrt"), &output, options);
    let left: Vec<_> = fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    match result {
        Ok(report) => Ok((fs::read_to_string(output).unwrap(), report)),
        Err(error) => {
            assert_eq!(left, ["s.pbrt"], "something was left behind");
            Err(error.to_string().replace(&format!("{}/", folder.path().display()), ""))
        }
    }
}

/// The elements of a kind, in order.
fn elements<'a>(tree: &'a roxmltree::Document<'a>, tag: &str, kind: &str) -> Vec<roxmltree::Node<'a, 'a>> {
    let fits = |node: &roxmltree::Node<'_, '_>| node.has_tag_name(tag) && node.attribute("type") == Some(kind);
    tree.descendants().filter(fits).collect()
}

/// The value of a parameter.
fn value<'a>(node: roxmltree::Node<'a, 'a>, name: &str) -> &'a str {
    let child = node.children().find(|child| child.attribute("name") == Some(name));
    let child = child.unwrap_or_else(|| panic!("no `{name}`"));
    child.attribute("value").unwrap_or_default()
}

/// The sixteen numbers of a placement.
fn matrix(node: roxmltree::Node<'_, '_>) -> Vec<f64> {
    let matrix = node.descendants().find(|node| node.has_tag_name("matrix")).expect("a matrix");
    matrix.attribute("value").unwrap().split(' ').map(|number| number.parse().unwrap()).collect()
}

fn close(found: &[f64], expected: &[f64]) {
    assert_eq!(found.len(), expected.len());
    assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?} {expected:?}");
}

#[test]
fn the_box_loads_and_keeps_its_numbers() {
    let (text, report) = convert("box.pbrt");
    assert_eq!((report.shapes, report.lights, report.materials, report.notes.len()), (6, 2, 5, 0));
    let tree = roxmltree::Document::parse(&text).unwrap();
    assert_eq!(value(elements(&tree, "integrator", "path")[0], "max_depth"), "5");
    let sensor = elements(&tree, "sensor", "perspective")[0];
    assert_eq!((value(sensor, "fov"), value(sensor, "fov_axis")), ("50", "smaller"));
    // Mitsuba's x is on the left.
    close(&matrix(sensor), &[-1., 0., 0., 0., 0., 1., 0., 1., 0., 0., 1., -4., 0., 0., 0., 1.]);
    assert_eq!(value(elements(&tree, "emitter", "area")[0], "radiance"), "16 16 12");
    assert_eq!(value(elements(&tree, "emitter", "point")[0], "intensity"), "1 1 2");
    assert_eq!(value(elements(&tree, "film", "hdrfilm")[0], "width"), "96");
    assert_eq!(value(elements(&tree, "sampler", "independent")[0], "sample_count"), "32");
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("box.xml");
    import(&sample("box.pbrt"), &output, &Options::default()).unwrap();
    let loaded = load::read(&output, &load::Options::default()).unwrap();
    assert!(loaded.warnings.is_empty());
}

/// Where the light of a small sphere falls, against pbrt's own projection: x / z to the right, y / z upwards, scaled
/// so that the shorter side of the image spans the field of view.
#[test]
fn images_are_not_mirrored() {
    let cases = [("", [1.0, 0.5, 5.0]), ("Scale -1 1 1", [-1.0, 0.5, 5.0]), ("Rotate 180 0 0 1", [-1.0, -0.5, 5.0])];
    for (before, [x, y, z]) in cases {
        let point = "Translate 1 0.5 5";
        let text = format!(
            "{before} Camera \"perspective\" \"float fov\" 40 Film \"rgb\" \"integer xresolution\" 60 \"integer yresolution\" 40
             WorldBegin {point} AreaLightSource \"diffuse\" Shape \"sphere\" \"float radius\" 0.1"
        );
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("s.pbrt"), text).unwrap();
        let output = folder.path().join("out.xml");
        import(&folder.path().join("s.pbrt"), &output, &Options::default()).unwrap();
        let scene = load::read(&output, &load::Options::default()).unwrap().scene;
        let settings =
            Settings { seed: 1, max_depth: 1, features: false, budget: Budget::Passes(400), ..Settings::default() };
        let image = render(&scene, Method::Path, &settings, |_| ()).image.colour;
        let (mut sum, mut centre) = (0.0, [0.0; 2]);
        for ((row, column, _), light) in image.indexed_iter() {
            sum += f64::from(*light);
            centre[0] += f64::from(*light) * (column as f64 + 0.5);
            centre[1] += f64::from(*light) * (row as f64 + 0.5);
        }
        let unit = 20.0 / 20.0_f64.to_radians().tan();
        let expected = [30.0 + unit * x / z, 20.0 - unit * y / z];
        let found = centre.map(|value| value / sum);
        let near = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 0.15);
        assert!(sum > 0.0 && near, "{before}: {found:?} {expected:?}");
    }
}

#[test]
fn blocks_restore_what_they_change() {
    let (text, report) = convert("blocks.pbrt");
    assert!(report.notes.is_empty(), "{:?}", report.notes);
    let tree = roxmltree::Document::parse(&text).unwrap();
    let spheres = elements(&tree, "shape", "sphere");
    // Radius, material, translation, scale.
    let expected = [
        ("7", "0.2", [1., 1., 0.], 1.),
        ("2", "0.1", [1., 0., 0.], 1.),
        ("3", "0.3", [1., 0., 0.], 2.),
        ("4", "0.3", [1., 0., 0.], 1.),
        ("5", "0.3", [1., 1., 0.], 1.),
        ("6", "0.3", [5., 6., 7.], 1.),
    ];
    assert_eq!(spheres.len(), expected.len());
    for (sphere, (radius, reflectance, shift, scale)) in spheres.into_iter().zip(expected) {
        assert_eq!(value(sphere, "radius"), radius);
        let id = sphere.children().find(|child| child.has_tag_name("ref")).unwrap().attribute("id");
        let material = tree.descendants().find(|node| node.attribute("id") == id).unwrap();
        let diffuse = material.descendants().find(|node| node.attribute("type") == Some("diffuse")).unwrap();
        assert_eq!(value(diffuse, "reflectance"), reflectance, "radius {radius}");
        let cells = matrix(sphere);
        close(&[cells[3], cells[7], cells[11], cells[0]], &[shift[0], shift[1], shift[2], scale]);
        assert_eq!(sphere.descendants().any(|node| node.has_tag_name("emitter")), radius == "7");
    }
}

#[test]
fn lights_keep_their_places_and_powers() {
    let (text, report) = convert("lights.pbrt");
    let tree = roxmltree::Document::parse(&text).unwrap();
    let points = elements(&tree, "emitter", "point");
    let position = points[0].children().find(|child| child.has_tag_name("point")).unwrap();
    assert_eq!(["x", "y", "z"].map(|axis| position.attribute(axis).unwrap()), ["2", "2", "3"]);
    assert_eq!((value(points[0], "intensity"), value(points[1], "intensity")), ("2 4 6", "1"));
    let sun = elements(&tree, "emitter", "directional")[0];
    let direction = sun.children().find(|child| child.has_tag_name("vector")).unwrap();
    let direction = ["x", "y", "z"].map(|axis| direction.attribute(axis).unwrap().parse().unwrap());
    close(&direction, &[0., 1., 0.]);
    assert_eq!(value(sun, "irradiance"), "5");
    let spot = elements(&tree, "emitter", "spot")[0];
    let cells = matrix(spot);
    close(&[cells[2], cells[6], cells[10], cells[3], cells[7], cells[11]], &[0., 1., 0., 1., 3., 3.]);
    assert_eq!((value(spot, "cutoff_angle"), value(spot, "beam_width")), ("20", "20"));
    assert_eq!(value(elements(&tree, "emitter", "constant")[0], "radiance"), "0.5 1 2");
    // 4 π² over the area 4 π and over π.
    let radiance: f64 = value(elements(&tree, "emitter", "area")[0], "radiance").parse().unwrap();
    close(&[radiance], &[1.0]);
    let notes: Vec<_> = report.notes.iter().map(|note| (note.change, note.line)).collect();
    assert_eq!(notes, [(Change::Approximated, 10), (Change::LeftOut, 12)]);
}

#[test]
fn environments_are_resampled_where_they_are_square() {
    for (size, name, notes) in [([16, 16], "meshes/out_001.exr", 1), ([32, 16], "sky.exr", 0)] {
        let folder = tempfile::tempdir().unwrap();
        Image::new(size[0], size[1]).write(&folder.path().join("sky.exr"), &WriteOptions::default()).unwrap();
        let text =
            "WorldBegin LightSource \"infinite\" \"string filename\" \"sky.exr\" \"float scale\" 3 Shape \"sphere\"";
        fs::write(folder.path().join("s.pbrt"), text).unwrap();
        let output = folder.path().join("out.xml");
        let report = import(&folder.path().join("s.pbrt"), &output, &Options::default()).unwrap();
        let text = fs::read_to_string(output).unwrap();
        let tree = roxmltree::Document::parse(&text).unwrap();
        let sky = elements(&tree, "emitter", "envmap")[0];
        assert_eq!((value(sky, "filename"), value(sky, "scale"), report.notes.len()), (name, "3", notes));
        // Mitsuba's up, +y, is +z here.
        let cells = matrix(sky);
        close(&[cells[1], cells[5], cells[9]], &[0., 0., 1.]);
        assert!(folder.path().join(name).is_file());
    }
}

#[test]
fn materials_and_textures_become_mitsubas() {
    let (text, report) = convert("materials.pbrt");
    let tree = roxmltree::Document::parse(&text).unwrap();
    let by_id = |id: &str| tree.descendants().find(|node| node.attribute("id") == Some(id)).unwrap();
    let inner = |id: &str| by_id(id).children().find(|node| node.is_element()).unwrap();
    let checks = inner("a").children().find(|node| node.has_tag_name("texture")).unwrap();
    assert_eq!((value(checks, "color0"), value(checks, "color1")), ("0.45 0.05 0.05", "0.05 0.05 0.45"));
    assert_eq!((inner("b").attribute("type"), value(inner("b"), "alpha")), (Some("roughplastic"), "0.1"));
    assert_eq!((value(inner("c"), "alpha_u"), value(inner("c"), "alpha_v")), ("0.2", "0.3"));
    assert!(value(inner("c"), "k").starts_with("2 2.449"));
    assert_eq!((value(by_id("d"), "alpha"), value(by_id("d"), "int_ior")), ("0.25", "1.5168"));
    assert_eq!(by_id("e").attribute("type"), Some("thindielectric"));
    assert_eq!((inner("f").attribute("type"), value(inner("f"), "weight")), (Some("blendbsdf"), "0.25"));
    assert_eq!(by_id("g").attribute("type"), Some("blendbsdf"));
    assert_eq!(value(inner("h_1"), "eta"), "0.143036 0.375307 1.44205");
    assert_eq!((inner("i").attribute("type"), value(inner("i"), "scale")), (Some("bumpmap"), "0.1"));
    assert_eq!(by_id("m").attribute("type"), Some("null"));
    assert_eq!(inner("o").attribute("type"), Some("plastic"));
    assert_eq!(value(elements(&tree, "bsdf", "mask")[0], "opacity"), "0.25");
    let film = elements(&tree, "film", "hdrfilm")[0];
    assert_eq!((value(film, "crop_offset_x"), value(film, "crop_width")), ("16", "32"));
    assert_eq!(value(elements(&tree, "sensor", "thinlens")[0], "focus_distance"), "8");
    assert_eq!(report.notes.iter().filter(|note| note.change == Change::LeftOut).count(), 0);
    // Mitsuba's images have no factor: this one was multiplied.
    let pictures: Vec<_> = elements(&tree, "texture", "bitmap").iter().map(|node| value(*node, "filename")).collect();
    assert_eq!(pictures.iter().filter(|name| **name == "meshes/out_001.exr").count(), 1, "{pictures:?}");
}

#[test]
fn version_3_has_other_names() {
    let (text, _) = convert("version3.pbrt");
    let tree = roxmltree::Document::parse(&text).unwrap();
    assert_eq!(value(elements(&tree, "integrator", "path")[0], "max_depth"), "8");
    assert_eq!(value(elements(&tree, "bsdf", "diffuse")[0], "reflectance"), "0.25");
    assert_eq!(value(elements(&tree, "bsdf", "dielectric")[0], "int_ior"), "1.33");
    assert_eq!(value(elements(&tree, "rfilter", "gaussian")[0], "stddev"), "1");
    // The share of the first material, which comes second here.
    let blend = elements(&tree, "bsdf", "blendbsdf")[0];
    assert_eq!(value(blend, "weight"), "0.3");
    let kinds: Vec<_> = blend.children().filter_map(|child| child.attribute("type")).collect();
    assert_eq!(kinds, ["roughconductor", "diffuse"]);
    // pbrt 3's polynomial at 0.1.
    let alpha: f64 = value(elements(&tree, "bsdf", "roughconductor")[0], "alpha").parse().unwrap();
    assert!((alpha - 0.461_760).abs() < 1e-6);
}

#[test]
fn shapes_and_groups() {
    let (text, report) = convert("shapes.pbrt");
    let tree = roxmltree::Document::parse(&text).unwrap();
    assert_eq!((report.shapes, report.instances), (14, 2));
    assert_eq!(elements(&tree, "shape", "shapegroup").len(), 1);
    assert_eq!(elements(&tree, "shape", "instance").len(), 2);
    assert_eq!(elements(&tree, "shape", "sphere").len(), 2);
    let disk = elements(&tree, "shape", "disk")[0];
    assert_eq!(value(disk, "flip_normals"), "true");
    // A mirrored cylinder keeps its outside.
    assert!(matrix(elements(&tree, "shape", "cylinder")[0])[0] > 0.0);
    let named = |name: &str| {
        let plys = elements(&tree, "shape", "ply").into_iter();
        plys.filter(|ply| value(*ply, "filename").ends_with(name)).count()
    };
    // Quads and the mirrored triangle are written anew.
    assert_eq!((named("quad.ply"), named("triangle.ply")), (0, 1));
    assert!(report.notes.iter().all(|note| note.line > 0 && note.file.ends_with("shapes.pbrt")));
}

/// Each text with a ^ where the caret must stand, and how its message starts.
const MISTAKES: [(&str, &str); 27] = [
    ("Shape ^\"sphere\n", "found a string without its end"),
    ("WorldBegin\nShape ^\"sphere", "found a string without its end"),
    ("^Shpe \"sphere\"", "found the directive `Shpe`; expected one of Accelerator"),
    ("^Shape \"teapot\"", "found the shape `teapot`; expected one of sphere, disk"),
    ("^Material \"velvet\"", "found the material `velvet`; expected one of diffuse"),
    ("Shape \"sphere\" ^\"string radius\" \"x\"", "found `radius` of type string; expected one of float, integer"),
    ("Shape \"sphere\" ^\"flot radius\" 1", "found the type `flot`; expected one of float"),
    ("Shape \"sphere\" ^\"radius\" 1", "found the string \"radius\"; expected a type and a name"),
    ("Shape \"sphere\" \"float radius\" ^nan", "found `nan`; expected a finite number"),
    ("Shape \"sphere\" \"float radius\" [ 1 ^1e999 ]", "found `1e999`; expected a finite number or `]`"),
    ("Shape \"sphere\" \"float radius\" ^-1", "found `-1`; expected a number above 0"),
    ("Shape \"sphere\" ^\"float radius\" [ 1 2 ]", "found 2 values of `radius`; expected 1"),
    ("Translate 1 ^nan 0", "found `nan`; expected a finite number, 2 of 3"),
    ("^Scale 1 0 1", "found a transformation that flattens space"),
    ("^LookAt 0 0 0 0 0 0 0 1 0", "found a LookAt with its target at its eye"),
    ("^AttributeEnd", "found AttributeEnd without its beginning"),
    ("AttributeBegin TransformBegin ^AttributeEnd", "found AttributeEnd inside of another block"),
    ("AttributeBegin^", "found the end of the file; expected the end of a block"),
    ("^Include \"s.pbrt\"", "found a file that includes itself: s.pbrt"),
    ("^Include \"nowhere.pbrt\"", "cannot read nowhere.pbrt: No such file"),
    ("Shape \"plymesh\" \"string filename\" ^\"nowhere.ply\"", "found the string \"nowhere.ply\"; expected a file"),
    (
        "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1 ^3]",
        "found `3`; expected an index below 3",
    ),
    (
        "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 # here\n ^-1 2]",
        "found `-1`; expected an index below 3",
    ),
    (
        "Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] \"integer indices\" [0 1 ^99999999999]",
        "found `99999999999`; expected a whole number",
    ),
    ("Shape \"trianglemesh\" ^\"point3 P\" [0 0 0 1]", "found 4 numbers in `P`; expected a multiple of 3"),
    ("^NamedMaterial \"x\"", "found the material `x`; expected nothing"),
    ("Material \"diffuse\" \"texture reflectance\" ^\"x\"", "found the string \"x\"; expected the name of a texture"),
];

#[test]
fn mistakes_are_pointed_at() {
    for (marked, message) in MISTAKES {
        let at = marked.find('^').unwrap();
        let text = marked.replacen('^', "", 1);
        let line = marked[..at].matches('\n').count() + 1;
        let column = at - marked[..at].rfind('\n').map_or(0, |newline| newline + 1) + 1;
        let found = convert_text(&text, &Options::default()).err().unwrap_or_else(|| panic!("this passes: {text}"));
        let expected = format!("s.pbrt:{line}:{column}: {message}");
        assert!(found.starts_with(&expected), "{marked}\n{found}\n{expected}");
        assert_eq!(found.lines().count(), 3, "one line, the excerpt, the caret: {found}");
    }
}

#[test]
fn the_unknown_is_replaced_where_asked_for() {
    let text = "Teapot 1 2 [ 3 ] \"x\"\nWorldBegin\nMaterial \"velvet\" \"float fluff\" 1\nShape \"teapot\"\nShape \"sphere\"\n\
                LightSource \"firefly\"\nTexture \"t\" \"float\" \"fbm\"";
    assert!(convert_text(text, &Options::default()).is_err());
    let (out, report) = convert_text(text, &Options { approximate: true }).unwrap();
    assert!(out.contains("diffuse"));
    let lines: Vec<_> = report.notes.iter().map(|note| note.line).collect();
    assert_eq!(lines, [1, 3, 4, 6, 7]);
}

#[test]
fn missing_scenes_and_folders_are_errors() {
    let folder = tempfile::tempdir().unwrap();
    let missing = import(&folder.path().join("no.pbrt"), &folder.path().join("o.xml"), &Options::default());
    assert!(matches!(missing, Err(ImportError::Source(_))));
    let nowhere = import(&sample("box.pbrt"), &folder.path().join("no/o.xml"), &Options::default());
    assert!(matches!(nowhere, Err(ImportError::Write { .. })));
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
}

/// Whatever is cut off or garbled is an error or a scene, never a panic.
#[test]
fn damaged_files_do_no_harm() {
    for name in ["box.pbrt", "materials.pbrt", "shapes.pbrt", "version3.pbrt", "lights.pbrt"] {
        let text = fs::read_to_string(sample(name)).unwrap();
        for at in (0..text.len()).step_by(97) {
            let _ = convert_text(&text[..at], &Options { approximate: true });
            let odd = ["]", "\"", "-1e300", "\u{e4}", "[", "0"][at % 6];
            let _ =
                convert_text(&format!("{}{odd}{}", &text[..at], &text[at..]), &Options { approximate: at % 2 == 0 });
        }
    }
}

#[test]
fn copies_do_not_grow_without_bound() {
    let mut text = "MakeNamedMaterial \"m0\" \"string type\" \"diffuse\"\n".to_owned();
    for i in 0..60 {
        let (a, b) = (i + 1, i);
        text +=
            &format!("MakeNamedMaterial \"m{a}\" \"string type\" \"mix\" \"string materials\" [ \"m{b}\" \"m{b}\" ]\n");
    }
    assert!(convert_text(&text, &Options::default()).unwrap_err().contains("found a mix of more than"));
    let mut text = String::new();
    for i in 1..60 {
        let inner =
            if i == 1 { String::new() } else { format!("\"texture tex1\" \"t{0}\" \"texture tex2\" \"t{0}\"", i - 1) };
        text += &format!("Texture \"t{i}\" \"float\" \"checkerboard\" {inner}\n");
    }
    assert!(convert_text(&text, &Options::default()).unwrap_err().contains("found a checkerboard of more than"));
}

#[test]
fn the_command_prints_what_it_did() {
    let folder = tempfile::tempdir().unwrap();
    let run = |more: &[&str], out: &str| {
        let mut command = Command::cargo_bin("pathblend").unwrap();
        command.current_dir(folder.path()).arg("import").arg(sample("lights.pbrt")).args(["-o", out]).args(more);
        command.output().unwrap()
    };
    let summary: serde_json::Value = serde_json::from_slice(&run(&["--json"], "a.xml").stdout).unwrap();
    for name in ["shapes", "instances", "lights", "materials", "files", "notes"] {
        assert!(summary.get(name).is_some(), "{name} is missing: {summary}");
    }
    let note = &summary["notes"][1];
    assert_eq!((note["change"].as_str(), note["line"].as_u64()), (Some("left_out"), Some(12)));
    assert!(note["file"].as_str().unwrap().ends_with("lights.pbrt"));
    let text = String::from_utf8(run(&[], "a.xml").stdout).unwrap();
    assert!(text.contains("lights.pbrt:12: left out: the media `fog`"), "{text}");
    let refused = run(&[], "a.exr");
    assert_eq!(refused.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&refused.stderr).contains("expected a name that ends in .xml"));
}
