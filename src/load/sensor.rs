//! `<sensor>` and the `<film>` inside.

use super::document::Element;
use super::error::LoadError;
use super::plugin::Plugin;
use crate::camera::Camera;
use crate::film::Filter;
use crate::math::Frame;
use crate::scene::FilmSpec;
use glam::{DAffine3, DVec2};

const KINDS: [&str; 2] = ["perspective", "thinlens"];

/// Width and height of a film that does not say.
const DEFAULT_SIZE: [i64; 2] = [768, 576];

/// Most pixels along an axis, and on the film.
const MOST: [usize; 2] = [1 << 16, 1 << 28];

/// Largest cosine between axes of a camera that counts as a right angle: matrices in scene files are rounded.
const SKEW_TOLERANCE: f64 = 1e-3;

/// Reads a camera; `size` takes the place of the film's.
pub(super) fn read(element: Element<'_>, size: Option<[usize; 2]>) -> Result<(Camera, FilmSpec), LoadError> {
    let mut plugin = Plugin::new(element)?;
    if !KINDS.contains(&plugin.kind) {
        return Err(plugin.unknown(&KINDS));
    }
    plugin.objects("sampler")?;
    let mut film = plugin.object("film")?.map_or(Ok(default_film()), film)?;
    film.size = size.unwrap_or(film.size);
    let (to_world, transform) = plugin.to_world()?;
    let half = half_extent(&mut plugin, film.size)?;
    plugin.ignore(&["near_clip", "shutter_open", "shutter_close"]);
    // Mitsuba focuses at the far clipping plane where nothing else is said.
    let far_clip = plugin.positive("far_clip")?.unwrap_or(1e4);
    let focus_distance = plugin.positive("focus_distance")?.unwrap_or(far_clip);
    let lens_radius = match plugin.kind {
        "thinlens" => {
            let radius = plugin.float("aperture_radius")?.ok_or_else(|| plugin.lacks("aperture_radius"))?;
            radius.check(|radius| *radius >= 0.0, "a number of at least 0")?
        }
        _ => 0.0,
    };
    plugin.finish()?;
    let axes = axes(&to_world).ok_or_else(|| {
        transform.error("the axes of this camera are not at right angles; expected a `to_world` without shear")
    })?;
    Ok((Camera { origin: to_world.translation, axes, size: film.size, half, lens_radius, focus_distance }, film))
}

/// Orthonormal axes of a camera. Scale is left aside; left-handed axes stay left-handed.
fn axes(to_world: &DAffine3) -> Option<Frame> {
    let [x, y, z] = [0, 1, 2].map(|i| to_world.matrix3.col(i).normalize());
    let skew = [x.dot(y), y.dot(z), z.dot(x)].map(f64::abs).into_iter().fold(0.0, f64::max);
    // Not a number where an axis has no length.
    if !(skew <= SKEW_TOLERANCE) {
        return None;
    }
    let bitangent = (y - z * y.dot(z)).normalize();
    let tangent = bitangent.cross(z);
    Some(Frame { tangent: tangent * tangent.dot(x).signum(), bitangent, normal: z })
}

/// Tangents of half the fields of view along x and y.
fn half_extent(plugin: &mut Plugin<'_>, size: [usize; 2]) -> Result<DVec2, LoadError> {
    let fov = plugin.float("fov")?.ok_or_else(|| plugin.lacks("fov"))?;
    let fov = fov.check(|fov| *fov > 0.0 && *fov < 180.0, "an angle between 0 and 180 degrees")?;
    let tangent = (0.5 * fov.to_radians()).tan();
    let aspect = size[0] as f64 / size[1] as f64;
    let (along_x, along_y) = (DVec2::new(tangent, tangent / aspect), DVec2::new(tangent * aspect, tangent));
    let Some(axis) = plugin.string("fov_axis")? else {
        return Ok(along_x);
    };
    match axis.value.text {
        "x" => Ok(along_x),
        "y" => Ok(along_y),
        "smaller" => Ok(if aspect > 1.0 { along_y } else { along_x }),
        "larger" => Ok(if aspect > 1.0 { along_x } else { along_y }),
        "diagonal" => Ok(DVec2::new(aspect, 1.0).normalize() * tangent),
        _ => Err(axis.refuse("one of x, y, diagonal, smaller, larger")),
    }
}

fn default_film() -> FilmSpec {
    FilmSpec { size: DEFAULT_SIZE.map(|pixels| pixels as usize), filter: Filter::Gaussian { stddev: 0.5 } }
}

fn film(element: Element<'_>) -> Result<FilmSpec, LoadError> {
    let mut plugin = Plugin::new(element)?;
    if plugin.kind != "hdrfilm" {
        return Err(plugin.unknown(&["hdrfilm"]));
    }
    // How the image is written is decided on the command line.
    plugin.ignore(&["file_format", "pixel_format", "component_format", "banner", "filename", "sample_border"]);
    let mut pixels = |name, default| {
        let Some(count) = plugin.integer(name)? else {
            return Ok(default);
        };
        count.check(|count| (1..=MOST[0] as i64).contains(count), &format!("1 to {} pixels", MOST[0]))
    };
    let size = [pixels("width", DEFAULT_SIZE[0])?, pixels("height", DEFAULT_SIZE[1])?].map(|pixels| pixels as usize);
    check_size(size).map_err(|message| element.error(message))?;
    let filter = plugin.object("rfilter")?.map_or(Ok(default_film().filter), filter)?;
    plugin.finish()?;
    Ok(FilmSpec { size, filter })
}

/// Refuses films without pixels, and those that would not fit into memory.
pub(super) fn check_size([width, height]: [usize; 2]) -> Result<(), String> {
    let [side, area] = MOST;
    let fits = (1..=side).contains(&width) && (1..=side).contains(&height) && width * height <= area;
    let expected = format!("expected 1 to {side} pixels each way and at most {area} in all");
    if fits { Ok(()) } else { Err(format!("an image of {width} × {height} pixels; {expected}")) }
}

fn filter(element: Element<'_>) -> Result<Filter, LoadError> {
    let mut plugin = Plugin::new(element)?;
    let filter = match plugin.kind {
        "box" => Filter::Box,
        "tent" => Filter::Tent,
        "gaussian" => {
            let stddev = plugin.float("stddev")?;
            let in_range = |stddev: &f64| *stddev > 0.0 && *stddev <= 16.0;
            let stddev = stddev.map(|s| s.check(in_range, "a number above 0 and at most 16")).transpose()?;
            Filter::Gaussian { stddev: stddev.unwrap_or(0.5) }
        }
        _ => return Err(plugin.unknown(&["box", "tent", "gaussian"])),
    };
    plugin.finish()?;
    Ok(filter)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use glam::{DMat3, DVec3};

    #[test]
    fn axes_are_orthonormal_and_keep_their_hand() {
        for x in [2.0, -2.0] {
            let turn = DMat3::from_rotation_y(0.3) * DMat3::from_rotation_x(1.1);
            let rounded = turn.as_mat3().as_dmat3() * DMat3::from_diagonal(DVec3::new(x, 3.0, 0.5));
            let frame = axes(&DAffine3::from_mat3(rounded)).unwrap();
            assert!((frame.normal - turn.z_axis).length() < 1e-6);
            assert!((frame.bitangent - turn.y_axis).length() < 1e-6);
            assert!((frame.tangent - turn.x_axis * x.signum()).length() < 1e-6);
            assert!(
                frame.tangent.dot(frame.bitangent).abs() < 1e-15 && frame.normal.dot(frame.bitangent).abs() < 1e-15
            );
        }
        let sheared = DMat3::from_cols(DVec3::X, DVec3::new(0.1, 1.0, 0.0), DVec3::Z);
        assert!(axes(&DAffine3::from_mat3(sheared)).is_none());
    }
}
