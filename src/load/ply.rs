//! PLY in ASCII and both binary byte orders.

use super::attributes::{Group, Per, RawAttribute, group};
use super::guard;
use super::mesh::RawMesh;
use glam::{DVec2, DVec3, Vec3};
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{ElementDef, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType, ScalarType};
use std::io::Cursor;
use std::iter::repeat_n;

/// Names that files use for the corners of a face.
const CORNERS: [&str; 2] = ["vertex_indices", "vertex_index"];

/// Most characters of the parser's message that are passed on: it quotes the file.
const SHOWN: usize = 200;

/// Properties of vertices that are no attributes.
const GEOMETRY: [&str; 12] = ["x", "y", "z", "nx", "ny", "nz", "u", "v", "s", "t", "texture_u", "texture_v"];

/// A vertex; with `ALL` it keeps properties that might belong to attributes.
#[derive(Default)]
struct Vertex<const ALL: bool> {
    position: [f64; 3],
    normal: [f64; 3],
    uv: [f64; 2],
    /// The other properties that are numbers, in the order of the file.
    others: Vec<f64>,
}

impl<const ALL: bool> PropertyAccess for Vertex<ALL> {
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
            "u" | "s" | "texture_u" => &mut self.uv[0],
            "v" | "t" | "texture_v" => &mut self.uv[1],
            _ => return keep(ALL, &mut self.others, &property),
        };
        match number(&property) {
            Some(value) => *slot = value,
            None => return PropertyAccessResult::UnsupportedType,
        }
        PropertyAccessResult::Set
    }
}

/// The value of a property that is a number.
fn number(property: &Property) -> Option<f64> {
    match property {
        Property::Double(value) => Some(*value),
        other => other.to_f32_lossy().map(f64::from),
    }
}

/// Keeps the value of a property that is a number, if `all` are wanted.
fn keep(all: bool, others: &mut Vec<f64>, property: &Property) -> PropertyAccessResult {
    match number(property).filter(|_| all) {
        Some(value) => others.push(value),
        None => return PropertyAccessResult::Ignored,
    }
    PropertyAccessResult::Set
}

/// A face, as [`Vertex`].
#[derive(Default)]
struct Face<const ALL: bool> {
    /// `None` where they are no indices.
    corners: Option<Vec<u32>>,
    others: Vec<f64>,
}

impl<const ALL: bool> PropertyAccess for Face<ALL> {
    fn new() -> Self {
        Self::default()
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        if !CORNERS.contains(&name) {
            return keep(ALL, &mut self.others, &property);
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

/// Reads the mesh in `bytes`, with its attributes where they are wanted. Polygons become fans of triangles. With `flip_v`
/// texture coordinates count from the top.
pub(super) fn read(bytes: &[u8], flip_v: bool, attributes: bool) -> Result<RawMesh, String> {
    let mut mesh = guard(|| if attributes { parse::<true>(bytes) } else { parse::<false>(bytes) })??;
    if flip_v {
        mesh.uvs.iter_mut().for_each(|uv| uv.y = 1.0 - uv.y);
    }
    Ok(mesh)
}

fn parse<const ALL: bool>(bytes: &[u8]) -> Result<RawMesh, String> {
    let mut reader = Reader::new(Cursor::new(bytes));
    let one_line = |error: ply_rs_bw::parser::ParseError| {
        let text = error.to_string();
        let words: Vec<_> = text.split_whitespace().collect();
        words.join(" ").chars().take(SHOWN).collect::<String>()
    };
    let header = Parser::<Other>::new().read_header(&mut reader).map_err(one_line)?;
    let (has_normals, has_uvs) = check(&header, bytes.len())?;
    let mut mesh = RawMesh::default();
    for (name, element) in &header.elements {
        match name.as_str() {
            "vertex" => {
                let parser = Parser::<Vertex<ALL>>::new();
                let vertices = parser.read_payload_for_element(&mut reader, element, &header).map_err(one_line)?;
                mesh.positions = vertices.iter().map(|vertex| DVec3::from(vertex.position)).collect();
                if has_normals {
                    mesh.normals = vertices.iter().map(|vertex| DVec3::from(vertex.normal)).collect();
                }
                if has_uvs {
                    mesh.uvs = vertices.iter().map(|vertex| DVec2::from(vertex.uv)).collect();
                }
                if ALL {
                    let rows = || vertices.iter().map(|vertex| vertex.others.as_slice());
                    mesh.attributes.extend(attributes(Per::Vertex, element, rows));
                }
            }
            "face" => {
                let parser = Parser::<Face<ALL>>::new();
                let faces = parser.read_payload_for_element(&mut reader, element, &header).map_err(one_line)?;
                let corners: Option<Vec<_>> = faces.iter().map(|face| face.corners.as_deref()).collect();
                let corners = corners.ok_or("a face has a corner that is no index from 0")?;
                mesh.triangles = corners.into_iter().flat_map(fan).collect();
                if ALL {
                    // One row for each triangle of a face.
                    let triangles = |face: &Face<ALL>| face.corners.as_ref().map_or(0, |c| c.len().saturating_sub(2));
                    let rows = || faces.iter().flat_map(|face| repeat_n(face.others.as_slice(), triangles(face)));
                    mesh.attributes.extend(attributes(Per::Face, element, rows));
                }
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

/// The attributes of vertices or faces, of which `rows` has the numbers that are no geometry.
fn attributes<'a, R: Iterator<Item = &'a [f64]>>(
    per: Per,
    element: &ElementDef,
    rows: impl Fn() -> R,
) -> Vec<RawAttribute> {
    let geometry: &[&str] = if per == Per::Vertex { &GEOMETRY } else { &CORNERS };
    let others = element.properties.iter().filter(|(name, _)| !geometry.contains(&name.as_str()));
    let mut names = Vec::new();
    let mut whole = Vec::new();
    for (name, property) in others {
        if let PropertyType::Scalar(scalar) = &property.data_type {
            names.push(name.as_str());
            whole.push(!matches!(scalar, ScalarType::Float | ScalarType::Double));
        }
    }
    let read = |Group { name, members }| {
        let value = |row: &[f64]| match members[..] {
            [x, y, z, ..] => Vec3::new(row[x] as f32, row[y] as f32, row[z] as f32),
            _ => Vec3::splat(row[members[0]] as f32),
        };
        let values = rows().map(value).collect();
        let whole = members.iter().any(|member| whole[*member]);
        RawAttribute { name, per, channels: members.len(), whole, values }
    };
    group(per, &names).into_iter().map(read).collect()
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
    let has_uvs = [["u", "v"], ["s", "t"], ["texture_u", "texture_v"]].iter().any(|names| has(names, vertex));
    Ok((has(&["nx", "ny", "nz"], vertex), has_uvs))
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
            let mesh = read(&bytes, false, false).unwrap();
            assert_eq!(mesh.positions, POINTS.map(DVec3::from));
            assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [3, 2, 4]]);
            assert!(mesh.normals.is_empty());
        }
    }

    /// Numbers stay as they are stored; a quad gives its values to both of its triangles.
    #[test]
    fn attributes_are_read() {
        let text = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
            property list uchar int odd\nproperty uchar green\nproperty uchar red\nproperty float nx\nproperty uchar blue\n\
            property double heat_0\nelement face 2\nproperty float r\nproperty float g\nproperty list uchar int vertex_indices\n\
            property float b\nproperty float a\nend_header\n\
            0 0 0 1 7 20 10 0 30 0.5\n1 0 0 0 21 11 0 31 1.5\n1 1 0 2 1 2 22 12 0 32 2.5\n0 1 0 0 23 13 0 33 3.5\n\
            0.25 0.5 4 0 1 2 3 0.75 1\n1 2 3 0 1 3 3 1\n";
        let [heat, face, colour] = {
            let mut attributes = read(text.as_bytes(), false, true).unwrap().attributes;
            attributes.sort_by_key(|attribute| attribute.channels);
            [0, 2, 1].map(|i| attributes[i].clone())
        };
        let vertices = |each: fn(f32) -> Vec3| [0.0, 1.0, 2.0, 3.0].map(each).to_vec();
        let expected = |name: &str, per, channels, whole, values| {
            let name = name.to_owned();
            RawAttribute { name, per, channels, whole, values }
        };
        let colours = vertices(|i| Vec3::new(10.0 + i, 20.0 + i, 30.0 + i));
        assert_eq!(colour, expected("vertex_color", Per::Vertex, 3, true, colours));
        assert_eq!(heat, expected("vertex_heat", Per::Vertex, 1, false, vertices(|i| Vec3::splat(0.5 + i))));
        let quad = Vec3::new(0.25, 0.5, 0.75);
        let faces = vec![quad, quad, Vec3::new(1.0, 2.0, 3.0)];
        assert_eq!(face, expected("face_color", Per::Face, 4, false, faces));
        assert!(read(text.as_bytes(), false, false).unwrap().attributes.is_empty());
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
            let found = read(text.as_bytes(), false, false).err().unwrap();
            assert!(found.starts_with(message), "{found}");
        }
    }

    #[test]
    fn truncated_files_are_errors() {
        let bytes = binary(true);
        for length in 0..bytes.len() {
            assert!(read(&bytes[..length], false, false).is_err(), "{length}");
        }
    }
}
