//! The manifold of specular chains: where chains of mirrors and smooth boundaries go when one end moves.
//!
//! A chain is x_0, …, x_{m+1}: fixed ends and m specular vertices between. At each of these the light obeys the law of
//! reflection or Snell's, which says that the half-vector is along the normal ([`constraint`]): two equations for the two
//! coordinates in which the vertex can move. Their derivatives couple neighbours only, so that the chain follows an end by
//! a product of 2×2 matrices ([`transfer`]). A [`walk`] repeats that step, each time back onto the manifold by tracing the
//! chain anew, until the chain ends where it should.
//!
//! Source: Jakob and Marschner 2012, "Manifold Exploration: A Markov Chain Monte Carlo Technique for Rendering Scenes with
//! Difficult Specular Transport", sections 4 and 5.

mod constraint;
mod walk;

pub use constraint::{Derivatives, derivatives, offset, offset_density, transfer};
pub use walk::{Chain, Goal, Link, MOST_LINKS, MOST_STEPS, Rejection};

use crate::bsdf::fresnel;
use crate::scene::{Scene, Surface};
use glam::DVec3;

/// What a specular vertex does with light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Turn {
    /// It is reflected.
    Reflected,
    /// It passes a boundary.
    Refracted {
        /// Refractive index of the far side over that of the side that it comes from.
        eta: f64,
    },
}

impl Turn {
    /// What happens at `surface` between the unit vectors `from`, back to where the chain comes from, and `onward`; `None`
    /// where light goes through without a law that bends it, as through panes and gaps.
    pub fn at(scene: &Scene, surface: &Surface, from: DVec3, onward: DVec3) -> Option<Self> {
        let sides = [from, onward].map(|w| w.dot(surface.frame.normal));
        if sides[0] * sides[1] > 0.0 {
            return Some(Self::Reflected);
        }
        let index = scene.bsdf(surface.bsdf).refractive_index()?;
        Some(Self::Refracted { eta: if sides[0] > 0.0 { index } else { 1.0 / index } })
    }

    /// The weight of the vector onward in the half-vector, that of the vector back being one.
    const fn weight(self) -> f64 {
        match self {
            Self::Reflected => 1.0,
            Self::Refracted { eta } => eta,
        }
    }

    /// Where light goes on that comes from the unit vector `from` and meets a facet with this unit `normal`; `None` where it
    /// is reflected totally.
    pub fn onward(self, normal: DVec3, from: DVec3) -> Option<DVec3> {
        let cos = from.dot(normal);
        match self {
            Self::Reflected => Some(normal * (2.0 * cos) - from),
            Self::Refracted { eta } => {
                let (_, cos_beyond) = fresnel::dielectric(cos.abs(), eta);
                Some((normal * cos - from) / eta - normal * cos_beyond?.copysign(cos))
            }
        }
    }
}
