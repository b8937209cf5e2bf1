//! Densities carry their measure in the type, walks carry where they start.

/// Where a subpath starts. Decides on which side the asymmetries of shading normals and refraction
/// (Veach 1997, sections 5.2 and 5.3) are accounted for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Walk {
    /// The walk starts at the camera and carries a measurement towards the lights.
    FromCamera,
    /// The walk starts at an emitter and carries power towards the camera.
    FromLight,
}

/// Probability density with respect to solid angle, in 1/sr. For a delta lobe it holds the probability of the lobe,
/// which is the coefficient of the Dirac density.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Default)]
pub struct SolidAnglePdf(pub f64);

/// Probability density with respect to surface area, in 1/m². For a vertex at infinity the density with respect
/// to solid angle stands in (such a vertex has no area), for a point light the probability of choosing it.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Default)]
pub struct AreaPdf(pub f64);

impl SolidAnglePdf {
    /// Density of arriving at a surface point whose normal makes `cos_arrival` with the ray, after `distance_squared`
    /// (Veach 1997, eq. 8.10).
    #[inline]
    pub fn to_area(self, cos_arrival: f64, distance_squared: f64) -> AreaPdf {
        AreaPdf(self.0 * cos_arrival.abs() / distance_squared)
    }
}

impl AreaPdf {
    /// Density of the direction that leads to the point: the inverse of [`SolidAnglePdf::to_area`].
    #[inline]
    pub fn to_solid_angle(self, cos_arrival: f64, distance_squared: f64) -> SolidAnglePdf {
        SolidAnglePdf(self.0 * distance_squared / cos_arrival.abs())
    }
}
