//! All the forms in which a scene can be written arrive as Mitsuba understands them. Numbers are from Mitsuba 3.9.1.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use glam::{DVec2, DVec3};
use pathblend::bsdf::Bsdf;
use pathblend::emitter::Emitter;
use pathblend::load::{self, Loaded, Options};
use pathblend::scene::{Caster, Scene};
use pathblend::texture::Site;
use std::path::Path;

const SENSOR: &str = "<sensor type=\"perspective\"><float name=\"fov\" value=\"60\"/></sensor>";

/// Loads `main.xml` beside other files.
fn load_files(files: &[(&str, &str)]) -> Loaded {
    let folder = tempfile::tempdir().unwrap();
    for (name, text) in files {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, text).unwrap();
    }
    load::read(&folder.path().join("main.xml"), &Options::default()).unwrap_or_else(|error| panic!("{error}"))
}

fn load(version: &str, body: &str) -> Scene {
    load_files(&[("main.xml", &format!("<scene version=\"{version}\">{body}</scene>"))]).scene
}

fn intensity(version: &str, colour: &str) -> [f64; 3] {
    let scene = load(version, &format!("{SENSOR}<emitter type=\"point\">{colour}</emitter>"));
    let start = scene.sample_start([0.0; 4]).expect("a light").0;
    match scene.emitter(start) {
        Emitter::Point(point) => point.intensity.to_rgb(),
        other => panic!("{other:?}"),
    }
}

fn close(found: [f64; 3], expected: [f64; 3]) {
    let near = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 5e-4 * b.max(1.0));
    assert!(near, "{found:?}, expected {expected:?}");
}

#[test]
fn old_files_have_old_names() {
    let body = r#"<integrator type="sppm"><integer name="maxDepth" value="7"/><boolean name="hideEmitters" value="true"/>
            <integer name="photonCount" value="9"/></integrator>
        <sensor type="perspective"><float name="fov" value="60"/><string name="fovAxis" value="y"/>
            <transform name="toWorld"><lookAt origin="0,0,5" target="0,0,0" up="0,1,0"/></transform>
            <film type="ldrfilm"><integer name="width" value="64"/><integer name="height" value="32"/>
                <float name="gamma" value="2.2"/><boolean name="highQualityEdges" value="true"/></film></sensor>
        <shape type="sphere"><transform name="toWorld"><scale value="2"/></transform>
            <bsdf type="dielectric"><float name="intIOR" value="2"/><float name="extIOR" value="1"/></bsdf>
            <emitter type="area"><float name="samplingWeight" value="1"/></emitter></shape>
        <dpt><integer name="spp" value="3"/></dpt>"#;
    let loaded = load_files(&[("main.xml", &format!("<scene version=\"0.5.0\">{body}</scene>"))]);
    let scene = loaded.scene;
    assert_eq!((scene.max_depth, scene.hide_emitters, scene.film.size), (7, true, [64, 32]));
    let half = DVec2::new(2.0, 1.0) * 30f64.to_radians().tan();
    assert!((scene.camera.half - half).length() < 1e-12 && scene.camera.origin == DVec3::new(0.0, 0.0, 5.0));
    assert!(matches!(&scene.bsdfs()[0], Bsdf::Dielectric(glass) if glass.eta == 2.0));
    assert!(loaded.warnings.iter().any(|warning| warning.contains("main.xml:10:9: <dpt>")), "{:?}", loaded.warnings);
    let hit = Caster::new(&scene).intersect(DVec3::new(0.0, 0.0, 9.0).into(), -DVec3::Z);
    assert!(hit.is_some_and(|surface| (surface.position.z - 2.0).abs() < 1e-12));
}

#[test]
fn scenes_are_spread_over_files() {
    let main = format!(
        r#"<scene version="3.0.0"><path value="more"/><default name="wide" value="3"/>{SENSOR}
        <include filename="parts/inner.xml"/><alias id="paint" as="colour"/>
        <shape type="sphere"><include filename="radius.xml"/><ref name="bsdf" id="colour"/></shape></scene>"#
    );
    let inner = r#"<scene version="0.6.0"><default name="wide" value="9"/><include filename="glass.xml"/>
        <shape type="obj"><string name="filename" value="a.obj"/><ref id="paint"/></shape></scene>"#;
    let loaded = load_files(&[
        ("main.xml", &main),
        ("parts/inner.xml", inner),
        ("parts/glass.xml", "<bsdf type=\"dielectric\" id=\"paint\"><float name=\"intIOR\" value=\"$wide\"/></bsdf>"),
        ("more/radius.xml", "<float name=\"radius\" value=\"$wide\"/>"),
        ("more/a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
    ]);
    assert_eq!(loaded.scene.primitive_counts(), (1, 1));
    let [Bsdf::Dielectric(glass)] = loaded.scene.bsdfs() else { panic!("{:?}", loaded.scene.bsdfs()) };
    assert_eq!(glass.eta, 3.0 / 1.000277);
    let hit = Caster::new(&loaded.scene).intersect(DVec3::new(0.0, 0.0, 9.0).into(), -DVec3::Z);
    assert!(hit.is_some_and(|surface| (surface.position.z - 3.0).abs() < 1e-12));
}

#[test]
fn colours_have_many_forms() {
    let named = |form: &str| form.replace('@', "name=\"intensity\"");
    for version in ["0.6.0", "3.0.0"] {
        let read = |form: &str| intensity(version, &named(form));
        close(read("<rgb @ value=\"1, 2 3\"/>"), [1.0, 2.0, 3.0]);
        close(read("<rgb @ value=\"0.5\"/>"), [0.5; 3]);
        close(read("<float @ value=\"0.5\"/>"), [0.5; 3]);
        close(read("<spectrum @ value=\"400:0.1, 500:0.2 600:0.7, 700:0.9\"/>"), [0.988_160, 0.387_351, 0.095_602]);
    }
    close(intensity("3.0.0", &named("<spectrum @ value=\"0.5\"/>")), [0.602_397, 0.474_146, 0.454_458]);
    // What only Mitsuba 0.6 had.
    let read = |form: &str| intensity("0.6.0", &named(form));
    close(read("<spectrum @ value=\"0.5\"/>"), [0.5; 3]);
    close(read("<spectrum @ value=\"1, 2, 3\"/>"), [1.0, 2.0, 3.0]);
    close(read("<srgb @ value=\"0.5, 0, 1\"/>"), [0.214_041, 0.0, 1.0]);
    close(read("<srgb @ value=\"#336699\"/>"), [0.033_105, 0.132_868, 0.318_547]);
    let warm = read("<blackbody @ temperature=\"3000K\"/>");
    assert!(warm[0] > 2.0 * warm[1] && warm[1] > 2.0 * warm[2], "{warm:?}");
}

#[test]
fn spectra_can_be_files() {
    let text = format!(
        "<scene version=\"3.0.0\">{SENSOR}<shape type=\"sphere\"><bsdf type=\"diffuse\">\
         <spectrum name=\"reflectance\" filename=\"s.spd\"/></bsdf></shape></scene>"
    );
    let spd = "# nm value\n400 0.1\n500 0.2 # more\n\n600 0.7\n700 0.9\n";
    let scene = load_files(&[("main.xml", &text), ("s.spd", spd)]).scene;
    let Bsdf::Diffuse(paint) = &scene.bsdfs()[0] else { panic!("{:?}", scene.bsdfs()) };
    close(paint.reflectance.at(&Site::default()).to_rgb(), [0.856_079, 0.404_085, 0.112_402]);
}

/// Directions to the top left and to the bottom right corner.
#[test]
fn cameras_see_what_mitsubas_see() {
    let film = |more: &str| {
        format!(
            "<film type=\"hdrfilm\"><integer name=\"width\" value=\"64\"/><integer name=\"height\" value=\"32\"/>{more}</film>"
        )
    };
    let (fov, axis) =
        ("<float name=\"fov\" value=\"60\"/>", |a: &str| format!("<string name=\"fov_axis\" value=\"{a}\"/>"));
    let shift = "<float name=\"principal_point_offset_x\" value=\"0.1\"/>\
                 <float name=\"principal_point_offset_y\" value=\"0.2\"/>";
    let crop = "<integer name=\"crop_offset_x\" value=\"8\"/><integer name=\"crop_offset_y\" value=\"4\"/>\
                <integer name=\"crop_width\" value=\"16\"/><integer name=\"crop_height\" value=\"10\"/>";
    let cases = [
        (format!("{fov}{}", film("")), [0.577_35, 0.288_68, -0.577_35, -0.288_68]),
        (format!("{fov}{}{}", axis("y"), film("")), [1.154_70, 0.577_35, -1.154_70, -0.577_35]),
        (format!("{fov}{}{}", axis("diagonal"), film("")), [0.516_40, 0.258_20, -0.516_40, -0.258_20]),
        (format!("{fov}{}{}", axis("smaller"), film("")), [1.154_70, 0.577_35, -1.154_70, -0.577_35]),
        (format!("{fov}{}{}", axis("larger"), film("")), [0.577_35, 0.288_68, -0.577_35, -0.288_68]),
        (format!("{fov}{shift}{}", film("")), [0.461_88, 0.173_21, -0.692_82, -0.404_15]),
        (format!("{fov}{}", film(crop)), [0.433_01, 0.216_51, 0.144_34, 0.036_08]),
        (format!("{fov}{}{}", axis("y"), film(crop)), [0.866_03, 0.433_01, 0.288_68, 0.072_17]),
        (format!("{fov}{shift}{}", film(crop)), [0.317_54, 0.101_04, 0.028_87, -0.079_39]),
        (film(""), [0.386_99, 0.193_49, -0.386_99, -0.193_49]),
        (
            format!("<string name=\"focal_length\" value=\"35\"/>{}", film("")),
            [0.552_84, 0.276_42, -0.552_84, -0.276_42],
        ),
    ];
    for (body, expected) in cases {
        let camera = load("3.0.0", &format!("<sensor type=\"perspective\">{body}</sensor>")).camera;
        let size = DVec2::new(camera.size[0] as f64, camera.size[1] as f64);
        let slopes = [DVec2::ZERO, size].map(|film| {
            let local = camera.axes.to_local(camera.ray(film, [0.5; 4]).1);
            [local.x / local.z, local.y / local.z]
        });
        let near = slopes.as_flattened().iter().zip(expected).all(|(a, b)| (a - b).abs() < 2e-5);
        assert!(near, "{body}: {slopes:?}, expected {expected:?}");
    }
}

/// A cylinder stands where Mitsuba's does, and an instance repeats it.
#[test]
fn cylinders_and_instances_are_placed() {
    let can = r#"<shape type="cylinder"><point name="p0" x="1" y="0" z="0"/><point name="p1" x="3" y="1" z="1"/>
        <float name="radius" value="0.5"/></shape>"#;
    let group = format!(
        r#"{SENSOR}<shape type="shapegroup" id="g">{can}<shape type="rectangle"/></shape>
        <shape type="instance"><ref id="g"/></shape>
        <shape type="instance"><ref id="g"/><transform name="to_world"><translate x="100"/></transform></shape>"#
    );
    let scene = load("3.0.0", &group);
    assert_eq!(scene.primitive_counts(), (4, 2));
    for shift in [0.0, 100.0] {
        let (origin, direction) = (DVec3::new(2.0 + shift, 0.5, 5.0), DVec3::new(0.0, 0.1, -1.0).normalize());
        let surface = Caster::new(&scene).intersect(origin.into(), direction).expect("a hit");
        assert!((surface.position - DVec3::new(2.0 + shift, 0.9041, 0.9593)).length() < 1e-3, "{surface:?}");
        assert!((surface.geometric - DVec3::new(-0.5756, 0.5203, 0.6308)).length() < 1e-3, "{surface:?}");
    }
}

/// All the light of a shining cylinder leaves from its side, evenly.
#[test]
fn light_starts_on_cylinders() {
    let scene = load("3.0.0", &format!("{SENSOR}<shape type=\"cylinder\"><emitter type=\"area\"/></shape>"));
    let mut middle = DVec3::ZERO;
    let n = 16;
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        let row = [0.5, (f64::from(i) + 0.5) / f64::from(n), (f64::from(j) + 0.5) / f64::from(n), 0.5];
        let (_, start, pdf) = scene.sample_start(row).expect("a start");
        let pathblend::emitter::Start::Surface { position, normal, .. } = start else { panic!("{start:?}") };
        assert!((position.truncate().length() - 1.0).abs() < 1e-12 && normal.z == 0.0);
        assert!((normal.truncate() - position.truncate()).length() < 1e-12);
        assert!((pdf.0 * std::f64::consts::TAU - 1.0).abs() < 1e-12);
        middle += position / f64::from(n * n);
    }
    assert!((middle - DVec3::new(0.0, 0.0, 0.5)).length() < 1e-12, "{middle}");
}

#[test]
fn paths_are_relative_to_the_file_that_has_them() {
    let folder = tempfile::tempdir().unwrap();
    let main = folder.path().join("main.xml");
    std::fs::write(&main, format!("<scene version=\"3.0.0\">{SENSOR}<include filename=\"a.xml\"/></scene>")).unwrap();
    std::fs::write(folder.path().join("a.xml"), "<scene version=\"3.0.0\">\n  <shape type=\"x\"/></scene>").unwrap();
    let error = load::read(&main, &Options::default()).err().expect("an error");
    assert!(error.file.ends_with(Path::new("a.xml")), "{error}");
    assert_eq!(error.place.map(|place| (place.line, place.column)), Some((2, 3)));
}
