//! Shading frames that textures tilt: bump maps (Blinn 1978) and normal maps.

use crate::math::Frame;
use crate::texture::{ReliefMap, Texture};
use glam::{DVec2, DVec3};

/// Step of the differences that slopes are taken from: far below the size of a texel, far above rounding.
const STEP: f64 = 1e-6;

/// The shading frame of `normal` whose tangent follows `along`, the derivative of the position by u.
#[inline]
pub(super) fn oriented(normal: DVec3, along: DVec3) -> Frame {
    match (along - normal * normal.dot(along)).try_normalize() {
        Some(tangent) => Frame { tangent, bitangent: normal.cross(tangent), normal },
        None => Frame::around(normal),
    }
}

/// The frame as `map` tilts it; `derivatives` are those of the position by u and v. Slopes are slopes by the texture
/// coordinates `uv`; all other textures are looked up at `place`.
pub(super) fn tilted(frame: Frame, map: &ReliefMap, [place, uv]: [DVec2; 2], derivatives: [DVec3; 2]) -> Frame {
    let normal = frame.normal;
    match map {
        ReliefMap::Bump { texture, scale } => {
            let slopes = slopes(texture, uv) * *scale;
            let [along_u, along_v] = derivatives;
            let along_u = along_u + normal * (slopes.x - normal.dot(along_u));
            let along_v = along_v + normal * (slopes.y - normal.dot(along_v));
            let Some(tilted) = along_u.cross(along_v).try_normalize() else { return frame };
            oriented(if tilted.dot(normal) < 0.0 { -tilted } else { tilted }, along_u)
        }
        ReliefMap::Normal { texture } => {
            let [x, y, z] = texture.colour(place).to_rgb();
            let local = DVec3::new(2.0 * x - 1.0, 2.0 * y - 1.0, 2.0 * z - 1.0);
            match frame.to_world(local).try_normalize() {
                Some(tilted) => oriented(tilted, derivatives[0]),
                None => frame,
            }
        }
    }
}

/// Derivatives of a texture's luminance by u and v.
fn slopes(texture: &Texture, uv: DVec2) -> DVec2 {
    let height = |offset: DVec2| texture.colour(uv + offset).luminance();
    let along = |axis: DVec2| (height(axis * STEP) - height(axis * -STEP)) / (2.0 * STEP);
    DVec2::new(along(DVec2::X), along(DVec2::Y))
}

/// Derivatives of the position by texture coordinates on a triangle; any two tangents where these do not span the plane.
#[inline]
pub(super) fn derivatives(corners: [DVec3; 3], uvs: [DVec2; 3], normal: DVec3) -> [DVec3; 2] {
    let [p, q] = [corners[1] - corners[0], corners[2] - corners[0]];
    let [a, b] = [uvs[1] - uvs[0], uvs[2] - uvs[0]];
    let determinant = a.x * b.y - a.y * b.x;
    if determinant == 0.0 {
        let Frame { tangent, bitangent, .. } = Frame::around(normal);
        return [tangent, bitangent];
    }
    [(p * b.y - q * a.y) / determinant, (q * a.x - p * b.x) / determinant]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spectrum::Spectrum;
    use crate::texture::Checkerboard;
    use glam::DAffine2;
    use std::sync::Arc;

    #[test]
    fn a_flat_normal_map_changes_nothing() {
        let flat = Checkerboard { colours: [Spectrum::rgb(0.5, 0.5, 1.0); 2], to_uv: DAffine2::IDENTITY };
        let map = ReliefMap::Normal { texture: Arc::new(Texture::Checkerboard(flat)) };
        let frame = oriented(DVec3::Z, DVec3::new(3.0, 4.0, 1.0));
        let same = tilted(frame, &map, [DVec2::new(0.2, 0.3); 2], [DVec3::new(3.0, 4.0, 1.0), DVec3::X]);
        assert!((same.normal - DVec3::Z).length() < 1e-12 && (same.tangent - frame.tangent).length() < 1e-12);
        assert!((frame.tangent - DVec3::new(0.6, 0.8, 0.0)).length() < 1e-12);
    }

    #[test]
    fn derivatives_are_those_of_the_plane() {
        let position = |uv: DVec2| DVec3::new(1.0 + 2.0 * uv.x, 3.0 - uv.y, uv.x + uv.y);
        let uvs = [DVec2::new(0.1, 0.2), DVec2::new(0.7, 0.1), DVec2::new(0.3, 0.9)];
        let [u, v] = derivatives(uvs.map(position), uvs, DVec3::Z);
        assert!((u - DVec3::new(2.0, 0.0, 1.0)).length() < 1e-12 && (v - DVec3::new(0.0, -1.0, 1.0)).length() < 1e-12);
    }
}
