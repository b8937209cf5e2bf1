//! The scene as flat arrays, and the questions that integrators ask of it.

mod builder;
mod caster;
mod patch;
mod relief;
mod surface;
mod tilted;

pub use builder::{Builder, FilmSpec, Mesh, SceneError, Shine};
pub use caster::{Caster, Origin};
pub use patch::Patch;
pub use surface::{SOLID, Surface};

use crate::bsdf::Bsdf;
use crate::camera::Camera;
use crate::emitter::{Emitter, LightTree, Start};
use crate::geometry::{Bvh, Primitive, Ray, Solid, SurfacePoint, offset};
use crate::math::{AreaPdf, Discrete, Frame, Row};
use crate::texture::{Relief, Site, attribute};
use glam::{DVec2, DVec3, Vec2, Vec3};

/// Index into the scene's scattering models.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct BsdfId(pub u32);

/// How walks from the camera choose a light for direct light.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum LightChoice {
    /// By emitted power.
    Power,
    /// By power, distance and direction, where there is more than one light to choose from by its place.
    #[default]
    Position,
}

/// Index into the scene's emitters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct EmitterId(pub u32);

/// What the primitives of one shape share.
#[derive(Clone, Copy, Debug)]
struct Shape {
    bsdf: BsdfId,
    emitter: Option<EmitterId>,
    /// Whether anything on it varies over the surface.
    textured: bool,
    /// Whether its shading frames must follow the texture coordinates.
    oriented: bool,
    /// Whether its vertices have texture coordinates.
    mapped: bool,
    /// Its first triangle, where textures are looked up by faces.
    chart: Option<u32>,
    /// Whether its vertices have normals.
    smooth: bool,
}

/// A scene, ready to render.
pub struct Scene {
    /// The camera.
    pub camera: Camera,
    /// What the scene file says about the image.
    pub film: FilmSpec,
    /// Longest path in edges that the scene file asks for.
    pub max_depth: usize,
    /// Whether the camera sees through surfaces that shine, and no environment: light shows by what it falls on only.
    pub hide_emitters: bool,
    /// Fingerprint of the scene: files, parameters, film size.
    pub hash: String,
    vertices: Vec<Vec3>,
    /// Normals per vertex; zero where a mesh has none.
    normals: Vec<Vec3>,
    /// Texture coordinates per vertex; zero where a mesh has none.
    uvs: Vec<Vec2>,
    triangles: Vec<[u32; 3]>,
    /// Unit normals per triangle, on the side that the vertex normals point to; without these counter-clockwise.
    face_normals: Vec<DVec3>,
    triangle_shapes: Vec<u32>,
    solids: Vec<Solid>,
    solid_shapes: Vec<u32>,
    shapes: Vec<Shape>,
    bsdfs: Vec<Bsdf>,
    /// Whether there are smooth boundaries that bend light, and lights with a surface.
    links: bool,
    /// By scattering model.
    reliefs: Vec<Option<Relief>>,
    emitters: Vec<Emitter>,
    /// Choice of an emitter by its power; `None` when nothing shines.
    lights: Option<Discrete>,
    /// Choice of an emitter by where it is seen from, if there is more than one with a place.
    light_tree: Option<LightTree>,
    environment: Option<EmitterId>,
    bvh: Bvh,
}

impl Scene {
    #[inline]
    fn intersect(&self, ray: &Ray, leaving: u32) -> Option<Surface> {
        let hit = self.bvh.intersect_from(ray, leaving)?;
        Some(match hit.primitive {
            Primitive::Triangle { index, u, v } => self.triangle_surface(index as usize, u, v),
            Primitive::Solid { index } => self.solid_surface(index as usize, ray.at(hit.t)),
        })
    }

    #[inline]
    fn triangle_surface(&self, index: usize, u: f64, v: f64) -> Surface {
        let corners = self.triangles[index];
        let [a, b, c] = corners.map(|i| self.vertices[i as usize].as_dvec3());
        let w = 1.0 - u - v;
        let normal = self.face_normals[index];
        let shape = self.shapes[self.triangle_shapes[index] as usize];
        let Shape { bsdf, emitter, textured, oriented, mapped, chart, smooth } = shape;
        let shading = if smooth {
            let [na, nb, nc] = corners.map(|i| self.normals[i as usize].as_dvec3());
            (na * w + nb * u + nc * v).normalize_or(normal)
        } else {
            normal
        };
        let (mut site, mut frame, mut up) = (Site::default(), Frame::around(shading), DVec3::Z);
        if textured {
            // Without texture coordinates, barycentric ones stand in, as in Mitsuba.
            let uvs = match mapped {
                true => corners.map(|i| self.uvs[i as usize].as_dvec2()),
                false => [DVec2::ZERO, DVec2::X, DVec2::Y],
            };
            let mapped = uvs[0] * w + uvs[1] * u + uvs[2] * v;
            let uv = match chart {
                Some(first) => attribute::place(index as u32 - first, DVec2::new(u, v)),
                None => mapped,
            };
            site = Site::new(uv, self.bsdf(bsdf).texture());
            if oriented {
                let derivatives = relief::derivatives([a, b, c], uvs, normal);
                (frame, up) = self.orient(shading, bsdf, [uv, mapped], derivatives);
            }
        }
        let (position, primitive) = (a * w + b * u + c * v, index as u32);
        let offset = offset::of_triangle(a, b, c);
        Surface { position, geometric: normal, frame, up, site, bsdf, emitter, offset, primitive }
    }

    /// The shading frame where it has to follow the texture coordinates, and `normal` in it. `at` are the place where
    /// textures are looked up, and the texture coordinates.
    fn orient(&self, normal: DVec3, bsdf: BsdfId, at: [DVec2; 2], derivatives: [DVec3; 2]) -> (Frame, DVec3) {
        let frame = relief::oriented(normal, derivatives[0]);
        match &self.reliefs[bsdf.0 as usize] {
            Some(relief) => {
                let tilted = relief::tilted(frame, &relief.map, at, derivatives);
                (tilted, tilted.to_local(normal))
            }
            None => (frame, DVec3::Z),
        }
    }

    #[inline]
    fn solid_surface(&self, index: usize, near: DVec3) -> Surface {
        let SurfacePoint { position, normal, offset, .. } = self.solids[index].surface_point(near);
        let Shape { bsdf, emitter, textured, oriented, .. } = self.shapes[self.solid_shapes[index] as usize];
        let (mut site, mut frame, mut up) = (Site::default(), Frame::around(normal), DVec3::Z);
        if textured {
            let chart = self.solids[index].chart(position);
            site = Site::new(chart.uv, self.bsdf(bsdf).texture());
            if oriented {
                (frame, up) = self.orient(normal, bsdf, [chart.uv; 2], chart.derivatives);
            }
        }
        let primitive = SOLID | index as u32;
        Surface { position, geometric: normal, frame, up, site, bsdf, emitter, offset, primitive }
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

    /// Radius of a sphere around all surfaces, in scene units.
    pub fn radius(&self) -> f64 {
        self.bvh.bounds().bounding_sphere().1
    }

    /// Whether anything shines.
    pub fn has_lights(&self) -> bool {
        self.lights.is_some()
    }

    /// Whether there is anything that photons could be gathered on.
    pub fn gathers(&self) -> bool {
        self.bsdfs.iter().any(|bsdf| [DVec3::Z, -DVec3::Z].iter().any(|wi| bsdf.gathers(*wi)))
    }

    /// Whether paths can be linked with lights over manifolds: whether there are smooth boundaries that bend light, and lights
    /// with a surface.
    pub fn links(&self) -> bool {
        self.links
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

    /// A row that [`Scene::sample_start`] maps to `start` on the emitter `id`; see [`Emitter::invert_start`].
    pub fn invert_start(&self, id: EmitterId, start: &Start, gamma: Row) -> Option<Row> {
        let lights = self.lights.as_ref()?;
        let row = self.emitter(id).invert_start(start, gamma)?;
        Some([lights.invert(id.0 as usize, row[0]), row[1], row[2], row[3]])
    }

    /// Density with which [`Scene::sample_start`] finds `start` on the emitter `id`.
    #[inline]
    pub fn start_pdf(&self, id: EmitterId, start: &Start) -> AreaPdf {
        AreaPdf(self.emitter(id).start_pdf(start).0 * self.choice_by_power(id))
    }

    /// Probability of an emitter where they are chosen by power.
    #[inline]
    fn choice_by_power(&self, id: EmitterId) -> f64 {
        self.lights.as_ref().map_or(0.0, |lights| lights.pdf(id.0 as usize))
    }
}
