//! Sources of light. A light subpath starts with [`Emitter::start`]; the same start serves next event estimation, so
//! that a point on a light has one density whichever technique made it.
//!
//! A new variant: its file, and one arm in each match below.

mod area;
mod constant;
mod directional;
mod environment;
mod extent;
mod panorama;
mod point;
mod reach;
pub mod sky;
mod spot;
#[cfg(test)]
mod tests;
mod tree;

pub use area::{Area, Surface};
pub use constant::Constant;
pub use directional::Directional;
pub use environment::{Backdrop, Environment, Sun};
pub use extent::{Cone, Extent};
pub use panorama::Panorama;
pub use point::Point;
pub use reach::Reach;
pub use spot::Spot;
pub use tree::LightTree;

use crate::math::{AreaPdf, Row, SolidAnglePdf};
use crate::spectrum::Spectrum;
use glam::{DVec2, DVec3};

/// Where light starts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start {
    /// On a surface that shines on the side of `normal`.
    Surface {
        /// The point.
        position: DVec3,
        /// Unit normal on the shining side.
        normal: DVec3,
        /// Texture coordinates.
        uv: DVec2,
        /// The triangle of the scene that it lies on; means nothing on solids.
        triangle: u32,
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
    /// Infinitely far away in a direction that has light alone, so that no ray can hit it.
    Distant {
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
    /// An environment that varies.
    Environment(Environment),
    /// An isolated point that shines evenly into all directions.
    Point(Point),
    /// An isolated point that shines into a cone.
    Spot(Spot),
    /// Parallel light.
    Directional(Directional),
}

impl Emitter {
    /// Samples a start from the two middle numbers of `row` (the first has chosen the emitter), with its density: per
    /// area, for an infinite start per solid angle, for a start that no ray can hit 1.
    #[inline]
    pub fn start(&self, row: Row) -> (Start, AreaPdf) {
        match self {
            Self::Area(area) => area.start(row),
            Self::Constant(constant) => constant.start(row),
            Self::Environment(environment) => environment.start(row),
            Self::Point(point) => point.start(),
            Self::Spot(spot) => spot.start(),
            Self::Directional(directional) => directional.start(),
        }
    }

    /// A row that [`Emitter::start`] maps to `start`; numbers that the sampling leaves open are taken from `gamma`, and so
    /// is the part of a light where several cover `start`. The first number is that of the choice among emitters.
    pub fn invert_start(&self, start: &Start, gamma: Row) -> Option<Row> {
        match (self, start) {
            (Self::Area(area), Start::Surface { position, triangle, .. }) => {
                area.invert_start(*position, *triangle, gamma)
            }
            (Self::Constant(constant), Start::Infinite { towards }) => Some(constant.invert_start(*towards, gamma)),
            (Self::Environment(environment), Start::Infinite { towards }) => environment.invert_start(*towards, gamma),
            (Self::Point(_) | Self::Spot(_), Start::Point { .. }) => Some(gamma),
            (Self::Directional(_), Start::Distant { .. }) => Some(gamma),
            _ => None,
        }
    }

    /// A row that [`Emitter::emit`] maps to the ray from `start` along `direction` that passes `point`.
    pub fn invert_emission(&self, start: &Start, direction: DVec3, point: DVec3, gamma: Row) -> Option<Row> {
        match (self, start) {
            (Self::Area(area), Start::Surface { position, triangle, .. }) => {
                area.invert_emission(*position, *triangle, direction, gamma)
            }
            (Self::Constant(constant), Start::Infinite { towards }) => {
                Some(constant.reach.invert_origin(*towards, point, gamma))
            }
            (Self::Environment(environment), Start::Infinite { towards }) => {
                Some(environment.reach().invert_origin(*towards, point, gamma))
            }
            (Self::Directional(directional), Start::Distant { towards }) => {
                Some(directional.reach.invert_origin(*towards, point, gamma))
            }
            (Self::Point(_), Start::Point { .. }) => Some(Point::invert_emission(direction, gamma)),
            (Self::Spot(spot), Start::Point { .. }) => spot.invert_emission(direction, gamma),
            _ => None,
        }
    }

    /// Density with which [`Emitter::start`] finds `start`.
    #[inline]
    pub fn start_pdf(&self, start: &Start) -> AreaPdf {
        match (self, start) {
            (Self::Area(area), _) => area.start_pdf(),
            (Self::Constant(constant), _) => constant.start_pdf(),
            (Self::Environment(environment), Start::Infinite { towards }) => environment.start_pdf(*towards),
            (Self::Environment(_), _) => AreaPdf(0.0),
            (Self::Point(_) | Self::Spot(_) | Self::Directional(_), _) => AreaPdf(1.0),
        }
    }

    /// Radiance from `start` along the unit vector `direction`; for a point its intensity in W/sr, for parallel
    /// light its irradiance in W/m².
    #[inline]
    pub fn radiance(&self, start: &Start, direction: DVec3) -> Spectrum {
        match (self, start) {
            (Self::Area(area), Start::Surface { normal, uv, .. }) => area.radiance(*uv, normal.dot(direction)),
            (Self::Constant(constant), _) => constant.radiance,
            (Self::Environment(environment), Start::Infinite { towards }) => environment.radiance(*towards),
            (Self::Point(point), _) => point.intensity,
            (Self::Spot(spot), _) => spot.intensity(direction),
            (Self::Directional(directional), _) => directional.irradiance,
            (Self::Area(_) | Self::Environment(_), _) => Spectrum::BLACK,
        }
    }

    /// Samples a ray that leaves `start`: origin, direction and throughput, which is radiance times cosine over the
    /// density of the ray given its start.
    #[inline]
    pub fn emit(&self, start: &Start, row: Row) -> Option<(DVec3, DVec3, Spectrum)> {
        match (self, start) {
            (Self::Area(area), Start::Surface { position, normal, uv, .. }) => {
                Some(area.emit(*position, *normal, *uv, row))
            }
            (Self::Constant(constant), Start::Infinite { towards }) => Some(constant.emit(*towards, row)),
            (Self::Environment(environment), Start::Infinite { towards }) => Some(environment.emit(*towards, row)),
            (Self::Point(point), Start::Point { position }) => Some(point.emit(*position, row)),
            (Self::Spot(spot), Start::Point { position }) => Some(spot.emit(*position, row)),
            (Self::Directional(directional), _) => Some(directional.emit(row)),
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
            (Self::Constant(constant), _) => AreaPdf(constant.reach.beam_pdf() * cos_arrival.abs()),
            (Self::Environment(environment), _) => AreaPdf(environment.beam_pdf() * cos_arrival.abs()),
            (Self::Directional(directional), _) => AreaPdf(directional.reach.beam_pdf() * cos_arrival.abs()),
            (Self::Spot(spot), _) => spot.direction_pdf(direction).to_area(cos_arrival, distance_squared),
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
            Start::Point { .. } | Start::Distant { .. } => AreaPdf(0.0),
        }
    }

    /// Emitted power in W, as a luminance: what lights are chosen by.
    pub fn power(&self) -> f64 {
        match self {
            Self::Area(area) => area.power(),
            Self::Constant(constant) => constant.power(),
            Self::Environment(environment) => environment.power(),
            Self::Point(point) => point.power(),
            Self::Spot(spot) => spot.power(),
            Self::Directional(directional) => directional.power(),
        }
    }
}
