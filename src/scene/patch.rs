//! The surroundings of a point of a surface, to first order.

use super::{SOLID, Scene, Surface};
use crate::geometry::Solid;
use crate::math::Frame;
use glam::DVec3;

/// A point of a surface, where it may move to, and how the shading normal turns there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Patch {
    /// The point, in scene units.
    pub position: DVec3,
    /// Unit vectors along the true surface, at right angles.
    pub tangents: [DVec3; 2],
    /// The shading normal.
    pub normal: DVec3,
    /// Its derivatives along the tangents, in 1 / scene unit.
    pub turning: [DVec3; 2],
}

impl Scene {
    /// What lies around a point of a surface; `None` where a relief turns the normals, or nothing tells them.
    pub fn patch(&self, surface: &Surface) -> Option<Patch> {
        if surface.up.z < 1.0 {
            return None;
        }
        let Surface { position, geometric, frame: Frame { normal, .. }, primitive, .. } = *surface;
        let Frame { tangent, bitangent, .. } = Frame::around(geometric);
        let tangents = [tangent, bitangent];
        let turning = match primitive & SOLID {
            0 => self.turning_of_triangle(primitive as usize, surface, tangents)?,
            _ => turning_of_solid(self.solids.get((primitive ^ SOLID) as usize)?, tangents),
        };
        Some(Patch { position, tangents, normal, turning })
    }

    fn turning_of_triangle(&self, index: usize, surface: &Surface, tangents: [DVec3; 2]) -> Option<[DVec3; 2]> {
        if !self.shapes[*self.triangle_shapes.get(index)? as usize].smooth {
            return Some([DVec3::ZERO; 2]);
        }
        let corners = self.triangles[index];
        let [a, b, c] = corners.map(|i| self.vertices[i as usize].as_dvec3());
        let [na, nb, nc] = corners.map(|i| self.normals[i as usize].as_dvec3());
        let (ab, ac) = (b - a, c - a);
        let across = ab.cross(ac);
        let area_squared = across.length_squared();
        // How far along both edges a step leads, as barycentric coordinates.
        let barycentric = |d: DVec3| [d.cross(ac).dot(across), ab.cross(d).dot(across)].map(|x| x / area_squared);
        let change = |[u, v]: [f64; 2]| (nb - na) * u + (nc - na) * v;
        let interpolated = na + change(barycentric(surface.position - a));
        let length = interpolated.length();
        let normal = interpolated / length;
        let turning = tangents.map(|tangent| {
            let change = change(barycentric(tangent));
            (change - normal * normal.dot(change)) / length
        });
        (length > 0.0 && area_squared > 0.0).then_some(turning)
    }
}

fn turning_of_solid(solid: &Solid, tangents: [DVec3; 2]) -> [DVec3; 2] {
    match solid {
        Solid::Sphere { radius, .. } => tangents.map(|tangent| tangent / *radius),
        Solid::Disk { .. } => [DVec3::ZERO; 2],
        Solid::Cylinder { axes: Frame { normal: axis, .. }, radius, .. } => {
            tangents.map(|tangent| (tangent - *axis * axis.dot(tangent)) / *radius)
        }
    }
}
