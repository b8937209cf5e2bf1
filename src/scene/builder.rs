//! Assembles a [`Scene`] from what a file says.

use super::{BsdfId, EmitterId, Scene, Shape};
use crate::bsdf::Bsdf;
use crate::camera::Camera;
use crate::emitter::{
    Area, Backdrop, Constant, Directional, Emitter, Environment, LightTree, Point, Reach, Spot, Surface,
};
use crate::film::Filter;
use crate::geometry::{Bvh, Solid, geometric_normal};
use crate::math::Discrete;
use crate::spectrum::Spectrum;
use crate::texture::{Colour, Relief, attribute};
use glam::{DVec2, DVec3, Vec2, Vec3};
use rayon::prelude::*;
use thiserror::Error;

/// A triangle mesh in world space.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Positions.
    pub positions: Vec<Vec3>,
    /// Unit normals per position; empty for a mesh with flat faces.
    pub normals: Vec<Vec3>,
    /// Texture coordinates per position; empty for a mesh without.
    pub uvs: Vec<Vec2>,
    /// Indices into the positions, counter-clockwise as seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Whether its textures are looked up by its faces: see [`crate::texture::attribute`].
    pub charted: bool,
}

/// What the scene file says about the image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmSpec {
    /// Width and height in pixels.
    pub size: [usize; 2],
    /// Reconstruction filter.
    pub filter: Filter,
}

/// What an emitter of the scene is made from.
#[derive(Clone, Debug, PartialEq)]
pub enum Shine {
    /// The same radiance from everywhere outside the scene.
    Environment(Spectrum),
    /// An image around the scene, a sun, or both. A sun and an image may also come one after the other.
    Backdrop(Backdrop),
    /// A point light: position, intensity.
    Point(DVec3, Spectrum),
    /// A spot light.
    Spot(Spot),
    /// Parallel light: unit vector towards the source, irradiance.
    Directional(DVec3, Spectrum),
}

/// What surrounds the scene.
enum Surroundings {
    Constant(Spectrum),
    Backdrop(Backdrop),
}

impl Surroundings {
    /// The emitter for a scene within `reach`, unless it is black.
    fn emitter(self, reach: Reach) -> Option<Emitter> {
        match self {
            Self::Constant(radiance) if radiance.is_black() => None,
            Self::Constant(radiance) => Some(Emitter::Constant(Constant { radiance, reach })),
            Self::Backdrop(backdrop) => Environment::new(backdrop, reach).map(Emitter::Environment),
        }
    }
}

/// Why a scene cannot be built.
#[derive(Debug, Error, PartialEq)]
pub enum SceneError {
    /// A mesh refers to vertices that it does not have.
    #[error("a mesh of {vertices} vertices refers to vertex {index}")]
    VertexOutOfRange {
        /// The index.
        index: u32,
        /// Number of vertices.
        vertices: usize,
    },
    /// Positions or normals are not finite.
    #[error("a mesh has a coordinate that is not a finite number")]
    NotFinite,
    /// A second environment.
    #[error("a scene can have one environment emitter only")]
    TwoEnvironments,
    /// An area light without area.
    #[error("an area emitter sits on a shape without area")]
    NoArea,
}

/// What the points of a shape come with: see [`Shape`].
struct Given {
    mapped: bool,
    smooth: bool,
    chart: Option<u32>,
}

/// Collects the parts of a scene.
#[derive(Default)]
pub struct Builder {
    vertices: Vec<Vec3>,
    normals: Vec<Vec3>,
    uvs: Vec<Vec2>,
    triangles: Vec<[u32; 3]>,
    triangle_shapes: Vec<u32>,
    solids: Vec<Solid>,
    solid_shapes: Vec<u32>,
    shapes: Vec<Shape>,
    bsdfs: Vec<Bsdf>,
    reliefs: Vec<Option<Relief>>,
    emitters: Vec<Emitter>,
    surroundings: Option<Surroundings>,
    parallel: Vec<(DVec3, Spectrum)>,
    hide_emitters: bool,
    hasher: blake3::Hasher,
}

impl Builder {
    /// An empty scene.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a scattering model.
    pub fn bsdf(&mut self, bsdf: Bsdf) -> BsdfId {
        self.reliefs.push(None);
        self.bsdfs.push(bsdf);
        BsdfId(self.bsdfs.len() as u32 - 1)
    }

    /// Gives a relief to the surfaces of a model, to be called before these are added.
    pub fn relief(&mut self, id: BsdfId, relief: Relief) {
        self.reliefs[id.0 as usize] = Some(relief);
    }

    /// Adds a mesh, which shines with `radiance` where one is given.
    pub fn mesh(&mut self, mesh: Mesh, bsdf: BsdfId, radiance: Option<Colour>) -> Result<(), SceneError> {
        if !mesh.positions.iter().chain(&mesh.normals).all(|v| v.is_finite()) {
            return Err(SceneError::NotFinite);
        }
        if let Some(index) = mesh.triangles.iter().flatten().find(|i| **i as usize >= mesh.positions.len()) {
            return Err(SceneError::VertexOutOfRange { index: *index, vertices: mesh.positions.len() });
        }
        // Light shines on the side that the vertex normals point to, as `Builder::face_normal` has it.
        let corners = |(index, triangle): (usize, &[u32; 3])| {
            let [a, b, c] = triangle.map(|i| mesh.positions[i as usize].as_dvec3());
            let normals = triangle.iter().filter_map(|i| mesh.normals.get(*i as usize));
            let towards = normals.sum::<Vec3>().as_dvec3();
            // Without texture coordinates, barycentric ones stand in, as in `Scene::triangle_surface`.
            let [ua, ub, uc] = match (mesh.charted, mesh.uvs.is_empty()) {
                (true, _) => [DVec2::ZERO, DVec2::X, DVec2::Y].map(|at| attribute::place(index as u32, at).as_vec2()),
                (false, true) => [Vec2::ZERO, Vec2::X, Vec2::Y],
                (false, false) => triangle.map(|i| mesh.uvs.get(i as usize).copied().unwrap_or_default()),
            };
            match (b - a).cross(c - a).dot(towards) < 0.0 {
                true => ([a, c, b], [ua, uc, ub]),
                false => ([a, b, c], [ua, ub, uc]),
            }
        };
        let first = self.triangles.len() as u32;
        let surface = |()| Surface::triangles(first, mesh.triangles.iter().enumerate().map(corners));
        let given = Given {
            mapped: !mesh.uvs.is_empty(),
            smooth: !mesh.normals.is_empty(),
            chart: mesh.charted.then_some(first),
        };
        let shape = self.shape(bsdf, radiance, given, surface)?;
        let base = self.vertices.len() as u32;
        self.triangles.extend(mesh.triangles.iter().map(|t| t.map(|i| i + base)));
        self.triangle_shapes.resize(self.triangles.len(), shape);
        self.normals.extend(&mesh.normals);
        self.vertices.extend(&mesh.positions);
        self.normals.resize(self.vertices.len(), Vec3::ZERO);
        self.uvs.extend(&mesh.uvs);
        self.uvs.resize(self.vertices.len(), Vec2::ZERO);
        Ok(())
    }

    /// Adds a sphere or a disk, which shines with `radiance` where one is given.
    pub fn solid(&mut self, solid: Solid, bsdf: BsdfId, radiance: Option<Colour>) -> Result<(), SceneError> {
        let surface = |()| Some(Surface::Solid(solid)).filter(|surface| surface.area() > 0.0);
        let given = Given { mapped: true, smooth: false, chart: None };
        let shape = self.shape(bsdf, radiance, given, surface)?;
        self.solids.push(solid);
        self.solid_shapes.push(shape);
        Ok(())
    }

    fn shape(
        &mut self,
        bsdf: BsdfId,
        radiance: Option<Colour>,
        given: Given,
        surface: impl FnOnce(()) -> Option<Surface>,
    ) -> Result<u32, SceneError> {
        let model = &self.bsdfs[bsdf.0 as usize];
        let oriented = self.reliefs[bsdf.0 as usize].is_some() || !model.is_isotropic();
        let mut textured = oriented || !model.is_constant();
        let emitter = match radiance.filter(|radiance| *radiance != Colour::Constant(Spectrum::BLACK)) {
            Some(radiance) => {
                let surface = surface(()).ok_or(SceneError::NoArea)?;
                textured |= !radiance.is_constant();
                self.emitters.push(Emitter::Area(Area::new(radiance, surface)));
                Some(EmitterId(self.emitters.len() as u32 - 1))
            }
            None => None,
        };
        let Given { mapped, smooth, chart } = given;
        self.shapes.push(Shape { bsdf, emitter, textured, oriented, mapped, chart, smooth });
        Ok(self.shapes.len() as u32 - 1)
    }

    /// Adds an emitter that is not a shape.
    pub fn emitter(&mut self, shine: Shine) -> Result<(), SceneError> {
        match shine {
            Shine::Environment(radiance) => return self.surround(Surroundings::Constant(radiance)),
            Shine::Backdrop(backdrop) => return self.surround(Surroundings::Backdrop(backdrop)),
            Shine::Point(position, intensity) => self.emitters.push(Emitter::Point(Point { position, intensity })),
            Shine::Spot(spot) => self.emitters.push(Emitter::Spot(spot)),
            Shine::Directional(towards, irradiance) => self.parallel.push((towards, irradiance)),
        }
        Ok(())
    }

    /// Sets what surrounds the scene: once, but a sun and an image behind it may come as two.
    fn surround(&mut self, new: Surroundings) -> Result<(), SceneError> {
        self.surroundings = Some(match (self.surroundings.take(), new) {
            (None, new) => new,
            (Some(Surroundings::Backdrop(a)), Surroundings::Backdrop(b))
                if !(a.image.is_some() && b.image.is_some() || a.sun.is_some() && b.sun.is_some()) =>
            {
                Surroundings::Backdrop(Backdrop { image: a.image.or(b.image), sun: a.sun.or(b.sun) })
            }
            _ => return Err(SceneError::TwoEnvironments),
        });
        Ok(())
    }

    /// Adds what surrounds a scene within `reach`, and says which emitter rays see that leave the scene.
    fn far_emitters(&mut self, reach: Reach) -> Option<EmitterId> {
        for (towards, irradiance) in std::mem::take(&mut self.parallel) {
            self.emitters.push(Emitter::Directional(Directional { towards, irradiance, reach }));
        }
        let emitter = self.surroundings.take()?.emitter(reach)?;
        self.emitters.push(emitter);
        Some(EmitterId(self.emitters.len() as u32 - 1))
    }

    /// Whether the camera does not see lights themselves.
    pub fn hide_emitters(&mut self, hide: bool) {
        self.hide_emitters = hide;
    }

    /// Adds bytes that decide the image to the scene's fingerprint, such as the text of the scene file.
    pub fn fingerprint(&mut self, bytes: &[u8]) {
        self.hasher.update(&(bytes.len() as u64).to_le_bytes());
        self.hasher.update(bytes);
    }

    /// Triangles without area have no normal; no ray hits them.
    fn face_normal(&self, triangle: &[u32; 3]) -> DVec3 {
        let [a, b, c] = triangle.map(|i| self.vertices[i as usize].as_dvec3());
        let towards: Vec3 = triangle.iter().map(|i| self.normals[*i as usize]).sum();
        let normal = geometric_normal(a, b, c).unwrap_or(DVec3::Z);
        if normal.dot(towards.as_dvec3()) < 0.0 { -normal } else { normal }
    }

    /// The scene as seen by `camera`. Builds the acceleration structure.
    pub fn build(mut self, camera: Camera, film: FilmSpec, max_depth: usize) -> Result<Scene, SceneError> {
        let bvh = Bvh::build(&self.vertices, &self.triangles, &self.solids);
        let face_normals = self.triangles.par_iter().map(|triangle| self.face_normal(triangle)).collect();
        let (center, radius) = bvh.bounds().bounding_sphere();
        // A margin for rounding; an empty scene has an environment too.
        let radius = if radius > 0.0 { radius * (1.0 + 1e-6) } else { 1.0 };
        let environment = self.far_emitters(Reach { center, radius });
        let powers: Vec<f64> = self.emitters.iter().map(Emitter::power).collect();
        Ok(Scene {
            camera,
            film,
            max_depth,
            hide_emitters: self.hide_emitters,
            hash: self.hasher.finalize().to_hex()[..32].to_owned(),
            vertices: self.vertices,
            normals: self.normals,
            uvs: self.uvs,
            triangles: self.triangles,
            face_normals,
            triangle_shapes: self.triangle_shapes,
            solids: self.solids,
            solid_shapes: self.solid_shapes,
            shapes: self.shapes,
            links: self.bsdfs.iter().any(refracts) && self.emitters.iter().any(has_surface),
            bsdfs: self.bsdfs,
            reliefs: self.reliefs,
            lights: Discrete::new(&powers),
            light_tree: LightTree::new(&self.emitters),
            emitters: self.emitters,
            environment,
            bvh,
        })
    }
}

/// Whether a light that shines has a surface.
fn has_surface(emitter: &Emitter) -> bool {
    matches!(emitter, Emitter::Area(_)) && emitter.power() > 0.0
}

/// Whether a boundary is smooth and bends light.
fn refracts(bsdf: &Bsdf) -> bool {
    bsdf.refractive_index().is_some() && [DVec3::Z, -DVec3::Z].iter().any(|wi| bsdf.is_delta(*wi))
}
