//! Surfaces that shine evenly into the hemisphere of their normal.

use super::Start;
use crate::geometry::Solid;
use crate::math::{AreaPdf, Discrete, Frame, Row, SolidAnglePdf, warp};
use crate::spectrum::Spectrum;
use glam::DVec3;
use std::f64::consts::{FRAC_1_PI, PI};

/// A shining surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Area {
    /// Radiance on the side of the normal, in W/(m² sr).
    pub radiance: Spectrum,
    surface: Surface,
    inverse_area: f64,
}

/// A triangle as light is sampled on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Facet {
    corner: DVec3,
    edges: [DVec3; 2],
    normal: DVec3,
    area: f64,
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
    },
    /// A sphere or a cylinder that shines outwards, or a disk.
    Solid(Solid),
}

impl Surface {
    /// The surface of triangles with the given corners, counter-clockwise as seen from the shining side; `None` when
    /// their area is zero or not finite.
    pub fn triangles(corners: impl Iterator<Item = [DVec3; 3]>) -> Option<Self> {
        let facets: Vec<Facet> = corners.map(Facet::new).collect();
        let areas: Vec<f64> = facets.iter().map(|facet| facet.area).collect();
        Some(Self::Triangles { choice: Discrete::new(&areas)?, facets })
    }

    /// Area in m².
    pub fn area(&self) -> f64 {
        match self {
            Self::Triangles { facets, .. } => facets.iter().map(|facet| facet.area).sum(),
            Self::Solid(solid) => solid.area(),
        }
    }

    /// A point with its normal, uniformly by area.
    #[inline]
    fn sample(&self, row: Row) -> (DVec3, DVec3) {
        match self {
            Self::Triangles { facets, choice } => {
                let (index, u) = choice.sample(row[1]);
                let facet = &facets[index];
                let at = warp::triangle::sample([u, row[2]]);
                (facet.corner + facet.edges[0] * at.x + facet.edges[1] * at.y, facet.normal)
            }
            Self::Solid(Solid::Sphere { center, radius, .. }) => {
                let normal = warp::sphere::sample([row[1], row[2]]);
                (*center + normal * *radius, normal)
            }
            Self::Solid(Solid::Disk { center, normal, radius, .. }) => {
                let at = warp::disk::sample([row[1], row[2]]) * *radius;
                let frame = Frame::around(*normal);
                (*center + frame.tangent * at.x + frame.bitangent * at.y, *normal)
            }
            Self::Solid(Solid::Cylinder { bottom, axes, length, radius }) => {
                let (sin, cos) = (2.0 * PI * row[1]).sin_cos();
                let normal = axes.tangent * cos + axes.bitangent * sin;
                (*bottom + axes.normal * (row[2] * *length) + normal * *radius, normal)
            }
        }
    }
}

impl Facet {
    fn new([a, b, c]: [DVec3; 3]) -> Self {
        let edges = [b - a, c - a];
        let cross = edges[0].cross(edges[1]);
        Self { corner: a, edges, normal: cross.normalize_or_zero(), area: 0.5 * cross.length() }
    }
}

impl Area {
    /// A light of `radiance` on `surface`.
    pub fn new(radiance: Spectrum, surface: Surface) -> Self {
        Self { radiance, inverse_area: 1.0 / surface.area(), surface }
    }

    #[inline]
    pub(super) fn start(&self, row: Row) -> (Start, AreaPdf) {
        let (position, normal) = self.surface.sample(row);
        (Start::Surface { position, normal }, self.start_pdf())
    }

    #[inline]
    pub(super) fn start_pdf(&self) -> AreaPdf {
        AreaPdf(self.inverse_area)
    }

    #[inline]
    pub(super) fn radiance(&self, cos: f64) -> Spectrum {
        if cos > 0.0 { self.radiance } else { Spectrum::BLACK }
    }

    #[inline]
    pub(super) fn emit(&self, position: DVec3, normal: DVec3, row: Row) -> (DVec3, DVec3, Spectrum) {
        let local = warp::hemisphere::sample([row[1], row[2]]);
        (position, Frame::around(normal).to_world(local), self.radiance * PI)
    }

    #[inline]
    pub(super) fn direction_pdf(&self, cos: f64) -> SolidAnglePdf {
        SolidAnglePdf(cos.max(0.0) * FRAC_1_PI)
    }

    pub(super) fn power(&self) -> f64 {
        self.radiance.luminance() * PI / self.inverse_area
    }
}
