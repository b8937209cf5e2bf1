//! Wavefront OBJ. Groups and materials are left aside: they do not change the shape, and Mitsuba does the same.

use super::guard;
use super::mesh::RawMesh;
use glam::DVec3;
use std::borrow::Cow;
use std::io::Cursor;

/// Most characters of an index: larger ones cannot be right, and would overflow.
const INDEX_LENGTH: usize = 11;

/// Reads the mesh in `bytes`. Polygons become fans of triangles; points and lines are left out.
pub(super) fn read(bytes: &[u8]) -> Result<RawMesh, String> {
    let geometry = geometry(bytes)?;
    let options = tobj::LoadOptions { single_index: true, triangulate: true, ignore_points: true, ignore_lines: true };
    let no_materials = |_: &std::path::Path| Ok(Default::default());
    let load = || tobj::load_obj_buf(&mut Cursor::new(&geometry), &options, no_materials);
    let (models, _) = guard(load)?.map_err(|error| error.to_string())?;
    let no_faces = || "it contains no faces".to_owned();
    let model = models.first().filter(|model| !model.mesh.indices.is_empty()).ok_or_else(no_faces)?;
    let triples = |flat: &[f32]| -> Vec<DVec3> {
        flat.chunks_exact(3).map(|c| DVec3::new(c[0].into(), c[1].into(), c[2].into())).collect()
    };
    let mesh = RawMesh {
        positions: triples(&model.mesh.positions),
        normals: triples(&model.mesh.normals),
        triangles: model.mesh.indices.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
    };
    if !mesh.normals.is_empty() && mesh.normals.len() != mesh.positions.len() {
        return Err("some faces have normals and others have none".to_owned());
    }
    Ok(mesh)
}

/// The lines of `bytes` that describe vertices and faces. Faces are checked, so that a bad one is named by its line.
fn geometry(bytes: &[u8]) -> Result<Vec<u8>, String> {
    let mut kept = Vec::with_capacity(bytes.len());
    // Vertices, texture coordinates and normals so far.
    let mut counts = [0; 3];
    for (index, line) in joined(bytes).split(|byte| *byte == b'\n').enumerate() {
        let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        match words.next() {
            Some(b"v") => counts[0] += 1,
            Some(b"vt") => counts[1] += 1,
            Some(b"vn") => counts[2] += 1,
            Some(b"f") => {
                if let Some(word) = words.find(|word| !is_corner(word, counts)) {
                    let word = String::from_utf8_lossy(word);
                    return Err(format!("line {}: `{word}` is not a corner of a face", index + 1));
                }
            }
            _ => continue,
        }
        kept.extend_from_slice(line);
        kept.push(b'\n');
    }
    Ok(kept)
}

/// The text with lines that end in a backslash joined to the next, at the same line numbers.
fn joined(bytes: &[u8]) -> Cow<'_, [u8]> {
    if !bytes.windows(2).any(|pair| pair == b"\\\n" || pair == b"\\\r") {
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

/// Whether `word` is `v`, `v/vt`, `v//vn` or `v/vt/vn` with indices from 1, or from -1 backwards through `counts`.
fn is_corner(word: &[u8], counts: [i64; 3]) -> bool {
    let parts: Vec<_> = word.split(|byte| *byte == b'/').collect();
    let valid = |(part, count): (&&[u8], i64)| {
        let number = std::str::from_utf8(part).ok().filter(|text| text.len() <= INDEX_LENGTH);
        number
            .and_then(|text| text.parse::<i64>().ok())
            .is_some_and(|index| index > 0 || (index < 0 && -index <= count))
    };
    let empty_middle = parts.len() == 3 && parts[1].is_empty();
    parts.len() <= 3 && parts.iter().zip(counts).enumerate().all(|(i, part)| (i == 1 && empty_middle) || valid(part))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    #[test]
    fn polygons_groups_and_continued_lines_are_read() {
        let text = b"# \xff\nmtllib none.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\ng a\nf 1 2 \\\n 3 4\no b\nusemtl c\nf -1 -2 -3\nl 1 2\n";
        let mesh = read(text).unwrap();
        assert_eq!(mesh.triangles, [[0, 1, 2], [0, 2, 3], [3, 2, 1]]);
        assert_eq!(mesh.positions[2], DVec3::new(1.0, 1.0, 0.0));
        assert!(mesh.normals.is_empty());
    }

    #[test]
    fn bad_files_are_explained() {
        let cases: [(&str, &str); 8] = [
            ("", "it contains no faces"),
            ("v 0 0\nf 1 1 1", "position parse error"),
            ("v 0 0 0\nf 1 1 2", "face vertex index out of bounds"),
            ("v 0 0 0\nf 1 1 -2", "line 2: `-2` is not a corner of a face"),
            ("v 0 0 0\nv 0 0 0 \\\n\nf 1 0 1", "line 4: `0` is not a corner of a face"),
            ("v 0 0 0\nf 1/1 1/-9223372036854775808 1", "line 2: `1/-9223372036854775808` is not a corner of a face"),
            ("v 0 0 0\nf 1//1 1//1 1//1", "it contains no faces"),
            ("v 0 0 0\nvn 0 0 1\nf 1//1 1 1//1", "some faces have normals and others have none"),
        ];
        for (text, message) in cases {
            match read(text.as_bytes()) {
                Err(found) => assert_eq!(found, message, "{text}"),
                // Indices of normals that are not there are ignored where there are none at all.
                Ok(mesh) => assert!(mesh.normals.is_empty() && text.contains("//1 1//1"), "{text}"),
            }
        }
    }
}
