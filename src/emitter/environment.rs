//! Everything around the scene: an image, a sun, or both. Light subpaths start with a direction, then a point on a disk
//! that covers the scene as seen along it.

use super::{Panorama, Reach, Start};
use crate::math::{AreaPdf, Discrete, Frame, Row, warp};
use crate::spectrum::Spectrum;
use glam::{DMat3, DVec3};

/// What surrounds a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Backdrop {
    /// An image, with the rotation from its axes to the world's.
    pub image: Option<(Panorama, DMat3)>,
    /// A sun before it.
    pub sun: Option<Sun>,
}

/// A disk in the sky of one radiance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sun {
    /// Unit vector towards its centre.
    pub towards: DVec3,
    /// Height of the cap that it cuts from the unit sphere: one minus the cosine of its angular radius.
    pub cap: f64,
    /// Radiance in W/(m² sr).
    pub radiance: Spectrum,
}

impl Sun {
    #[inline]
    fn covers(&self, direction: DVec3) -> bool {
        warp::cone::depth(Frame::around(self.towards).to_local(direction)) <= self.cap
    }

    fn integral(&self) -> f64 {
        self.radiance.luminance() / warp::cone::pdf(self.cap).0
    }
}

/// A backdrop and the sphere around the scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    backdrop: Backdrop,
    reach: Reach,
    /// Choice between image and sun by their light.
    choice: Discrete,
    integral: f64,
}

impl Environment {
    /// The scene around which it lies.
    pub(super) fn reach(&self) -> &Reach {
        &self.reach
    }

    /// An environment around a scene within `reach`; `None` when it is black.
    pub fn new(backdrop: Backdrop, reach: Reach) -> Option<Self> {
        let image = backdrop.image.as_ref().map_or(0.0, |(image, _)| image.integral());
        let sun = backdrop.sun.as_ref().map_or(0.0, Sun::integral);
        Some(Self { choice: Discrete::new(&[image, sun])?, backdrop, reach, integral: image + sun })
    }

    #[inline]
    pub(super) fn radiance(&self, towards: DVec3) -> Spectrum {
        let image = self.backdrop.image.as_ref();
        let sky = image.map_or(Spectrum::BLACK, |(image, rotation)| image.radiance(rotation.transpose() * towards));
        match &self.backdrop.sun {
            Some(sun) if sun.covers(towards) => sky + sun.radiance,
            _ => sky,
        }
    }

    #[inline]
    pub(super) fn start(&self, row: Row) -> (Start, AreaPdf) {
        let (which, rest) = self.choice.sample(row[1]);
        let u = [rest, row[2]];
        let towards = match (which, &self.backdrop) {
            (0, Backdrop { image: Some((image, rotation)), .. }) => *rotation * image.sample(u),
            (_, Backdrop { sun: Some(sun), .. }) => Frame::around(sun.towards).to_world(warp::cone::sample(u, sun.cap)),
            _ => warp::sphere::sample(u),
        };
        // Rounding may lead over the edge of what shines, where there is neither density nor light.
        (Start::Infinite { towards }, AreaPdf(self.start_pdf(towards).0.max(f64::MIN_POSITIVE)))
    }

    /// Densities with which the image and the sun are chosen and give `towards`.
    #[inline]
    fn densities(&self, towards: DVec3) -> [f64; 2] {
        let image = self.backdrop.image.as_ref();
        let sky = image.map_or(0.0, |(image, rotation)| image.pdf(rotation.transpose() * towards).0);
        let sun = match &self.backdrop.sun {
            Some(sun) if sun.covers(towards) => warp::cone::pdf(sun.cap).0,
            _ => 0.0,
        };
        [self.choice.pdf(0) * sky, self.choice.pdf(1) * sun]
    }

    /// A row that [`Environment::start`] maps to `towards`; image or sun are drawn in proportion to their densities.
    pub(super) fn invert_start(&self, towards: DVec3, gamma: Row) -> Option<Row> {
        let densities = self.densities(towards);
        let (which, _) = Discrete::new(&densities)?.sample(gamma[1]);
        let [u, v] = match (which, &self.backdrop) {
            (0, Backdrop { image: Some((image, rotation)), .. }) => image.invert(rotation.transpose() * towards),
            (1, Backdrop { sun: Some(sun), .. }) => {
                warp::cone::invert(Frame::around(sun.towards).to_local(towards), sun.cap)
            }
            _ => return None,
        };
        Some([gamma[0], self.choice.invert(which, u), v, gamma[3]])
    }

    #[inline]
    pub(super) fn start_pdf(&self, towards: DVec3) -> AreaPdf {
        let [sky, sun] = self.densities(towards);
        AreaPdf(sky + sun)
    }

    #[inline]
    pub(super) fn beam_pdf(&self) -> f64 {
        self.reach.beam_pdf()
    }

    #[inline]
    pub(super) fn emit(&self, towards: DVec3, row: Row) -> (DVec3, DVec3, Spectrum) {
        (self.reach.origin(towards, row), -towards, self.radiance(towards) / self.beam_pdf())
    }

    pub(super) fn power(&self) -> f64 {
        self.integral * self.reach.shadow()
    }
}
