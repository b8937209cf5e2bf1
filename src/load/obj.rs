//! Wavefront OBJ. Groups and materials are left aside: they do not change the shape, and Mitsuba does the same.

use super::mesh::RawMesh;
use foldhash::fast::RandomState;
use glam::{DVec2, DVec3};
use std::borrow::Cow;
use std::collections::HashMap;

/// What a corner has in the place of an index that it does not give.
const NONE: u32 = u32::MAX;

/// A corner of a face: indices from 0 of its position, texture coordinates and normal.
type Corner = [u32; 3];

/// What the lines say, in their order.
#[derive(Default)]
struct Lines {
    positions: Vec<DVec3>,
    uvs: Vec<DVec2>,
    normals: Vec<DVec3>,
    corners: Vec<Corner>,
    /// Where the corners of each triangle are, and its line.
    triangles: Vec<([u32; 3], u32)>,
}

/// Reads the mesh in `bytes`. Polygons become fans of triangles; points and lines are left out. With `flip_v` texture
/// coordinates count from the top.
pub(super) fn read(bytes: &[u8], flip_v: bool) -> Result<RawMesh, String> {
    let mut lines = Lines::default();
    let text = joined(bytes);
    let ends = memchr::memchr_iter(b'\n', &text).chain([text.len()]);
    let mut start = 0;
    for (index, end) in ends.enumerate() {
        let mut words = Words(&text[start..end]);
        start = end + 1;
        let located = |reason: String| format!("line {}: {reason}", index + 1);
        match words.next() {
            Some(b"v") => lines.positions.push(DVec3::from(numbers(words, 3).map_err(located)?)),
            Some(b"vn") => lines.normals.push(DVec3::from(numbers(words, 3).map_err(located)?)),
            Some(b"vt") => {
                let [u, v, _] = numbers(words, 1).map_err(located)?;
                lines.uvs.push(DVec2::new(u, if flip_v { 1.0 - v } else { v }));
            }
            Some(b"f") => lines.face(words, index as u32 + 1).map_err(located)?,
            _ => {}
        }
    }
    lines.mesh()
}

impl Lines {
    fn face(&mut self, words: Words<'_>, line: u32) -> Result<(), String> {
        let counts = [self.positions.len(), self.uvs.len(), self.normals.len()];
        let first = self.corners.len() as u32;
        for word in words {
            let corner = corner(word, counts);
            let named = || format!("`{}` is not a corner of a face", String::from_utf8_lossy(word));
            self.corners.push(corner.ok_or_else(named)?);
        }
        for last in first + 2..self.corners.len() as u32 {
            self.triangles.push(([first, last - 1, last], line));
        }
        Ok(())
    }

    /// The mesh with one vertex per corner that differs from all others.
    fn mesh(self) -> Result<RawMesh, String> {
        if self.triangles.is_empty() {
            return Err("it contains no faces".to_owned());
        }
        let mut mesh = RawMesh::default();
        let used = |i: usize| self.corners.iter().any(|corner| corner[i] != NONE);
        let (mapped, smooth) = (used(1), used(2));
        let mut known: HashMap<Corner, u32, RandomState> =
            HashMap::with_capacity_and_hasher(self.positions.len(), RandomState::default());
        for (triangle, line) in &self.triangles {
            let mut vertices = [0; 3];
            for (vertex, place) in vertices.iter_mut().zip(triangle) {
                let corner = self.corners[*place as usize];
                *vertex = match known.get(&corner) {
                    Some(index) => *index,
                    None => {
                        self.vertex(corner, mapped, smooth, &mut mesh)
                            .ok_or_else(|| format!("line {line}: a face refers to a vertex that does not exist"))?;
                        let index = mesh.positions.len() as u32 - 1;
                        known.insert(corner, index);
                        index
                    }
                };
            }
            mesh.triangles.push(vertices);
        }
        Ok(mesh)
    }

    /// Adds a vertex. One without a normal or texture coordinates among others that have them gets zeros, as in Mitsuba.
    fn vertex(&self, [position, uv, normal]: Corner, mapped: bool, smooth: bool, mesh: &mut RawMesh) -> Option<()> {
        mesh.positions.push(*self.positions.get(position as usize)?);
        if mapped {
            mesh.uvs.push(if uv == NONE { DVec2::ZERO } else { *self.uvs.get(uv as usize)? });
        }
        if smooth {
            mesh.normals.push(if normal == NONE { DVec3::ZERO } else { *self.normals.get(normal as usize)? });
        }
        Some(())
    }
}

/// The words of a line.
struct Words<'l>(&'l [u8]);

impl<'l> Iterator for Words<'l> {
    type Item = &'l [u8];

    #[inline]
    fn next(&mut self) -> Option<&'l [u8]> {
        let line = self.0.trim_ascii_start();
        let end = line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len());
        let (word, rest) = line.split_at(end);
        self.0 = rest;
        Some(word).filter(|word| !word.is_empty())
    }
}

/// The first three numbers of a line, which has at least `least`; missing ones are zero.
fn numbers(mut words: Words<'_>, least: usize) -> Result<[f64; 3], String> {
    let mut result = [0.0; 3];
    for (i, slot) in result.iter_mut().enumerate() {
        match words.next() {
            None if i < least => return Err(format!("it has fewer than {least} numbers")),
            None => break,
            Some(word) => {
                let number = fast_float2::parse(word);
                *slot = number.map_err(|_| format!("`{}` is not a number", String::from_utf8_lossy(word)))?;
            }
        }
    }
    Ok(result)
}

/// `v`, `v/vt`, `v//vn` or `v/vt/vn` with indices from 1, or from -1 backwards through `counts`.
fn corner(word: &[u8], counts: [usize; 3]) -> Option<Corner> {
    let mut corner = [NONE; 3];
    for (i, part) in word.split(|byte| *byte == b'/').enumerate() {
        if part.is_empty() && i > 0 {
            continue;
        }
        let index = match integer(part)? {
            number @ 1.. => number - 1,
            0 => return None,
            number => (counts.get(i).copied()? as i64).checked_add(number)?,
        };
        *corner.get_mut(i)? = u32::try_from(index).ok().filter(|index| *index != NONE)?;
    }
    Some(corner)
}

/// A whole number of so few digits that it fits.
#[inline]
fn integer(word: &[u8]) -> Option<i64> {
    let (sign, digits) = match word {
        [b'-', digits @ ..] => (-1, digits),
        [b'+', digits @ ..] => (1, digits),
        digits => (1, digits),
    };
    let append = |number: i64, digit: &u8| digit.is_ascii_digit().then(|| 10 * number + i64::from(digit - b'0'));
    let digits = Some(digits).filter(|digits| (1..=18).contains(&digits.len()))?;
    digits.iter().try_fold(0, append).map(|number| sign * number)
}

/// The text with lines that end in a backslash joined to the next, at the same line numbers.
fn joined(bytes: &[u8]) -> Cow<'_, [u8]> {
    if memchr::memchr(b'\\', bytes).is_none() {
        return Cow::Borrowed(bytes);
    }
    let mut text = Vec::with_capacity(bytes.len());
    let mut owed = 0;
    for line in bytes.split(|byte| *byte == b'\n') {
        let line = line.strip_suffix(b"\r").unwrap_or(line);
        if let Some(start) = line.strip_suffix(b"\\") {
            text.extend_from_slice(start);
            text.push(b' ');
            owed += 1;
        } else {
            text.extend_from_slice(line);
            text.resize(text.len() + 1 + owed, b'\n');
            owed = 0;
        }
    }
    Cow::Owned(text)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn polygons_groups_and_continued_lines_are_read() {
        let text = b"# \xff\nmtllib none.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\ng a\nf 1 2 \\\n 3 4\no b\nusemtl c\nf -1 -2 -3\nl 1 2\n";
        let mesh = read(text, true).unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [3, 2, 1]]);
        assert_eq!(mesh.positions[2], DVec3::new(1.0, 1.0, 0.0));
        assert!(mesh.normals.is_empty() && mesh.uvs.is_empty());
    }

    /// Corners with and without normals and texture coordinates stand side by side.
    #[test]
    fn corners_are_told_apart_by_all_their_indices() {
        let text =
            b"v 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0.25\nvt 1\nvn 0 0 2\nf 1/1/1 2/2/1 3/1/1\nf 1/2 2/2/1 3//1\nf 1 2 3\n";
        let mesh = read(text, true).unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [3, 1, 4], [5, 6, 7]]);
        assert_eq!(mesh.uvs[..2], [DVec2::new(0.0, 0.75), DVec2::new(1.0, 1.0)]);
        assert_eq!((mesh.normals[0], mesh.normals[5]), (DVec3::new(0.0, 0.0, 2.0), DVec3::ZERO));
        assert_eq!(read(text, false).unwrap().uvs[0], DVec2::new(0.0, 0.25));
    }

    #[test]
    fn bad_files_are_explained() {
        let missing = "a face refers to a vertex that does not exist";
        let cases = [
            ("", "it contains no faces".to_owned()),
            ("v 0 0\nf 1 1 1", "line 1: it has fewer than 3 numbers".to_owned()),
            ("v 0 0 z\nf 1 1 1", "line 1: `z` is not a number".to_owned()),
            ("v 0 0 0\nf 1 1 2", format!("line 2: {missing}")),
            ("v 0 0 0\nf 1 1 -2", "line 2: `-2` is not a corner of a face".to_owned()),
            ("v 0 0 0\nv 0 0 0 \\\n\nf 1 0 1", "line 4: `0` is not a corner of a face".to_owned()),
            (
                "v 0 0 0\nf 1/1 1/-9223372036854775808 1",
                "line 2: `1/-9223372036854775808` is not a corner of a face".to_owned(),
            ),
            ("v 0 0 0\nf 1/1/1/1 1 1", "line 2: `1/1/1/1` is not a corner of a face".to_owned()),
            ("v 0 0 0\nf 1//1 1//1 1//1", format!("line 2: {missing}")),
        ];
        for (text, message) in cases {
            assert_eq!(read(text.as_bytes(), true).err(), Some(message), "{text}");
        }
    }
}
