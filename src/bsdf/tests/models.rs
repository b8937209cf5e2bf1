//! The models under test; a new one joins by one line.

use super::super::*;
use crate::texture::{Colour, Number};

/// A model with parameters.
pub struct Case {
    pub name: String,
    pub bsdf: Bsdf,
    /// Whether several of its lobes, none of them a Dirac density, lead to the same directions.
    pub mixes: bool,
    /// Whether it absorbs nothing.
    pub lossless: bool,
}

fn case(name: impl Into<String>, bsdf: Bsdf) -> Case {
    Case { name: name.into(), bsdf, mixes: false, lossless: false }
}

fn mixture(name: impl Into<String>, bsdf: Bsdf) -> Case {
    Case { mixes: true, ..case(name, bsdf) }
}

fn lossless(name: impl Into<String>, bsdf: Bsdf) -> Case {
    Case { lossless: true, ..case(name, bsdf) }
}

fn colour(r: f64, g: f64, b: f64) -> Colour {
    Spectrum::rgb(r, g, b).into()
}

fn diffuse() -> Bsdf {
    Bsdf::Diffuse(Diffuse { reflectance: colour(0.2, 0.5, 0.9) })
}

fn gold() -> Conductor {
    let index = Some((Spectrum::rgb(0.14, 0.37, 1.44), Spectrum::rgb(3.98, 2.39, 1.6)));
    Conductor { index, specular_reflectance: Spectrum::ONE.into() }
}

fn mirror() -> Bsdf {
    Bsdf::Conductor(Conductor { index: None, specular_reflectance: Spectrum::ONE.into() })
}

fn roughness(distribution: Distribution, [u, v]: [f64; 2], visible: bool) -> Roughness {
    Roughness { distribution, alpha_u: u.into(), alpha_v: v.into(), visible }
}

fn rough_gold(distribution: Distribution, alpha: [f64; 2], visible: bool) -> Bsdf {
    Bsdf::RoughConductor(RoughConductor { metal: gold(), roughness: roughness(distribution, alpha, visible) })
}

fn glass(eta: f64) -> Bsdf {
    let one = Spectrum::ONE;
    Bsdf::Dielectric(Dielectric { eta, specular_reflectance: one, specular_transmittance: one })
}

fn rough_glass(eta: f64, roughness: Roughness) -> Bsdf {
    let (specular_reflectance, specular_transmittance) = (Spectrum::ONE, Spectrum::rgb(1.0, 0.9, 0.8));
    Bsdf::RoughDielectric(RoughDielectric { eta, roughness, specular_reflectance, specular_transmittance })
}

fn plastic(eta: f64, nonlinear: bool) -> Bsdf {
    Bsdf::Plastic(Plastic::new(eta, colour(0.2, 0.5, 0.9), colour(1.0, 0.9, 0.8), nonlinear))
}

fn rough_plastic(distribution: Distribution, alpha: f64, nonlinear: bool) -> Bsdf {
    let coat = RoughCoat::new(1.5, (distribution, alpha, true));
    Bsdf::RoughPlastic(Box::new(RoughPlastic::new(coat, colour(0.2, 0.5, 0.8), colour(1.0, 0.9, 0.8), nonlinear)))
}

fn phong(exponent: f64) -> Bsdf {
    let exponent = exponent.into();
    Bsdf::Phong(Phong {
        exponent,
        specular_reflectance: colour(0.3, 0.4, 0.5),
        diffuse_reflectance: colour(0.4, 0.3, 0.2),
    })
}

fn mask(opacity: f64, nested: Bsdf) -> Bsdf {
    Bsdf::Mask(Mask { opacity: Number::Constant(opacity), nested: Box::new(nested) })
}

fn blend(weight: f64, first: Bsdf, second: Bsdf) -> Bsdf {
    Bsdf::Blend(Blend { weight: Number::Constant(weight), nested: Box::new([first, second]) })
}

fn pane() -> Bsdf {
    let one = Spectrum::ONE;
    Bsdf::ThinDielectric(ThinDielectric { eta: 1.5, specular_reflectance: one, specular_transmittance: one })
}

/// Burley's model with roughness, metallic, spec_trans, anisotropic, and strengths of tint, sheen, flatness and coat.
fn principled(
    [roughness, metallic, spec_trans, anisotropic]: [f64; 4],
    [tint, sheen, flatness, coat]: [f64; 4],
) -> Bsdf {
    Bsdf::Principled(Box::new(Principled {
        base_color: colour(0.5, 0.3, 0.1),
        roughness: roughness.into(),
        anisotropic: anisotropic.into(),
        metallic: metallic.into(),
        spec_trans: spec_trans.into(),
        spec_tint: tint.into(),
        sheen: sheen.into(),
        sheen_tint: tint.into(),
        flatness: flatness.into(),
        clearcoat: coat.into(),
        clearcoat_gloss: 0.2.into(),
        eta: 1.5,
    }))
}

fn coating(eta: f64, depth: f64, rough: Option<(Distribution, f64)>, nested: Bsdf) -> Bsdf {
    let rough = rough.map(|(distribution, alpha)| RoughCoat::new(eta, (distribution, alpha, true)));
    let (depth, specular_reflectance) = (Spectrum::rgb(depth, 0.5 * depth, 0.0), Spectrum::ONE.into());
    Bsdf::Coating(Box::new(Coating { eta, depth, rough, specular_reflectance, nested: Box::new(nested) }))
}

/// Sweeps of distributions, roughnesses and indices.
fn microfacets() -> Vec<Case> {
    let mut cases = Vec::new();
    for distribution in [Distribution::Ggx, Distribution::Beckmann] {
        for visible in [true, false] {
            let named = |model: &str, alpha: [f64; 2]| format!("{model} {distribution:?} {alpha:?} {visible}");
            for alpha in [[0.05, 0.05], [0.3, 0.3], [0.1, 0.4], [0.9, 0.6]] {
                cases.push(case(named("metal", alpha), rough_gold(distribution, alpha, visible)));
            }
            for (alpha, eta) in [([0.05, 0.05], 1.5), ([0.4, 0.4], 1.5), ([0.2, 0.5], 1.2), ([0.4, 0.3], 0.7)] {
                let bsdf = rough_glass(eta, roughness(distribution, alpha, visible));
                cases.push(case(format!("{} {eta}", named("glass", alpha)), bsdf));
            }
        }
        for (alpha, nonlinear) in [(0.05, false), (0.3, false), (0.3, true)] {
            let name = format!("rough plastic {distribution:?} {alpha} {nonlinear}");
            cases.push(mixture(name, rough_plastic(distribution, alpha, nonlinear)));
        }
    }
    cases
}

/// All models.
pub fn cases() -> Vec<Case> {
    let brushed = || rough_gold(Distribution::Ggx, [0.2, 0.4], true);
    let frosted = || rough_glass(1.5, roughness(Distribution::Ggx, [0.3, 0.3], true));
    let mut cases = vec![
        case("diffuse", diffuse()),
        case("conductor", Bsdf::Conductor(gold())),
        lossless("mirror", mirror_on_both_sides()),
        lossless("dielectric", glass(1.5)),
        lossless("dielectric 0.7", glass(0.7)),
        lossless("thin dielectric", pane()),
        lossless("null", Bsdf::Null),
        case("plastic", plastic(1.5, false)),
        case("plastic 1.9", plastic(1.9, false)),
        case("plastic nonlinear", plastic(1.3, true)),
        mixture("phong 1", phong(1.0)),
        mixture("phong 30", phong(30.0)),
        mixture("phong 400", phong(400.0)),
        case("mask of diffuse", mask(0.3, diffuse())),
        case("mask of glass", mask(0.6, frosted())),
        case("mask of plastic", mask(0.8, plastic(1.5, false))),
        lossless("mask of a mirror", mask(0.5, mirror_on_both_sides())),
        case("full mask", mask(1.0, diffuse())),
        lossless("empty mask", mask(0.0, diffuse())),
        mixture("blend of diffuse, metal", blend(0.3, diffuse(), brushed())),
        mixture("blend of glass, plastic", blend(0.6, frosted(), plastic(1.5, false))),
        mixture(
            "blend of glasses",
            blend(0.6, frosted(), rough_glass(1.2, roughness(Distribution::Beckmann, [0.2; 2], true))),
        ),
        case("blend of mirror, diffuse", blend(0.5, mirror(), diffuse())),
        lossless("blend of glass, null", blend(0.5, glass(1.5), Bsdf::Null)),
        mixture("blend of a blend", blend(0.5, blend(0.2, diffuse(), phong(20.0)), mask(0.5, brushed()))),
        mixture("principled", principled([0.5, 0.0, 0.0, 0.0], [0.0; 4])),
        mixture("principled metal", principled([0.4, 1.0, 0.0, 0.7], [0.0; 4])),
        mixture("principled glass", principled([0.5, 0.0, 1.0, 0.0], [0.0; 4])),
        mixture("principled cloth", principled([0.7, 0.0, 0.0, 0.0], [0.5, 0.5, 0.5, 0.0])),
        mixture("principled coat", principled([0.6, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0])),
        mixture("principled all", principled([0.4, 0.3, 0.5, 0.5], [0.5, 0.2, 0.5, 0.5])),
        case("coating of diffuse", coating(1.5, 0.0, None, diffuse())),
        case("coating of metal", coating(1.3, 0.4, None, brushed())),
        case("coating of a mirror", coating(1.5, 0.4, None, mirror())),
        mixture("rough coating of diffuse", coating(1.5, 0.2, Some((Distribution::Ggx, 0.1)), diffuse())),
        mixture("rough coating of metal", coating(1.5, 0.0, Some((Distribution::Beckmann, 0.3)), brushed())),
        mixture("rough coating of a mirror", coating(1.5, 0.0, Some((Distribution::Beckmann, 0.2)), mirror())),
        mixture("coating of phong", coating(1.5, 0.2, None, phong(20.0))),
        mixture("two-sided", Bsdf::TwoSided(Box::new([phong(20.0), brushed()]))),
        case("two-sided plastic", Bsdf::TwoSided(Box::new([plastic(1.5, true), plastic(1.2, false)]))),
        case("turned plastic", Bsdf::Turned(Box::new(plastic(1.5, true)))),
        case("turned glass", Bsdf::Turned(Box::new(frosted()))),
    ];
    cases.extend(microfacets());
    cases
}

fn mirror_on_both_sides() -> Bsdf {
    Bsdf::TwoSided(Box::new([mirror(), mirror()]))
}

#[test]
fn there_are_many_cases() {
    assert!(cases().len() >= 60, "{}", cases().len());
}
