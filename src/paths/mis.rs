//! Weights of the techniques by the ratios of their densities, outward from the connection (Veach 1997, section 10.2).
//!
//! With p_s the density of technique s for one and the same path, p_{s+1} / p_s = L_s / C_s and p_{s-1} / p_s =
//! C_{s-1} / L_{s-1}, where L_i and C_i are the densities of vertex x_i in a walk from the light and from the camera.
//! A vertex with delta lobes only cannot be an end of a connection, so techniques that would connect there have no
//! density; the coefficients of its Dirac densities stand in for the densities and cancel.
//!
//! Direct light, technique s = 1, may choose its light by where it is to arrive; walks cannot. Its density is that of the
//! choice by power times the preference q(x_1) / p of the light.
//!
//! Merging (Georgiev et al. 2012, *Light Transport Simulation with Vertex Connection and Merging*) joins a light subpath
//! that ends near x_i with a camera subpath that ends at x_i. Both have sampled x_i, and any of N light subpaths may end
//! within the radius r, so its density is that of the connection with i + 1 light vertices times η C_i, η = N π r².

use super::subpath::{Vertex, VertexKind};
use crate::emitter::Start;

/// The densities that a connection changes: those of its two end vertices and their predecessors, in a walk from the
/// other side.
#[derive(Clone, Copy, Debug)]
pub struct Junction {
    /// C of the last vertex of the light subpath.
    pub light: f64,
    /// C of the vertex before it.
    pub light_previous: f64,
    /// L of the last vertex of the camera subpath.
    pub camera: f64,
    /// L of the vertex before it.
    pub camera_previous: f64,
    /// How much more often direct light chooses the path's light for its first surface than walks do.
    pub preference: f64,
}

impl Junction {
    /// What the technique with this many light vertices has beside the densities of walks.
    #[inline]
    fn preferred(&self, lights: usize) -> f64 {
        if lights == 1 { self.preference } else { 1.0 }
    }
}

impl Default for Junction {
    fn default() -> Self {
        Self { light: 0.0, light_previous: 0.0, camera: 0.0, camera_previous: 0.0, preference: 1.0 }
    }
}

/// Exponent of the power heuristic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum Heuristic {
    /// Weights proportional to the densities.
    Balance,
    /// Weights proportional to their squares.
    Power,
}

impl Heuristic {
    /// What a technique counts whose density is `ratio` times that of another, if the other counts 1.
    #[inline]
    pub fn apply(self, ratio: f64) -> f64 {
        match self {
            Self::Balance => ratio,
            Self::Power => ratio * ratio,
        }
    }
}

/// The techniques that a method combines, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Techniques {
    /// How their densities make weights; `None` where each path has one technique only, of weight 1.
    pub heuristic: Option<Heuristic>,
    /// Light subpaths that may be merged with a camera subpath, times the area that they are merged over; 0 for methods
    /// that only connect.
    pub merging: f64,
}

impl Techniques {
    /// Connections only.
    pub const fn connections(heuristic: Heuristic) -> Self {
        Self { heuristic: Some(heuristic), merging: 0.0 }
    }

    /// One technique for each path.
    pub const ALONE: Self = Self { heuristic: None, merging: 0.0 };
}

/// How the two subpaths come together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Joint {
    /// By a connection of their ends.
    Connected,
    /// By a merger at the last light vertex; the camera subpath is the one that ends before it.
    Merged,
}

/// Weight of the technique that connects `light` (all its vertices) with `camera` (all its vertices), whose density is
/// the unit of those of the others; for a merger what its weight is, divided by its density in that unit.
#[inline]
pub(super) fn weight(
    light: &[Vertex],
    camera: &[Vertex],
    junction: &Junction,
    joint: Joint,
    techniques: &Techniques,
) -> f64 {
    let Techniques { heuristic: Some(heuristic), merging } = *techniques else { return 1.0 };
    let own = heuristic.apply(junction.preferred(light.len()));
    // After a merger the last camera vertex has scattered, perhaps in a way that no connection can.
    let mut sum = if joint == Joint::Merged && camera[camera.len() - 1].delta { 0.0 } else { own };
    for_others(light, camera, junction, joint, merging, |_, density| sum += heuristic.apply(density));
    own / sum
}

/// Densities of all techniques for the path that connects `light` (all its vertices) with `camera` (all its vertices), by
/// the number of light vertices and with that of the walks of this one as unit; 0 for those that cannot find it.
pub(super) fn densities(light: &[Vertex], camera: &[Vertex], junction: &Junction, densities: &mut Vec<f64>) {
    densities.clear();
    densities.resize(light.len() + camera.len(), 0.0);
    densities[light.len()] = junction.preferred(light.len());
    for_others(light, camera, junction, Joint::Connected, 0.0, |lights, density| densities[lights] = density);
}

/// Calls `visit` with the number of light vertices and the density of every other connection that may find the path, and
/// of every merger, which counts as the connection with one more light vertex than the camera subpath leaves.
#[inline(always)]
fn for_others(
    light: &[Vertex],
    camera: &[Vertex],
    junction: &Junction,
    joint: Joint,
    merging: f64,
    mut visit: impl FnMut(usize, f64),
) {
    let merged = joint == Joint::Merged;
    // Techniques with more vertices from the camera: x_{s-1}, x_{s-2}, … change sides.
    let mut ratio = 1.0;
    for i in (0..light.len()).rev() {
        let from_camera = match light.len() - i {
            1 => junction.light,
            2 => junction.light_previous,
            _ => light[i].reverse.0,
        };
        // The end of the subpath is connected, however the walk went on from there.
        let scatters_delta = light[i].delta && i < light.len() - 1;
        if merging > 0.0 && i > 0 && light[i].connects && !scatters_delta {
            visit(i + 1, ratio * merging * from_camera);
        }
        ratio *= from_camera / light[i].forward.0;
        let possible = if i == 0 { can_be_hit(&light[0]) } else { !scatters_delta && !light[i - 1].delta };
        if possible {
            visit(i, ratio * junction.preferred(i));
        }
    }

    // Techniques with more vertices from the light; the lens cannot be hit, so its vertex stays.
    let mut ratio = 1.0;
    for i in (1..camera.len()).rev() {
        let from_light = match camera.len() - i {
            1 => junction.camera,
            2 => junction.camera_previous,
            _ => camera[i].reverse.0,
        };
        let lights = light.len() + camera.len() - i;
        // The end is connected, or it is the light that the walk met: however the walk went on does not matter.
        let scatters_delta = camera[i].delta && (merged || i < camera.len() - 1);
        let on_light = light.is_empty() && i == camera.len() - 1;
        if merging > 0.0 && !on_light && camera[i].connects && !scatters_delta {
            visit(lights, ratio * merging * from_light);
        }
        ratio *= from_light / camera[i].forward.0;
        if !scatters_delta && !camera[i - 1].delta {
            visit(lights, ratio * junction.preferred(lights));
        }
    }
}

/// Whether a walk from the camera can meet the light that `vertex` lies on.
#[inline]
fn can_be_hit(vertex: &Vertex) -> bool {
    !matches!(vertex.kind, VertexKind::Light(_, Start::Point { .. } | Start::Distant { .. }))
}
