//! PLY files that a scene refers to.

use super::mesh::Mesh;
use glam::{DVec2, DVec3};
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{Header, Property, PropertyAccess, PropertyAccessResult};
use std::io::Cursor;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Most characters of the parser's message that are passed on: it quotes the file.
const SHOWN: usize = 200;

/// A mesh file as it was read.
pub(super) struct MeshFile {
    pub mesh: Mesh,
    /// Whether all faces are triangles, which is all that Mitsuba reads.
    pub triangles_only: bool,
}

/// Position, normal, texture coordinates.
#[derive(Default)]
struct Vertex([f64; 8]);

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let slot = match name {
            "x" => 0,
            "y" => 1,
            "z" => 2,
            "nx" => 3,
            "ny" => 4,
            "nz" => 5,
            "u" | "s" | "texture_u" | "texture_s" => 6,
            "v" | "t" | "texture_v" | "texture_t" => 7,
            _ => return PropertyAccessResult::Ignored,
        };
        let value = match property {
            Property::Double(value) => Some(value),
            other => other.to_f32_lossy().map(f64::from),
        };
        let Some(value) = value else { return PropertyAccessResult::UnsupportedType };
        self.0[slot] = value;
        PropertyAccessResult::Set
    }
}

/// The corners of a face; `None` where they are no indices.
#[derive(Default)]
struct Face(Option<Vec<u32>>);

impl PropertyAccess for Face {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if !["vertex_indices", "vertex_index"].contains(&name) {
            return PropertyAccessResult::Ignored;
        }
        self.0 = property.to_u32_list();
        PropertyAccessResult::Set
    }
}

/// Reads the mesh in `bytes`; polygons become fans of triangles. The parser was written by others: should it panic, that
/// is an error of the file.
pub(super) fn read(bytes: &[u8]) -> Result<MeshFile, String> {
    catch_unwind(AssertUnwindSafe(|| parse(bytes))).map_err(|_| "it confuses the parser".to_owned())?
}

fn parse(bytes: &[u8]) -> Result<MeshFile, String> {
    let one_line = |error: ply_rs_bw::parser::ParseError| {
        let text = error.to_string();
        text.split_whitespace().collect::<Vec<_>>().join(" ").chars().take(SHOWN).collect::<String>()
    };
    let mut reader = Reader::new(Cursor::new(bytes));
    let header = Parser::<Vertex>::new().read_header(&mut reader).map_err(one_line)?;
    let count = header.elements.values().fold(0usize, |sum, element| sum.saturating_add(element.count));
    if count > bytes.len() {
        return Err(format!("its header promises {count} elements, more than its {} bytes can hold", bytes.len()));
    }
    let (mut vertices, mut faces) = (Vec::new(), Vec::new());
    for (name, element) in &header.elements {
        if name == "face" {
            faces = Parser::<Face>::new().read_payload_for_element(&mut reader, element, &header).map_err(one_line)?;
        } else {
            let read = Parser::<Vertex>::new().read_payload_for_element(&mut reader, element, &header);
            let read = read.map_err(one_line)?;
            if name == "vertex" {
                vertices = read;
            }
        }
    }
    assemble(&header, &vertices, faces)
}

fn assemble(header: &Header, vertices: &[Vertex], faces: Vec<Face>) -> Result<MeshFile, String> {
    let properties = header.elements.get("vertex").map(|vertex| &vertex.properties);
    let has = |name: &str| properties.is_some_and(|properties| properties.contains_key(name));
    if vertices.iter().any(|vertex| vertex.0.iter().any(|value| !value.is_finite())) {
        return Err("it has a number that is not finite".to_owned());
    }
    let mut mesh = Mesh { positions: triples(vertices, 0), ..Mesh::default() };
    if ["nx", "ny", "nz"].iter().all(|name| has(name)) {
        mesh.normals = triples(vertices, 3);
    }
    if ["u", "s", "texture_u", "texture_s"].iter().any(|name| has(name)) {
        mesh.uvs = vertices.iter().map(|vertex| DVec2::from_slice(&vertex.0[6..])).collect();
    }
    let mut triangles_only = true;
    for Face(corners) in faces {
        let corners = corners.ok_or("a face has a corner that is no index from 0")?;
        if let Some(index) = corners.iter().find(|index| **index as usize >= vertices.len()) {
            return Err(format!("a face refers to vertex {index} of {}", vertices.len()));
        }
        triangles_only &= corners.len() == 3;
        mesh.triangles.extend(corners.windows(2).skip(1).map(|pair| [corners[0], pair[0], pair[1]]));
    }
    if mesh.triangles.is_empty() {
        return Err("it contains no faces".to_owned());
    }
    // Mitsuba knows fewer names for texture coordinates.
    triangles_only &= !has("texture_u") && !has("texture_s");
    Ok(MeshFile { mesh, triangles_only })
}

fn triples(vertices: &[Vertex], at: usize) -> Vec<DVec3> {
    vertices.iter().map(|vertex| DVec3::from_slice(&vertex.0[at..])).collect()
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn what_is_written_is_read() {
        let mesh = Mesh {
            positions: vec![DVec3::ZERO, DVec3::X, DVec3::new(0.5, -2.0, 3.0)],
            normals: vec![DVec3::Z; 3],
            uvs: vec![DVec2::new(0.25, 0.75); 3],
            triangles: vec![[2, 1, 0]],
        };
        let read = read(&mesh.to_ply()).unwrap();
        assert!(read.triangles_only);
        let turned = Mesh { uvs: vec![DVec2::new(0.25, 0.25); 3], ..mesh };
        assert_eq!(read.mesh, turned);
    }
}
