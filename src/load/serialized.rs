//! Mitsuba's own format of meshes, versions 3 and 4: meshes one after the other, each behind a short header and
//! compressed by zlib, and at the end where each of them starts.

use super::mesh::RawMesh;
use flate2::read::ZlibDecoder;
use glam::{DVec2, DVec3};
use std::io::Read;

/// First two bytes of the file and of each mesh in it.
const MAGIC: u16 = 0x041c;

/// Most bytes that a compressed one may stand for. Real meshes stay far below; more would be an attack on the memory.
const MOST_GROWTH: u64 = 256;

/// Longest name of a mesh.
const LONGEST_NAME: usize = 1 << 16;

const HAS_NORMALS: u32 = 0x0001;
const HAS_UVS: u32 = 0x0002;
const HAS_COLOURS: u32 = 0x0008;
const FACE_NORMALS: u32 = 0x0010;
const DOUBLES: u32 = 0x2000;

/// Reads the mesh number `index` in `bytes`.
pub(super) fn read(bytes: &[u8], index: usize) -> Result<RawMesh, String> {
    let version = header(bytes)?;
    let start = if index == 0 { 0 } else { start_of(bytes, version, index)? };
    let mesh = bytes.get(start..).ok_or("a mesh starts behind the end of the file")?;
    let version = header(mesh)?;
    Stream { inner: ZlibDecoder::new(&mesh[4..]), bytes: mesh.len() as u64 }.mesh(version)
}

/// The version that a header states.
fn header(bytes: &[u8]) -> Result<u16, String> {
    let [a, b, c, d, ..] = *bytes else { return Err("it is too short for a header".to_owned()) };
    if u16::from_le_bytes([a, b]) != MAGIC {
        return Err("it does not start as a serialized mesh does".to_owned());
    }
    match u16::from_le_bytes([c, d]) {
        version @ (3 | 4) => Ok(version),
        version => Err(format!("its version is {version}; expected 3 or 4")),
    }
}

/// Where the mesh number `index` starts: the file ends with all starts and their count.
fn start_of(bytes: &[u8], version: u16, index: usize) -> Result<usize, String> {
    let short = || "it is too short for its list of meshes".to_owned();
    let number = |at: usize, width: usize| {
        let digits = at.checked_add(width).and_then(|end| bytes.get(at..end));
        digits.map(|digits| digits.iter().rev().fold(0u64, |sum, digit| sum << 8 | u64::from(*digit)))
    };
    let end = bytes.len().checked_sub(4).ok_or_else(short)?;
    let count = number(end, 4).ok_or_else(short)? as usize;
    if index >= count {
        return Err(format!("it holds {count} meshes; expected a `shape_index` below that, found {index}"));
    }
    let width = if version == 3 { 4 } else { 8 };
    let list = count.checked_mul(width).and_then(|length| end.checked_sub(length)).ok_or_else(short)?;
    number(list + index * width, width).and_then(|start| usize::try_from(start).ok()).ok_or_else(short)
}

/// A compressed mesh.
struct Stream<'b> {
    inner: ZlibDecoder<&'b [u8]>,
    /// Its length as it is in the file, and what follows.
    bytes: u64,
}

impl Stream<'_> {
    fn mesh(mut self, version: u16) -> Result<RawMesh, String> {
        let flags = u32::from_le_bytes(self.array()?);
        if version == 4 {
            self.skip_name()?;
        }
        let vertices = u64::from_le_bytes(self.array()?);
        let triangles = u64::from_le_bytes(self.array()?);
        let bound = self.bytes.saturating_mul(MOST_GROWTH);
        if vertices.saturating_add(triangles).saturating_mul(12) > bound || vertices > u64::from(u32::MAX) {
            let found = format!("{vertices} vertices and {triangles} triangles");
            return Err(format!("its header promises {found}, more than its {} bytes can hold", self.bytes));
        }
        let has = |flag| flags & flag != 0;
        let doubles = has(DOUBLES);
        let mut mesh = RawMesh { face_normals: has(FACE_NORMALS), ..RawMesh::default() };
        mesh.positions = self.vectors(vertices, doubles)?;
        if has(HAS_NORMALS) {
            mesh.normals = self.vectors(vertices, doubles)?;
        }
        if has(HAS_UVS) {
            mesh.uvs = self.numbers(2 * vertices, doubles)?.chunks_exact(2).map(DVec2::from_slice).collect();
        }
        if has(HAS_COLOURS) {
            self.numbers(3 * vertices, doubles)?;
        }
        let corners = self.bytes(triangles.saturating_mul(12))?;
        let index = |i: usize, corner: &[u8]| u32::from_le_bytes([0, 1, 2, 3].map(|byte| corner[4 * i + byte]));
        mesh.triangles = corners.chunks_exact(12).map(|corner| [0, 1, 2].map(|i| index(i, corner))).collect();
        match mesh.triangles.iter().flatten().find(|index| u64::from(**index) >= vertices) {
            Some(index) => Err(format!("a face refers to vertex {index} of {vertices}")),
            None if mesh.triangles.is_empty() => Err("it contains no faces".to_owned()),
            None => Ok(mesh),
        }
    }

    fn skip_name(&mut self) -> Result<(), String> {
        for _ in 0..LONGEST_NAME {
            if self.array::<1>()? == [0] {
                return Ok(());
            }
        }
        Err(format!("the name of a mesh has more than {LONGEST_NAME} bytes"))
    }

    fn vectors(&mut self, count: u64, doubles: bool) -> Result<Vec<DVec3>, String> {
        Ok(self.numbers(3 * count, doubles)?.chunks_exact(3).map(DVec3::from_slice).collect())
    }

    fn numbers(&mut self, count: u64, doubles: bool) -> Result<Vec<f64>, String> {
        let width = if doubles { 8 } else { 4 };
        let bytes = self.bytes(count.saturating_mul(width))?;
        let double = |b: &[u8]| f64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]]);
        let single = |b: &[u8]| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
        let numbers = bytes.chunks_exact(width as usize);
        Ok(if doubles { numbers.map(double).collect() } else { numbers.map(single).collect() })
    }

    /// The next `count` bytes. Memory grows with what is there, not with what is promised.
    fn bytes(&mut self, count: u64) -> Result<Vec<u8>, String> {
        let mut bytes = Vec::new();
        let found = self.inner.by_ref().take(count).read_to_end(&mut bytes);
        match found {
            Ok(found) if found as u64 == count => Ok(bytes),
            Ok(_) => Err("it ends too early".to_owned()),
            Err(error) => Err(format!("its compressed data is damaged: {error}")),
        }
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let bytes = self.bytes(N as u64)?;
        bytes.try_into().map_err(|_| "it ends too early".to_owned())
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use flate2::{Compression, write::ZlibEncoder};
    use std::io::Write;

    /// A mesh of one triangle, `shift` to the right, without the list at the end.
    fn mesh(version: u16, flags: u32, shift: f64, vertices: u64) -> Vec<u8> {
        let mut body = flags.to_le_bytes().to_vec();
        if version == 4 {
            body.extend(b"name\0");
        }
        body.extend(vertices.to_le_bytes());
        body.extend(1u64.to_le_bytes());
        let mut put = |number: f64| {
            if flags & DOUBLES != 0 {
                body.extend(number.to_le_bytes())
            } else {
                body.extend((number as f32).to_le_bytes())
            }
        };
        [shift, 0.0, 0.0, shift + 1.0, 0.0, 0.0, shift, 1.0, 0.0].into_iter().for_each(&mut put);
        if flags & HAS_NORMALS != 0 {
            [0.0, 0.0, 1.0].repeat(3).into_iter().for_each(&mut put);
        }
        if flags & HAS_UVS != 0 {
            [0.25, 0.75].repeat(3).into_iter().for_each(&mut put);
        }
        if flags & HAS_COLOURS != 0 {
            [0.5; 9].into_iter().for_each(&mut put);
        }
        [0u32, 1, 2].into_iter().for_each(|index| body.extend(index.to_le_bytes()));
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
        encoder.write_all(&body).unwrap();
        [&MAGIC.to_le_bytes()[..], &version.to_le_bytes(), &encoder.finish().unwrap()].concat()
    }

    fn file(version: u16, flags: u32) -> Vec<u8> {
        let (first, second) = (mesh(version, flags, 0.0, 3), mesh(version, flags, 5.0, 3));
        let starts =
            [0, first.len() as u64].map(|start| start.to_le_bytes()[..if version == 3 { 4 } else { 8 }].to_vec());
        [first, second, starts.concat(), 2u32.to_le_bytes().to_vec()].concat()
    }

    #[test]
    fn all_forms_are_read() {
        for version in [3, 4] {
            for kind in 0..32 {
                let has = |bit: u32, flag: u32| if kind >> bit & 1 == 1 { flag } else { 0 };
                let wide = has(4, DOUBLES);
                let flags = has(0, HAS_NORMALS) | has(1, HAS_UVS) | has(2, HAS_COLOURS) | has(3, FACE_NORMALS) | wide;
                let bytes = file(version, flags);
                let (first, second) = (read(&bytes, 0).unwrap(), read(&bytes, 1).unwrap());
                assert_eq!((first.positions[1].x, second.positions[1].x), (1.0, 6.0));
                assert_eq!(second.triangles, [[0, 1, 2]]);
                assert_eq!(second.normals.len(), if flags & HAS_NORMALS != 0 { 3 } else { 0 });
                assert_eq!(second.uvs, vec![DVec2::new(0.25, 0.75); if flags & HAS_UVS != 0 { 3 } else { 0 }]);
                assert_eq!(second.face_normals, flags & FACE_NORMALS != 0);
            }
        }
    }

    #[test]
    fn bad_files_are_explained() {
        let good = file(4, 0);
        let cases: [(Vec<u8>, usize, &str); 7] = [
            (Vec::new(), 0, "it is too short for a header"),
            (b"hello".to_vec(), 0, "it does not start as"),
            (vec![0x1c, 0x04, 9, 0], 0, "its version is 9; expected 3 or 4"),
            (good.clone(), 2, "it holds 2 meshes"),
            (good[..30].to_vec(), 0, "its compressed data is damaged"),
            (mesh(4, 0, 0.0, 1 << 33), 0, "its header promises 8589934592 vertices"),
            (mesh(4, 0, 0.0, 2), 0, "a face refers to vertex"),
        ];
        for (bytes, index, message) in cases {
            let found = read(&bytes, index).err().unwrap();
            assert!(found.starts_with(message), "{found}; expected {message}");
        }
    }

    #[test]
    fn truncated_files_do_not_panic() {
        let bytes = file(3, HAS_UVS);
        for length in 0..bytes.len() {
            let _ = (read(&bytes[..length], 0), read(&bytes[..length], 1));
        }
    }
}
