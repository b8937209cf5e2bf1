//! A path as a whole: what one technique has found, and the rows by which another would find the same path (Bitterli et
//! al. 2017, section 6; Bitterli 2015, algorithm 2).
//!
//! A technique with more light vertices reads rows of the light's walk for those that change hands, and no longer those of
//! the camera's walk for them: only these need to be inverted. What is known of the path, its directions, the densities of
//! its vertices in walks from both sides and which of them scatter by a delta lobe, does not depend on the technique.

use super::mis::{self, Junction};
use super::subpath::{Subpath, Vertex, VertexKind};
use crate::emitter::Start;
use crate::math::Row;
use crate::scene::{EmitterId, Scene, Surface};
use glam::{DVec2, DVec3};

/// A light subpath and a camera subpath that are connected.
#[derive(Clone, Debug, Default)]
pub struct FullPath {
    /// The light subpath, s vertices.
    pub light: Subpath,
    /// The camera subpath, t ≥ 1 vertices.
    pub camera: Subpath,
    /// What the connection changed.
    pub junction: Junction,
    /// Film position.
    pub film: DVec2,
}

impl FullPath {
    /// Its length k.
    pub fn edges(&self) -> usize {
        self.light.vertices.len() + self.camera.vertices.len() - 1
    }

    /// Densities of all techniques, by their number of light vertices, in units of that of the walks that found the path.
    pub fn densities(&self, densities: &mut Vec<f64>) {
        mis::densities(&self.light.vertices, &self.camera.vertices, &self.junction, densities);
    }

    /// Vertex x_m, from 0 on the light to k on the lens.
    pub(super) fn vertex(&self, m: usize) -> &Vertex {
        let s = self.light.vertices.len();
        if m < s { &self.light.vertices[m] } else { &self.camera.vertices[self.edges() - m] }
    }

    /// Where x_m is; of no meaning at infinity.
    pub fn position(&self, m: usize) -> DVec3 {
        self.vertex(m).position
    }

    /// The light that x_0 lies on, and where.
    pub(super) fn start(&self) -> Option<(EmitterId, Start)> {
        let vertex = self.vertex(0);
        match &vertex.kind {
            VertexKind::Light(id, start) => Some((*id, *start)),
            VertexKind::Environment(id) => Some((*id, Start::Infinite { towards: -vertex.back })),
            VertexKind::Surface(surface) => Some((surface.emitter?, surface.start())),
            VertexKind::Camera => None,
        }
    }

    /// Unit vector from x_m to x_{m+1}.
    fn direction(&self, scene: &Scene, m: usize) -> Option<DVec3> {
        let (light, camera) = (&self.light.vertices, &self.camera.vertices);
        if m + 1 < light.len() {
            return Some(-light[m + 1].back);
        }
        if m >= light.len() {
            return Some(self.vertex(m).back);
        }
        let end = &light[m];
        match &end.kind {
            VertexKind::Light(_, Start::Infinite { towards } | Start::Distant { towards }) => Some(-*towards),
            _ if camera.len() == 1 => Some(-scene.camera.sight(camera[0].position, end.position)?.direction),
            _ => (camera[camera.len() - 1].position - end.position).try_normalize(),
        }
    }

    /// Whether x_m scatters by a delta lobe: no end of the connection does, however its walk might have gone on.
    pub(super) fn scatters_delta(&self, m: usize) -> bool {
        let s = self.light.vertices.len();
        m + 1 != s && m != s && self.vertex(m).delta
    }

    /// Whether x_m scatters as in another path: by the same lobe, and with the vertices `around` where they are there.
    pub fn scatters_as(&self, other: &Self, m: usize, around: &[usize]) -> bool {
        let same = |m: usize| self.position(m) == other.position(m) && !self.is_at_infinity(m);
        self.edges() == other.edges()
            && self.scatters_delta(m) == other.scatters_delta(m)
            && around.iter().all(|m| same(*m))
    }

    /// Whether x_m has no position.
    fn is_at_infinity(&self, m: usize) -> bool {
        match self.vertex(m).kind {
            VertexKind::Environment(_) => true,
            VertexKind::Light(_, start) => matches!(start, Start::Infinite { .. } | Start::Distant { .. }),
            VertexKind::Surface(_) | VertexKind::Camera => false,
        }
    }

    /// How x_m scatters, for 0 < m < k.
    pub fn event(&self, scene: &Scene, m: usize) -> Option<Event<'_>> {
        let (to_light, to_camera) = (-self.direction(scene, m - 1)?, self.direction(scene, m)?);
        let surface = self.vertex(m).surface()?;
        let [to_light, to_camera] = [to_light, to_camera].map(|direction| surface.frame.to_local(direction));
        Some(Event { surface, to_light, to_camera, delta: self.scatters_delta(m) })
    }

    /// The row with which a walk from the light finds x_m; numbers that are open are taken from `gamma`. `None` where it
    /// cannot.
    pub fn light_row(&self, scene: &Scene, m: usize, gamma: Row) -> Option<Row> {
        let row = match m {
            0 => {
                let (id, start) = self.start()?;
                scene.invert_start(id, &start, gamma)
            }
            1 => {
                let ((id, start), direction) = (self.start()?, self.direction(scene, 0)?);
                scene.emitter(id).invert_emission(&start, direction, self.vertex(1).position, gamma)
            }
            _ => {
                let event = self.event(scene, m - 1)?;
                event.row(scene, event.to_light, event.to_camera, gamma)
            }
        };
        inside(row?)
    }

    /// The row with which a walk from the camera finds its vertex `c`, that is x_{k-c}, as [`FullPath::light_row`].
    pub fn camera_row(&self, scene: &Scene, c: usize, gamma: Row) -> Option<Row> {
        if c < 2 {
            return inside(scene.camera.invert(self.film, self.vertex(self.edges()).position, gamma));
        }
        let event = self.event(scene, self.edges() + 1 - c)?;
        inside(event.row(scene, event.to_camera, event.to_light, gamma)?)
    }
}

/// Scattering at a vertex of a path, with directions in the surface's shading frame.
#[derive(Clone, Copy, Debug)]
pub struct Event<'a> {
    /// The surface.
    pub surface: &'a Surface,
    /// Unit vector to the vertex before, on the light's side.
    pub to_light: DVec3,
    /// Unit vector to the vertex after, on the camera's side.
    pub to_camera: DVec3,
    /// Whether it is by a delta lobe.
    pub delta: bool,
}

impl Event<'_> {
    /// A row that scatters so from `wi` to `wo`.
    fn row(&self, scene: &Scene, wi: DVec3, wo: DVec3, gamma: Row) -> Option<Row> {
        scene.invert_scatter(self.surface, wi, wo, self.delta, gamma)
    }
}

/// Primary samples, if they are some: rounding at the edge of a chart must not lead out of the cube.
fn inside(row: Row) -> Option<Row> {
    let valid = row.iter().all(|number| (0.0..=1.0).contains(number));
    valid.then(|| row.map(|number| number.min(1f64.next_down())))
}
