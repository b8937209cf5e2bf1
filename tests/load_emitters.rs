//! Emitters arrive in the scene as Mitsuba understands them.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use glam::DVec3;
use pathblend::emitter::{Emitter, Start};
use pathblend::image::{Image, WriteOptions};
use pathblend::load::{self, Loaded, Options};
use pathblend::scene::{EmitterId, Scene};
use pathblend::spectrum::Spectrum;

fn read(version: &str, body: &str) -> Result<Loaded, String> {
    let folder = tempfile::tempdir().unwrap();
    let mut image = Image::new(4, 3);
    let samples = [
        1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 2.0, 1.0, 0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 20.0, 8.0, 9.0, 0.2,
        1.0, 0.0, 3.0, 3.0, 3.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 0.0, 0.0, 5.0,
    ];
    image.colour.iter_mut().zip(samples).for_each(|(to, from)| *to = from);
    image.write(&folder.path().join("e.exr"), &WriteOptions::default()).unwrap();
    let path = folder.path().join("scene.xml");
    let sensor = "<sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/></sensor><shape type=\"sphere\"/>";
    std::fs::write(&path, format!("<scene version=\"{version}\">{sensor}{body}</scene>")).unwrap();
    load::read(&path, &Options::default()).map_err(|error| error.to_string())
}

fn load(version: &str, body: &str) -> Scene {
    read(version, body).unwrap_or_else(|error| panic!("{error}")).scene
}

fn seen(scene: &Scene, towards: DVec3) -> Spectrum {
    let environment = scene.emitter(scene.environment().expect("an environment"));
    environment.radiance(&Start::Infinite { towards: towards.normalize() }, -towards.normalize())
}

fn assert_close(found: Spectrum, expected: [f64; 3]) {
    let close = found.to_rgb().iter().zip(expected).all(|(a, b)| (a - b).abs() < 2e-5 * (1.0 + b));
    assert!(close, "{:?}, expected {expected:?}", found.to_rgb());
}

/// Values of Mitsuba 3.9.1.
#[test]
fn environment_images_have_scale_and_rotation() {
    let scene = load(
        "3.0.0",
        r#"<emitter type="envmap"><string name="filename" value="e.exr"/> <float name="scale" value="3"/>
        <transform name="to_world"><rotate x="1" angle="90"/><rotate y="1" angle="40"/></transform></emitter>"#,
    );
    assert_close(seen(&scene, DVec3::new(-0.2, -0.7, 0.6)), [47.19228, 22.40126, 25.22971]);
    assert_close(seen(&scene, DVec3::new(-0.6, 0.8, 0.01)), [0.77947, 2.32752, 3.56978]);
    let stretched = r#"<emitter type="envmap"><string name="filename" value="e.exr"/>
        <transform name="to_world"><scale x="2"/></transform></emitter>"#;
    assert!(read("3.0.0", stretched).err().unwrap().contains("expected a rotation"));
}

#[test]
fn spots_and_parallel_light_have_their_directions() {
    let scene = load(
        "3.0.0",
        r#"<emitter type="spot"><rgb name="intensity" value="3,2,1"/> <float name="cutoff_angle" value="25"/>
        <transform name="to_world"><lookat origin="0,0,5" target="1,0,0" up="0,1,0"/></transform></emitter>
        <emitter type="directional"><vector name="direction" x="1" y="-2" z="0.5"/></emitter>"#,
    );
    let Emitter::Spot(spot) = scene.emitter(EmitterId(0)) else { panic!("no spot") };
    assert!((spot.axis - DVec3::new(1.0, 0.0, -5.0).normalize()).length() < 1e-12);
    assert!((spot.cutoff.to_degrees() - 25.0).abs() < 1e-12 && (spot.beam.to_degrees() - 18.75).abs() < 1e-12);
    let Emitter::Directional(light) = scene.emitter(EmitterId(1)) else { panic!("no parallel light") };
    assert!((light.towards - DVec3::new(-0.436436, 0.872872, -0.218218)).length() < 1e-6);
    assert!(scene.environment().is_none());
}

/// Directions measured in Mitsuba 3.9.1; in older files +y is up and −z north.
#[test]
fn skies_turn_with_their_version() {
    let newer = load("3.0.0", "<emitter type=\"sunsky\"><float name=\"hour\" value=\"9\"/></emitter>");
    let older = load("0.6.0", "<emitter type=\"sunsky\"><float name=\"hour\" value=\"9\"/></emitter>");
    for (scene, towards) in
        [(newer, DVec3::new(0.0956952, -0.614786, 0.782867)), (older, DVec3::new(0.614786, 0.782867, 0.0956952))]
    {
        assert!(seen(&scene, towards).luminance() > 5000.0, "no sun");
        assert!(seen(&scene, -towards).is_black(), "light from below");
        assert!(seen(&scene, towards + DVec3::splat(0.1)).luminance() < 10.0, "too much sun");
    }
}

#[test]
fn a_sun_and_a_sky_make_one_environment() {
    let sun = "<emitter type=\"sun\"><float name=\"sunRadiusScale\" value=\"10\"/></emitter>";
    let sky = "<emitter type=\"sky\"/>";
    let both = load("0.6.0", &format!("{sun}{sky}"));
    let one = "<emitter type=\"sunsky\"><float name=\"sunRadiusScale\" value=\"10\"/></emitter>";
    assert_eq!(both.emitter(EmitterId(0)), load("0.6.0", one).emitter(EmitterId(0)));
    assert!(read("0.6.0", &format!("{sky}{sky}")).err().unwrap().contains("one environment"));
    assert!(read("0.6.0", &format!("{sky}<emitter type=\"constant\"/>")).is_err());
    let small = load("0.6.0", "<emitter type=\"sun\"><float name=\"sunRadiusScale\" value=\"0\"/></emitter>");
    assert!(matches!(small.emitter(EmitterId(0)), Emitter::Directional(_)) && small.environment().is_none());
    let night = "<emitter type=\"sky\"><float name=\"hour\" value=\"1\"/></emitter>";
    assert!(read("0.6.0", night).err().unwrap().contains("below the horizon"));
}
