//! The model at one point, where its textures have been looked up.

use super::{Clearcoat, Principled};
use crate::bsdf::{Distribution, Evaluation, Letter, Microfacet, flip, fresnel, lobes};
use crate::math::{SolidAnglePdf, Walk, warp::hemisphere};
use crate::spectrum::Spectrum;
use crate::texture::{Number, Site};
use glam::{DVec2, DVec3};
use std::f64::consts::FRAC_1_PI;

/// Parameters at one point.
pub(super) struct Local {
    color: Spectrum,
    roughness: f64,
    metallic: f64,
    spec_trans: f64,
    spec_tint: f64,
    sheen: f64,
    sheen_tint: f64,
    flatness: f64,
    eta: f64,
    pub coat: Clearcoat,
    pub microfacet: Microfacet,
}

/// A pair of directions as seen from the side of the incident one.
pub(super) struct Pair {
    /// Whether the incident direction is on the side of the normal.
    front: bool,
    wi: DVec3,
    wo: DVec3,
    /// The facet that takes one to the other.
    pub h: DVec3,
    /// Index of the far side over that of the near side.
    eta: f64,
    /// Reflectance of the facet as that of a dielectric.
    reflectance: f64,
}

impl Pair {
    pub fn of(local: &Local, wi: DVec3, wo: DVec3) -> Option<Self> {
        let (front, eta) = (wi.z > 0.0, local.relative_eta(wi));
        let (wi, wo) = if front { (wi, wo) } else { (flip(wi), flip(wo)) };
        let h = (wi + if wo.z > 0.0 { wo } else { wo * eta }).try_normalize()?;
        let h = if h.z < 0.0 { -h } else { h };
        let faces = wi.z > 0.0 && wo.z != 0.0 && wi.dot(h) > 0.0 && wo.dot(h) * wo.z > 0.0;
        let (reflectance, _) = fresnel::dielectric(wi.dot(h).min(1.0), eta);
        faces.then_some(Self { front, wi, wo, h, eta, reflectance })
    }
}

/// Schlick's weight (1 − cos θ)⁵.
fn schlick(cos: f64) -> f64 {
    (1.0 - cos).clamp(0.0, 1.0).powi(5)
}

/// Interpolates from `a` to `b`.
fn mix(a: f64, b: f64, t: f64) -> f64 {
    a + (b - a) * t
}

impl Local {
    pub fn of(model: &Principled, site: &Site) -> Self {
        // Textures may hold other numbers.
        let unit = |number: &Number| number.at(site).clamp(0.0, 1.0);
        let (roughness, aspect) = (unit(&model.roughness), (1.0 - 0.9 * unit(&model.anisotropic)).sqrt());
        let alpha = DVec2::new(1.0 / aspect, aspect) * roughness * roughness;
        Self {
            color: model.base_color.at(site),
            roughness,
            metallic: unit(&model.metallic),
            spec_trans: unit(&model.spec_trans),
            spec_tint: unit(&model.spec_tint),
            sheen: unit(&model.sheen),
            sheen_tint: unit(&model.sheen_tint),
            flatness: unit(&model.flatness),
            eta: model.eta,
            coat: Clearcoat::of(unit(&model.clearcoat), unit(&model.clearcoat_gloss)),
            microfacet: Microfacet {
                distribution: Distribution::Ggx,
                alpha: alpha.max(DVec2::splat(0.001)),
                visible: true,
            },
        }
    }

    /// Weight of the diffuse lobes.
    pub fn diffuse(&self) -> f64 {
        (1.0 - self.metallic) * (1.0 - self.spec_trans)
    }

    /// Weight of the transparent lobes.
    fn transparent(&self) -> f64 {
        (1.0 - self.metallic) * self.spec_trans
    }

    pub fn relative_eta(&self, wi: DVec3) -> f64 {
        if wi.z > 0.0 { self.eta } else { 1.0 / self.eta }
    }

    /// Probability of the main lobe, and that of the coat among the others. Inside there is the main lobe only.
    pub fn probabilities(&self, wi: DVec3) -> (f64, f64) {
        if wi.z <= 0.0 {
            return (1.0, 0.0);
        }
        let (coat, base) = (0.25 * self.coat.strength, self.diffuse());
        (1.0 / (1.0 + coat + base), lobes::share(coat, base))
    }

    /// Probability that a facet which reflects `reflectance` is passed.
    fn passing(&self, front: bool, reflectance: f64) -> f64 {
        if front { self.transparent() * (1.0 - reflectance) } else { 1.0 - reflectance }
    }

    pub fn sample_main(&self, wi: DVec3, lobe: f64, u: [f64; 2]) -> Option<DVec3> {
        let front = wi.z > 0.0;
        if wi.z == 0.0 || !(front || self.transparent() > 0.0) {
            return None;
        }
        let upper = if front { wi } else { flip(wi) };
        let h = self.microfacet.sample(upper, u);
        let (cos, eta) = (upper.dot(h), self.relative_eta(wi));
        let (reflectance, cos_t) = fresnel::dielectric(cos.clamp(0.0, 1.0), eta);
        let (passes, _) = lobes::choose(lobe, self.passing(front, reflectance));
        let direction = match cos_t {
            Some(cos_t) if passes => h * (cos / eta - cos_t) - upper / eta,
            _ => h * (2.0 * cos) - upper,
        };
        let direction = if front { direction } else { flip(direction) };
        ((wi.z * direction.z < 0.0) == passes).then_some(direction)
    }

    /// The number that chooses within the main lobe, and those that sample its facet.
    pub fn invert_main(&self, pair: &Pair, rest: f64) -> (f64, [f64; 2]) {
        let lobe = lobes::unchoose((pair.wo.z < 0.0, rest), self.passing(pair.front, pair.reflectance));
        (lobe, self.microfacet.invert(pair.wi, pair.h))
    }

    /// Densities of main lobe, coat and base, for the way there.
    pub fn densities(&self, pair: &Pair) -> [f64; 3] {
        self.densities_from(pair, pair.front, pair.wi, pair.wo, pair.eta)
    }

    /// Densities from `a` to `b`, one of which is the incident direction of the pair; `a` is above.
    fn densities_from(&self, pair: &Pair, front: bool, a: DVec3, b: DVec3, eta: f64) -> [f64; 3] {
        if !front && self.transparent() <= 0.0 {
            return [0.0; 3];
        }
        let (main, coat) = self.probabilities(if front { a } else { -a });
        let (passing, h) = (self.passing(front, pair.reflectance), pair.h);
        let cos = a.dot(h);
        let facets = main * self.microfacet.pdf(a, h);
        if b.z < 0.0 {
            let cos_b = b.dot(h).abs();
            // Walter et al. 2007, eq. 17.
            return [facets * passing * eta * eta * cos_b / (cos - eta * cos_b).powi(2), 0.0, 0.0];
        }
        let others = 1.0 - main;
        let coat_pdf = if coat > 0.0 { others * coat * self.coat.pdf(a, h) } else { 0.0 };
        [facets * (1.0 - passing) / (4.0 * cos), coat_pdf, others * (1.0 - coat) * hemisphere::pdf(b).0]
    }

    pub fn evaluate(&self, pair: &Pair, walk: Walk) -> Evaluation {
        let reverse = if pair.wo.z > 0.0 {
            self.densities_from(pair, pair.front, pair.wo, pair.wi, pair.eta)
        } else {
            // From the other side all is turned over, the facet too, whose density does not change by that.
            self.densities_from(pair, !pair.front, -pair.wo, -pair.wi, 1.0 / pair.eta)
        };
        let (specular, coat, diffuse) = self.values(pair, walk);
        let glossy = if self.microfacet.letter() == Letter::S { specular + coat } else { coat };
        Evaluation {
            value: specular + coat + diffuse,
            pdf: SolidAnglePdf(self.densities(pair).iter().sum()),
            pdf_reverse: SolidAnglePdf(reverse.iter().sum()),
            letter: lobes::letter(glossy, if glossy == coat { specular + diffuse } else { diffuse }),
        }
    }

    /// Values of main lobe, coat and base.
    fn values(&self, pair: &Pair, walk: Walk) -> (Spectrum, Spectrum, Spectrum) {
        let Pair { front, wi, wo, h, eta, reflectance } = *pair;
        let facets = self.microfacet.density(h) * self.microfacet.shadowing(wi, h) * self.microfacet.shadowing(wo, h);
        let cos = wi.dot(h);
        if wo.z < 0.0 {
            // Walter et al. 2007, eq. 21; the base colours each of the two passages by its root (Burley 2015).
            let cos_o = wo.dot(h).abs();
            let squeeze = if walk == Walk::FromCamera { 1.0 } else { eta * eta };
            let spread = (1.0 - reflectance) * squeeze / (cos - eta * cos_o).powi(2);
            let value = self.transparent() * facets * spread * cos * cos_o / (wi.z * wo.z.abs());
            return (self.color.map(f64::sqrt) * value, Spectrum::BLACK, Spectrum::BLACK);
        }
        let facets = facets / (4.0 * wi.z * wo.z);
        if !front {
            return (Spectrum::grey(self.transparent() * reflectance * facets), Spectrum::BLACK, Spectrum::BLACK);
        }
        let specular = self.fresnel(cos, eta, reflectance) * facets;
        let coat = self.coat.value(wi, wo, h, mix(0.04, 1.0, self.weight(cos, eta)));
        (specular, Spectrum::grey(coat), self.base(wi, wo, cos))
    }

    /// Schlick's weight on the side where the index is smaller.
    fn weight(&self, cos: f64, eta: f64) -> f64 {
        let cos_t = (1.0 - (1.0 - cos * cos) / (eta * eta)).max(0.0).sqrt();
        schlick(if eta > 1.0 { cos } else { cos_t })
    }

    /// The base's colour with luminance 1.
    fn tint(&self) -> Spectrum {
        let luminance = self.color.luminance();
        if luminance > 0.0 { self.color / luminance } else { Spectrum::ONE }
    }

    /// Reflectance on the side of the normal: a true dielectric, one that is tinted, and a metal, the last two after
    /// Schlick.
    fn fresnel(&self, cos: f64, eta: f64, reflectance: f64) -> Spectrum {
        let weight = self.weight(cos, eta);
        let towards_one = |straight: Spectrum| straight.map(|straight| mix(straight, 1.0, weight));
        let straight = ((eta - 1.0) / (eta + 1.0)).powi(2);
        let dielectric = Spectrum::grey(reflectance * (1.0 - self.spec_tint));
        let tinted = towards_one(self.tint() * straight) * self.spec_tint;
        (dielectric + tinted) * (1.0 - self.metallic) + towards_one(self.color) * self.metallic
    }

    /// Diffuse and retro-reflection, their flat version, and sheen (Burley 2015, sections 3 to 5).
    fn base(&self, wi: DVec3, wo: DVec3, cos: f64) -> Spectrum {
        let (fi, fo) = (schlick(wi.z), schlick(wo.z));
        let retro = 2.0 * self.roughness * cos * cos;
        let diffuse = (1.0 - 0.5 * fi) * (1.0 - 0.5 * fo) + retro * (fo + fi + fo * fi * (retro - 1.0));
        let flat = mix(1.0, 0.5 * retro, fo) * mix(1.0, 0.5 * retro, fi);
        let flat = 1.25 * (flat * (1.0 / (wo.z + wi.z) - 0.5) + 0.5);
        let base = self.color * (self.diffuse() * FRAC_1_PI * mix(diffuse, flat, self.flatness));
        if self.diffuse() <= 0.0 {
            return Spectrum::BLACK;
        }
        let tint = self.tint().map(|tint| mix(1.0, tint, self.sheen_tint));
        base + tint * (self.sheen * (1.0 - self.metallic) * schlick(cos))
    }
}
