//! Where an emitter of limited size shines: what lights are grouped by.

use super::{Area, Emitter, Reach, Surface};
use crate::geometry::{Bounds, Solid};
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, PI};

/// Directions within an angle of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Unit vector along the middle.
    pub axis: DVec3,
    /// Largest angle to it, in [0, π].
    pub angle: f64,
}

impl Cone {
    /// All directions.
    const ALL: Self = Self { axis: DVec3::Z, angle: PI };

    /// A cone around two others (Conty Estevez and Kulla 2018, algorithm 1).
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        let (wide, narrow) = if self.angle >= other.angle { (self, other) } else { (other, self) };
        let between = wide.axis.angle_between(narrow.axis);
        if (between + narrow.angle).min(PI) <= wide.angle {
            return wide;
        }
        let angle = 0.5 * (wide.angle + between + narrow.angle);
        let turned = wide.axis.cross(narrow.axis).try_normalize();
        match turned {
            Some(around) if angle < PI => {
                let (sin, cos) = (angle - wide.angle).sin_cos();
                Self { axis: (wide.axis * cos + around.cross(wide.axis) * sin).normalize(), angle }
            }
            _ => Self::ALL,
        }
    }
}

/// Bounds of places and directions of emission.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// Around all points that shine.
    pub bounds: Bounds,
    /// Around the normals there.
    pub normals: Cone,
    /// Largest angle to a normal under which there is light, in [0, π].
    pub spread: f64,
}

impl Extent {
    /// Around two others.
    #[must_use]
    pub fn union(self, other: Self) -> Self {
        Self {
            bounds: self.bounds.union(other.bounds),
            normals: self.normals.union(other.normals),
            spread: self.spread.max(other.spread),
        }
    }
}

impl Emitter {
    /// Where it shines; `None` for an emitter that is infinitely far away.
    pub fn extent(&self) -> Option<Extent> {
        let at = |position| Bounds { min: position, max: position };
        Some(match self {
            Self::Area(area) => area.extent(),
            Self::Point(point) => Extent { bounds: at(point.position), normals: Cone::ALL, spread: PI },
            Self::Spot(spot) => {
                Extent { bounds: at(spot.position), normals: Cone { axis: spot.axis, angle: 0.0 }, spread: spot.cutoff }
            }
            Self::Constant(_) | Self::Environment(_) | Self::Directional(_) => return None,
        })
    }
}

impl Emitter {
    /// The scene as an emitter knows it that is infinitely far away; `None` for others.
    pub(super) fn reach(&self) -> Option<&Reach> {
        match self {
            Self::Constant(constant) => Some(&constant.reach),
            Self::Environment(environment) => Some(environment.reach()),
            Self::Directional(directional) => Some(&directional.reach),
            Self::Area(_) | Self::Point(_) | Self::Spot(_) => None,
        }
    }
}

impl Area {
    fn extent(&self) -> Extent {
        let (bounds, normals) = match self.surface() {
            Surface::Triangles { facets, .. } => {
                let corners = facets.iter().flat_map(|facet| facet.corners());
                let bounds = corners.fold(Bounds::EMPTY, Bounds::including);
                let cones = facets.iter().map(|facet| Cone { axis: facet.normal(), angle: 0.0 });
                (bounds, cones.reduce(Cone::union).unwrap_or(Cone::ALL))
            }
            Surface::Solid(solid @ Solid::Disk { normal, .. }) => (solid.bounds(), Cone { axis: *normal, angle: 0.0 }),
            Surface::Solid(solid) => (solid.bounds(), Cone::ALL),
        };
        Extent { bounds, normals, spread: FRAC_PI_2 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Stream, warp::sphere};

    #[test]
    fn a_union_holds_both_cones() {
        let mut stream = Stream::new(3, &[]);
        for _ in 0..20_000 {
            let [a, b] = [(); 2].map(|()| {
                let [u, v, w, x] = stream.row();
                Cone { axis: sphere::sample([u, v]), angle: if x < 0.2 { 0.0 } else { w * PI } }
            });
            let union = a.union(b);
            for cone in [a, b] {
                let farthest = (union.axis.angle_between(cone.axis) + cone.angle).min(PI);
                assert!(farthest <= union.angle + 1e-7, "{a:?} {b:?} {union:?}");
            }
        }
    }
}
