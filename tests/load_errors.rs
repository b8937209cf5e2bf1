//! What a user sees who got a scene file wrong.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use pathblend::load::{self, Options};
use std::path::Path;

const SENSOR: &str = "<sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/></sensor>";

/// The message for a scene whose third line starts with `body`, without the path before the file's name.
fn message(body: &str) -> String {
    message_of(&format!("<scene version=\"3.0.0\">\n{SENSOR}\n{body}\n</scene>\n"), &Options::default())
}

fn message_of(text: &str, options: &Options) -> String {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("broken.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n").unwrap();
    std::fs::write(folder.path().join("infinite.obj"), "v 0 0 0\nv 1 0 0\nv 0 1e99 0\nf 1 2 3\n").unwrap();
    std::fs::write(folder.path().join("garbage.ply"), [0xff, 0x00, 0x80, 0x1b].repeat(100)).unwrap();
    let path = folder.path().join("scene.xml");
    std::fs::write(&path, text).unwrap();
    let error = load::read(&path, options).err().unwrap_or_else(|| panic!("this loads:\n{text}"));
    error.to_string().replace(&format!("{}/", folder.path().display()), "")
}

/// Each body with a ^ where the caret must stand, and how its message starts.
const BODIES: [(&str, &str); 87] = [
    // Plugins that do not exist, or not here.
    (
        r#"^<bsdf type="velvet"/>"#,
        "unknown bsdf `velvet`; expected one of diffuse, conductor, roughconductor, dielectric, thindielectric, roughdielectric, plastic, \
         roughplastic, phong, coating, roughcoating, principled, null, mask, blendbsdf, twosided, bumpmap, normalmap",
    ),
    (
        r#"^<shape type="helix"/>"#,
        "unknown shape `helix`; expected one of rectangle, cube, sphere, disk, cylinder, obj, ply, serialized",
    ),
    (r#"^<emitter type="projector"/>"#, "unknown emitter `projector`; expected one of constant, envmap, sunsky"),
    (r#"^<emitter type="envmap"/>"#, "emitter `envmap` lacks the parameter `filename`"),
    (
        r#"<emitter type="spot"><float name="cutoff_angle" value="^0"/></emitter>"#,
        "`cutoff_angle` is 0; expected above 0, up to 180",
    ),
    (r#"<emitter type="sky"><float name="turbidity" value="^11"/></emitter>"#, "`turbidity` is 11; expected 1 to 10"),
    (r#"<emitter type="sky"/>^<emitter type="constant"/>"#, "a scene can have one environment emitter only"),
    (r#"^<emitter type="area"/>"#, "an area emitter shines from a shape"),
    (
        r#"<shape type="sphere">^<emitter type="point"/></shape>"#,
        "unexpected emitter `point` in a shape; expected area",
    ),
    (r#"^<sensor type="fisheye"/>"#, "unknown sensor `fisheye`; expected one of perspective, thinlens"),
    (
        r#"^<medium type="homogeneous"/>"#,
        "unexpected <medium> in the scene; expected one of default, integrator, sensor, texture, bsdf",
    ),
    (r#"^<bsdf/>"#, "<bsdf> lacks the attribute `type`"),
    (r#"<bsdf type="diffuse" ^kind="x"/>"#, "unexpected attribute `kind` in <bsdf>; expected one of type, id, name"),
    // Parameters.
    (
        r#"<bsdf type="diffuse">^<float name="sheen" value="1"/></bsdf>"#,
        "unreferenced parameter `sheen` in bsdf `diffuse`; expected reflectance",
    ),
    (
        r#"<bsdf type="diffuse">^<bsdf type="diffuse"/></bsdf>"#,
        "unreferenced <bsdf> in bsdf `diffuse`; expected reflectance",
    ),
    (
        r#"<bsdf type="diffuse">^<string name="reflectance" value="1"/></bsdf>"#,
        "`reflectance` is a <string>; expected one of <rgb>, <spectrum>, <float>",
    ),
    (
        r#"<bsdf type="diffuse">^<texture type="bitmap" name="reflectance"/></bsdf>"#,
        "texture `bitmap` lacks the parameter `filename`",
    ),
    (r#"<bsdf type="diffuse">^<rgb name="reflectance"/></bsdf>"#, "<rgb> lacks the attribute `value`"),
    (
        r#"<bsdf type="diffuse"><rgb name="reflectance" value="1"/><rgb name="^reflectance" value="1"/></bsdf>"#,
        "the parameter `reflectance` is given twice",
    ),
    (
        r#"<bsdf type="diffuse"><rgb name="reflectance" value="^0.1 0.2"/></bsdf>"#,
        "found `0.1 0.2`; expected three numbers, or one for all three",
    ),
    (
        r#"<bsdf type="diffuse"><rgb name="reflectance" value="^0.1 0.2 nan"/></bsdf>"#,
        "found `0.1 0.2 nan`; expected finite numbers",
    ),
    (
        r#"<bsdf type="diffuse"><rgb name="reflectance" value="^0.1, 0.2, 1.5"/></bsdf>"#,
        "`reflectance` is 0.1, 0.2, 1.5; expected values from 0 to 1",
    ),
    (
        r#"<bsdf type="diffuse"><spectrum name="reflectance" value="^400:0.1, 700"/></bsdf>"#,
        "found `400:0.1, 700`; expected pairs wavelength:value of finite numbers",
    ),
    (
        r#"<bsdf type="roughconductor"><float name="alpha" value="^0"/></bsdf>"#,
        "`alpha` is 0; expected a number above 0",
    ),
    (
        r#"<bsdf type="roughconductor"><float name="alpha" value="^rough"/></bsdf>"#,
        "found `rough`; expected a finite number",
    ),
    (
        r#"<bsdf type="roughconductor"><string name="distribution" value="^phong"/></bsdf>"#,
        "`distribution` is phong; expected one of beckmann, ggx",
    ),
    (
        r#"<bsdf type="conductor"><string name="material" value="^Brass"/></bsdf>"#,
        "`material` is Brass; expected one of none, Ag, Al,",
    ),
    (r#"<bsdf type="conductor"><rgb name="eta" value="^-1"/></bsdf>"#, "`eta` is -1; expected values of at least 0"),
    (
        r#"<bsdf type="dielectric"><float name="int_ior" value="^-1.5"/></bsdf>"#,
        "`int_ior` is -1.5; expected a number above 0 or one of vacuum, helium",
    ),
    (
        r#"<bsdf type="dielectric"><string name="ext_ior" value="^honey"/></bsdf>"#,
        "`ext_ior` is honey; expected a number above 0 or one of vacuum, helium",
    ),
    (r#"^<bsdf type="mask"/>"#, "a mask with 0 nested <bsdf>; expected one"),
    (
        r#"^<bsdf type="blendbsdf"><bsdf type="diffuse"/><bsdf type="diffuse"/></bsdf>"#,
        "bsdf `blendbsdf` lacks the parameter `weight`",
    ),
    (
        r#"^<bsdf type="blendbsdf"><float name="weight" value="0.5"/><bsdf type="diffuse"/></bsdf>"#,
        "a blendbsdf with 1 nested <bsdf>; expected two",
    ),
    (
        r#"<bsdf type="twosided"><bsdf type="^mask"><bsdf type="diffuse"/></bsdf></bsdf>"#,
        "a twosided bsdf cannot hold `mask`; expected an opaque bsdf",
    ),
    (r#"<bsdf type="mask" id="a">^<ref id="a"/></bsdf>"#, "this refers to itself: a → a"),
    (
        r#"^<bsdf type="roughdielectric"><float name="int_ior" value="1.5"/><float name="ext_ior" value="1.5"/></bsdf>"#,
        "`int_ior` equals `ext_ior`; expected two indices that differ",
    ),
    (
        r#"^<bsdf type="roughconductor"><float name="alpha" value="1"/><float name="alpha_u" value="1"/></bsdf>"#,
        "both `alpha` and `alpha_u`, `alpha_v`; expected one or the other",
    ),
    (
        r#"<bsdf type="conductor"><rgb name="eta" value="1"/><string name="material" value="^Au"/></bsdf>"#,
        "`material` is Au; expected either `material` or `eta` and `k`",
    ),
    (
        r#"^<bsdf type="principled"><float name="sheen" value="2"/></bsdf>"#,
        "`sheen` is 2; expected a number from 0 to 1",
    ),
    (
        r#"^<bsdf type="principled"><float name="eta" value="1.5"/><float name="specular" value="0.5"/></bsdf>"#,
        "both `eta` and `specular`; expected one or the other",
    ),
    (
        r#"^<bsdf type="coating"><bsdf type="dielectric"/></bsdf>"#,
        "a coating over a transparent bsdf; expected an opaque one",
    ),
    (r#"^<bsdf type="bumpmap"><bsdf type="diffuse"/></bsdf>"#, "bsdf `bumpmap` lacks the parameter `map`"),
    (r#"^<bsdf type="twosided"/>"#, "a twosided bsdf with 0 nested <bsdf>; expected one or two"),
    (
        r#"<bsdf type="twosided"><bsdf type="^dielectric"/></bsdf>"#,
        "a twosided bsdf cannot hold `dielectric`; expected an opaque bsdf",
    ),
    (r#"<bsdf type="twosided" id="a">^<ref id="a"/></bsdf>"#, "this refers to itself: a → a"),
    // References.
    (r#"<shape type="sphere"><ref id="^nobody"/></shape>"#, "nothing in this file has the id `nobody`"),
    (
        r#"<shape type="disk" id="a"/><shape type="sphere">^<ref id="a"/></shape>"#,
        "this refers to a <shape>; expected one of",
    ),
    (r#"<shape type="sphere" id="a"/><shape type="disk" id="^a"/>"#, "the id `a` is given twice"),
    (
        r#"<shape type="sphere"><bsdf type="diffuse"/>^<bsdf type="diffuse"/></shape>"#,
        "a second <bsdf> in shape `sphere`",
    ),
    // Light.
    (
        r#"<shape type="sphere"><emitter type="area"><rgb name="radiance" value="^1 -1 1"/></emitter></shape>"#,
        "`radiance` is 1 -1 1; expected values of at least 0",
    ),
    (r#"<emitter type="constant"/>^<emitter type="constant"/>"#, "a scene can have one environment emitter only"),
    (r#"<emitter type="point">^<point name="position" x="1" y="2"/></emitter>"#, "<point> lacks the attribute `z`"),
    (
        r#"<emitter type="point"><point name="position" value="1"/>^<transform name="to_world"/></emitter>"#,
        "a point emitter with both",
    ),
    // Shapes.
    (r#"<shape type="sphere"><float name="radius" value="^-2"/></shape>"#, "`radius` is -2; expected a number above 0"),
    (r#"^<shape type="sphere"><float name="radius" value="1e30"/></shape>"#, "this shape is too small or too large"),
    (
        r#"<shape type="sphere"><boolean name="flip_normals" value="^yes"/></shape>"#,
        "found `yes`; expected true or false",
    ),
    (
        r#"^<shape type="sphere"><boolean name="flip_normals" value="true"/><emitter type="area"/></shape>"#,
        "a sphere that shines inwards is not supported",
    ),
    (
        r#"<shape type="sphere">^<transform name="to_world"><scale x="2"/></transform></shape>"#,
        "a sphere that is scaled differently along its axes",
    ),
    (
        r#"<shape type="disk">^<transform name="to_world"><scale x="2"/></transform></shape>"#,
        "a disk that is scaled differently along x and y",
    ),
    (r#"^<shape type="obj"/>"#, "shape `obj` lacks the parameter `filename`"),
    (
        r#"<shape type="obj"><string name="filename" value="^no.obj"/></shape>"#,
        "cannot read the mesh no.obj: No such file",
    ),
    (
        r#"<shape type="obj"><string name="filename" value="^broken.obj"/></shape>"#,
        "the mesh broken.obj is broken: line 4: a face refers to a vertex that does not exist",
    ),
    (
        r#"^<shape type="obj"><string name="filename" value="infinite.obj"/></shape>"#,
        "this shape is too small or too large",
    ),
    (r#"<shape type="ply"><string name="filename" value="^garbage.ply"/></shape>"#, "the mesh garbage.ply is broken: "),
    // Transformations.
    (
        r#"<shape type="cube"><transform name="to_world">^<shear x="1"/></transform></shape>"#,
        "unknown transformation <shear>; expected one of translate, scale, rotate, matrix, lookat",
    ),
    (
        r#"<shape type="cube">^<transform name="to_world"><scale z="0"/></transform></shape>"#,
        "this transformation flattens space",
    ),
    (
        r#"<shape type="cube">^<transform name="to_world"><scale value="1e200"/></transform></shape>"#,
        "this transformation is too large",
    ),
    (
        r#"<shape type="cube"><transform name="to_world">^<rotate angle="3"/></transform></shape>"#,
        "<rotate> has no axis",
    ),
    (
        r#"<shape type="cube"><transform name="to_world">^<rotate x="1"/></transform></shape>"#,
        "<rotate> lacks the attribute `angle`",
    ),
    (
        r#"<shape type="cube"><transform name="to_world"><matrix value="^1 2 3"/></transform></shape>"#,
        "found 3 numbers; expected 16, or 9 without translation",
    ),
    (
        r#"<shape type="cube"><transform name="to_world"><matrix value="^1 0 0 0 0 1 0 0 0 0 1 0 0 0 1 1"/></transform></shape>"#,
        "the last row of this matrix is not 0 0 0 1",
    ),
    (
        r#"<shape type="cube"><transform name="to_world">^<lookat origin="0 0 0" target="0 0 0" up="0 1 0"/></transform></shape>"#,
        "<lookat> has its target at its origin",
    ),
    (
        r#"<shape type="cube"><transform name="to_world">^<lookat origin="0 0 0" target="0 2 0" up="0 1 0"/></transform></shape>"#,
        "<lookat> looks along `up`",
    ),
    // Camera, film, integrator.
    (
        r#"<sensor type="perspective"><string name="focal_length" value="^-3mm"/></sensor>"#,
        "`focal_length` is -3mm; expected a length above 0 such as 50mm",
    ),
    (
        r#"<sensor type="perspective"><float name="fov" value="^20"/><string name="focal_length" value="3mm"/></sensor>"#,
        "`fov` is 20; expected either `fov` or `focal_length`",
    ),
    (
        r#"<sensor type="perspective">^<film type="hdrfilm"><integer name="crop_offset_x" value="700"/></film></sensor>"#,
        "the crop of 768 × 576 pixels at 700, 0 leaves the film",
    ),
    (
        r#"<sensor type="perspective"><float name="fov" value="^180"/></sensor>"#,
        "`fov` is 180; expected an angle between 0 and 180 degrees",
    ),
    (
        r#"^<sensor type="thinlens"><float name="fov" value="90"/></sensor>"#,
        "sensor `thinlens` lacks the parameter `aperture_radius`",
    ),
    (
        r#"<sensor type="orthographic">^<float name="fov" value="40"/></sensor>"#,
        "unreferenced parameter `fov` in sensor `orthographic`; expected",
    ),
    (
        r#"<sensor type="orthographic"><float name="near_clip" value="2"/><float name="far_clip" value="^2"/></sensor>"#,
        "`far_clip` is 2; expected a number above `near_clip`",
    ),
    (
        r#"<sensor type="orthographic">^<transform name="to_world"><matrix value="1 1 0 0 1 0 0 0 1"/></transform></sensor>"#,
        "the axes of this camera are not at right angles",
    ),
    (
        r#"<sensor type="perspective"><film type="hdrfilm"><integer name="width" value="^0"/></film></sensor>"#,
        "`width` is 0; expected 1 to 65536 pixels",
    ),
    (
        r#"<sensor type="perspective"><film type="hdrfilm">^<float name="width" value="8"/></film></sensor>"#,
        "`width` is a <float>; expected <integer>",
    ),
    (
        r#"<sensor type="perspective"><film type="hdrfilm">^<rfilter type="lanczos"/></film></sensor>"#,
        "unknown rfilter `lanczos`; expected one of box, tent, gaussian",
    ),
    (
        r#"<integrator type="path"><integer name="max_depth" value="^-2"/></integrator>"#,
        "`max_depth` is -2; expected -1 (no bound) or 1 to 4096",
    ),
    (
        r#"<integrator type="path"><boolean name="hide_emitters" value="^maybe"/></integrator>"#,
        "found `maybe`; expected true or false",
    ),
    (r#"<integrator type="path"/>^<integrator type="path"/>"#, "a scene can have one integrator only"),
];

#[test]
fn mistakes_are_named_with_their_place() {
    let mut wrong = String::new();
    for (marked, expected) in BODIES {
        let found = message(&marked.replace('^', ""));
        let column = 1 + marked.find('^').unwrap();
        if !found.starts_with(&format!("scene.xml:3:{column}: {expected}")) {
            wrong += &format!("expected {column}: {expected}\n{found}\n");
        }
        let caret = found.lines().last().unwrap_or_default();
        assert!(found.lines().count() == 3 && caret.trim_end().ends_with('^'), "{found}");
    }
    assert!(wrong.is_empty(), "{wrong}");
}

#[test]
fn the_excerpt_shows_the_line_with_a_caret() {
    let found = message("    <bsdf type=\"velvet\">\n    </bsdf>");
    assert_eq!(found.lines().nth(1), Some("   |     <bsdf type=\"velvet\">"));
    assert_eq!(found.lines().nth(2), Some("   |     ^"));
}

#[test]
fn whole_files_are_refused_with_a_reason() {
    let plain = Options::default();
    let cases = [
        ("", "scene.xml:1:1: not well-formed XML"),
        (
            "<scene version=\"3.0.0\">\n<shape>\n</scene>",
            "scene.xml:3:1: not well-formed XML: expected 'shape' tag, not 'scene'",
        ),
        ("<html/>", "scene.xml:1:1: found <html>; expected <scene version=\"3.0.0\">"),
        ("<scene/>", "scene.xml:1:1: <scene> lacks the attribute `version`"),
        ("<scene version=\"0.3.0\"/>", "scene.xml:1:17: scene format 0.3.0 is not supported; expected 0.4 to 3"),
        ("<scene version=\"3.0.0\"/>", "scene.xml:1:1: this scene lacks a <sensor>"),
        (
            "<scene version=\"3.0.0\">\n <shape type=\"$form\"/></scene>",
            "scene.xml:2:15: the parameter `$form` has no <default> before this place; expected nothing",
        ),
    ];
    for (text, expected) in cases {
        let found = message_of(text, &plain);
        assert!(found.starts_with(expected), "{found}");
    }
    let overrides = [("width".to_owned(), "3".to_owned())].into();
    let text = format!(
        "<scene version=\"3.0.0\"><default name=\"spp\" value=\"1\"/>{SENSOR}<default name=\"x\" value=\"$spp\"/></scene>"
    );
    let found = message_of(&text, &Options { overrides, ..Options::default() });
    assert_eq!(found, "scene.xml: nothing in this file uses the parameter `width`; expected spp");
    let found = message_of(&text, &Options { size: Some([0, 9]), ..plain });
    assert!(found.starts_with("scene.xml: an image of 0 × 9 pixels; expected 1 to 65536"), "{found}");
}

#[test]
fn files_that_are_no_text_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.xml");
    std::fs::write(&path, b"<scene version=\"3.0.0\">\n  \xff\xfe</scene>").unwrap();
    let found = load::read(&path, &Options::default()).err().unwrap();
    assert_eq!(found.place.map(|place| (place.line, place.column)), Some((2, 3)));
    assert!(found.message.contains("not UTF-8 text"));
    let missing = load::read(Path::new("/no/such/scene.xml"), &Options::default()).err().unwrap();
    assert!(missing.to_string().starts_with("/no/such/scene.xml: cannot read the scene file: No such file"));
    assert!(load::read(folder.path(), &Options::default()).is_err());
}

#[test]
fn dark_scenes_are_legal_but_said_to_be_dark() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.xml");
    let warnings = |body: &str| {
        std::fs::write(&path, format!("<scene version=\"3.0.0\">{SENSOR}{body}</scene>")).unwrap();
        load::read(&path, &Options::default()).unwrap_or_else(|error| panic!("{error}")).warnings
    };
    let dark = "nothing in the scene shines: the image will be black";
    assert_eq!(warnings(""), ["the scene has no shapes", dark]);
    assert_eq!(warnings("<shape type=\"sphere\"/>"), [dark]);
    assert_eq!(warnings("<shape type=\"sphere\"/><emitter type=\"constant\"/>"), [""; 0]);
    let black = "<emitter type=\"constant\"><float name=\"radiance\" value=\"0\"/></emitter>";
    assert_eq!(warnings(&format!("<shape type=\"sphere\"/>{black}")), [dark]);
}
