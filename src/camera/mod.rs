//! Cameras: pinhole and thin lens, one model whose lens may have no size.
//!
//! Local axes as in Mitsuba: the camera looks along +z, +x points left, +y up. Film positions are in pixels, (0, 0) at
//! the top left corner.

use crate::math::{Frame, Row, SolidAnglePdf, warp};
use glam::{DVec2, DVec3};

/// A perspective camera, with depth of field when `lens_radius` is positive.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Centre of the lens.
    pub origin: DVec3,
    /// Local axes in world space, orthonormal; left-handed ones are allowed.
    pub axes: Frame,
    /// Film size in pixels.
    pub size: [usize; 2],
    /// Tangents of half the horizontal and half the vertical field of view.
    pub half: DVec2,
    /// Where the middle of the film lies in the plane at distance 1; zero for a camera that looks straight ahead.
    pub center: DVec2,
    /// Radius of the lens, 0 for a pinhole.
    pub lens_radius: f64,
    /// Distance to the plane in focus, positive.
    pub focus_distance: f64,
}

impl Camera {
    /// Point on the lens from the last two numbers of `row`.
    #[inline]
    pub fn lens(&self, row: Row) -> DVec3 {
        if self.lens_radius == 0.0 {
            return self.origin;
        }
        let at = warp::disk::sample([row[2], row[3]]) * self.lens_radius;
        self.origin + self.axes.tangent * at.x + self.axes.bitangent * at.y
    }

    /// Direction of the ray from the point `lens` through the film position `film`.
    #[inline]
    pub fn direction(&self, lens: DVec3, film: DVec2) -> DVec3 {
        let x = (1.0 - 2.0 * film.x / self.size[0] as f64) * self.half.x + self.center.x;
        let y = (1.0 - 2.0 * film.y / self.size[1] as f64) * self.half.y + self.center.y;
        let through_center = self.axes.to_world(DVec3::new(x, y, 1.0));
        if self.lens_radius == 0.0 {
            return through_center.normalize();
        }
        (self.origin + through_center * self.focus_distance - lens).normalize()
    }

    /// Film position of the ray from `lens` along `direction`; `None` when it misses the film.
    #[inline]
    pub fn film(&self, lens: DVec3, direction: DVec3) -> Option<DVec2> {
        let local = self.axes.to_local(direction);
        if local.z <= 0.0 {
            return None;
        }
        let offset = self.axes.to_local(lens - self.origin) / self.focus_distance;
        let x = local.x / local.z + offset.x - self.center.x;
        let y = local.y / local.z + offset.y - self.center.y;
        let film = DVec2::new(
            0.5 * (1.0 - x / self.half.x) * self.size[0] as f64,
            0.5 * (1.0 - y / self.half.y) * self.size[1] as f64,
        );
        let inside = film.x >= 0.0 && film.y >= 0.0 && film.x < self.size[0] as f64 && film.y < self.size[1] as f64;
        inside.then_some(film)
    }

    /// Density of `direction` when film positions are uniform over the film: 1 / (A cos³ θ) with A the area of the film
    /// at distance 1. It is at the same time the importance W cos θ of a measurement that sums over the film.
    #[inline]
    pub fn direction_pdf(&self, direction: DVec3) -> SolidAnglePdf {
        let cos = direction.dot(self.axes.normal);
        if cos <= 0.0 {
            return SolidAnglePdf(0.0);
        }
        SolidAnglePdf(1.0 / (4.0 * self.half.x * self.half.y * cos * cos * cos))
    }

    /// Width of a pixel in the plane at distance 1.
    pub fn pixel_width(&self) -> f64 {
        2.0 * self.half.x / self.size[0] as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Stream;

    fn camera(lens_radius: f64) -> Camera {
        Camera {
            origin: DVec3::new(1.0, 2.0, 3.0),
            axes: Frame::around(DVec3::new(0.2, -0.5, 0.7).normalize()),
            size: [64, 32],
            half: DVec2::new(0.6, 0.3),
            center: DVec2::new(-0.1, 0.2),
            lens_radius,
            focus_distance: 2.5,
        }
    }

    #[test]
    fn film_inverts_direction() {
        for lens_radius in [0.0, 0.3] {
            let camera = camera(lens_radius);
            let mut stream = Stream::new(2, &[]);
            for _ in 0..1000 {
                let film = DVec2::new(64.0 * stream.number(), 32.0 * stream.number());
                let lens = camera.lens(stream.row());
                let back = camera.film(lens, camera.direction(lens, film)).map(|p| (p - film).length());
                assert!(back.is_some_and(|d| d < 1e-9), "{film} {back:?}");
            }
        }
    }

    /// The density integrates to one over the sphere of directions, and the expectation of 1/pdf over the film is the
    /// solid angle that it covers.
    #[test]
    fn directions_have_their_density() {
        for lens_radius in [0.0, 0.3] {
            let camera = camera(lens_radius);
            let mut stream = Stream::new(4, &[]);
            let lens = camera.lens(stream.row());
            let n = 400_000;
            let mut sum = 0.0;
            for _ in 0..n {
                let direction = warp::sphere::sample([stream.number(), stream.number()]);
                if camera.film(lens, direction).is_some() {
                    sum += camera.direction_pdf(direction).0 / warp::sphere::PDF.0;
                }
            }
            let mean = sum / f64::from(n);
            assert!((mean - 1.0).abs() < 0.02, "{mean}");
        }
    }
}
