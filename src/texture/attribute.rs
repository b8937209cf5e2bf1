//! Textures that lie on the faces of one mesh: values of its vertices or of its faces.
//!
//! A shape that has one is *charted*: the place where its textures are looked up tells the triangle and the barycentric
//! coordinates there, in place of texture coordinates. Other textures on it are [`Draped`].

use super::Texture;
use crate::spectrum::Spectrum;
use glam::{DVec2, Vec2, Vec3};
use std::sync::Arc;

/// Triangles lie in rows of so many, so that corners are exact in single precision.
const ROW: u32 = 1 << 12;

/// The place, in the chart of its mesh, of the point at the barycentric coordinates `at` of the second and the third
/// corner of a triangle. Each triangle has a square of two by two for itself, with room for rounding around.
#[inline]
pub fn place(triangle: u32, at: DVec2) -> DVec2 {
    origin(triangle) + at
}

#[inline]
fn origin(triangle: u32) -> DVec2 {
    DVec2::new(f64::from(triangle % ROW), f64::from(triangle / ROW)) * 2.0 + 0.5
}

/// The triangle at a place in the chart, and the weights of its corners.
#[inline]
fn find(place: DVec2) -> (usize, [f64; 3]) {
    let cell = (place * 0.5).floor();
    let triangle = cell.x as u32 + cell.y as u32 * ROW;
    let at = place - origin(triangle);
    (triangle as usize, [1.0 - at.x - at.y, at.x, at.y])
}

/// A value for each vertex or face of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Attribute {
    /// The vertices of each triangle; `None` where the values are those of the triangles.
    pub triangles: Option<Arc<[[u32; 3]]>>,
    /// The values, grey ones in all three channels.
    pub values: Arc<[Vec3]>,
    /// Factor on the values.
    pub scale: f64,
}

impl Attribute {
    #[inline]
    pub(super) fn colour(&self, place: DVec2) -> Spectrum {
        let (triangle, weights) = find(place);
        let value = |index: usize| self.values[index].as_dvec3();
        let found = match &self.triangles {
            None => value(triangle),
            Some(triangles) => {
                let [a, b, c] = triangles[triangle].map(|vertex| value(vertex as usize));
                a * weights[0] + b * weights[1] + c * weights[2]
            }
        };
        let [r, g, b] = (found * self.scale).to_array();
        Spectrum::rgb(r, g, b)
    }

    pub(super) fn mean(&self) -> Spectrum {
        let sum = self.values.iter().map(|value| value.as_dvec3()).sum::<glam::DVec3>();
        let [r, g, b] = (sum * (self.scale / self.values.len().max(1) as f64)).to_array();
        Spectrum::rgb(r, g, b)
    }
}

/// A texture by texture coordinates, on a charted shape.
#[derive(Clone, Debug, PartialEq)]
pub struct Draped {
    /// The vertices of each triangle.
    pub triangles: Arc<[[u32; 3]]>,
    /// Texture coordinates per vertex; barycentric ones stand in where there are none.
    pub uvs: Arc<[Vec2]>,
    /// The texture.
    pub texture: Arc<Texture>,
}

impl Draped {
    pub(super) fn colour(&self, place: DVec2) -> Spectrum {
        let (triangle, weights) = find(place);
        let uv = |index: u32| self.uvs[index as usize].as_dvec2();
        self.texture.colour(match self.uvs.is_empty() {
            true => DVec2::new(weights[1], weights[2]),
            false => {
                let [a, b, c] = self.triangles[triangle].map(uv);
                a * weights[0] + b * weights[1] + c * weights[2]
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::texture::Checkerboard;
    use glam::DAffine2;

    #[test]
    fn the_chart_tells_triangles_apart() {
        for triangle in [0, 1, ROW - 1, ROW, 123_456_789, (1 << 28) - 1] {
            let corners = [DVec2::ZERO, DVec2::X, DVec2::Y];
            for (i, corner) in corners.into_iter().enumerate() {
                // Corners survive single precision, and rounding leads to no other triangle.
                let exact = place(triangle, corner);
                assert_eq!(exact.as_vec2().as_dvec2(), exact);
                let (found, weights) = find(exact - 1e-9);
                assert_eq!(found, triangle as usize);
                assert!((weights[i] - 1.0).abs() < 1e-8, "{weights:?}");
            }
        }
    }

    #[test]
    fn vertices_are_interpolated_and_faces_are_even() {
        let triangles: Arc<[[u32; 3]]> = Arc::new([[0, 1, 2], [2, 1, 3]]);
        let values: Arc<[Vec3]> = (0..4).map(|i| Vec3::new(i as f32, 1.0, 0.0)).collect();
        let at = place(1, DVec2::new(0.25, 0.5));
        let smooth = Attribute { triangles: Some(triangles.clone()), values: values.clone(), scale: 2.0 };
        assert_eq!(smooth.colour(at).to_rgb(), [2.0 * (0.25 * 2.0 + 0.25 + 0.5 * 3.0), 2.0, 0.0]);
        let flat = Attribute { triangles: None, values, scale: 1.0 };
        assert_eq!(flat.colour(at).to_rgb(), [1.0, 1.0, 0.0]);
        assert_eq!(flat.mean().to_rgb(), [1.5, 1.0, 0.0]);
    }

    #[test]
    fn other_textures_keep_their_coordinates() {
        let colours = [Spectrum::grey(0.1), Spectrum::grey(0.9)];
        let texture = Arc::new(Texture::Checkerboard(Checkerboard { colours, to_uv: DAffine2::IDENTITY }));
        let uvs = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(Vec2::from);
        let draped = Draped { triangles: Arc::new([[0, 1, 2], [0, 2, 3]]), uvs: Arc::new(uvs), texture };
        // (0.2, 0.7): the second triangle, by its corners (0, 0), (1, 1), (0, 1).
        assert_eq!(draped.colour(place(1, DVec2::new(0.2, 0.5))), colours[1]);
        let bare = Draped { uvs: Arc::new([]), ..draped };
        assert_eq!(bare.colour(place(1, DVec2::new(0.2, 0.3))), colours[0]);
    }
}
