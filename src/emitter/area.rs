//! Surfaces that shine evenly into the hemisphere of their normal; how much may vary over the surface.

use super::Start;
use crate::geometry::{NO_TRIANGLE, Solid};
use crate::math::{AreaPdf, Discrete, Frame, Row, SolidAnglePdf, warp};
use crate::spectrum::Spectrum;
use crate::texture::Colour;
use glam::{DVec2, DVec3, Vec2};
use std::f64::consts::{FRAC_1_PI, PI};

/// A shining surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Area {
    /// Radiance on the side of the normal, in W/(m² sr).
    pub radiance: Colour,
    surface: Surface,
    inverse_area: f64,
    power: f64,
}

/// A triangle as light is sampled on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facet {
    corner: DVec3,
    edges: [DVec3; 2],
    normal: DVec3,
    area: f64,
    /// Texture coordinates of the corners.
    uvs: [Vec2; 3],
}

/// Along each side of a triangle, or axis of a solid, so many points tell how bright a textured one is.
const PROBES: [usize; 2] = [4, 32];

/// Calls `at` with the middles of a square's `count` × `count` cells, and takes the mean.
fn mean(count: usize, at: impl Fn([f64; 2]) -> f64) -> f64 {
    let middle = |i: usize| (i as f64 + 0.5) / count as f64;
    (0..count * count).map(|i| at([middle(i / count), middle(i % count)])).sum::<f64>() / (count * count) as f64
}

/// A surface that points are sampled on.
#[derive(Clone, Debug, PartialEq)]
pub enum Surface {
    /// Triangles, chosen by area.
    Triangles {
        /// The triangles.
        facets: Vec<Facet>,
        /// Choice by area.
        choice: Discrete,
        /// Index of the first of them in the scene.
        first: u32,
    },
    /// A sphere or a cylinder that shines outwards, or a disk.
    Solid(Solid),
}

impl Surface {
    /// The surface of triangles with the given corners, counter-clockwise as seen from the shining side, and their
    /// texture coordinates; `first` is the scene's index of the first. `None` when their area is zero or not finite.
    pub fn triangles(first: u32, corners: impl Iterator<Item = ([DVec3; 3], [Vec2; 3])>) -> Option<Self> {
        let facets: Vec<Facet> = corners.map(|(corners, uvs)| Facet::new(corners, uvs)).collect();
        let areas: Vec<f64> = facets.iter().map(|facet| facet.area).collect();
        Some(Self::Triangles { choice: Discrete::new(&areas)?, facets, first })
    }

    /// Area in m².
    pub fn area(&self) -> f64 {
        match self {
            Self::Triangles { facets, .. } => facets.iter().map(|facet| facet.area).sum(),
            Self::Solid(solid) => solid.area(),
        }
    }

    /// A point, uniformly by area; where it is `textured`, on triangles also its texture coordinates.
    #[inline]
    fn sample(&self, row: Row, textured: bool) -> Place {
        match self {
            Self::Triangles { facets, choice, first } => {
                let (index, u) = choice.sample(row[1]);
                let facet = &facets[index];
                let at = warp::triangle::sample([u, row[2]]);
                let uv = if textured { facet.uv(at) } else { DVec2::ZERO };
                let position = facet.corner + facet.edges[0] * at.x + facet.edges[1] * at.y;
                Place { position, normal: facet.normal, uv, triangle: first + index as u32 }
            }
            Self::Solid(solid) => {
                let (position, normal) = sample_solid(solid, row);
                Place { position, normal, uv: DVec2::ZERO, triangle: NO_TRIANGLE }
            }
        }
    }

    /// The two numbers that [`Surface::sample`] maps to `position`, with the normal there as it has it; `triangle` is
    /// what the point lies on.
    fn invert(&self, position: DVec3, triangle: u32) -> Option<([f64; 2], DVec3)> {
        match self {
            Self::Triangles { facets, choice, first } => {
                let index = triangle.checked_sub(*first)? as usize;
                let facet = facets.get(index)?;
                let [u, v] = warp::triangle::invert(facet.barycentric(position));
                Some(([choice.invert(index, u), v], facet.normal))
            }
            Self::Solid(solid) => Some(invert_solid(solid, position)),
        }
    }

    /// The integral of `radiance` over the surface, as a luminance; of a texture by some points.
    fn integral(&self, radiance: &Colour) -> f64 {
        match (self, radiance) {
            (_, Colour::Constant(radiance)) => self.area() * radiance.luminance(),
            (Self::Triangles { facets, .. }, _) => facets.iter().map(|facet| facet.area * facet.mean(radiance)).sum(),
            (Self::Solid(solid), _) => {
                let uv = |[u, v]: [f64; 2]| solid.chart(self.sample([0.0, u, v, 0.0], false).position).uv;
                self.area() * mean(PROBES[1], |u| radiance.at(&uv(u).into()).luminance().max(0.0))
            }
        }
    }
}

/// A sampled point.
struct Place {
    position: DVec3,
    normal: DVec3,
    uv: DVec2,
    triangle: u32,
}

/// A point of a solid with its normal, uniformly by area.
fn sample_solid(solid: &Solid, row: Row) -> (DVec3, DVec3) {
    match solid {
        Solid::Sphere { center, radius, .. } => {
            let normal = warp::sphere::sample([row[1], row[2]]);
            (*center + normal * *radius, normal)
        }
        Solid::Disk { center, normal, radius, .. } => {
            let at = warp::disk::sample([row[1], row[2]]) * *radius;
            let frame = Frame::around(*normal);
            (*center + frame.tangent * at.x + frame.bitangent * at.y, *normal)
        }
        Solid::Cylinder { bottom, axes, length, radius } => {
            let (sin, cos) = (2.0 * PI * row[1]).sin_cos();
            let normal = axes.tangent * cos + axes.bitangent * sin;
            (*bottom + axes.normal * (row[2] * *length) + normal * *radius, normal)
        }
    }
}

/// The inverse of [`sample_solid`], with the normal.
fn invert_solid(solid: &Solid, position: DVec3) -> ([f64; 2], DVec3) {
    match solid {
        Solid::Sphere { center, .. } => {
            let normal = (position - *center).normalize_or(DVec3::Z);
            (warp::sphere::invert(normal), normal)
        }
        Solid::Disk { center, normal, radius, .. } => {
            let at = Frame::around(*normal).to_local(position - *center) / *radius;
            (warp::disk::invert(at.truncate()), *normal)
        }
        Solid::Cylinder { bottom, axes, length, .. } => {
            let local = axes.to_local(position - *bottom);
            let turn = local.y.atan2(local.x) / (2.0 * PI);
            let normal = (axes.tangent * local.x + axes.bitangent * local.y).normalize_or(axes.tangent);
            ([if turn < 0.0 { turn + 1.0 } else { turn }, local.z / *length], normal)
        }
    }
}

impl Facet {
    fn new([a, b, c]: [DVec3; 3], uvs: [Vec2; 3]) -> Self {
        let edges = [b - a, c - a];
        let cross = edges[0].cross(edges[1]);
        Self { corner: a, edges, normal: cross.normalize_or_zero(), area: 0.5 * cross.length(), uvs }
    }

    /// The corners.
    pub(super) fn corners(&self) -> [DVec3; 3] {
        [self.corner, self.corner + self.edges[0], self.corner + self.edges[1]]
    }

    /// Unit normal on the shining side.
    pub(super) fn normal(&self) -> DVec3 {
        self.normal
    }

    /// Barycentric coordinates of the second and the third corner at a point of the triangle.
    fn barycentric(&self, position: DVec3) -> DVec2 {
        let across = position - self.corner;
        let [a, b] = self.edges;
        let share = |first: DVec3, second: DVec3| first.cross(second).dot(self.normal) / (2.0 * self.area);
        DVec2::new(share(across, b), share(a, across))
    }

    /// Texture coordinates at the barycentric coordinates of the second and the third corner.
    #[inline]
    fn uv(&self, at: DVec2) -> DVec2 {
        let [a, b, c] = self.uvs.map(|uv| uv.as_dvec2());
        a * (1.0 - at.x - at.y) + b * at.x + c * at.y
    }

    fn mean(&self, radiance: &Colour) -> f64 {
        mean(PROBES[0], |u| radiance.at(&self.uv(warp::triangle::sample(u)).into()).luminance().max(0.0))
    }
}

impl Area {
    /// A light of `radiance` on `surface`.
    pub fn new(radiance: Colour, surface: Surface) -> Self {
        let power = surface.integral(&radiance) * PI;
        Self { radiance, inverse_area: 1.0 / surface.area(), surface, power }
    }

    /// The surface that shines.
    pub(super) fn surface(&self) -> &Surface {
        &self.surface
    }

    #[inline]
    pub(super) fn start(&self, row: Row) -> (Start, AreaPdf) {
        let textured = !self.radiance.is_constant();
        let Place { position, normal, mut uv, triangle } = self.surface.sample(row, textured);
        if let (Surface::Solid(solid), true) = (&self.surface, textured) {
            uv = solid.chart(position).uv;
        }
        (Start::Surface { position, normal, uv, triangle }, self.start_pdf())
    }

    /// A row that [`Area::start`] takes to a point of `triangle`.
    pub(super) fn invert_start(&self, position: DVec3, triangle: u32, gamma: Row) -> Option<Row> {
        let ([u, v], _) = self.surface.invert(position, triangle)?;
        Some([gamma[0], u, v, gamma[3]])
    }

    #[inline]
    pub(super) fn start_pdf(&self) -> AreaPdf {
        AreaPdf(self.inverse_area)
    }

    #[inline]
    pub(super) fn radiance(&self, uv: DVec2, cos: f64) -> Spectrum {
        match &self.radiance {
            _ if cos <= 0.0 => Spectrum::BLACK,
            Colour::Constant(radiance) => *radiance,
            Colour::Textured(texture) => texture.colour(uv).map(|channel| channel.max(0.0)),
        }
    }

    #[inline]
    pub(super) fn emit(&self, position: DVec3, normal: DVec3, uv: DVec2, row: Row) -> (DVec3, DVec3, Spectrum) {
        let local = warp::hemisphere::sample([row[1], row[2]]);
        (position, Frame::around(normal).to_world(local), self.radiance(uv, 1.0) * PI)
    }

    /// A row that [`Area::emit`] takes from a point of `triangle` along `direction`. The normal is that of the sampled
    /// start, since the frame around one that differs in the last bit, of a hit, may be another one.
    pub(super) fn invert_emission(&self, position: DVec3, triangle: u32, direction: DVec3, gamma: Row) -> Option<Row> {
        let (_, normal) = self.surface.invert(position, triangle)?;
        let local = Frame::around(normal).to_local(direction);
        let [u, v] = warp::hemisphere::invert(local);
        (local.z > 0.0).then_some([gamma[0], u, v, gamma[3]])
    }

    #[inline]
    pub(super) fn direction_pdf(&self, cos: f64) -> SolidAnglePdf {
        SolidAnglePdf(cos.max(0.0) * FRAC_1_PI)
    }

    pub(super) fn power(&self) -> f64 {
        self.power
    }
}
