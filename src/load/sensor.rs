//! `<sensor>` and the `<film>` inside.

use super::document::Element;
use super::error::LoadError;
use super::plugin::Plugin;
use crate::camera::{Camera, Projection};
use crate::film::Filter;
use crate::math::Frame;
use crate::scene::FilmSpec;
use glam::{DAffine3, DVec2, DVec3};

const KINDS: [&str; 3] = ["perspective", "thinlens", "orthographic"];

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
        plugin.stand_in(&KINDS, "a perspective one")?;
    }
    plugin.objects("sampler")?;
    let Film { whole, crop, filter } = plugin.object("film")?.map_or(Ok(Film::default()), film)?;
    let (to_world, transform) = plugin.placement()?;
    let is_whole = crop.size == whole;
    let whole = size.filter(|_| is_whole).unwrap_or(whole);
    let crop = if is_whole { Crop { offset: [0, 0], size: whole } } else { crop };
    let parallel = plugin.kind == "orthographic";
    let half = if parallel { half_size(&to_world, whole) } else { half_extent(&mut plugin, whole)? };
    let principal = if parallel { DVec2::ZERO } else { principal_point(&mut plugin)? };
    let (mut half, center) = window(half, principal, whole, crop);
    let size = size.unwrap_or(crop.size);
    if !is_whole {
        // A cropped film that is given another size keeps its width in the scene.
        half.y *= (size[1] * crop.size[0]) as f64 / (size[0] * crop.size[1]) as f64;
    }
    plugin.ignore(&["shutter_open", "shutter_close", "srf", "x_fov"]);
    let (origin, projection) = match plugin.kind {
        "orthographic" => orthographic(&mut plugin, &to_world)?,
        _ => (to_world.translation, perspective(&mut plugin)?),
    };
    plugin.finish()?;
    let axes = axes(&to_world).ok_or_else(|| {
        transform.error("the axes of this camera are not at right angles; expected a `to_world` without shear")
    })?;
    let camera = Camera { origin, axes, size, half, center, projection };
    Ok((camera, FilmSpec { size, filter }))
}

/// Orthonormal axes of a camera. Scale is left aside; left-handed axes stay left-handed.
fn axes(to_world: &DAffine3) -> Option<Frame> {
    let axis = |i| to_world.matrix3.col(i).try_normalize();
    let (x, y, z) = (axis(0)?, axis(1)?, axis(2)?);
    if [x.dot(y), y.dot(z), z.dot(x)].iter().any(|cosine| cosine.abs() > SKEW_TOLERANCE) {
        return None;
    }
    let bitangent = (y - z * y.dot(z)).normalize();
    let tangent = bitangent.cross(z);
    Some(Frame { tangent: tangent * tangent.dot(x).signum(), bitangent, normal: z })
}

fn perspective(plugin: &mut Plugin<'_>) -> Result<Projection, LoadError> {
    plugin.ignore(&["near_clip"]);
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
    Ok(Projection::Perspective { lens_radius, focus_distance })
}

/// The middle of the film, which lies at the near clipping plane, and how far rays go from there: as in Mitsuba 3 the
/// scale of `to_world` moves the former and not the latter.
fn orthographic(plugin: &mut Plugin<'_>, to_world: &DAffine3) -> Result<(DVec3, Projection), LoadError> {
    plugin.ignore(&["focus_distance"]);
    let near = plugin.positive("near_clip")?.unwrap_or(1e-2);
    let depth = match plugin.float("far_clip")? {
        Some(far) => far.check(|far| *far > near, "a number above `near_clip`")?,
        None => 1e4,
    } - near;
    Ok((to_world.transform_point3(DVec3::Z * near), Projection::Orthographic { depth }))
}

/// Half the size of the film of an orthographic camera, which spans -1 to 1 along its x axis.
fn half_size(to_world: &DAffine3, size: [usize; 2]) -> DVec2 {
    let scale = |i| to_world.matrix3.col(i).length();
    DVec2::new(scale(0), scale(1) * size[1] as f64 / size[0] as f64)
}

/// Where the axis of a camera meets the film, in parts of the film, to the right and down of its middle.
fn principal_point(plugin: &mut Plugin<'_>) -> Result<DVec2, LoadError> {
    let [x, y] = ["principal_point_offset_x", "principal_point_offset_y"].map(|name| plugin.number(name, 0.0));
    Ok(DVec2::new(x?, y?))
}

/// Half the extents, and the middle, of the cropped part of a film with half the extents `half`.
fn window(half: DVec2, principal: DVec2, whole: [usize; 2], crop: Crop) -> (DVec2, DVec2) {
    let vector = |size: [usize; 2]| DVec2::new(size[0] as f64, size[1] as f64);
    let share = vector(crop.size) / vector(whole);
    let middle = vector(crop.offset) / vector(whole) + 0.5 * share;
    (half * share, half * (DVec2::ONE - 2.0 * middle - 2.0 * principal))
}

/// Tangents of half the fields of view along x and y.
fn half_extent(plugin: &mut Plugin<'_>, size: [usize; 2]) -> Result<DVec2, LoadError> {
    let aspect = size[0] as f64 / size[1] as f64;
    let along_diagonal = DVec2::new(aspect, 1.0).normalize();
    if plugin.has("focal_length", &["string"]) || !plugin.has("fov", &["float", "integer"]) {
        return Ok(along_diagonal * focal_length(plugin)?);
    }
    let fov = plugin.float("fov")?.ok_or_else(|| plugin.lacks("fov"))?;
    let fov = fov.check(|fov| *fov > 0.0 && *fov < 180.0, "an angle between 0 and 180 degrees")?;
    let tangent = (0.5 * fov.to_radians()).tan();
    let (along_x, along_y) = (DVec2::new(tangent, tangent / aspect), DVec2::new(tangent * aspect, tangent));
    let Some(axis) = plugin.string("fov_axis")? else {
        return Ok(along_x);
    };
    match axis.value.text {
        "x" => Ok(along_x),
        "y" => Ok(along_y),
        "smaller" => Ok(if aspect > 1.0 { along_y } else { along_x }),
        "larger" => Ok(if aspect > 1.0 { along_x } else { along_y }),
        "diagonal" => Ok(along_diagonal * tangent),
        _ => Err(axis.refuse("one of x, y, diagonal, smaller, larger")),
    }
}

/// Tangent of half the diagonal field of view of a lens on film of 35 mm.
fn focal_length(plugin: &mut Plugin<'_>) -> Result<f64, LoadError> {
    // Both are given, or a `fov` that is not a number, which is refused here.
    if let Some(fov) = plugin.float("fov")? {
        return Err(fov.refuse("either `fov` or `focal_length`"));
    }
    let length = plugin.string("focal_length")?;
    let millimetres = match &length {
        None => 50.0,
        Some(length) => {
            let text = length.value.text.trim_end_matches("mm").trim();
            let valid = |number: &f64| number.is_finite() && *number > 0.0;
            text.parse().ok().filter(valid).ok_or_else(|| length.refuse("a length above 0 such as 50mm"))?
        }
    };
    Ok(0.5 * 36f64.hypot(24.0) / millimetres)
}

/// What a film element says.
struct Film {
    /// Width and height in pixels without the crop.
    whole: [usize; 2],
    crop: Crop,
    filter: Filter,
}

/// The part of a film that is rendered.
#[derive(Clone, Copy)]
struct Crop {
    /// Its top left corner in pixels.
    offset: [usize; 2],
    size: [usize; 2],
}

impl Default for Film {
    fn default() -> Self {
        let whole = DEFAULT_SIZE.map(|pixels| pixels as usize);
        Self { whole, crop: Crop { offset: [0, 0], size: whole }, filter: Filter::Gaussian { stddev: 0.5 } }
    }
}

fn film(element: Element<'_>) -> Result<Film, LoadError> {
    let mut plugin = Plugin::new(element)?;
    let kinds = ["hdrfilm", "ldrfilm", "mfilm"];
    let known = &kinds[..if element.is_legacy() { 3 } else { 1 }];
    if !known.contains(&plugin.kind) {
        plugin.stand_in(known, "an hdrfilm")?;
    }
    // How the image is written is decided on the command line.
    plugin.ignore(&["file_format", "pixel_format", "component_format", "banner", "filename", "sample_border"]);
    plugin.ignore(&["compensate", "high_quality_edges", "attach_log", "gamma", "exposure", "key", "burn", "label"]);
    plugin.ignore(&["tonemap_method", "has_variance", "digits", "variable", "fov"]);
    let mut pixels = |name, default, least: i64| {
        let Some(count) = plugin.integer(name)? else {
            return Ok(default);
        };
        let bounds = format!("{least} to {} pixels", MOST[0]);
        count.check(|count| (least..=MOST[0] as i64).contains(count), &bounds).map(|count| count as usize)
    };
    let [width, height] = Film::default().whole;
    let whole = [pixels("width", width, 1)?, pixels("height", height, 1)?];
    let offset = [pixels("crop_offset_x", 0, 0)?, pixels("crop_offset_y", 0, 0)?];
    let size = [pixels("crop_width", whole[0], 1)?, pixels("crop_height", whole[1], 1)?];
    check_size(whole).map_err(|message| element.error(message))?;
    if (0..2).any(|i| offset[i] + size[i] > whole[i]) {
        return Err(element.error(format!(
            "the crop of {} × {} pixels at {}, {} leaves the film; expected one inside of {} × {}",
            size[0], size[1], offset[0], offset[1], whole[0], whole[1]
        )));
    }
    let filter = plugin.object("rfilter")?.map_or(Ok(Film::default().filter), filter)?;
    plugin.finish()?;
    Ok(Film { whole, crop: Crop { offset, size }, filter })
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
        _ => {
            plugin.stand_in(&["box", "tent", "gaussian"], "a gaussian one")?;
            plugin.ignore_rest();
            Film::default().filter
        }
    };
    plugin.finish()?;
    Ok(filter)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use glam::DMat3;

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
