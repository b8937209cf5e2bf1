//! PLY in ASCII and both binary byte orders.

use super::guard;
use super::mesh::RawMesh;
use glam::{DVec2, DVec3};
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType};
use std::io::Cursor;

/// Names that files use for the corners of a face.
const CORNERS: [&str; 2] = ["vertex_indices", "vertex_index"];

/// Most characters of the parser's message that are passed on: it quotes the file.
const SHOWN: usize = 200;

#[derive(Default)]
struct Vertex {
    position: [f64; 3],
    normal: [f64; 3],
    uv: [f64; 2],
}

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let slot = match name {
            "x" => &mut self.position[0],
            "y" => &mut self.position[1],
            "z" => &mut self.position[2],
            "nx" => &mut self.normal[0],
            "ny" => &mut self.normal[1],
            "nz" => &mut self.normal[2],
            "u" | "s" => &mut self.uv[0],
            "v" | "t" => &mut self.uv[1],
            _ => return PropertyAccessResult::Ignored,
        };
        *slot = match property {
            Property::Double(value) => value,
            other => match other.to_f32_lossy() {
                Some(value) => f64::from(value),
                None => return PropertyAccessResult::UnsupportedType,
            },
        };
        PropertyAccessResult::Set
    }
}

#[derive(Default)]
struct Face {
    /// `None` where they are no indices.
    corners: Option<Vec<u32>>,
}

impl PropertyAccess for Face {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if !CORNERS.contains(&name) {
            return PropertyAccessResult::Ignored;
        }
        self.corners = property.to_u32_list();
        PropertyAccessResult::Set
    }
}

/// An element that does not matter.
struct Other;

impl PropertyAccess for Other {
    fn new() -> Self {
        Self
    }
}

/// Reads the mesh in `bytes`. Polygons become fans of triangles. With `flip_v` texture coordinates count from the top.
pub(super) fn read(bytes: &[u8], flip_v: bool) -> Result<RawMesh, String> {
    let mut mesh = guard(|| parse(bytes))??;
    if flip_v {
        mesh.uvs.iter_mut().for_each(|uv| uv.y = 1.0 - uv.y);
    }
    Ok(mesh)
}

fn parse(bytes: &[u8]) -> Result<RawMesh, String> {
    let mut reader = Reader::new(Cursor::new(bytes));
    let one_line = |error: ply_rs_bw::parser::ParseError| {
        let text = error.to_string();
        let words: Vec<_> = text.split_whitespace().collect();
        words.join(" ").chars().take(SHOWN).collect::<String>()
    };
    let header = Parser::<Vertex>::new().read_header(&mut reader).map_err(one_line)?;
    let (has_normals, has_uvs) = check(&header, bytes.len())?;
    let mut mesh = RawMesh::default();
    for (name, element) in &header.elements {
        match name.as_str() {
            "vertex" => {
                let parser = Parser::<Vertex>::new();
                let vertices = parser.read_payload_for_element(&mut reader, element, &header).map_err(one_line)?;
                mesh.positions = vertices.iter().map(|vertex| DVec3::from(vertex.position)).collect();
                if has_normals {
                    mesh.normals = vertices.iter().map(|vertex| DVec3::from(vertex.normal)).collect();
                }
                if has_uvs {
                    mesh.uvs = vertices.iter().map(|vertex| DVec2::from(vertex.uv)).collect();
                }
            }
            "face" => {
                let parser = Parser::<Face>::new();
                let faces = parser.read_payload_for_element(&mut reader, element, &header).map_err(one_line)?;
                let corners: Option<Vec<_>> = faces.iter().map(|face| face.corners.as_deref()).collect();
                let corners = corners.ok_or("a face has a corner that is no index from 0")?;
                mesh.triangles = corners.into_iter().flat_map(fan).collect();
            }
            _ => {
                let parser = Parser::<Other>::new();
                parser.read_payload_for_element(&mut reader, element, &header).map_err(one_line)?;
            }
        }
    }
    match mesh.triangles.iter().flatten().find(|index| **index as usize >= mesh.positions.len()) {
        Some(index) => Err(format!("a face refers to vertex {index} of {}", mesh.positions.len())),
        None if mesh.triangles.is_empty() => Err("it contains no faces".to_owned()),
        None => Ok(mesh),
    }
}

fn fan(corners: &[u32]) -> impl Iterator<Item = [u32; 3]> {
    corners.windows(2).skip(1).map(|pair| [corners[0], pair[0], pair[1]])
}

/// Refuses a header without vertices or faces, or with more elements than the file has bytes; whether it has
/// normals, and texture coordinates.
fn check(header: &Header, bytes: usize) -> Result<(bool, bool), String> {
    let element = |name: &str| header.elements.get(name).ok_or_else(|| format!("it has no element `{name}`"));
    let (vertex, face) = (element("vertex")?, element("face")?);
    let has = |names: &[&str], element: &ElementDef| names.iter().all(|name| element.properties.contains_key(*name));
    if !has(&["x", "y", "z"], vertex) {
        return Err("its vertices lack one of x, y, z".to_owned());
    }
    let is_list = |name: &&str| {
        face.properties.get(*name).is_some_and(|corners| matches!(corners.data_type, PropertyType::List(..)))
    };
    if !CORNERS.iter().any(is_list) {
        return Err("its faces lack the list `vertex_indices`".to_owned());
    }
    let count = header.elements.values().fold(0usize, |sum, element| sum.saturating_add(element.count));
    if count > bytes {
        return Err(format!("its header promises {count} elements, more than its {bytes} bytes can hold"));
    }
    Ok((has(&["nx", "ny", "nz"], vertex), has(&["u", "v"], vertex) || has(&["s", "t"], vertex)))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    fn header(format: &str, vertices: usize) -> String {
        format!(
            "ply\nformat {format} 1.0\nelement vertex {vertices}\nproperty float x\nproperty double y\nproperty float z\n\
             element face 2\nproperty uchar red\nproperty list uchar int vertex_index\nend_header\n"
        )
    }

    fn binary(little: bool) -> Vec<u8> {
        let mut bytes = header(if little { "binary_little_endian" } else { "binary_big_endian" }, 5).into_bytes();
        let mut put = |little_endian: &[u8]| {
            if little { bytes.extend(little_endian) } else { bytes.extend(little_endian.iter().rev()) }
        };
        for [x, y, z] in POINTS {
            put(&(x as f32).to_le_bytes());
            put(&y.to_le_bytes());
            put(&(z as f32).to_le_bytes());
        }
        for face in [&[0i32, 1, 2, 3][..], &[3, 2, 4]] {
            put(&[9]);
            put(&[face.len() as u8]);
            face.iter().for_each(|index| put(&index.to_le_bytes()));
        }
        bytes
    }

    const POINTS: [[f64; 3]; 5] =
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.5], [0.0, 1.0, 0.0], [0.5, 2.0, -3.0]];

    #[test]
    fn all_encodings_are_read() {
        let mut ascii = header("ascii", 5);
        POINTS.iter().for_each(|[x, y, z]| ascii += &format!("{x} {y} {z}\n"));
        ascii += "9 4 0 1 2 3\n9 3 3 2 4\n";
        for bytes in [ascii.into_bytes(), binary(true), binary(false)] {
            let mesh = read(&bytes, false).unwrap();
            assert_eq!(mesh.positions, POINTS.map(DVec3::from));
            assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [3, 2, 4]]);
            assert!(mesh.normals.is_empty());
        }
    }

    #[test]
    fn bad_files_are_explained() {
        let short = |count| header("ascii", count);
        let cases: [(String, &str); 5] = [
            (short(1) + "0 0 0\n0 3 0 0 0\n0 3 0 0 1\n", "a face refers to vertex 1 of 1"),
            (short(1) + "0 0 0\n0 3 0 0 -1\n0 3 0 0 0\n", "a face has a corner that is no index from 0"),
            (short(9_999_999_999), "its header promises 10000000001 elements"),
            (short(3), "Line 11: Unexpected end of file"),
            ("ply\nformat ascii 1.0\nelement vertex 0\nend_header\n".into(), "it has no element `face`"),
        ];
        for (text, message) in cases {
            let found = read(text.as_bytes(), false).err().unwrap();
            assert!(found.starts_with(message), "{found}");
        }
    }

    #[test]
    fn truncated_files_are_errors() {
        let bytes = binary(true);
        for length in 0..bytes.len() {
            assert!(read(&bytes[..length], false).is_err(), "{length}");
        }
    }
}
