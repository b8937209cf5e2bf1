//! Anisotropic microfacet normal distributions (Walter et al. 2007; Heitz 2014; Heitz 2018 for the visible normals of
//! GGX, Jakob 2014 for those of Beckmann). Directions in the shading frame, `wi.z > 0`.

use super::slopes::Slopes;
use super::{GLOSSY_ALPHA, Letter};
use crate::math::warp::disk;
use crate::texture::{Number, Site};
use glam::{DVec2, DVec3};
use std::f64::consts::{FRAC_1_PI, TAU};

/// Smallest roughness; smaller ones are raised to it, as in Mitsuba.
pub(super) const SMALLEST_ALPHA: f64 = 1e-4;

/// The family of distributions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Distribution {
    /// Trowbridge and Reitz.
    Ggx,
    /// Beckmann.
    Beckmann,
}

/// A distribution of microfacet normals whose roughness may vary over the surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Roughness {
    /// The family.
    pub distribution: Distribution,
    /// Roughness α along the tangent.
    pub alpha_u: Number,
    /// Roughness α along the bitangent.
    pub alpha_v: Number,
    /// Whether only normals that the incident direction sees are sampled; else all are.
    pub visible: bool,
}

impl Roughness {
    /// The same roughness everywhere and in all directions.
    pub fn isotropic(distribution: Distribution, alpha: f64) -> Self {
        Self { distribution, alpha_u: alpha.into(), alpha_v: alpha.into(), visible: true }
    }

    /// The distribution at `site`.
    #[inline]
    pub fn at(&self, site: &Site) -> Microfacet {
        Microfacet {
            distribution: self.distribution,
            alpha: DVec2::new(self.alpha_u.at(site), self.alpha_v.at(site)).max(DVec2::splat(SMALLEST_ALPHA)),
            visible: self.visible,
        }
    }

    /// Whether it is the same along the tangent and the bitangent.
    pub fn is_isotropic(&self) -> bool {
        self.alpha_u == self.alpha_v
    }

    /// Whether it is the same everywhere.
    pub fn is_constant(&self) -> bool {
        self.alpha_u.is_constant() && self.alpha_v.is_constant()
    }

    /// Whether photons are gathered: where the letter is `D`, and wherever it varies.
    #[inline]
    pub fn gathers(&self) -> bool {
        !self.is_constant() || self.at(&Site::default()).letter() == Letter::D
    }
}

/// A distribution of microfacet normals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Microfacet {
    /// The family.
    pub distribution: Distribution,
    /// Roughness α > 0 along the two tangents: for Beckmann the root mean square slope.
    pub alpha: DVec2,
    /// Whether only visible normals are sampled.
    pub visible: bool,
}

impl Microfacet {
    /// Specular-like where the smaller α is below [`GLOSSY_ALPHA`].
    #[inline]
    pub fn letter(&self) -> Letter {
        if self.alpha.min_element() < GLOSSY_ALPHA { Letter::S } else { Letter::D }
    }

    /// Takes `w` to where the distribution has α = 1 (Heitz 2014, section 5.3).
    #[inline]
    fn stretch(&self, w: DVec3) -> DVec3 {
        DVec3::new(self.alpha.x * w.x, self.alpha.y * w.y, w.z)
    }

    /// Density D(h) of normals per projected area (Heitz 2014, eqs. 83 and 85).
    #[inline]
    pub fn density(&self, h: DVec3) -> f64 {
        if h.z <= 0.0 {
            return 0.0;
        }
        let sin2 = (h.truncate() / self.alpha).length_squared();
        let cos2 = h.z * h.z;
        let area = self.alpha.x * self.alpha.y;
        match self.distribution {
            Distribution::Ggx => FRAC_1_PI / (area * (sin2 + cos2) * (sin2 + cos2)),
            Distribution::Beckmann => (-sin2 / cos2).exp() * FRAC_1_PI / (area * cos2 * cos2),
        }
    }

    /// Smith's shadowing of one direction `w`, which must lie on the same side of the facet `h` as of the surface
    /// (Walter et al. 2007, eqs. 27 and 34).
    #[inline]
    pub fn shadowing(&self, w: DVec3, h: DVec3) -> f64 {
        if w.dot(h) * w.z <= 0.0 {
            return 0.0;
        }
        let tan2 = (w.truncate() * self.alpha).length_squared() / (w.z * w.z);
        match self.distribution {
            Distribution::Ggx => 2.0 / (1.0 + (1.0 + tan2).sqrt()),
            Distribution::Beckmann if tan2 == 0.0 => 1.0,
            Distribution::Beckmann => {
                let a = 1.0 / tan2.sqrt();
                if a >= 1.6 { 1.0 } else { (3.535 * a + 2.181 * a * a) / (1.0 + 2.276 * a + 2.577 * a * a) }
            }
        }
    }

    /// A microfacet normal as seen from `wi`.
    #[inline]
    pub fn sample(&self, wi: DVec3, u: [f64; 2]) -> DVec3 {
        let h = match (self.visible, self.distribution) {
            (true, Distribution::Ggx) => VisibleDisk::of(self.stretch(wi)).at(disk::sample(u)),
            (true, Distribution::Beckmann) => {
                let slope = Slopes::of(self.stretch(wi)).sample(u);
                DVec3::new(-slope.x, -slope.y, 1.0)
            }
            (false, distribution) => {
                let tan2 = match distribution {
                    Distribution::Ggx => u[0] / (1.0 - u[0]),
                    Distribution::Beckmann => -(-u[0]).ln_1p(),
                };
                (DVec2::from_angle(TAU * u[1]) * tan2.sqrt()).extend(1.0)
            }
        };
        self.stretch(h).normalize()
    }

    /// [`Microfacet::sample`] of GGX's visible normals as a map from the unit disk: for many normals of one direction.
    pub(super) fn seen_from(&self, wi: DVec3) -> impl Fn(DVec2) -> DVec3 {
        let visible = VisibleDisk::of(self.stretch(wi));
        move |point| self.stretch(visible.at(point)).normalize()
    }

    /// Density of [`Microfacet::sample`] per solid angle of the normal. For visible normals of Beckmann the exact
    /// shadowing stands in place of the fit, so that the density is that of the samples.
    #[inline]
    pub fn pdf(&self, wi: DVec3, h: DVec3) -> f64 {
        match (self.visible, self.distribution) {
            (false, _) => self.density(h) * h.z,
            (true, Distribution::Ggx) => self.density(h) * self.shadowing(wi, h) * wi.dot(h).max(0.0) / wi.z,
            (true, Distribution::Beckmann) => {
                // The stretched directions have the same cosines but for their lengths.
                let stretched = self.stretch(wi);
                self.density(h) * wi.dot(h).max(0.0) / (stretched.length() * Slopes::of(stretched).area())
            }
        }
    }

    /// The inverse of [`Microfacet::sample`].
    pub fn invert(&self, wi: DVec3, h: DVec3) -> [f64; 2] {
        let n = DVec3::new(h.x / self.alpha.x, h.y / self.alpha.y, h.z);
        match (self.visible, self.distribution) {
            (true, Distribution::Ggx) => VisibleDisk::of(self.stretch(wi)).invert(n.normalize()),
            (true, Distribution::Beckmann) => Slopes::of(self.stretch(wi)).invert(-n.truncate() / n.z),
            (false, distribution) => {
                let (tan2, turn) = ((n.truncate() / n.z).length_squared(), n.y.atan2(n.x) / TAU);
                let u = match distribution {
                    Distribution::Ggx => tan2 / (1.0 + tan2),
                    Distribution::Beckmann => -(-tan2).exp_m1(),
                };
                [u, if turn < 0.0 { turn + 1.0 } else { turn }]
            }
        }
    }
}

/// The hemisphere of GGX, stretched to α = 1, as seen from a direction (Heitz 2018, listing 1).
struct VisibleDisk {
    axis: DVec3,
    tangent: DVec3,
    bitangent: DVec3,
    /// Share of the disk that the lower half of the projected hemisphere covers.
    share: f64,
}

impl VisibleDisk {
    #[inline]
    fn of(stretched: DVec3) -> Self {
        let axis = stretched.normalize();
        let tangent = DVec2::new(-axis.y, axis.x).normalize_or(DVec2::X).extend(0.0);
        Self { axis, tangent, bitangent: axis.cross(tangent), share: 0.5 * (1.0 + axis.z) }
    }

    /// The normal at the point `p` of the unit disk.
    #[inline]
    fn at(&self, p: DVec2) -> DVec3 {
        let bulge = (1.0 - p.x * p.x).max(0.0).sqrt();
        let y = (1.0 - self.share) * bulge + self.share * p.y;
        let z = (1.0 - p.x * p.x - y * y).max(0.0).sqrt();
        let n = self.tangent * p.x + self.bitangent * y + self.axis * z;
        DVec3::new(n.x, n.y, n.z.max(0.0))
    }

    fn invert(&self, n: DVec3) -> [f64; 2] {
        let x = n.dot(self.tangent);
        let bulge = (1.0 - x * x).max(0.0).sqrt();
        let y = (n.dot(self.bitangent) - (1.0 - self.share) * bulge) / self.share;
        disk::invert(DVec2::new(x, y))
    }
}
