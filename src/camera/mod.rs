//! Cameras: perspective, with a lens that may have no size, and orthographic. In the latter a path ends on the film
//! itself, at right angles, so that the point there takes the place of the lens.
//!
//! Local axes as in Mitsuba: the camera looks along +z, +x points left, +y up. Film positions are in pixels, (0, 0) at
//! the top left corner.

use crate::math::{AreaPdf, Frame, Row, SolidAnglePdf, warp};
use glam::{DVec2, DVec3};

/// A camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Centre of the lens, or of what the scene's axes call the film of an orthographic camera.
    pub origin: DVec3,
    /// Local axes in world space, orthonormal; left-handed ones are allowed.
    pub axes: Frame,
    /// Film size in pixels.
    pub size: [usize; 2],
    /// Half the width and height of what is seen: in the plane at distance 1, or anywhere for an orthographic camera.
    pub half: DVec2,
    /// Where the middle of the film lies in that plane; zero for a camera that looks straight ahead.
    pub center: DVec2,
    /// How rays leave it.
    pub projection: Projection,
}

/// How rays leave a camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Through a lens.
    Perspective {
        /// Radius of the lens, 0 for a pinhole.
        lens_radius: f64,
        /// Distance to the plane in focus, positive.
        focus_distance: f64,
    },
    /// At right angles to the film.
    Orthographic {
        /// How far they go.
        depth: f64,
    },
}

/// A point as the camera sees it.
#[derive(Clone, Copy, Debug)]
pub struct Sight {
    /// Where the path ends: on the lens, or on the film of an orthographic camera.
    pub lens: DVec3,
    /// Unit direction from there to the point.
    pub direction: DVec3,
    /// Film position.
    pub film: DVec2,
    /// Density with which rays reach the point when film positions are uniform, per area at right angles to the ray. It
    /// is at the same time the importance of a measurement that sums over the film.
    pub density: f64,
}

impl Camera {
    /// Where the ray through the film position `film` starts, and its direction; the lens is sampled by the last two
    /// numbers of `row`.
    #[inline]
    pub fn ray(&self, film: DVec2, row: Row) -> (DVec3, DVec3) {
        let x = (1.0 - 2.0 * film.x / self.size[0] as f64) * self.half.x + self.center.x;
        let y = (1.0 - 2.0 * film.y / self.size[1] as f64) * self.half.y + self.center.y;
        let Frame { tangent, bitangent, normal } = self.axes;
        match self.projection {
            Projection::Perspective { lens_radius, focus_distance } => {
                let through_center = self.axes.to_world(DVec3::new(x, y, 1.0));
                if lens_radius == 0.0 {
                    return (self.origin, through_center.normalize());
                }
                let at = warp::disk::sample([row[2], row[3]]) * lens_radius;
                let lens = self.origin + tangent * at.x + bitangent * at.y;
                (lens, (self.origin + through_center * focus_distance - lens).normalize())
            }
            Projection::Orthographic { .. } => (self.origin + tangent * x + bitangent * y, normal),
        }
    }

    /// Whether rays leave a lens and not a point.
    pub fn has_lens(&self) -> bool {
        matches!(self.projection, Projection::Perspective { lens_radius, .. } if lens_radius > 0.0)
    }

    /// The film position that the first two numbers of a row stand for, evenly over the film.
    #[inline]
    pub fn film_position(&self, row: Row) -> DVec2 {
        DVec2::new(row[0] * self.size[0] as f64, row[1] * self.size[1] as f64)
    }

    /// The row that [`Camera::ray`] reads for the point `lens` of the lens, and that [`Camera::film_position`]
    /// takes to `film`; numbers that it leaves open are taken from `gamma`.
    pub fn invert(&self, film: DVec2, lens: DVec3, gamma: Row) -> Row {
        let [x, y] = [film.x / self.size[0] as f64, film.y / self.size[1] as f64];
        match self.projection {
            Projection::Perspective { lens_radius, .. } if lens_radius > 0.0 => {
                let at = self.axes.to_local(lens - self.origin).truncate() / lens_radius;
                let [u, v] = warp::disk::invert(at);
                [x, y, u, v]
            }
            _ => [x, y, gamma[2], gamma[3]],
        }
    }

    /// How the camera sees `point`, through `lens` if it has one; `None` when the film does not show it.
    #[inline]
    pub fn sight(&self, lens: DVec3, point: DVec3) -> Option<Sight> {
        match self.projection {
            Projection::Perspective { focus_distance, .. } => {
                let offset = point - lens;
                let distance_squared = offset.length_squared();
                let direction = offset / distance_squared.sqrt();
                let local = self.axes.to_local(direction);
                if local.z <= 0.0 {
                    return None;
                }
                let shift = self.axes.to_local(lens - self.origin).truncate() / focus_distance;
                let film = self.film(local.truncate() / local.z + shift)?;
                let density = self.direction_pdf(direction).0 / distance_squared;
                Some(Sight { lens, direction, film, density })
            }
            Projection::Orthographic { depth } => {
                let local = self.axes.to_local(point - self.origin);
                let film = self.film(local.truncate()).filter(|_| local.z > 0.0 && local.z <= depth)?;
                let direction = self.axes.normal;
                Some(Sight { lens: point - direction * local.z, direction, film, density: self.film_pdf() })
            }
        }
    }

    /// Film position of a point of the plane where `half` and `center` are measured.
    #[inline]
    fn film(&self, at: DVec2) -> Option<DVec2> {
        let DVec2 { x, y } = at - self.center;
        let film = DVec2::new(
            0.5 * (1.0 - x / self.half.x) * self.size[0] as f64,
            0.5 * (1.0 - y / self.half.y) * self.size[1] as f64,
        );
        let inside = film.x >= 0.0 && film.y >= 0.0 && film.x < self.size[0] as f64 && film.y < self.size[1] as f64;
        inside.then_some(film)
    }

    /// Density, per area, of a surface that a ray along `direction` meets when film positions are uniform.
    #[inline]
    pub fn arrival_pdf(&self, direction: DVec3, cos: f64, distance_squared: f64) -> AreaPdf {
        match self.projection {
            Projection::Perspective { .. } => self.direction_pdf(direction).to_area(cos, distance_squared),
            Projection::Orthographic { .. } => AreaPdf(self.film_pdf() * cos.abs()),
        }
    }

    /// Density per area in the plane where `half` is measured.
    #[inline]
    fn film_pdf(&self) -> f64 {
        1.0 / (4.0 * self.half.x * self.half.y)
    }

    /// Density of `direction` through a lens when film positions are uniform: 1 / (A cos³ θ) with A the area of the film
    /// at distance 1, that is W cos θ.
    #[inline]
    fn direction_pdf(&self, direction: DVec3) -> SolidAnglePdf {
        let cos = direction.dot(self.axes.normal);
        if cos <= 0.0 {
            return SolidAnglePdf(0.0);
        }
        SolidAnglePdf(1.0 / (4.0 * self.half.x * self.half.y * cos * cos * cos))
    }

    /// Whether `point`, which a ray from the film has met, is not too far away to be shown.
    #[inline]
    pub fn reaches(&self, point: DVec3) -> bool {
        match self.projection {
            Projection::Perspective { .. } => true,
            Projection::Orthographic { depth } => self.axes.normal.dot(point - self.origin) <= depth,
        }
    }

    /// Width of what a pixel shows at a distance; of one that is no square, the side of a square of its area.
    #[inline]
    pub fn pixel_width(&self, distance: f64) -> f64 {
        let [x, y] = [self.half.x / self.size[0] as f64, self.half.y / self.size[1] as f64];
        match self.projection {
            Projection::Perspective { .. } => 2.0 * x * distance,
            Projection::Orthographic { .. } => 2.0 * (x * y).sqrt(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Stream;

    const PROJECTIONS: [Projection; 3] = [
        Projection::Perspective { lens_radius: 0.0, focus_distance: 2.5 },
        Projection::Perspective { lens_radius: 0.3, focus_distance: 2.5 },
        Projection::Orthographic { depth: 10.0 },
    ];

    fn camera(projection: Projection) -> Camera {
        Camera {
            origin: DVec3::new(1.0, 2.0, 3.0),
            axes: Frame::around(DVec3::new(0.2, -0.5, 0.7).normalize()),
            size: [64, 32],
            half: DVec2::new(0.6, 0.3),
            center: DVec2::new(-0.1, 0.2),
            projection,
        }
    }

    #[test]
    fn sight_inverts_ray() {
        for projection in PROJECTIONS {
            let camera = camera(projection);
            let mut stream = Stream::new(2, &[]);
            for _ in 0..1000 {
                let film = DVec2::new(64.0 * stream.number(), 32.0 * stream.number());
                let row = stream.row();
                let (lens, direction) = camera.ray(film, row);
                let [x, y, u, v] = camera.invert(film, lens, row);
                let off = [x - film.x / 64.0, y - film.y / 32.0, u - row[2], v - row[3]].map(f64::abs);
                assert!(off.iter().all(|off| *off < 1e-9), "{row:?}: {off:?}");
                let distance = 0.1 + 9.0 * stream.number();
                let back = camera.sight(lens, lens + direction * distance);
                let same = |sight: &Sight| {
                    (sight.film - film).length() < 1e-9
                        && (sight.lens - lens).length() < 1e-9
                        && (sight.direction - direction).length() < 1e-12
                        && (camera.arrival_pdf(direction, 1.0, distance * distance).0 / sight.density - 1.0).abs()
                            < 1e-9
                };
                assert!(back.as_ref().is_some_and(same), "{film} {back:?}");
            }
        }
        let camera = camera(PROJECTIONS[2]);
        let at = |z: f64| camera.ray(DVec2::splat(16.0), [0.5; 4]).0 + camera.axes.normal * z;
        assert!(camera.sight(DVec3::ZERO, at(-0.1)).is_none() && camera.sight(DVec3::ZERO, at(10.1)).is_none());
        assert!(camera.reaches(at(9.9)) && !camera.reaches(at(10.1)));
    }

    /// Over a plane across the view, tilted, the density integrates to one.
    #[test]
    fn points_have_their_density() {
        for projection in PROJECTIONS {
            let camera = camera(projection);
            let mut stream = Stream::new(4, &[]);
            let (lens, _) = camera.ray(DVec2::ZERO, stream.row());
            let Frame { tangent, bitangent, normal } = camera.axes;
            let across = (bitangent + normal * 0.4).normalize();
            let facing = tangent.cross(across);
            let (n, side) = (400_000, 8.0);
            let mut sum = 0.0;
            for _ in 0..n {
                let [x, y] = [(); 2].map(|()| side * (stream.number() - 0.5));
                let sight = camera.sight(lens, camera.origin + normal * 3.0 + tangent * x + across * y);
                sum += sight.map_or(0.0, |sight| sight.density * sight.direction.dot(facing).abs());
            }
            let mean = sum * side * side / f64::from(n);
            assert!((mean - 1.0).abs() < 0.02, "{projection:?}: {mean}");
        }
    }
}
