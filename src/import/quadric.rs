//! Surfaces of revolution as meshes, where Mitsuba has no such shape: parts, stretched ones, cones.

use super::mesh::Mesh;
use glam::{DVec2, DVec3};

/// Steps around the axis of a full turn.
const AROUND: u32 = 64;

/// Steps along the profile, unless it is straight.
const ALONG: u32 = 32;

/// A profile that turns about the z axis.
pub(super) enum Profile {
    /// Part of a circle, between angles from the south pole.
    Sphere { radius: f64, from: f64, to: f64 },
    /// A line, between points (distance from the axis, z).
    Line { from: DVec2, to: DVec2 },
    /// z grows with the square of the distance, to `top` at `radius`.
    Paraboloid { radius: f64, top: f64, from: f64, to: f64 },
}

impl Profile {
    /// The point at `v`, and the direction outwards.
    fn at(&self, v: f64) -> (DVec2, DVec2) {
        match *self {
            Self::Sphere { radius, from, to } => {
                let (sin, cos) = (from + (to - from) * v).sin_cos();
                let out = DVec2::new(sin, -cos);
                (out * radius, out)
            }
            Self::Line { from, to } => {
                let along = (to - from).normalize_or_zero();
                (from.lerp(to, v), DVec2::new(along.y, -along.x))
            }
            Self::Paraboloid { radius, top, from, to } => {
                let z = from + (to - from) * v;
                let r = radius * (z / top).max(0.0).sqrt();
                (DVec2::new(r, z), DVec2::new(2.0 * top * r, -radius * radius).normalize_or_zero())
            }
        }
    }

    /// The surface that the profile sweeps in a turn by `angle` radians.
    pub fn sweep(&self, angle: f64) -> Mesh {
        let turns = (angle.abs() / std::f64::consts::TAU).min(1.0);
        let around = ((f64::from(AROUND) * turns).ceil() as u32).max(1);
        let along = if matches!(self, Self::Line { .. }) { 1 } else { ALONG };
        let mut mesh = Mesh::default();
        for j in 0..=along {
            let v = f64::from(j) / f64::from(along);
            let (point, out) = self.at(v);
            for i in 0..=around {
                let u = f64::from(i) / f64::from(around);
                let (sin, cos) = (angle * u).sin_cos();
                mesh.positions.push(DVec3::new(point.x * cos, point.x * sin, point.y));
                mesh.normals.push(DVec3::new(out.x * cos, out.x * sin, out.y));
                mesh.uvs.push(DVec2::new(u, v));
            }
        }
        for j in 0..along {
            for i in 0..around {
                let a = j * (around + 1) + i;
                let (b, d) = (a + 1, a + around + 1);
                mesh.triangles.extend([[a, b, d + 1], [a, d + 1, d]]);
            }
        }
        // Triangles at the poles have two corners in the same place, but for rounding.
        let size = mesh.positions.iter().map(|p| p.length_squared()).fold(0.0, f64::max);
        mesh.triangles.retain(|triangle| {
            let [a, b, c] = triangle.map(|i| mesh.positions[i as usize]);
            (b - a).cross(c - a).length() > 1e-12 * size
        });
        mesh
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DAffine3;
    use std::f64::consts::{PI, TAU};

    #[test]
    fn normals_look_where_faces_do_and_areas_fit() {
        let sphere = Profile::Sphere { radius: 2.0, from: 0.0, to: PI };
        let tube = Profile::Line { from: DVec2::new(1.0, -1.0), to: DVec2::new(1.0, 2.0) };
        let bowl = Profile::Paraboloid { radius: 1.0, top: 1.0, from: 0.0, to: 1.0 };
        let bowl_area = PI / 6.0 * (5.0_f64.powf(1.5) - 1.0);
        for (profile, area) in [(sphere, 16.0 * PI), (tube, 6.0 * PI), (bowl, bowl_area)] {
            let mesh = profile.sweep(TAU);
            let found = mesh.area(&DAffine3::IDENTITY);
            assert!((found / area - 1.0).abs() < 0.01, "{found} {area}");
            for triangle in &mesh.triangles {
                let [a, b, c] = triangle.map(|i| mesh.positions[i as usize]);
                assert!((b - a).cross(c - a).dot(mesh.normals[triangle[0] as usize]) > 0.0);
            }
        }
    }
}
