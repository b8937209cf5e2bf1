//! Shapes and groups of them.

use super::Importer;
use super::gzip;
use super::material::Material;
use super::mesh::Mesh;
use super::params::Params;
use super::ply;
use super::quadric::Profile;
use super::source::Spot;
use super::texture::Texture;
use super::transform::{mirrors, similarity};
use super::xml::Node;
use crate::load::LoadError;
use crate::spectrum::Spectrum;
use glam::{DAffine3, DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, PI};

const SHAPES: [&str; 9] =
    ["sphere", "disk", "cylinder", "trianglemesh", "plymesh", "bilinearmesh", "loopsubdiv", "cone", "paraboloid"];

/// Name of the material of shapes without one.
const DEFAULT: &str = "default_grey";

/// A shape without its material.
struct Form {
    node: Node,
    /// Area in the world.
    area: f64,
}

impl Importer<'_> {
    /// `Shape "type" parameters`.
    pub(super) fn shape(&mut self, kind: &str, mut params: Params) -> Result<(), LoadError> {
        let alpha = self.maybe_share(&mut params, "alpha")?;
        let alpha = alpha.filter(|alpha| alpha.constant() != Some(Spectrum::ONE));
        if params.any("shadowalpha").is_some() {
            self.report.left_out(&params.spot, "`shadowalpha`: shadows are as opaque as the shape");
        }
        let material = self.current_material();
        let textured = alpha.is_some() || self.materials.get(material).is_some_and(Material::is_textured);
        let form = match kind {
            "sphere" => self.sphere(&mut params, textured)?,
            "disk" => self.disk(&mut params, textured)?,
            "cylinder" => self.cylinder(&mut params, textured)?,
            "cone" | "paraboloid" => self.pointed(kind, &mut params)?,
            "trianglemesh" => {
                let mesh = self.triangle_mesh(&mut params)?;
                self.mesh(mesh, &params.spot, false)?
            }
            "bilinearmesh" => {
                let mesh = self.bilinear_mesh(&mut params)?;
                self.mesh(mesh, &params.spot, false)?
            }
            "loopsubdiv" => {
                self.report.approximated(&params.spot, "loopsubdiv: its control mesh with smooth normals");
                params.ignore(&["levels", "nlevels", "scheme"]);
                let mesh = self.triangle_mesh(&mut params)?;
                self.mesh(mesh, &params.spot, true)?
            }
            "plymesh" => self.ply_mesh(&mut params, textured)?,
            _ => return self.unknown(&params.spot, "the shape", kind, &SHAPES, "nothing"),
        };
        let spot = params.spot.clone();
        self.finish(params);
        self.add_shape(form, material, alpha, &spot);
        Ok(())
    }

    /// The index of the current material, from now on in use.
    fn current_material(&mut self) -> usize {
        let index = self.state.material.or_else(|| self.materials.iter().position(|material| material.id == DEFAULT));
        let index = index.unwrap_or_else(|| {
            let node = Node::new("bsdf", "diffuse").rgb("reflectance", Spectrum::grey(0.5));
            self.materials.push(Material {
                id: DEFAULT.to_owned(),
                node,
                transmissive: false,
                opacity: None,
                used: true,
            });
            self.materials.len() - 1
        });
        if let Some(material) = self.materials.get_mut(index) {
            material.used = true;
        }
        index
    }

    fn add_shape(&mut self, form: Form, material: usize, alpha: Option<Texture>, spot: &Spot) {
        let id = self.materials.get(material).map(|material| material.id.clone()).unwrap_or_default();
        let mut node = match alpha {
            None => form.node.reference(&id),
            Some(alpha) => {
                let mask = Node::new("bsdf", "mask").child(alpha.float_node("opacity"));
                form.node.child(mask.reference(&id))
            }
        };
        self.report.shapes += 1;
        let light = self.state.area.clone();
        if let Some(group) = self.group.as_ref().and_then(|name| self.groups.get_mut(name)) {
            if light.is_some() {
                self.report.left_out(spot, "the light of a shape in an object, as in pbrt");
            }
            group.shapes.push(node);
            return;
        }
        if let Some(light) = light {
            node = node.child(self.area_node(&light, Some(form.area)));
        }
        self.shapes.push(node);
    }

    /// `ObjectInstance "name"`.
    pub(super) fn instance(&mut self, name: &str, spot: &Spot) -> Result<(), LoadError> {
        if self.group.is_some() {
            return Err(spot.error("found an instance inside of an object; expected ObjectEnd before it"));
        }
        let Some(group) = self.groups.get(name) else {
            let known = super::names(&self.groups);
            return self.unknown(spot, "the object", name, &known, "nothing");
        };
        if !group.shapes.is_empty() {
            let node = Node::new("shape", "instance").reference(&group.id).placed(&self.state.transform);
            self.shapes.push(node);
            self.report.instances += 1;
        }
        Ok(())
    }

    /// A shape of Mitsuba's own, in a space that does not mirror: pbrt keeps its outside outside.
    fn solid(&self, node: Node, space: &DAffine3, area: f64) -> Form {
        let turn = if mirrors(space) { DVec3::new(-1.0, 1.0, 1.0) } else { DVec3::ONE };
        let node = node.placed(&(*space * DAffine3::from_scale(turn)));
        let node = if self.state.reversed { node.boolean("flip_normals", true) } else { node };
        Form { node, area }
    }

    fn sphere(&mut self, params: &mut Params, textured: bool) -> Result<Form, LoadError> {
        let radius = params.positive("radius")?.unwrap_or(1.0);
        let low = params.float("zmin")?.unwrap_or(-radius).clamp(-radius, radius);
        let high = params.float("zmax")?.unwrap_or(radius).clamp(-radius, radius);
        let turn = turn(params)?;
        let space = self.state.transform;
        let whole = low == -radius && high == radius && turn == 360.0;
        if let Some(scale) = similarity(&space).filter(|_| whole && !(textured && mirrors(&space))) {
            let node = Node::new("shape", "sphere").float("radius", radius);
            return Ok(self.solid(node, &space, 4.0 * PI * (radius * scale).powi(2)));
        }
        let angle = |z: f64| (z / radius).asin() + FRAC_PI_2;
        self.swept("sphere", &Profile::Sphere { radius, from: angle(low), to: angle(high) }, turn, params)
    }

    fn disk(&mut self, params: &mut Params, textured: bool) -> Result<Form, LoadError> {
        let height = params.float("height")?.unwrap_or(0.0);
        let radius = params.positive("radius")?.unwrap_or(1.0);
        let inner = params.float("innerradius")?.unwrap_or(0.0).clamp(0.0, radius);
        let turn = turn(params)?;
        let space = self.state.transform;
        if let Some(scale) = similarity(&space).filter(|_| inner == 0.0 && turn == 360.0 && !textured) {
            let place = DAffine3::from_translation(DVec3::Z * height) * DAffine3::from_scale(DVec3::splat(radius));
            return Ok(self.solid(Node::new("shape", "disk"), &(space * place), PI * (radius * scale).powi(2)));
        }
        let (from, to) = (DVec2::new(radius, height), DVec2::new(inner, height));
        self.swept("disk", &Profile::Line { from, to }, turn, params)
    }

    fn cylinder(&mut self, params: &mut Params, textured: bool) -> Result<Form, LoadError> {
        let radius = params.positive("radius")?.unwrap_or(1.0);
        let (a, b) = (params.float("zmin")?.unwrap_or(-1.0), params.float("zmax")?.unwrap_or(1.0));
        let (low, high) = (a.min(b), a.max(b));
        let turn = turn(params)?;
        let space = self.state.transform;
        if low == high {
            return Err(params.spot.error("found a cylinder whose zmin is its zmax; expected different heights"));
        }
        if let Some(scale) = similarity(&space).filter(|_| turn == 360.0 && !textured) {
            let node = Node::new("shape", "cylinder").float("radius", radius);
            let node = node.triple("point", "p0", DVec3::Z * low).triple("point", "p1", DVec3::Z * high);
            return Ok(self.solid(node, &space, 2.0 * PI * radius * (high - low) * scale * scale));
        }
        let (from, to) = (DVec2::new(radius, low), DVec2::new(radius, high));
        self.swept("cylinder", &Profile::Line { from, to }, turn, params)
    }

    /// Cones and paraboloids.
    fn pointed(&mut self, kind: &str, params: &mut Params) -> Result<Form, LoadError> {
        let radius = params.positive("radius")?.unwrap_or(1.0);
        let turn = turn(params)?;
        let profile = if kind == "cone" {
            let height = params.positive("height")?.unwrap_or(1.0);
            Profile::Line { from: DVec2::new(radius, 0.0), to: DVec2::new(0.0, height) }
        } else {
            let top = params.positive("zmax")?.unwrap_or(1.0);
            let low = params.float("zmin")?.unwrap_or(0.0).clamp(0.0, top);
            Profile::Paraboloid { radius, top, from: low, to: top }
        };
        self.swept(kind, &profile, turn, params)
    }

    /// A surface of revolution as a mesh.
    fn swept(&mut self, kind: &str, profile: &Profile, turn: f64, params: &Params) -> Result<Form, LoadError> {
        let mesh = profile.sweep(turn.to_radians());
        if mesh.triangles.is_empty() {
            return Err(params.spot.error(format!("found a {kind} without area; expected one with area")));
        }
        let count = mesh.triangles.len();
        let message = format!("a {kind} that is partial, stretched or textured: {count} triangles");
        self.report.approximated(&params.spot, message);
        self.mesh(mesh, &params.spot, false)
    }

    /// Writes a mesh. One without normals has flat faces, unless it is to be `smooth`.
    fn mesh(&mut self, mesh: Mesh, spot: &Spot, smooth: bool) -> Result<Form, LoadError> {
        let space = self.state.transform;
        let mesh = mesh.facing(self.state.reversed, mirrors(&space));
        let name = self.out.bytes("ply", &mesh.to_ply()).map_err(|message| spot.error(message))?;
        let node = Node::new("shape", "ply").string("filename", name).placed(&space);
        let flat = mesh.normals.is_empty() && !smooth;
        let node = if flat { node.boolean("face_normals", true) } else { node };
        Ok(Form { node, area: mesh.area(&space) })
    }

    fn ply_mesh(&mut self, params: &mut Params, textured: bool) -> Result<Form, LoadError> {
        let Some(file) = params.take("filename", &["string"])? else {
            return Err(params.spot.error("a plymesh lacks the parameter `filename`"));
        };
        let path = self.find(&file)?;
        let bytes = std::fs::read(&path).map_err(|error| file.error_at(0, &format!("a file to read ({error})")))?;
        let packed = bytes.len();
        let read = gzip::unpack(bytes).and_then(|bytes| Ok((bytes.len(), ply::read(&bytes)?)));
        let (size, read) = read.map_err(|reason| file.error_at(0, &format!("a whole mesh ({reason})")))?;
        if params.any("displacement").is_some() {
            self.report.left_out(&params.spot, "the displacement of a plymesh");
        }
        let space = self.state.transform;
        let flat = read.mesh.normals.is_empty();
        // Normals of the file keep their side when mirrored; faces do not. Mitsuba 3.9 merges meshes without looking at
        // `flip_normals`, and fails: those are written anew.
        let turned = self.state.reversed != (flat && mirrors(&space));
        if turned || packed != size || !read.triangles_only {
            return self.mesh(read.mesh, &params.spot, false);
        }
        let mut node = Node::new("shape", "ply").string("filename", self.resource(&file)?).placed(&space);
        if flat {
            node = node.boolean("face_normals", true);
        }
        if textured && !read.mesh.uvs.is_empty() {
            node = node.boolean("flip_tex_coords", true);
        }
        Ok(Form { node, area: read.mesh.area(&space) })
    }

    fn triangle_mesh(&mut self, params: &mut Params) -> Result<Mesh, LoadError> {
        let mut mesh = self.vertices(params)?;
        params.ignore(&["S", "faceIndices"]);
        mesh.triangles = match corners::<3>(params, mesh.positions.len())? {
            Some(corners) => corners,
            None if mesh.positions.len() == 3 => vec![[0, 1, 2]],
            None => return Err(params.spot.error("this mesh lacks the parameter `indices`")),
        };
        Ok(mesh)
    }

    /// Each patch becomes two triangles.
    fn bilinear_mesh(&mut self, params: &mut Params) -> Result<Mesh, LoadError> {
        let mut mesh = self.vertices(params)?;
        params.ignore(&["faceIndices"]);
        let patches = match corners::<4>(params, mesh.positions.len())? {
            Some(corners) => corners,
            None if mesh.positions.len() == 4 => vec![[0, 1, 2, 3]],
            None => return Err(params.spot.error("this mesh lacks the parameter `indices`")),
        };
        if mesh.uvs.is_empty() && patches == [[0, 1, 2, 3]] {
            mesh.uvs = vec![DVec2::ZERO, DVec2::X, DVec2::Y, DVec2::ONE];
        }
        let curved = patches.iter().any(|patch| {
            let [a, b, c, d] = patch.map(|index| mesh.positions[index as usize]);
            let (x, y, z) = (b - a, c - a, d - a);
            x.cross(y).dot(z).abs() > 1e-4 * x.length() * y.length() * z.length()
        });
        if curved {
            self.report.approximated(&params.spot, "curved bilinear patches: two triangles each");
        }
        mesh.triangles = patches.iter().flat_map(|&[a, b, c, d]| [[a, b, d], [a, d, c]]).collect();
        Ok(mesh)
    }

    /// Positions, normals and texture coordinates.
    fn vertices(&mut self, params: &mut Params) -> Result<Mesh, LoadError> {
        let positions = params.triples("P")?;
        let positions = positions.ok_or_else(|| params.spot.error("this mesh lacks the parameter `P`"))?;
        let normals = params.triples("N")?.unwrap_or_default();
        let uvs = match params.pairs("uv")? {
            None => params.pairs("st")?,
            found => found,
        };
        let uvs = uvs.unwrap_or_default();
        for (name, count) in [("N", normals.len()), ("uv", uvs.len())] {
            if count != 0 && count != positions.len() {
                let found = format!("{count} values of `{name}`");
                return Err(params.spot.expected(&found, &format!("{}, as many as of `P`", positions.len())));
            }
        }
        Ok(Mesh { positions, normals, uvs, triangles: Vec::new() })
    }
}

/// The angle of a partial surface of revolution, in degrees.
fn turn(params: &mut Params) -> Result<f64, LoadError> {
    Ok(params.positive("phimax")?.unwrap_or(360.0).min(360.0))
}

/// The corners of faces with `N` corners each.
fn corners<const N: usize>(params: &mut Params, vertices: usize) -> Result<Option<Vec<[u32; N]>>, LoadError> {
    let Some((indices, param)) = params.indices("indices")? else { return Ok(None) };
    let fits = |index: &i64| usize::try_from(*index).is_ok_and(|index| index < vertices);
    if let Some(bad) = indices.iter().position(|index| !fits(index)) {
        return Err(param.error_at(bad, &format!("an index below {vertices}, the number of vertices, and at least 0")));
    }
    let (faces, rest) = indices.as_chunks::<N>();
    if !rest.is_empty() || faces.is_empty() {
        return Err(param.spot.expected(&format!("{} indices", indices.len()), &format!("a multiple of {N}")));
    }
    Ok(Some(faces.iter().map(|face| face.map(|index| index as u32)).collect()))
}
