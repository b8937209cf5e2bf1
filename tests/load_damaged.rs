//! A sound scene is broken in one named way at a time: each gives one error with its place and its cause.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use flate2::{Compression, write::ZlibEncoder};
use pathblend::load::{self, Options};
use std::collections::BTreeMap;
use std::io::Write;
use std::path::Path;

const MAIN: &str = r##"<?xml version="1.0" encoding="utf-8"?>
<scene version="3.0.0">
    <path value="shared"/>
    <default name="wide" value="64"/>
    <integrator type="path"><integer name="max_depth" value="7"/></integrator>
    <sensor type="perspective">
        <float name="fov" value="40"/>
        <transform name="to_world"><lookat origin="0 0 9" target="0 0 0" up="0 1 0"/></transform>
        <film type="hdrfilm"><integer name="width" value="$wide"/><rfilter type="box"/></film>
    </sensor>
    <bsdf type="diffuse" id="paint"><rgb name="reflectance" value="0.1, 0.2, 0.3"/></bsdf>
    <bsdf type="diffuse" id="tint"><spectrum name="reflectance" value="400:0.1, 700:0.2"/></bsdf>
    <bsdf type="diffuse" id="measured"><spectrum name="reflectance" filename="paint.spd"/></bsdf>
    <include filename="inner.xml"/>
    <alias id="paint" as="colour"/>
    <shape type="obj"><string name="filename" value="a.obj"/><ref id="colour"/></shape>
    <shape type="ply"><string name="filename" value="a.ply"/><ref id="tint"/></shape>
    <shape type="serialized"><string name="filename" value="a.serialized"/><integer name="shape_index" value="1"/></shape>
    <shape type="cylinder"><point name="p1" x="0" y="0" z="2"/><float name="radius" value="0.5"/></shape>
    <shape type="shapegroup" id="group"><shape type="rectangle"/></shape>
    <shape type="instance"><ref id="group"/><transform name="to_world"><scale value="2"/></transform></shape>
    <emitter type="point"><rgb name="intensity" value="1"/></emitter>
</scene>
"##;

const INNER: &str = "<scene version=\"0.6.0\">\n  <shape type=\"sphere\"><ref id=\"paint\"/>\
                     <boolean name=\"flipNormals\" value=\"false\"/></shape>\n</scene>\n";

const OBJ: &str = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nf 1/1/1 2/1/1 3/1/1\n";

const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                   element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";

/// A mesh in Mitsuba's format with a triangle to the vertex `last`, of so many vertices as it says.
fn serialized(vertices: u64, last: u32, x: f32) -> Vec<u8> {
    let mut body = [&0u32.to_le_bytes()[..], b"name\0", &vertices.to_le_bytes(), &1u64.to_le_bytes()].concat();
    [x, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().for_each(|number: &f32| body.extend(number.to_le_bytes()));
    [0, 1, last].iter().for_each(|index| body.extend(index.to_le_bytes()));
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    encoder.write_all(&body).unwrap();
    [&[0x1c, 0x04, 4, 0][..], &encoder.finish().unwrap()].concat()
}

/// Two meshes and their list, of which the second one is given.
fn two_meshes(second: &[u8]) -> Vec<u8> {
    let first = serialized(3, 2, 0.0);
    let starts = [0, first.len() as u64].map(u64::to_le_bytes).concat();
    [&first[..], second, &starts, &2u32.to_le_bytes()].concat()
}

type Files = BTreeMap<&'static str, Vec<u8>>;

fn sound() -> Files {
    [
        ("main.xml", MAIN.as_bytes().to_vec()),
        ("inner.xml", INNER.as_bytes().to_vec()),
        ("a.obj", OBJ.as_bytes().to_vec()),
        ("shared/a.ply", PLY.as_bytes().to_vec()),
        ("a.serialized", two_meshes(&serialized(3, 2, 0.0))),
        ("paint.spd", b"# nm\n400 0.1\n700 0.2\n".to_vec()),
    ]
    .into()
}

/// The message for the scene in `files`.
fn message(files: &Files) -> Result<(), String> {
    let folder = tempfile::tempdir().unwrap();
    for (name, bytes) in files {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, bytes).unwrap();
    }
    let result = load::read(&folder.path().join("main.xml"), &Options::default());
    result.map(drop).map_err(|error| error.to_string().replace(&format!("{}/", folder.path().display()), ""))
}

/// Line and column of a byte.
fn place(text: &str, offset: usize) -> (usize, usize) {
    let before = &text[..offset];
    (before.matches('\n').count() + 1, before.rsplit('\n').next().unwrap_or_default().chars().count() + 1)
}

/// Replaces a piece of an XML file. The error must stand at the ^ in the new text.
fn replaced(file: &'static str, from: &str, to: &str, phrase: &str) -> Result<(), String> {
    let mut files = sound();
    let text = String::from_utf8(files[file].clone()).unwrap();
    assert_eq!(text.matches(from).count(), 1, "{from}");
    let marked = text.replace(from, to);
    let text = marked.replace('^', "");
    let (line, column) = place(&text, marked.find('^').unwrap_or_else(|| panic!("no place in {to}")));
    files.insert(file, text.into_bytes());
    expect(message(&files), &format!("{file}:{line}:{column}: "), phrase)
}

/// Replaces a file that the scene names. The error must stand at its name.
fn swapped(file: &'static str, bytes: &[u8], phrase: &str) -> Result<(), String> {
    let mut files = sound();
    files.insert(file, bytes.to_vec());
    let name = Path::new(file).file_name().unwrap().to_str().unwrap();
    let (line, column) = place(MAIN, MAIN.find(name).unwrap());
    expect(message(&files), &format!("main.xml:{line}:{column}: "), phrase)
}

fn expect(found: Result<(), String>, start: &str, phrase: &str) -> Result<(), String> {
    match found {
        Ok(()) => Err(format!("it loads; expected {start}… {phrase}")),
        Err(found) if found.starts_with(start) && found.contains(phrase) => Ok(()),
        Err(found) => Err(format!("{found}\n   expected {start}… {phrase}")),
    }
}

/// What is changed in `main.xml`, the change with a ^ at the place of the error, and a phrase of the cause.
const CHANGES: [(&str, &str, &str); 61] = [
    // The document.
    ("</emitter>\n</scene>\n", "</emitter>^\n", "the file ends before its outermost element"),
    ("<sensor type", "<sensor kind=\"^<\" type", "not well-formed XML"),
    ("<scene version=\"3.0.0\">", "^<!DOCTYPE s [<!ENTITY a \"b\">]><scene version=\"3.0.0\">", "<!DOCTYPE>"),
    ("<scene version=\"3.0.0\">", "<scene version=\"^4.0.0\">", "expected 0.4 to 3"),
    ("<scene version=\"3.0.0\">", "<scene version=\"^0.2.0\">", "expected 0.4 to 3"),
    ("<scene version=\"3.0.0\">", "^<scene>", "lacks the attribute `version`"),
    ("<path value=\"shared\"/>", "^<path/>", "<path> lacks the attribute `value`"),
    (
        "<default name=\"wide\" value=\"64\"/>",
        "<default name=\"wide\" value=\"64\" ^unit=\"px\"/>",
        "unexpected attribute `unit`",
    ),
    ("value=\"$wide\"", "value=\"^$broad\"", "the parameter `$broad` has no <default>"),
    ("<emitter type=\"point\">", "^<emiter/><emitter type=\"point\">", "unexpected <emiter> in the scene"),
    ("<emitter type=\"point\">", "^<medium/><emitter type=\"point\">", "unexpected <medium> in the scene"),
    // Other files.
    ("inner.xml", "^other.xml", "cannot find the file `other.xml`; looked for other.xml, shared/other.xml"),
    ("inner.xml", "^main.xml", "files include each other in a circle: main.xml → main.xml"),
    ("<include filename=\"inner.xml\"/>", "^<include/>", "<include> lacks the attribute `filename`"),
    (
        "a.obj",
        "^b.obj",
        "cannot read the mesh b.obj: No such file or directory (os error 2); looked for b.obj, shared/b.obj",
    ),
    ("a.ply", "^shared", "it is not a plain file"),
    ("paint.spd", "^none.spd", "cannot read the spectrum none.spd"),
    // Names.
    ("id=\"tint\"><", "id=\"^paint\"><", "the id `paint` is given twice"),
    (
        "<alias id=\"paint\" as=\"colour\"/>",
        "<alias id=\"^pain\" as=\"colour\"/>",
        "nothing in this file has the id `pain`",
    ),
    ("as=\"colour\"", "as=\"^tint\"", "the id `tint` is given twice"),
    ("<alias id=\"paint\" as", "<alias id=\"paint\" ^is", "unexpected attribute `is` in <alias>"),
    ("<ref id=\"colour\"/>", "<ref id=\"^color\"/>", "nothing in this file has the id `color`"),
    ("<ref id=\"colour\"/>", "^<ref id=\"group\"/>", "this refers to a <shape>"),
    ("<shape type=\"rectangle\"/>", "^<ref id=\"group\"/>", "this refers to itself: group → group"),
    ("<ref id=\"colour\"/>", "^<ref/>", "<ref> lacks the attribute `id`"),
    // Kinds and parameters.
    (
        "<shape type=\"cylinder\">",
        "^<shape type=\"tube\">",
        "unknown shape `tube`; expected one of rectangle, cube, sphere, disk, cylinder",
    ),
    ("<shape type=\"cylinder\">", "^<shape>", "<shape> lacks the attribute `type`"),
    ("<emitter type=\"point\">", "^<emitter type=\"torch\">", "unknown emitter `torch`"),
    ("<sensor type=\"perspective\">", "^<sensor type=\"eye\">", "unknown sensor `eye`"),
    ("<film type=\"hdrfilm\">", "^<film type=\"paper\">", "unknown film `paper`"),
    ("<rfilter type=\"box\"/>", "^<rfilter type=\"cone\"/>", "unknown rfilter `cone`"),
    (
        "<float name=\"radius\" value=\"0.5\"/>",
        "^<float name=\"width\" value=\"0.5\"/>",
        "unreferenced parameter `width` in shape `cylinder`",
    ),
    (
        "<float name=\"radius\"",
        "^<string name=\"radius\"",
        "`radius` is a <string>; expected one of <float>, <integer>",
    ),
    ("<integer name=\"shape_index\"", "^<float name=\"shape_index\"", "`shape_index` is a <float>; expected <integer>"),
    (
        "<float name=\"radius\" value=\"0.5\"/>",
        "<float name=\"radius\" value=\"1\"/><float name=\"^radius\" value=\"2\"/>",
        "given twice",
    ),
    ("<float name=\"fov\" value=\"40\"/>", "^<float name=\"fOV\" value=\"40\"/>", "unreferenced parameter `fOV`"),
    // Values.
    ("value=\"40\"", "value=\"^nan\"", "found `nan`; expected a finite number"),
    ("value=\"40\"", "value=\"^inf\"", "found `inf`; expected a finite number"),
    ("value=\"40\"", "value=\"^-40\"", "`fov` is -40; expected an angle"),
    ("value=\"40\"", "value=\"^wide\"", "found `wide`; expected a finite number"),
    ("value=\"0.5\"", "value=\"^-0.5\"", "`radius` is -0.5; expected a number above 0"),
    ("value=\"0.5\"", "value=\"^0\"", "`radius` is 0; expected a number above 0"),
    ("value=\"7\"", "value=\"^7.5\"", "found `7.5`; expected a whole number"),
    ("value=\"7\"", "value=\"^99999\"", "`max_depth` is 99999; expected -1 (no bound) or 1 to 4096"),
    ("value=\"0.1, 0.2, 0.3\"", "value=\"^0.1, 0.2\"", "expected three numbers"),
    ("value=\"0.1, 0.2, 0.3\"", "value=\"^0.1, nan, 0.3\"", "expected finite numbers"),
    ("value=\"0.1, 0.2, 0.3\"", "value=\"^0.1, 0.2, -0.3\"", "expected values from 0 to 1"),
    ("value=\"400:0.1, 700:0.2\"", "value=\"^400:0.1\"", "fewer than two values"),
    ("value=\"400:0.1, 700:0.2\"", "value=\"^700:0.1, 400:0.2\"", "in ascending order"),
    ("value=\"400:0.1, 700:0.2\"", "value=\"^400:0.1, 700:-0.2\"", "this spectrum is -0.2 at 700 nm"),
    ("value=\"400:0.1, 700:0.2\"", "value=\"^400:0.1, 700:nan\"", "expected pairs wavelength:value"),
    ("value=\"1\"/></emitter>", "value=\"^-1\"/></emitter>", "`intensity` is -1; expected values of at least 0"),
    // Transformations and shapes.
    (
        "<transform name=\"to_world\"><scale value=\"2\"/>",
        "^<transform name=\"to_world\"><scale value=\"0\"/>",
        "flattens space",
    ),
    ("<scale value=\"2\"/>", "<matrix value=\"^1 0 0 0\"/>", "found 4 numbers; expected 16, or 9"),
    ("<scale value=\"2\"/>", "^<bend value=\"2\"/>", "unknown transformation <bend>"),
    ("target=\"0 0 0\"", "target=\"^0 0\"", "expected three numbers"),
    ("<lookat origin=\"0 0 9\"", "^<lookat origin=\"0 0 0\"", "has its target at its origin"),
    ("x=\"0\" y=\"0\" z=\"2\"", "x=\"0\" y=\"^nan\" z=\"2\"", "expected a finite number"),
    (
        "<shape type=\"cylinder\"><point name=\"p1\" x=\"0\" y=\"0\" z=\"2\"/>",
        "^<shape type=\"cylinder\"><point name=\"p1\" x=\"0\" y=\"0\" z=\"0\"/>",
        "`p0` and `p1` in the same place",
    ),
    (
        "<shape type=\"rectangle\"/>",
        "<shape type=\"rectangle\">^<emitter type=\"area\"/></shape>",
        "a shape in a shapegroup cannot shine",
    ),
    ("<shape type=\"instance\"><ref id=\"group\"/>", "^<shape type=\"instance\">", "an instance of nothing"),
];

#[test]
fn the_sound_scene_loads() {
    assert_eq!(message(&sound()), Ok(()));
}

#[test]
fn damaged_scene_files_are_explained() {
    let wrong: Vec<_> =
        CHANGES.iter().filter_map(|(from, to, phrase)| replaced("main.xml", from, to, phrase).err()).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(CHANGES.len() > 60);
}

#[test]
fn damage_in_included_files_is_found_there() {
    let cases = [
        ("value=\"false\"", "value=\"^no\"", "found `no`; expected true or false"),
        (
            "<boolean name=\"flipNormals\"",
            "^<float name=\"flipNormals\"",
            "`flipNormals` is a <float>; expected <boolean>",
        ),
        ("<shape type=\"sphere\">", "^<shape type=\"ball\">", "unknown shape `ball`"),
        ("\"paint\"", "\"^paintt\"", "nothing in this file has the id `paintt`"),
        ("</scene>", "<include filename=\"^main.xml\"/></scene>", "in a circle: main.xml → inner.xml → main.xml"),
        ("</shape>", "^</shap>", "not well-formed XML"),
    ];
    let wrong: Vec<_> =
        cases.iter().filter_map(|(from, to, phrase)| replaced("inner.xml", from, to, phrase).err()).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn damaged_meshes_are_explained() {
    let ply = |from: &str, to: &str| PLY.replace(from, to).into_bytes();
    let obj = |from: &str, to: &str| OBJ.replace(from, to).into_bytes();
    let cut = |bytes: Vec<u8>, length: usize| bytes[..length].to_vec();
    let whole = serialized(3, 2, 0.0);
    let cases: Vec<(&'static str, Vec<u8>, &str)> = vec![
        ("a.obj", Vec::new(), "it contains no faces"),
        ("a.obj", obj("3/1/1", "4/1/1"), "line 6: a face refers to a vertex that does not exist"),
        ("a.obj", obj("3/1/1", "0/1/1"), "line 6: `0/1/1` is not a corner of a face"),
        ("a.obj", obj("3/1/1", "-9/1/1"), "line 6: `-9/1/1` is not a corner of a face"),
        ("a.obj", obj("3/1/1", "3/1/9"), "line 6: a face refers to a vertex that does not exist"),
        ("a.obj", obj("v 0 1 0", "v 0 1"), "line 3: it has fewer than 3 numbers"),
        ("a.obj", obj("v 0 1 0", "v 0 one 0"), "line 3: `one` is not a number"),
        ("a.obj", obj("v 0 1 0", "v 0 nan 0"), "a coordinate that is not a finite number"),
        ("a.obj", obj("vt 0 0", "vt inf 0"), "a coordinate that is not a finite number"),
        ("shared/a.ply", Vec::new(), "is broken"),
        ("shared/a.ply", ply("vertex 3", "vertex 9999999999"), "promises 10000000000 elements"),
        ("shared/a.ply", ply("face 1", "face 99999999999999999999999"), "is broken"),
        ("shared/a.ply", ply("3 0 1 2", "3 0 1 7"), "a face refers to vertex 7 of 3"),
        ("shared/a.ply", ply("3 0 1 2", "3 0 1 -1"), "no index from 0"),
        ("shared/a.ply", ply("0 1 0\n3 0 1 2\n", ""), "Unexpected end of file"),
        ("shared/a.ply", ply("property float z\n", ""), "its vertices lack one of x, y, z"),
        ("shared/a.ply", ply("ascii", "binary_little_endian"), "is broken"),
        ("a.serialized", Vec::new(), "it is too short for a header"),
        ("a.serialized", b"PK\x03\x04 not a mesh".to_vec(), "it does not start as a serialized mesh does"),
        ("a.serialized", serialized(3, 2, 0.0), "is broken"),
        ("a.serialized", two_meshes(&serialized(1 << 30, 2, 0.0)), "its header promises 1073741824 vertices"),
        ("a.serialized", two_meshes(&serialized(10 << 30, 2, 0.0)), "its header promises 10737418240 vertices"),
        (
            "a.serialized",
            two_meshes(&serialized(u64::MAX, 2, 0.0)),
            "its header promises 18446744073709551615 vertices",
        ),
        ("a.serialized", two_meshes(&serialized(3, 3, 0.0)), "a face refers to vertex 3 of 3"),
        ("a.serialized", two_meshes(&serialized(3, 2, f32::NAN)), "a coordinate that is not a finite number"),
        ("a.serialized", two_meshes(&whole[..whole.len() - 20]), "its compressed data is damaged"),
        ("a.serialized", two_meshes(&serialized(4, 2, 0.0)), "it ends too early"),
        ("a.serialized", cut(two_meshes(&whole), 60), "is broken"),
        ("paint.spd", b"400 0.1\n700\n".to_vec(), "line 2: expected a wavelength and a value"),
        ("paint.spd", b"400 0.1\n".to_vec(), "fewer than two values"),
    ];
    let wrong: Vec<_> = cases.iter().filter_map(|(file, bytes, phrase)| swapped(file, bytes, phrase).err()).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

/// What grows when it is read, by entities, parameters, references or files, is refused before it has grown.
#[test]
fn bombs_are_refused() {
    let scene = |body: &str| format!("<scene version=\"3.0.0\">{body}</scene>");
    let entities: String = (1..30).map(|i| format!("<!ENTITY e{i} \"&e{};&e{};\">", i - 1, i - 1)).collect();
    let entities = format!("<!DOCTYPE s [<!ENTITY e0 \"lol\">{entities}]><scene version=\"3.0.0\">&e29;</scene>");
    let doubled = |i: usize| format!("<default name=\"p{}\" value=\"$p{i}$p{i}\"/>", i + 1);
    let parameters =
        scene(&format!("<default name=\"p0\" value=\"lol\"/>{}", (0..60).map(doubled).collect::<String>()));
    let group = |i: usize| {
        let inner = format!("<ref id=\"g{}\"/>", i + 1).repeat(9);
        format!("<bsdf type=\"twosided\" id=\"g{i}\">{inner}</bsdf>")
    };
    let groups: String = (0..30).map(group).collect();
    let references = scene(&format!("{groups}<bsdf type=\"diffuse\" id=\"g30\"/>"));
    let includes = scene(&"<include filename=\"inner.xml\"/>".repeat(300));
    for (text, phrase) in [
        (entities, "<!DOCTYPE>"),
        (parameters, "this text has more than"),
        (references, "this stands for more than"),
        (includes, "too many files"),
    ] {
        let mut files = sound();
        files.insert("main.xml", text.into_bytes());
        files.insert("inner.xml", b"<scene version=\"3.0.0\"/>".to_vec());
        let found = message(&files).unwrap_err();
        assert!(found.starts_with("main.xml:1:") && found.contains(phrase), "{found}");
    }
    // As much memory as the whole of this program's tests may have taken.
    if let Ok(status) = std::fs::read_to_string("/proc/self/status") {
        let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")?.trim().strip_suffix(" kB")).unwrap();
        assert!(peak.trim().parse::<u64>().unwrap() < 1 << 20, "{peak} kB");
    }
}
