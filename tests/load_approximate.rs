//! What is not known is an error, or with `approximate` a warning with its place.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use pathblend::bsdf::{Bsdf, Diffuse};
use pathblend::load::{self, Options};
use pathblend::spectrum::Spectrum;

const BEFORE: &str = r#"<scene version="3.0.0"><sensor type="perspective"><float name="fov" value="30"/>"#;

/// Something that is not known, marked by `^`, and the warning that stands for it.
const CASES: [(&str, &str); 12] = [
    (
        r#"</sensor><shape type="sphere">^<bsdf type="velvet"><rgb name="base_color" value="0.1"/><float name="fuzz" value="2"/></bsdf></shape>"#,
        "the bsdf `velvet` is not known: a diffuse one of its colour",
    ),
    (
        r#"</sensor><shape type="sphere">^<bsdf type="wet"><bsdf type="diffuse"><rgb name="reflectance" value="0.1"/></bsdf></bsdf></shape>"#,
        "the bsdf `wet` is not known: the first model in it",
    ),
    (
        r#"</sensor><shape type="sphere"><bsdf type="diffuse">^<texture name="reflectance" type="wood"/></bsdf></shape>"#,
        "the texture `wood` is not known: a grey of 0.5",
    ),
    (
        r#"</sensor>^<emitter type="projector"><float name="fov" value="3"/></emitter>"#,
        "the emitter `projector` is not known: left out",
    ),
    (
        r#"</sensor>^<shape type="hair"><string name="filename" value="x"/></shape>"#,
        "the shape `hair` is not known: left out",
    ),
    (
        r#"</sensor><shape type="sphere">^<emitter type="glow"><rgb name="radiance" value="1"/></emitter></shape>"#,
        "the emitter `glow` is not known: an area emitter",
    ),
    (
        r#"</sensor><shape type="sphere">^<float name="wobble" value="1"/></shape>"#,
        "shape `sphere` has no parameter `wobble` here: left out",
    ),
    (r#"</sensor>^<medium type="homogeneous"/>"#, "<medium> is not known: left out"),
    (
        r#"<film type="hdrfilm">^<rfilter type="lanczos"><integer name="lobes" value="3"/></rfilter></film></sensor>"#,
        "the rfilter `lanczos` is not known: a gaussian one",
    ),
    (r#"^<film type="specfilm"/></sensor>"#, "the film `specfilm` is not known: an hdrfilm"),
    (r#"</sensor>^<sensor type="fisheye"/>"#, "the sensor `fisheye` is not known: a perspective one"),
    (r#"^<float name="zoom" value="1"/></sensor>"#, "sensor `perspective` has no parameter `zoom` here: left out"),
];

fn read(body: &str, approximate: bool) -> Result<load::Loaded, load::LoadError> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scene.xml");
    std::fs::write(&file, format!("{BEFORE}{body}</scene>")).unwrap();
    load::read(&file, &Options { approximate, ..Options::default() })
}

#[test]
fn unknown_things_are_refused_or_replaced() {
    for (marked, expected) in CASES {
        let column = BEFORE.len() + marked.find('^').unwrap() + 1;
        let body = marked.replace('^', "");
        let refused = read(&body, false).err().unwrap_or_else(|| panic!("{body} is taken")).to_string();
        assert!(refused.contains(&format!("scene.xml:1:{column}: ")), "{refused}");
        let warnings = read(&body, true).unwrap_or_else(|error| panic!("{error}")).warnings;
        let expected = format!("scene.xml:1:{column}: {expected}");
        assert_eq!(
            warnings.iter().filter(|warning| warning.ends_with(&expected)).count(),
            1,
            "{expected}: {warnings:?}"
        );
    }
}

#[test]
fn what_stands_for_a_model_has_its_colour() {
    for (marked, _) in &CASES[..2] {
        let scene = read(&marked.replace('^', ""), true).unwrap().scene;
        assert_eq!(scene.bsdfs(), [Bsdf::Diffuse(Diffuse { reflectance: Spectrum::grey(0.1).into() })]);
    }
}
