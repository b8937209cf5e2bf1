//! Textures that show what a mesh file says of its vertices and faces.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use pathblend::emitter::Start;
use pathblend::load::{self, Loaded, Options};
use pathblend::math::Stream;
use pathblend::scene::EmitterId;
use pathblend::spectrum::Spectrum;

/// A square whose vertices have bytes for colours, and whose faces have colours, a number and four channels.
const MESH: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
    property uchar red\nproperty uchar green\nproperty uchar blue\nproperty double bad_0\nelement face 2\n\
    property list uchar int vertex_indices\nproperty float r\nproperty float g\nproperty float b\nproperty float heat_0\n\
    end_header\n-1 -1 0 9 9 9 1e99\n1 -1 0 9 9 9 0\n1 1 0 9 9 9 0\n-1 1 0 9 9 9 0\n3 0 1 2 1 2 3 0.5\n3 0 2 3 4 0 0 0.25\n";

fn load_text(body: &str) -> Result<Loaded, String> {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("a.ply"), MESH).unwrap();
    std::fs::write(folder.path().join("rgba.ply"), MESH.replace("heat_0", "a")).unwrap();
    let bare = MESH.replace(" r\n", " x\n");
    let bare = ["red", "heat_0", "bad_0"]
        .iter()
        .enumerate()
        .fold(bare, |text, (i, name)| text.replace(name, &format!("other{i}")));
    std::fs::write(folder.path().join("plain.ply"), bare).unwrap();
    let path = folder.path().join("scene.xml");
    let sensor = "<sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/></sensor>";
    std::fs::write(&path, format!("<scene version=\"3.0.0\">\n{sensor}\n{body}\n</scene>\n")).unwrap();
    let strip = |text: String| text.replace(&format!("{}/", folder.path().display()), "");
    load::read(&path, &Options::default()).map_err(|error| strip(error.to_string()))
}

fn shape(file: &str, inside: &str) -> String {
    format!("<shape type=\"ply\"><string name=\"filename\" value=\"{file}\"/>{inside}</shape>")
}

/// Each attribute with the parameter that it is used for, and how the message goes on behind its place.
#[test]
fn mistakes_are_named_with_their_place() {
    let diffuse = |name: &str| {
        format!(
            r#"<bsdf type="diffuse"><texture type="mesh_attribute" name="reflectance"><string name="name" value="^{name}"/></texture></bsdf>"#
        )
    };
    let mask = |name: &str| {
        let texture =
            format!(r#"<texture type="mesh_attribute" name="opacity"><string name="name" value="^{name}"/></texture>"#);
        format!(r#"<bsdf type="mask">{texture}<bsdf type="diffuse"/></bsdf>"#)
    };
    let normals = |name: &str| mask(name).replace("\"mask\"", "\"normalmap\"").replace("opacity", "normalmap");
    let bump = r#"<bsdf type="bumpmap">^<texture type="mesh_attribute" name="map"><string name="name" value="face_heat"/></texture><bsdf type="diffuse"/></bsdf>"#;
    let cases = [
        (
            shape("a.ply", &diffuse("vertex_colour")),
            "`name` is vertex_colour; expected one of vertex_color, vertex_bad, face_color, face_heat, what the mesh a.ply has",
        ),
        (
            shape("plain.ply", &diffuse("face_color")),
            "`name` is face_color; expected an attribute of the mesh plain.ply, which has none",
        ),
        (
            format!("<shape type=\"sphere\">{}</shape>", diffuse("face_color")),
            "`name` is face_color; expected an attribute of this sphere, which has none",
        ),
        (shape("a.ply", &diffuse("color")), "`name` is color; expected a name that starts with vertex_ or face_"),
        (diffuse("color"), "`name` is color; expected a name that starts with vertex_ or face_"),
        (
            shape("rgba.ply", &diffuse("face_color")),
            "`name` is face_color; expected an attribute with 1 or 3 channels here; this one of the mesh rgba.ply has 4",
        ),
        (
            shape("a.ply", &mask("face_color")),
            "`name` is face_color; expected an attribute with 1 channels here; this one of the mesh a.ply has 3",
        ),
        (shape("a.ply", &normals("face_heat")), "`name` is face_heat; expected an attribute with 3 channels here"),
        (
            shape("a.ply", &diffuse("vertex_bad")),
            "`name` is vertex_bad; expected finite numbers, which the mesh a.ply does not have there",
        ),
        (shape("a.ply", bump), "unknown texture `mesh_attribute`; expected one of bitmap, checkerboard"),
        (
            shape("a.ply", r#"<bsdf type="diffuse">^<texture type="mesh_attribute" name="reflectance"/></bsdf>"#),
            "texture `mesh_attribute` lacks the parameter `name`",
        ),
    ];
    for (marked, expected) in cases {
        let found = load_text(&marked.replace('^', "")).err().unwrap_or_else(|| panic!("this loads:\n{marked}"));
        let column = 1 + marked.find('^').unwrap();
        assert!(
            found.starts_with(&format!("scene.xml:3:{column}: {expected}")),
            "expected {column}: {expected}\n{found}"
        );
    }
}

/// A model by reference is another one on each of the meshes, and bytes are worth a warning.
#[test]
fn models_are_read_for_each_shape() {
    let texture =
        r#"<texture type="mesh_attribute" name="reflectance"><string name="name" value="vertex_color"/></texture>"#;
    let model = format!("<bsdf type=\"diffuse\" id=\"m\">{texture}</bsdf>");
    let used = shape("a.ply", "<ref id=\"m\"/>");
    let loaded = load_text(&format!("{model}{used}{used}<shape type=\"disk\"/>")).unwrap();
    assert_eq!(loaded.scene.bsdfs().len(), 3);
    let warning = "`vertex_color` is stored as whole numbers, which are taken as they are: 255 is not 1";
    assert!(loaded.warnings.iter().any(|found| found.ends_with(warning)), "{:?}", loaded.warnings);
}

/// Mitsuba 3.9.1 crashes where it samples such lights, so this stands alone: each half shines in its own colour.
#[test]
fn faces_shine() {
    let texture = r#"<texture type="mesh_attribute" name="radiance"><string name="name" value="face_color"/><float name="scale" value="2"/></texture>"#;
    let scene = load_text(&shape("a.ply", &format!("<emitter type=\"area\">{texture}</emitter>"))).unwrap().scene;
    let mut stream = Stream::new(1, &[]);
    for _ in 0..1000 {
        let (id, start, _) = scene.sample_start(stream.row()).unwrap();
        let Start::Surface { position, normal, .. } = start else { panic!("{start:?}") };
        let expected = if position.x > position.y { [2.0, 4.0, 6.0] } else { [8.0, 0.0, 0.0] };
        assert_eq!(scene.emitter(id).radiance(&start, normal).to_rgb(), expected, "{position}");
    }
    // Both halves have an area of 2 m².
    let luminance = |rgb: [f64; 3]| Spectrum::rgb(rgb[0], rgb[1], rgb[2]).luminance();
    let power = std::f64::consts::PI * 2.0 * (luminance([2.0, 4.0, 6.0]) + luminance([8.0, 0.0, 0.0]));
    assert!((scene.emitter(EmitterId(0)).power() / power - 1.0).abs() < 1e-9);
}
