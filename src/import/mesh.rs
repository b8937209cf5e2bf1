//! Triangle meshes and the files that they are written to.

use glam::{DAffine3, DVec2, DVec3};

/// A mesh in its own space.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Mesh {
    pub positions: Vec<DVec3>,
    /// One per position, or none at all: then its faces are flat.
    pub normals: Vec<DVec3>,
    /// One per position, or none at all; v as in pbrt.
    pub uvs: Vec<DVec2>,
    pub triangles: Vec<[u32; 3]>,
}

impl Mesh {
    /// The mesh with its other side out. pbrt turns the faces of mirrored meshes back, Mitsuba does not: `mirrored`
    /// says whether the mesh will be.
    pub fn facing(mut self, reversed: bool, mirrored: bool) -> Self {
        if reversed {
            self.normals.iter_mut().for_each(|normal| *normal = -*normal);
        }
        if reversed != mirrored {
            self.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
        }
        self
    }

    /// Its area after a transformation.
    pub fn area(&self, transform: &DAffine3) -> f64 {
        let corner =
            |index: u32| self.positions.get(index as usize).map_or(DVec3::ZERO, |p| transform.transform_point3(*p));
        let area = |[a, b, c]: [DVec3; 3]| 0.5 * (b - a).cross(c - a).length();
        self.triangles.iter().map(|triangle| area(triangle.map(corner))).sum()
    }

    /// The mesh as binary PLY. Mitsuba has the first row of images at v = 0, pbrt at v = 1.
    pub fn to_ply(&self) -> Vec<u8> {
        let mut header = format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float y\nproperty float z\n",
            self.positions.len()
        );
        if !self.normals.is_empty() {
            header += "property float nx\nproperty float ny\nproperty float nz\n";
        }
        if !self.uvs.is_empty() {
            header += "property float u\nproperty float v\n";
        }
        header +=
            &format!("element face {}\nproperty list uchar int vertex_indices\nend_header\n", self.triangles.len());
        let mut bytes = header.into_bytes();
        let mut put = |values: &[f64]| values.iter().for_each(|v| bytes.extend((*v as f32).to_le_bytes()));
        for (index, position) in self.positions.iter().enumerate() {
            put(&position.to_array());
            if let Some(normal) = self.normals.get(index) {
                put(&normal.to_array());
            }
            if let Some(uv) = self.uvs.get(index) {
                put(&[uv.x, 1.0 - uv.y]);
            }
        }
        for triangle in &self.triangles {
            bytes.push(3);
            triangle.iter().for_each(|index| bytes.extend(index.to_le_bytes()));
        }
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn meshes_turn_over() {
        let mesh = Mesh {
            positions: vec![DVec3::ZERO, DVec3::X, DVec3::Y],
            normals: vec![DVec3::Z; 3],
            uvs: Vec::new(),
            triangles: vec![[0, 1, 2]],
        };
        assert_eq!(mesh.area(&DAffine3::from_scale(DVec3::splat(2.0))), 2.0);
        let mirrored = mesh.clone().facing(false, true);
        assert_eq!((mirrored.triangles[0], mirrored.normals[0]), ([0, 2, 1], DVec3::Z));
        let both = mesh.facing(true, true);
        assert_eq!((both.triangles[0], both.normals[0]), ([0, 1, 2], -DVec3::Z));
    }
}
