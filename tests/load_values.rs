//! Parameters and defaults arrive in the scene as Mitsuba 3 understands them.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use glam::DVec3;
use pathblend::bsdf::{
    Bsdf, Conductor, Dielectric, Diffuse, Distribution, Mask, Phong, Plastic, RoughCoat, RoughConductor,
    RoughDielectric, RoughPlastic, Roughness,
};
use pathblend::camera::Projection;
use pathblend::film::Filter;
use pathblend::load::{self, Options, UNBOUNDED_DEPTH};
use pathblend::scene::{Caster, Scene};
use pathblend::spectrum::Spectrum;
use pathblend::texture::Colour;

const SENSOR: &str = "<sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/></sensor>";

fn load_bare(body: &str) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.xml");
    std::fs::write(&path, format!("<scene version=\"3.0.0\">{body}</scene>")).unwrap();
    load::read(&path, &Options::default()).unwrap_or_else(|error| panic!("{error}")).scene
}

fn load(body: &str) -> Scene {
    load_bare(&format!("{SENSOR}{body}"))
}

/// The models in use when a sphere has the model `xml`.
fn bsdfs(xml: &str) -> Vec<Bsdf> {
    load(&format!("<shape type=\"sphere\">{xml}</shape>")).bsdfs().to_vec()
}

fn grey(reflectance: f64) -> Bsdf {
    Bsdf::Diffuse(Diffuse { reflectance: Spectrum::grey(reflectance).into() })
}

fn glass(eta: f64) -> Bsdf {
    let one = Spectrum::ONE;
    Bsdf::Dielectric(Dielectric { eta, specular_reflectance: one, specular_transmittance: one })
}

const MIRROR: Conductor = Conductor { index: None, specular_reflectance: Colour::Constant(Spectrum::ONE) };

#[test]
fn bsdfs_have_mitsubas_defaults() {
    assert_eq!(bsdfs(""), [grey(0.5)]);
    assert_eq!(bsdfs("<bsdf type=\"diffuse\"/>"), [grey(0.5)]);
    assert_eq!(bsdfs("<bsdf type=\"conductor\"/>"), [Bsdf::Conductor(MIRROR)]);
    assert_eq!(bsdfs("<bsdf type=\"dielectric\"/>"), [glass(1.5046 / 1.000277)]);
    let roughness = Roughness::isotropic(Distribution::Beckmann, 0.1);
    let rough = Bsdf::RoughConductor(RoughConductor { metal: MIRROR, roughness });
    assert_eq!(bsdfs("<bsdf type=\"roughconductor\"/>"), [rough]);
}

#[test]
fn bsdfs_have_their_parameters() {
    let copper = r#"<bsdf type="roughconductor">
        <rgb name="eta" value="0.2, 0.92, 1.1"/> <spectrum name="k" value="2.5"/> <float name="alpha" value="0.3"/>
        <string name="distribution" value="ggx"/> <float name="specular_reflectance" value="0.9"/></bsdf>"#;
    let index = Some((Spectrum::rgb(0.2, 0.92, 1.1), Spectrum::grey(2.5)));
    let metal = Conductor { index, specular_reflectance: Spectrum::grey(0.9).into() };
    let roughness = Roughness::isotropic(Distribution::Ggx, 0.3);
    assert_eq!(bsdfs(copper), [Bsdf::RoughConductor(RoughConductor { metal, roughness })]);
    let diamond = r#"<bsdf type="dielectric"><string name="int_ior" value="Diamond"/>
        <float name="ext_ior" value="1.25"/></bsdf>"#;
    assert_eq!(bsdfs(diamond), [glass(2.419 / 1.25)]);
    let paper = r#"<bsdf type="twosided"><bsdf type="diffuse"><rgb name="reflectance" value="0.2"/></bsdf>
        <bsdf type="conductor"/></bsdf>"#;
    assert_eq!(bsdfs(paper), [Bsdf::TwoSided(Box::new([grey(0.2), Bsdf::Conductor(MIRROR)]))]);
}

#[test]
fn layered_and_rough_models_have_mitsubas_defaults() {
    let (one, half) = (|| Colour::from(Spectrum::ONE), || Colour::from(Spectrum::grey(0.5)));
    let eta = 1.49 / 1.000277;
    assert_eq!(bsdfs("<bsdf type=\"plastic\"/>"), [Bsdf::Plastic(Plastic::new(eta, half(), one(), false))]);
    let coat = RoughCoat::new(eta, (Distribution::Beckmann, 0.1, true));
    let rough = Bsdf::RoughPlastic(Box::new(RoughPlastic::new(coat, half(), one(), false)));
    assert_eq!(bsdfs("<bsdf type=\"roughplastic\"/>"), [rough]);
    let frosted = RoughDielectric {
        eta: 1.5046 / 1.000277,
        roughness: Roughness::isotropic(Distribution::Beckmann, 0.1),
        specular_reflectance: Spectrum::ONE,
        specular_transmittance: Spectrum::ONE,
    };
    assert_eq!(bsdfs("<bsdf type=\"roughdielectric\"/>"), [Bsdf::RoughDielectric(frosted)]);
    let phong =
        Phong { exponent: 30.0.into(), specular_reflectance: Spectrum::grey(0.2).into(), diffuse_reflectance: half() };
    assert_eq!(bsdfs("<bsdf type=\"phong\"/>"), [Bsdf::Phong(phong)]);
    let mask = Mask { opacity: 0.5.into(), nested: Box::new(grey(0.5)) };
    assert_eq!(bsdfs("<bsdf type=\"mask\"><bsdf type=\"diffuse\"/></bsdf>"), [Bsdf::Mask(mask)]);
    assert_eq!(bsdfs("<bsdf type=\"null\"/>"), [Bsdf::Null]);
}

#[test]
fn rough_metals_have_their_parameters() {
    let brushed = r#"<bsdf type="roughconductor"><string name="material" value="Cu"/> <float name="ext_eta" value="2"/>
        <float name="alpha_u" value="0.2"/> <float name="alpha_v" value="0.4"/>
        <boolean name="sample_visible" value="false"/></bsdf>"#;
    let [Bsdf::RoughConductor(RoughConductor { metal, roughness })] = &bsdfs(brushed)[..] else { panic!("a metal") };
    let (eta, k) = metal.index.unwrap();
    let close = |a: Spectrum, b: [f64; 3]| a.to_rgb().iter().zip(b).all(|(a, b)| (2.0 * a - b).abs() < 1e-5);
    assert!(close(eta, [0.201005, 0.923750, 1.102215]) && close(k, [3.913262, 2.453045, 2.142090]));
    assert_eq!((roughness.alpha_u.clone(), roughness.alpha_v.clone()), (0.2.into(), 0.4.into()));
    assert!(!roughness.visible);
}

#[test]
fn shared_models_are_added_once_and_unused_ones_never() {
    let sphere = "<shape type=\"sphere\"><ref id=\"a\"/></shape>";
    let models = "<bsdf type=\"dielectric\" id=\"a\"/><bsdf type=\"diffuse\" id=\"b\"/>";
    assert_eq!(load(&format!("{sphere}{models}{sphere}")).bsdfs(), [glass(1.5046 / 1.000277)]);
}

/// A mirrored sphere is turned inside out, as in Mitsuba: its glass lies outside.
#[test]
fn spheres_can_be_turned_inside_out() {
    let glass_of = |extra: &str| {
        let body = "<bsdf type=\"dielectric\"><float name=\"int_ior\" value=\"2\"/>\
                    <float name=\"ext_ior\" value=\"1\"/></bsdf>";
        bsdfs(&format!("{body}{extra}"))
    };
    let flip = "<boolean name=\"flip_normals\" value=\"true\"/>";
    let mirror = "<transform name=\"to_world\"><scale x=\"-1\"/></transform>";
    assert_eq!(glass_of(""), [glass(2.0)]);
    let turned = Bsdf::Turned(Box::new(glass(2.0)));
    assert_eq!(glass_of(flip), std::slice::from_ref(&turned));
    assert_eq!(glass_of(mirror), [turned]);
    assert_eq!(glass_of(&format!("{flip}{mirror}")), [glass(2.0)]);
}

#[test]
fn film_and_depth_are_taken() {
    let scene = load("");
    assert_eq!((scene.film.size, scene.film.filter), ([768, 576], Filter::Gaussian { stddev: 0.5 }));
    let pinhole = Projection::Perspective { lens_radius: 0.0, focus_distance: 1e4 };
    assert_eq!((scene.max_depth, scene.camera.projection), (UNBOUNDED_DEPTH, pinhole));
    let depth =
        |value: i64| format!("<integrator type=\"any\"><integer name=\"max_depth\" value=\"{value}\"/></integrator>");
    assert_eq!(load(&depth(-1)).max_depth, UNBOUNDED_DEPTH);
    assert_eq!(load(&depth(7)).max_depth, 7);
    for (filter, expected) in [
        ("<rfilter type=\"box\"/>", Filter::Box),
        ("<rfilter type=\"tent\"/>", Filter::Tent),
        (
            "<rfilter type=\"gaussian\"><float name=\"stddev\" value=\"0.7\"/></rfilter>",
            Filter::Gaussian { stddev: 0.7 },
        ),
    ] {
        let film = format!("<film type=\"hdrfilm\"><integer name=\"width\" value=\"32\"/>{filter}</film>");
        let sensor = format!("<sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/>{film}</sensor>");
        let scene = load_bare(&sensor);
        assert_eq!((scene.film.size, scene.film.filter), ([32, 576], expected));
    }
}

/// Steps of a transformation apply in the order of the file.
#[test]
fn transformations_apply_in_order() {
    let steps = "<scale value=\"0.5\"/><translate x=\"1\"/><rotate z=\"2\" angle=\"90\"/><translate z=\"3\"/>";
    let scene = load(&format!("<shape type=\"sphere\"><transform name=\"to_world\">{steps}</transform></shape>"));
    let hit = Caster::new(&scene).intersect(DVec3::new(0.0, 1.0, 9.0).into(), -DVec3::Z);
    let position = hit.map(|surface| surface.position);
    assert!(position.is_some_and(|p| (p - DVec3::new(0.0, 1.0, 3.5)).length() < 1e-12), "{position:?}");
}

/// The hash changes with everything that decides the image, other files included.
#[test]
fn the_hash_covers_all_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.xml");
    let shape = "<shape type=\"obj\"><string name=\"filename\" value=\"a.obj\"/></shape>";
    std::fs::write(&path, format!("<scene version=\"3.0.0\">{SENSOR}{shape}</scene>")).unwrap();
    let hash = |mesh: &str| {
        std::fs::write(folder.path().join("a.obj"), mesh).unwrap();
        load::read(&path, &Options::default()).unwrap_or_else(|error| panic!("{error}")).scene.hash
    };
    let spectrum = |text: &str| {
        let light = "<emitter type=\"point\"><spectrum name=\"intensity\" filename=\"s.spd\"/></emitter>";
        std::fs::write(folder.path().join("s.spd"), text).unwrap();
        std::fs::write(folder.path().join("lit.xml"), format!("<scene version=\"3.0.0\">{SENSOR}{light}</scene>"))
            .unwrap();
        let loaded = load::read(&folder.path().join("lit.xml"), &Options::default());
        loaded.unwrap_or_else(|error| panic!("{error}")).scene.hash
    };
    assert_ne!(spectrum("400 1\n700 1"), spectrum("400 1\n700 2"));
    let triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
    assert_eq!(hash(triangle), hash(triangle));
    assert_ne!(hash(triangle), hash(&triangle.replace("1 0 0", "2 0 0")));
}
