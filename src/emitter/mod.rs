//! Sources of light. A light subpath starts with [`Emitter::start`]; the same start serves next event estimation, so
//! that a point on a light has one density whichever technique made it.
//!
//! A new variant: its file, and one arm in each match below.

mod area;
mod constant;
mod point;

pub use area::{Area, Surface};
pub use constant::Constant;
pub use point::Point;

use crate::math::{AreaPdf, Row, SolidAnglePdf};
use crate::spectrum::Spectrum;
use glam::DVec3;

/// Where light starts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start {
    /// On a surface that shines on the side of `normal`.
    Surface {
        /// The point.
        position: DVec3,
        /// Unit normal on the shining side.
        normal: DVec3,
    },
    /// At an isolated point, which no ray can hit.
    Point {
        /// The point.
        position: DVec3,
    },
    /// Infinitely far away.
    Infinite {
        /// Unit vector from the scene towards the source.
        towards: DVec3,
    },
}

/// A source of light.
#[derive(Clone, Debug, PartialEq)]
pub enum Emitter {
    /// A surface that shines evenly into the hemisphere of its normal.
    Area(Area),
    /// An environment of one radiance.
    Constant(Constant),
    /// An isolated point that shines evenly into all directions.
    Point(Point),
}

impl Emitter {
    /// Samples a start from the two middle numbers of `row` (the first has chosen the emitter), with its density: per area, for an infinite start per
    /// solid angle, for a point 1.
    #[inline]
    pub fn start(&self, row: Row) -> (Start, AreaPdf) {
        match self {
            Self::Area(area) => area.start(row),
            Self::Constant(constant) => constant.start(row),
            Self::Point(point) => point.start(),
        }
    }

    /// Density of [`Emitter::start`]: area lights are sampled evenly, so that it is the same everywhere.
    #[inline]
    pub fn start_pdf(&self) -> AreaPdf {
        match self {
            Self::Area(area) => area.start_pdf(),
            Self::Constant(constant) => constant.start_pdf(),
            Self::Point(_) => AreaPdf(1.0),
        }
    }

    /// Radiance from `start` along the unit vector `direction`; for a point its intensity in W/sr.
    #[inline]
    pub fn radiance(&self, start: &Start, direction: DVec3) -> Spectrum {
        match (self, start) {
            (Self::Area(area), Start::Surface { normal, .. }) => area.radiance(normal.dot(direction)),
            (Self::Constant(constant), _) => constant.radiance,
            (Self::Point(point), _) => point.intensity,
            (Self::Area(_), _) => Spectrum::BLACK,
        }
    }

    /// Samples a ray that leaves `start`: origin, direction and throughput, which is radiance times cosine over the
    /// density of the ray given its start.
    #[inline]
    pub fn emit(&self, start: &Start, row: Row) -> Option<(DVec3, DVec3, Spectrum)> {
        match (self, start) {
            (Self::Area(area), Start::Surface { position, normal }) => Some(area.emit(*position, *normal, row)),
            (Self::Constant(constant), Start::Infinite { towards }) => Some(constant.emit(*towards, row)),
            (Self::Point(point), Start::Point { position }) => Some(point.emit(*position, row)),
            _ => None,
        }
    }

    /// Density, per area at the next vertex, of [`Emitter::emit`] leaving `start` along `direction`.
    #[inline]
    pub fn emit_pdf(&self, start: &Start, direction: DVec3, cos_arrival: f64, distance_squared: f64) -> AreaPdf {
        match (self, start) {
            (Self::Area(area), Start::Surface { normal, .. }) => {
                area.direction_pdf(normal.dot(direction)).to_area(cos_arrival, distance_squared)
            }
            (Self::Constant(constant), _) => AreaPdf(constant.beam_pdf() * cos_arrival.abs()),
            (Self::Point(_), _) => crate::math::warp::sphere::PDF.to_area(cos_arrival, distance_squared),
            (Self::Area(_), _) => AreaPdf(0.0),
        }
    }

    /// Density of `start` for a walk that arrives there along a direction of density `pdf`.
    #[inline]
    pub fn arrival_pdf(start: &Start, pdf: SolidAnglePdf, direction: DVec3, distance_squared: f64) -> AreaPdf {
        match start {
            Start::Surface { normal, .. } => pdf.to_area(normal.dot(direction), distance_squared),
            Start::Infinite { .. } => AreaPdf(pdf.0),
            Start::Point { .. } => AreaPdf(0.0),
        }
    }

    /// Emitted power in W, as a luminance: what lights are chosen by.
    pub fn power(&self) -> f64 {
        match self {
            Self::Area(area) => area.power(),
            Self::Constant(constant) => constant.power(),
            Self::Point(point) => point.power(),
        }
    }
}
