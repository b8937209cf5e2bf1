//! Triangle meshes on their way into the world.

use super::attributes::RawAttribute;
use super::transform::normal_matrix;
use crate::scene::Mesh;
use glam::{DAffine3, DVec2, DVec3};

/// A mesh in its own space.
#[derive(Clone, Debug, Default)]
pub(super) struct RawMesh {
    pub positions: Vec<DVec3>,
    /// One per position, of any length; empty where the file has none.
    pub normals: Vec<DVec3>,
    /// Texture coordinates per position; empty where the file has none.
    pub uvs: Vec<DVec2>,
    pub triangles: Vec<[u32; 3]>,
    /// Further values, where they were asked for.
    pub attributes: Vec<RawAttribute>,
    /// Whether the file itself asks for flat faces.
    pub face_normals: bool,
}

/// What a shape says about its normals.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Facing {
    /// Flat faces, whatever normals there are.
    pub face_normals: bool,
    /// The other side is the outside.
    pub flip_normals: bool,
}

impl RawMesh {
    /// The mesh in world space, with normals as Mitsuba 3 has them: those of the file, moved by the inverse transpose;
    /// where the file has none, they are averaged over the faces as these lie in the world; with `face_normals` there
    /// are none, and faces look to where their corners turn counter-clockwise in the world.
    pub fn place(self, to_world: &DAffine3, facing: Facing) -> Mesh {
        let positions: Vec<_> = self.positions.iter().map(|p| to_world.transform_point3(*p)).collect();
        let normal_matrix = normal_matrix(to_world);
        let mut normals: Vec<_> = match (facing.face_normals || self.face_normals, self.normals.is_empty()) {
            (true, _) => Vec::new(),
            (false, true) => average_normals(&positions, &self.triangles),
            (false, false) => self.normals.iter().map(|n| (normal_matrix * *n).normalize_or_zero()).collect(),
        };
        let mut triangles = self.triangles;
        if facing.flip_normals {
            normals.iter_mut().for_each(|normal| *normal = -*normal);
        }
        for triangle in &mut triangles {
            // Mitsuba shades and shines by the vertex normals: let the corners turn with them.
            let [a, b, c] = triangle.map(|i| i as usize);
            let turns_away = match normals.is_empty() {
                true => facing.flip_normals,
                false => face(&positions, *triangle).dot(normals[a] + normals[b] + normals[c]) < 0.0,
            };
            if turns_away {
                triangle.swap(1, 2);
            }
        }
        Mesh {
            positions: positions.iter().map(|p| p.as_vec3()).collect(),
            normals: normals.iter().map(|n| n.as_vec3()).collect(),
            uvs: self.uvs.iter().map(|uv| uv.as_vec2()).collect(),
            triangles,
            charted: false,
        }
    }

    /// The mesh in world space with flat faces, outside kept outside: for the built-in shapes, whose normals Mitsuba
    /// moves by the inverse transpose. A mirrored shape would turn inside out otherwise.
    pub fn place_solid(self, to_world: &DAffine3, flip_normals: bool) -> Mesh {
        let mirrored = to_world.matrix3.determinant() < 0.0;
        self.place(to_world, Facing { face_normals: true, flip_normals: flip_normals != mirrored })
    }
}

/// Normal of a face, as long as twice its area.
fn face(positions: &[DVec3], triangle: [u32; 3]) -> DVec3 {
    let [a, b, c] = triangle.map(|i| positions[i as usize]);
    (b - a).cross(c - a)
}

/// Face normals averaged at the vertices, weighted by the angle of the face there (Thürmer and Wüthrich 1998,
/// *Computing Vertex Normals from Polygonal Facets*).
fn average_normals(positions: &[DVec3], triangles: &[[u32; 3]]) -> Vec<DVec3> {
    let mut sums = vec![DVec3::ZERO; positions.len()];
    for triangle in triangles {
        let normal = face(positions, *triangle).normalize_or_zero();
        let corners = triangle.map(|i| positions[i as usize]);
        for i in 0..3 {
            let here = corners[i];
            let (next, previous) = (corners[(i + 1) % 3] - here, corners[(i + 2) % 3] - here);
            let angle = next.normalize_or_zero().dot(previous.normalize_or_zero()).clamp(-1.0, 1.0).acos();
            sums[triangle[i] as usize] += normal * angle;
        }
    }
    sums.iter().map(|sum| sum.normalize_or_zero()).collect()
}

/// [-1, 1]² at z = 0, normal +z.
pub(super) fn rectangle() -> RawMesh {
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(DVec2::from);
    RawMesh {
        positions: corners.iter().map(|corner| corner.extend(0.0)).collect(),
        uvs: corners.iter().map(|corner| (*corner + DVec2::ONE) / 2.0).collect(),
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        ..RawMesh::default()
    }
}

/// Corners of the faces of a cube, counter-clockwise from outside. Mitsuba's order, since it places the texture.
const CUBE: [[[f64; 3]; 4]; 6] = [
    [[1.0, -1.0, -1.0], [1.0, -1.0, 1.0], [-1.0, -1.0, 1.0], [-1.0, -1.0, -1.0]],
    [[1.0, 1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, 1.0, 1.0], [1.0, 1.0, 1.0]],
    [[1.0, -1.0, -1.0], [1.0, 1.0, -1.0], [1.0, 1.0, 1.0], [1.0, -1.0, 1.0]],
    [[1.0, -1.0, 1.0], [1.0, 1.0, 1.0], [-1.0, 1.0, 1.0], [-1.0, -1.0, 1.0]],
    [[-1.0, -1.0, 1.0], [-1.0, 1.0, 1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, -1.0]],
    [[1.0, 1.0, -1.0], [1.0, -1.0, -1.0], [-1.0, -1.0, -1.0], [-1.0, 1.0, -1.0]],
];

/// [-1, 1]³, normals outwards; the whole texture on each face.
pub(super) fn cube() -> RawMesh {
    let corners = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]].map(DVec2::from);
    RawMesh {
        positions: CUBE.as_flattened().iter().map(|corner| DVec3::from(*corner)).collect(),
        uvs: corners.repeat(6),
        triangles: (0..6).flat_map(|face| [[0, 1, 2], [3, 0, 2]].map(|t| t.map(|i| 4 * face + i))).collect(),
        ..RawMesh::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Texture coordinates of the mesh straight below the point (x, y), on the face that looks up.
    fn uv_below(mesh: &RawMesh, x: f64, y: f64) -> Option<DVec2> {
        mesh.triangles.iter().find_map(|triangle| {
            let [a, b, c] = triangle.map(|i| mesh.positions[i as usize]);
            let normal = (b - a).cross(c - a);
            let at = DVec3::new(x, y, a.z);
            let weights = [[b, c], [c, a], [a, b]].map(|[p, q]| (p - at).cross(q - at).z / normal.z);
            let inside = normal.z > 0.0 && weights.iter().all(|weight| *weight >= 0.0);
            inside.then(|| triangle.iter().zip(weights).map(|(i, weight)| mesh.uvs[*i as usize] * weight).sum())
        })
    }

    /// What Mitsuba 3.9.1 answers at the same points.
    #[test]
    fn textures_lie_as_in_mitsuba() {
        for (mesh, expected) in [(rectangle(), [0.6, 0.35]), (cube(), [0.35, 0.6])] {
            let found = uv_below(&mesh, 0.2, -0.3);
            assert!(found.is_some_and(|uv| (uv - DVec2::from(expected)).length() < 1e-12), "{found:?}");
        }
    }
}
