//! Scattering at surfaces whose shading frame a relief has tilted, as in Mitsuba 3. Directions are given in the tilted
//! frame.
//!
//! A direction may be on one side of the surface and on the other of the tilted plane. Seen from such a direction, the
//! tilted normal n is mirrored at the untilted one u, to 2 (n·u) u − n: turning the frame by half a circle about u does
//! that, and is its own inverse. What decides is the direction to the camera, since that is where a walk from the camera
//! has its frame from; a walk from a light samples by the frame of its own side, and evaluates by the other's. Light that
//! would then have to pass through the surface is left out.
//!
//! Where the tilted frame is cut off by the untilted horizon, light would end abruptly: it is faded out before, by the
//! share of it that reaches a microfacet surface whose normals are spread as far as the tilt (Estevez, Lecocq and Stein
//! 2019, *A Microfacet-Based Shadowing Function to Solve the Bump Terminator Problem*).

use super::{Scene, Surface};
use crate::bsdf::{Bsdf, Evaluation, Scatter};
use crate::math::{Row, SolidAnglePdf, Walk};
use crate::texture::{Relief, Site};
use glam::DVec3;

/// The frame in which a direction meets the surface.
#[derive(Clone, Copy, PartialEq)]
struct Facing {
    /// The untilted normal, in the tilted frame.
    up: DVec3,
    mirrored: bool,
}

impl Facing {
    /// From the tilted frame to this one, and back.
    fn turn(&self, w: DVec3) -> DVec3 {
        if self.mirrored { self.up * (2.0 * self.up.dot(w)) - w } else { w }
    }

    /// Whether a direction is on the same side of the surface with and without the tilt.
    fn admits(&self, w: DVec3) -> bool {
        self.turn(w).z * self.up.dot(w) > 0.0
    }

    /// What the cosine of a direction in this frame is of that in the tilted one, with which integrators multiply.
    fn stretch(&self, w: DVec3) -> f64 {
        if self.mirrored { (self.turn(w).z / w.z).abs() } else { 1.0 }
    }
}

impl Relief {
    /// The share of the light from `towards` that is left: Smith's masking for GGX, whose α² is an eighth of the squared
    /// tangent of the tilt (Estevez et al. 2019).
    fn shadowing(&self, up: DVec3, towards: DVec3) -> f64 {
        if !self.shadows {
            return 1.0;
        }
        let tangent_squared = |cos: f64| (1.0 - cos * cos).max(0.0) / (cos * cos);
        let alpha_squared = (0.125 * tangent_squared(up.z)).clamp(0.0, 1.0);
        2.0 / (1.0 + (1.0 + alpha_squared * tangent_squared(up.dot(towards))).sqrt())
    }
}

impl Scene {
    #[inline]
    fn tilted<'a>(&'a self, at: &'a Surface) -> Option<Tilted<'a>> {
        if at.up.z >= 1.0 {
            return None;
        }
        let relief = self.reliefs[at.bsdf.0 as usize].as_ref()?;
        Some(Tilted { bsdf: self.bsdf(at.bsdf), relief, up: at.up, site: &at.site })
    }

    /// What scattering from `wi` to `wo` at a surface amounts to; see [`Bsdf::evaluate`].
    #[inline]
    pub fn evaluate(&self, at: &Surface, wi: DVec3, wo: DVec3, walk: Walk) -> Option<Evaluation> {
        match self.tilted(at) {
            None => self.bsdf(at.bsdf).evaluate(&at.site, wi, wo, walk),
            Some(tilted) => tilted.evaluate(wi, wo, walk),
        }
    }

    /// Samples a direction in which a surface scatters; see [`Bsdf::sample`].
    #[inline]
    pub fn scatter(&self, at: &Surface, wi: DVec3, row: Row, walk: Walk) -> Option<Scatter> {
        match self.tilted(at) {
            None => self.bsdf(at.bsdf).sample(&at.site, wi, row, walk),
            Some(tilted) => tilted.sample(wi, row, walk),
        }
    }

    /// A row that [`Scene::scatter`] takes from `wi` to `wo`; see [`Bsdf::invert`].
    pub fn invert_scatter(&self, at: &Surface, wi: DVec3, wo: DVec3, delta: bool, gamma: Row) -> Option<Row> {
        match self.tilted(at) {
            None => self.bsdf(at.bsdf).invert(&at.site, wi, wo, delta, gamma),
            Some(tilted) => tilted.invert(wi, wo, delta, gamma),
        }
    }

    /// `wi` as the scattering model of a surface meets it, for what a model says of a direction.
    #[inline]
    pub fn met(&self, at: &Surface, wi: DVec3) -> DVec3 {
        self.tilted(at).map_or(wi, |tilted| tilted.facing(wi).turn(wi))
    }
}

/// A point of a surface with a relief.
struct Tilted<'a> {
    bsdf: &'a Bsdf,
    relief: &'a Relief,
    /// The untilted normal.
    up: DVec3,
    site: &'a Site,
}

impl Tilted<'_> {
    fn facing(&self, w: DVec3) -> Facing {
        Facing { up: self.up, mirrored: self.relief.mirrors && w.dot(self.up) * w.z < 0.0 }
    }

    fn evaluate(&self, wi: DVec3, wo: DVec3, walk: Walk) -> Option<Evaluation> {
        let (own, other) = (self.facing(wi), self.facing(wo));
        let (decides, towards_light) = match walk {
            Walk::FromCamera => (own, wo),
            Walk::FromLight => (other, wi),
        };
        let within = |facing: Facing| {
            let admitted = facing.admits(wi) && facing.admits(wo);
            let found = || self.bsdf.evaluate(self.site, facing.turn(wi), facing.turn(wo), walk);
            if admitted { found() } else { None }
        };
        let found = within(decides)?;
        let factor = self.relief.shadowing(self.up, towards_light) * decides.stretch(towards_light);
        let value = found.value * factor;
        if own == other {
            return Some(Evaluation { value, ..found });
        }
        let none = SolidAnglePdf(0.0);
        let pdf = within(own).map_or(none, |found| found.pdf);
        let pdf_reverse = within(other).map_or(none, |found| found.pdf_reverse);
        Some(Evaluation { value, pdf, pdf_reverse, ..found })
    }

    fn invert(&self, wi: DVec3, wo: DVec3, delta: bool, gamma: Row) -> Option<Row> {
        let own = self.facing(wi);
        let admitted = own.admits(wo);
        admitted.then(|| self.bsdf.invert(self.site, own.turn(wi), own.turn(wo), delta, gamma)).flatten()
    }

    fn sample(&self, wi: DVec3, row: Row, walk: Walk) -> Option<Scatter> {
        let own = self.facing(wi);
        let sampled = self.bsdf.sample(self.site, own.turn(wi), row, walk)?;
        let direction = own.turn(sampled.direction);
        if !own.admits(direction) {
            return None;
        }
        let scatter = Scatter { direction, ..sampled };
        if !scatter.delta {
            let Evaluation { value, pdf, pdf_reverse, letter } = self.evaluate(wi, direction, walk)?;
            let weight = value * (direction.z.abs() / pdf.0);
            return Some(Scatter { weight, pdf, pdf_reverse, letter, ..scatter });
        }
        let factor = match walk {
            Walk::FromCamera => self.relief.shadowing(self.up, direction),
            Walk::FromLight => self.relief.shadowing(self.up, wi) * own.stretch(wi) / own.stretch(direction),
        };
        let weight = scatter.weight * factor;
        match walk {
            _ if own == self.facing(direction) => Some(Scatter { weight, ..scatter }),
            // No walk from the other side finds it, nor may what is found from a light be.
            Walk::FromCamera => Some(Scatter { weight, pdf_reverse: SolidAnglePdf(0.0), ..scatter }),
            Walk::FromLight => None,
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use crate::bsdf::{Diffuse, Distribution, RoughDielectric, Roughness};
    use crate::math::{Frame, Stream, warp::sphere};
    use crate::scene::relief::{oriented, tilted};
    use crate::spectrum::Spectrum;
    use crate::texture::{Checkerboard, ReliefMap, Texture};
    use glam::{DAffine2, DVec2};
    use std::f64::consts::PI;
    use std::sync::Arc;

    const NORMAL: DVec3 = DVec3::new(-0.536_631_28, 0.094_699_74, 0.838_486_03);

    fn relief() -> Relief {
        let [r, g, b] = (NORMAL * 0.5 + 0.5).to_array();
        let board = Checkerboard { colours: [Spectrum::rgb(r, g, b); 2], to_uv: DAffine2::IDENTITY };
        let texture = Arc::new(Texture::Checkerboard(board));
        Relief { map: ReliefMap::Normal { texture }, mirrors: true, shadows: true }
    }

    fn glass() -> Bsdf {
        Bsdf::RoughDielectric(RoughDielectric {
            eta: 1.5046 / 1.000277,
            roughness: Roughness::isotropic(Distribution::Beckmann, 0.3),
            specular_reflectance: Spectrum::ONE,
            specular_transmittance: Spectrum::ONE,
        })
    }

    /// Calls `check` with a tilted surface of `bsdf`, and the tilted frame.
    fn with<R>(bsdf: &Bsdf, check: impl FnOnce(Tilted<'_>, Frame) -> R) -> R {
        let relief = relief();
        let frame = tilted(oriented(DVec3::Z, DVec3::X), &relief.map, [DVec2::ZERO; 2], [DVec3::X, DVec3::Y]);
        let up = frame.to_local(DVec3::Z);
        check(Tilted { bsdf, relief: &relief, up, site: &Site::default() }, frame)
    }

    /// Values times cosine, as Mitsuba 3.9.1 has them for a bump map with this slope: as it is, mirrored, from behind.
    #[test]
    fn values_are_those_of_mitsuba() {
        let cases = [
            ([0.159670249, 0.248671679, 0.955336489], [-0.162055211, 0.354097097, 0.921060994], 0.00062891445),
            ([0.159670249, 0.248671679, 0.955336489], [-0.953915374, 0.135977339, 0.267498829], 0.038266256),
            ([0.997494987, 0.0, 0.070737202], [-0.162055211, 0.354097097, 0.921060994], 0.017846765),
            ([0.997494987, 0.0, 0.070737202], [-0.953915374, 0.135977339, 0.267498829], 0.0),
            ([-0.987512552, 0.140766501, 0.070737202], [-0.162055211, 0.354097097, 0.921060994], 0.017814403),
            ([0.997494987, 0.0, -0.070737202], [-0.162055211, 0.354097097, -0.921060994], 0.32747972),
        ];
        with(&glass(), |surface, frame| {
            for (wi, wo, expected) in cases {
                let [wi, wo] = [wi, wo].map(|w: [f64; 3]| frame.to_local(DVec3::from(w).normalize()));
                let found = surface.evaluate(wi, wo, Walk::FromCamera);
                let found = found.map_or(0.0, |found| found.value.luminance() * wo.z.abs());
                assert!((found - expected).abs() <= 2e-5 * expected, "{wi} {wo}: {found}, expected {expected}");
            }
        });
    }

    /// Both walks see the same light along the same directions, and each knows the other's density.
    #[test]
    fn walks_from_both_sides_agree() {
        let diffuse = Bsdf::Diffuse(Diffuse { reflectance: Spectrum::grey(0.7).into() });
        for bsdf in [diffuse, glass()] {
            with(&bsdf, |surface, _| {
                let mut stream = Stream::new(4, &[]);
                let mut mirrored = [0; 2];
                for _ in 0..20_000 {
                    let [a, b, c, d] = stream.row();
                    let (camera, light) = (sphere::sample([a, b]), sphere::sample([c, d]));
                    let one = surface.evaluate(camera, light, Walk::FromCamera);
                    let Some(one) = one.filter(|one| !one.value.is_black()) else { continue };
                    let other = surface.evaluate(light, camera, Walk::FromLight).unwrap();
                    let eta_squared = one.value.luminance() / other.value.luminance();
                    let same_side = camera.dot(surface.up) * light.dot(surface.up) > 0.0;
                    assert!(!same_side || (eta_squared - 1.0).abs() < 1e-6, "{eta_squared}");
                    let close = |a: SolidAnglePdf, b: SolidAnglePdf| (a.0 - b.0).abs() <= 1e-6 * a.0.max(b.0);
                    assert!(
                        close(one.pdf, other.pdf_reverse) && close(one.pdf_reverse, other.pdf),
                        "{one:?}\n{other:?}"
                    );
                    mirrored[usize::from(surface.facing(camera) != surface.facing(light))] += 1;
                }
                assert!(mirrored.iter().all(|count| *count > 100), "{mirrored:?}");
            });
        }
    }

    /// The mean weight of samples is the integral of value times cosine, whichever side decides the frame.
    #[test]
    fn samples_weigh_what_they_are_worth() {
        let diffuse = Bsdf::Diffuse(Diffuse { reflectance: Spectrum::grey(0.7).into() });
        with(&diffuse, |surface, frame| {
            let mut stream = Stream::new(5, &[]);
            let wi = frame.to_local(DVec3::new(0.95, -0.1, 0.2).normalize());
            assert!(surface.facing(wi).mirrored);
            for walk in [Walk::FromCamera, Walk::FromLight] {
                let n = 200_000;
                let mut sums = [[0.0; 2]; 2];
                for _ in 0..n {
                    let sampled = surface.sample(wi, stream.row(), walk);
                    let wo = sphere::sample([stream.number(), stream.number()]);
                    let found = surface.evaluate(wi, wo, walk);
                    let integrand = found.map_or(0.0, |found| found.value.luminance() * wo.z.abs() * 4.0 * PI);
                    for (sums, value) in
                        sums.iter_mut().zip([sampled.map_or(0.0, |sampled| sampled.weight.luminance()), integrand])
                    {
                        sums[0] += value / f64::from(n);
                        sums[1] += value * value / f64::from(n);
                    }
                }
                let [weight, integral] = sums.map(|sums| sums[0]);
                let error =
                    (sums.map(|[mean, square]| (square - mean * mean) / f64::from(n)).iter().sum::<f64>()).sqrt();
                assert!((weight - integral).abs() < 4.5 * error, "{walk:?}: {weight}, expected {integral} ± {error}");
            }
        });
    }
}
