//! The scene as flat arrays, and the questions that integrators ask of it.

mod builder;
mod caster;
mod surface;

pub use builder::{Builder, FilmSpec, Mesh, SceneError, Shine};
pub use caster::Caster;
pub use surface::Surface;

use crate::bsdf::Bsdf;
use crate::camera::Camera;
use crate::emitter::{Emitter, Start};
use crate::geometry::{Bvh, Primitive, Ray, Solid};
use crate::math::{AreaPdf, Discrete, Frame, Row};
use glam::{DVec3, Vec3};

/// Index into the scene's scattering models.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct BsdfId(pub u32);

/// Index into the scene's emitters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct EmitterId(pub u32);

/// What the primitives of one shape share.
#[derive(Clone, Copy, Debug)]
struct Shape {
    bsdf: BsdfId,
    emitter: Option<EmitterId>,
}

/// A scene, ready to render.
pub struct Scene {
    /// The camera.
    pub camera: Camera,
    /// What the scene file says about the image.
    pub film: FilmSpec,
    /// Longest path in edges that the scene file asks for.
    pub max_depth: usize,
    /// Fingerprint of everything that decides the image.
    pub hash: String,
    vertices: Vec<Vec3>,
    /// Normals per vertex; zero where a mesh has none.
    normals: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    triangle_shapes: Vec<u32>,
    solids: Vec<Solid>,
    solid_shapes: Vec<u32>,
    shapes: Vec<Shape>,
    bsdfs: Vec<Bsdf>,
    emitters: Vec<Emitter>,
    /// Choice of an emitter by its power; `None` when nothing shines.
    lights: Option<Discrete>,
    environment: Option<EmitterId>,
    bvh: Bvh,
}

impl Scene {
    #[inline]
    fn intersect(&self, ray: &Ray) -> Option<Surface> {
        let hit = self.bvh.intersect(ray)?;
        Some(match hit.primitive {
            Primitive::Triangle { index, u, v } => self.triangle_surface(index as usize, u, v),
            Primitive::Solid { index } => self.solid_surface(index as usize, ray, hit.t),
        })
    }

    fn triangle_surface(&self, index: usize, u: f64, v: f64) -> Surface {
        let corners = self.triangles[index];
        let [a, b, c] = corners.map(|i| self.vertices[i as usize].as_dvec3());
        let position = a * (1.0 - u - v) + b * u + c * v;
        let face = (b - a).cross(c - a).normalize();
        let [na, nb, nc] = corners.map(|i| self.normals[i as usize].as_dvec3());
        let interpolated = na * (1.0 - u - v) + nb * u + nc * v;
        let length = interpolated.length();
        let (geometric, shading) = if length > 0.0 {
            let shading = interpolated / length;
            (if face.dot(shading) < 0.0 { -face } else { face }, shading)
        } else {
            (face, face)
        };
        let magnitude = a.abs().max(b.abs()).max(c.abs()).max_element();
        self.surface(position, geometric, shading, magnitude, self.triangle_shapes[index])
    }

    fn solid_surface(&self, index: usize, ray: &Ray, t: f64) -> Surface {
        let (position, normal, magnitude) = match &self.solids[index] {
            Solid::Sphere { center, radius } => {
                let normal = (ray.origin + ray.direction * t - *center).normalize();
                (*center + normal * *radius, normal, center.abs().max_element() + radius)
            }
            Solid::Disk { center, normal, radius } => {
                let point = ray.origin + ray.direction * t;
                let position = point - *normal * (point - *center).dot(*normal);
                (position, *normal, center.abs().max_element() + radius)
            }
        };
        self.surface(position, normal, normal, magnitude, self.solid_shapes[index])
    }

    #[inline]
    fn surface(&self, position: DVec3, geometric: DVec3, shading: DVec3, magnitude: f64, shape: u32) -> Surface {
        let shape = self.shapes[shape as usize];
        Surface {
            position,
            geometric,
            frame: Frame::around(shading),
            bsdf: shape.bsdf,
            emitter: shape.emitter,
            offset: magnitude * surface::RELATIVE_OFFSET,
        }
    }

    /// The scattering model `id`.
    #[inline]
    pub fn bsdf(&self, id: BsdfId) -> &Bsdf {
        &self.bsdfs[id.0 as usize]
    }

    /// The emitter `id`.
    #[inline]
    pub fn emitter(&self, id: EmitterId) -> &Emitter {
        &self.emitters[id.0 as usize]
    }

    /// The emitter that rays see which leave the scene.
    #[inline]
    pub fn environment(&self) -> Option<EmitterId> {
        self.environment
    }

    /// Whether anything shines.
    pub fn has_lights(&self) -> bool {
        self.lights.is_some()
    }

    /// All scattering models.
    pub fn bsdfs(&self) -> &[Bsdf] {
        &self.bsdfs
    }

    /// Number of triangles and of solids.
    pub fn primitive_counts(&self) -> (usize, usize) {
        (self.triangles.len(), self.solids.len())
    }

    /// Samples where light starts; the density includes the choice of the emitter by power.
    #[inline]
    pub fn sample_start(&self, row: Row) -> Option<(EmitterId, Start, AreaPdf)> {
        let lights = self.lights.as_ref()?;
        let (index, _) = lights.sample(row[0]);
        let (start, pdf) = self.emitters[index].start(row);
        Some((EmitterId(index as u32), start, AreaPdf(pdf.0 * lights.pdf(index))))
    }

    /// Density of [`Scene::sample_start`] for any start on the emitter `id`.
    #[inline]
    pub fn start_pdf(&self, id: EmitterId) -> AreaPdf {
        let choice = self.lights.as_ref().map_or(0.0, |lights| lights.pdf(id.0 as usize));
        AreaPdf(self.emitter(id).start_pdf().0 * choice)
    }
}
