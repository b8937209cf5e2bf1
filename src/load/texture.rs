//! `<texture>` elements, and the parameters of plugins that may be textures.

use super::attributes::{self, Skin};
use super::document::Element;
use super::error::LoadError;
use super::plugin::Plugin;
use crate::spectrum::Spectrum;
use crate::texture::{Bitmap, Checkerboard, Colour, Lookup, Number, Texture, Wrap};
use glam::{DAffine2, DAffine3, DMat2, DVec2};
use std::sync::Arc;

const KINDS: [&str; 3] = ["bitmap", "checkerboard", attributes::KIND];

/// Parameters of a texture that choose how it is stored, or how Mitsuba 0.6 filters it.
const HARMLESS: [&str; 5] = ["format", "accel", "cache", "max_anisotropy", "coordinates"];

impl<'a> Plugin<'a> {
    /// A share of light that may be a texture: constants have channels from 0 to 1, `default` where it is not given.
    pub fn colour_texture(&mut self, name: &'static str, default: f64) -> Result<Colour, LoadError> {
        match self.texture(name, Role::Colour)? {
            Some(texture) => Ok(Colour::Textured(texture)),
            None => self.share(name, default).map(Colour::Constant),
        }
    }

    /// A number that may be a texture, `default` where it is not given. The caller checks the range of a constant. A
    /// colour stands for its luminance.
    pub fn number_texture(&mut self, name: &'static str, default: f64) -> Result<Number, LoadError> {
        if let Some(texture) = self.texture(name, Role::Number)? {
            return Ok(Number::Textured(texture));
        }
        if self.has(name, &["rgb", "spectrum"]) {
            let colour = self.colour(name)?.map_or(default, |colour| colour.value.luminance());
            return Ok(Number::Constant(colour));
        }
        Ok(Number::Constant(self.float(name)?.map_or(default, |number| number.value)))
    }

    /// The texture in the place of the parameter `name`, nested or by reference; `None` where there is another kind of
    /// value or nothing.
    pub fn texture(&mut self, name: &'static str, role: Role) -> Result<Option<Arc<Texture>>, LoadError> {
        if !self.has(name, &["texture"]) {
            return Ok(None);
        }
        let element = self.take(name, &["texture"])?;
        element.map(|element| read(element, self.skin, role)).transpose()
    }

    /// The one nested texture, whatever its name: what bump and normal maps have.
    pub fn any_texture(&mut self, role: Role) -> Result<Option<Arc<Texture>>, LoadError> {
        let element = self.object("texture")?;
        element.map(|element| read(element, self.skin, role)).transpose()
    }
}

/// What a texture is read for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Colour,
    Number,
    Normal,
    /// Its slopes by the texture coordinates: attributes of meshes have none in Mitsuba.
    Height,
}

impl Role {
    /// Numbers of channels that an attribute may have.
    fn channels(self) -> &'static [usize] {
        match self {
            Self::Colour => &[1, 3],
            Self::Number => &[1],
            Self::Normal => &[3],
            Self::Height => &[],
        }
    }
}

/// Reads a texture and the image that it names, as it lies on `skin`.
pub(super) fn read(element: Element<'_>, skin: Option<&Skin>, role: Role) -> Result<Arc<Texture>, LoadError> {
    let mut plugin = Plugin::new(element)?.on(skin);
    if plugin.kind == attributes::KIND && role != Role::Height {
        let texture = attributes::read(&mut plugin, role.channels())?;
        plugin.finish()?;
        return Ok(Arc::new(texture));
    }
    let texture = match plugin.kind {
        "bitmap" => Texture::Bitmap(bitmap(&mut plugin)?),
        "checkerboard" => Texture::Checkerboard(Checkerboard {
            colours: [plugin.share("color0", 0.4)?, plugin.share("color1", 0.2)?],
            to_uv: to_uv(&mut plugin)?,
        }),
        _ => {
            let known = if role == Role::Height { &KINDS[..2] } else { &KINDS[..] };
            plugin.stand_in(known, "a grey of 0.5")?;
            plugin.ignore_rest();
            let colours = [Spectrum::grey(0.5); 2];
            Texture::Checkerboard(Checkerboard { colours, to_uv: DAffine2::IDENTITY })
        }
    };
    plugin.ignore(&HARMLESS);
    plugin.finish()?;
    Ok(Arc::new(match skin.filter(|_| role != Role::Height) {
        Some(skin) => skin.drape(texture),
        None => texture,
    }))
}

fn bitmap(plugin: &mut Plugin<'_>) -> Result<Bitmap, LoadError> {
    let name = plugin.string("filename")?.ok_or_else(|| plugin.lacks("filename"))?.value;
    // Mitsuba 0.6 says `gamma` 1 where Mitsuba 3 says `raw`.
    let gamma = plugin.float("gamma")?;
    let linear = gamma.map(|gamma| gamma.check(|gamma| [-1.0, 0.0, 1.0].contains(gamma), "1 (linear), or -1 (sRGB)"));
    let linear = linear.transpose()? == Some(1.0);
    Ok(Bitmap {
        picture: plugin.element.document.pictures.get(name)?,
        raw: plugin.boolean("raw")? || linear,
        lookup: lookup(plugin)?,
        wrap: wrap(plugin)?,
        to_uv: to_uv(plugin)?,
    })
}

/// The filters of Mitsuba 0.6 for pictures seen from far away are read as `bilinear`: many samples do their work.
fn lookup(plugin: &mut Plugin<'_>) -> Result<Lookup, LoadError> {
    let Some(name) = plugin.string("filter_type")? else {
        return Ok(Lookup::default());
    };
    match name.value.text {
        "bilinear" | "trilinear" | "ewa" => Ok(Lookup::Bilinear),
        "nearest" => Ok(Lookup::Nearest),
        _ => Err(name.refuse("one of bilinear, nearest, trilinear, ewa")),
    }
}

fn wrap(plugin: &mut Plugin<'_>) -> Result<Wrap, LoadError> {
    let mut one = |parameter| {
        let Some(name) = plugin.string(parameter)? else {
            return Ok(None);
        };
        match name.value.text {
            "repeat" => Ok(Some((Wrap::Repeat, name))),
            "mirror" => Ok(Some((Wrap::Mirror, name))),
            "clamp" => Ok(Some((Wrap::Clamp, name))),
            _ => Err(name.refuse("one of repeat, mirror, clamp")),
        }
    };
    let both = one("wrap_mode")?.map_or(Wrap::default(), |(wrap, _)| wrap);
    let u = one("wrap_mode_u")?.map_or(both, |(wrap, _)| wrap);
    match one("wrap_mode_v")? {
        Some((wrap, name)) if wrap != u => Err(name.refuse("the same mode along u and v")),
        _ => Ok(u),
    }
}

/// From texture coordinates to the texture's plane: `to_uv`, or the scales and offsets of Mitsuba 0.6.
fn to_uv(plugin: &mut Plugin<'_>) -> Result<DAffine2, LoadError> {
    let DAffine3 { matrix3, translation } = plugin.transformation("to_uv")?.0;
    let placed = DAffine2 {
        matrix2: DMat2::from_cols(matrix3.x_axis.truncate(), matrix3.y_axis.truncate()),
        translation: translation.truncate(),
    };
    let both = plugin.number("uvscale", 1.0)?;
    let scale = DVec2::new(plugin.number("uscale", both)?, plugin.number("vscale", both)?);
    let offset = DVec2::new(plugin.number("uoffset", 0.0)?, plugin.number("voffset", 0.0)?);
    Ok(DAffine2::from_scale_angle_translation(scale, 0.0, offset) * placed)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::super::document::with_root;
    use super::*;
    use crate::image::{Image, WriteOptions};
    use crate::texture::Site;
    use ::image::{Rgb, RgbImage};
    use std::path::Path;

    const ORANGE: [u8; 3] = [255, 128, 10];

    fn with<R>(folder: &Path, body: &str, test: impl FnOnce(Plugin<'_>) -> R) -> R {
        let text = format!("<scene version=\"3.0.0\">{body}</scene>");
        let last = |root: Element<'_>| test(Plugin::new(root.children().last().unwrap()).unwrap());
        with_root(&folder.join("s.xml"), &text, last).unwrap()
    }

    fn colour(folder: &Path, parameter: &str) -> Result<Colour, String> {
        let body = format!("<texture type=\"checkerboard\" id=\"board\"/><bsdf type=\"x\">{parameter}</bsdf>");
        with(folder, &body, |mut plugin| plugin.colour_texture("reflectance", 0.5)).map_err(|error| error.to_string())
    }

    fn bitmap(folder: &Path, file: &str, more: &str) -> Result<Colour, String> {
        let inside = format!("<string name=\"filename\" value=\"{file}\"/>{more}");
        colour(folder, &format!("<texture name=\"reflectance\" type=\"bitmap\">{inside}</texture>"))
    }

    /// Every format shows the same colour; those without a loss show it exactly.
    #[test]
    fn images_of_every_format_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let picture = RgbImage::from_pixel(16, 8, Rgb(ORANGE));
        let linear = picture.get_pixel(0, 0).0.map(|code| {
            let code = f32::from(code) / 255.0;
            if code <= 0.04045 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
        });
        let mut exr = Image::new(16, 8);
        exr.colour.indexed_iter_mut().for_each(|((_, _, channel), sample)| *sample = linear[channel]);
        exr.write(&folder.path().join("a.exr"), &WriteOptions::default()).unwrap();
        let light = ::image::Rgb32FImage::from_pixel(16, 8, Rgb(linear));
        light.save(folder.path().join("a.hdr")).unwrap();
        for (name, tolerance) in [("a.png", 1e-6), ("a.tga", 1e-6), ("a.bmp", 1e-6), ("a.jpg", 0.02)] {
            picture.save(folder.path().join(name)).unwrap();
            assert_shows(&bitmap(folder.path(), name, "").unwrap(), linear, tolerance);
        }
        for (name, tolerance) in [("a.exr", 1e-7), ("a.hdr", 5e-3)] {
            assert_shows(&bitmap(folder.path(), name, "").unwrap(), linear, tolerance);
        }
        let raw = bitmap(folder.path(), "a.png", "<boolean name=\"raw\" value=\"true\"/>").unwrap();
        assert_shows(&raw, ORANGE.map(|code| f32::from(code) / 255.0), 1e-6);
    }

    fn assert_shows(colour: &Colour, expected: [f32; 3], tolerance: f64) {
        let found = colour.at(&DVec2::new(0.3, 0.8).into()).to_rgb();
        let close = found.iter().zip(expected).all(|(a, b)| (a - f64::from(b)).abs() < tolerance);
        assert!(close, "{colour:?}: {found:?}, expected {expected:?}");
    }

    #[test]
    fn parameters_arrive() {
        let folder = tempfile::tempdir().unwrap();
        RgbImage::from_pixel(4, 4, Rgb(ORANGE)).save(folder.path().join("a.png")).unwrap();
        let more = r#"<string name="filter_type" value="ewa"/> <string name="wrap_mode" value="mirror"/>
            <float name="uvscale" value="3"/> <float name="vscale" value="2"/> <float name="uoffset" value="0.5"/>"#;
        let Colour::Textured(texture) = bitmap(folder.path(), "a.png", more).unwrap() else { unreachable!() };
        let Texture::Bitmap(bitmap) = &*texture else { unreachable!() };
        assert_eq!((bitmap.lookup, bitmap.wrap, bitmap.raw), (Lookup::Bilinear, Wrap::Mirror, false));
        assert_eq!(bitmap.to_uv.transform_point2(DVec2::new(0.1, 0.1)), DVec2::new(0.8, 0.2));
    }

    #[test]
    fn references_and_constants_are_colours_too() {
        let folder = tempfile::tempdir().unwrap();
        let read = |parameter: &str| colour(folder.path(), parameter);
        let board = read("<ref name=\"reflectance\" id=\"board\"/>").unwrap();
        assert_eq!(board.at(&DVec2::splat(0.1).into()).to_rgb(), [0.4; 3]);
        assert_eq!(read("<rgb name=\"reflectance\" value=\"0.1\"/>").unwrap().at(&Site::default()).to_rgb(), [0.1; 3]);
        assert_eq!(read("").unwrap().at(&Site::default()).to_rgb(), [0.5; 3]);
        assert!(read("<rgb name=\"reflectance\" value=\"2\"/>").is_err());
    }

    #[test]
    fn a_damaged_image_is_one_clear_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.png");
        RgbImage::from_fn(64, 64, |x, y| Rgb([x as u8, y as u8, (x * y) as u8])).save(&path).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        for (damage, name) in [(&bytes[..bytes.len() / 2], "cut.png"), (b"hello", "text.png"), (b"", "none.jpg")] {
            std::fs::write(folder.path().join(name), damage).unwrap();
            let message = bitmap(folder.path(), name, "").unwrap_err();
            assert!(message.contains("s.xml:1:") && message.contains("cannot be used"), "{message}");
        }
        let missing = bitmap(folder.path(), "missing.png", "").unwrap_err();
        assert!(missing.contains("cannot read the image"), "{missing}");
        let odd = bitmap(folder.path(), "a.png", "<string name=\"filter_type\" value=\"sharp\"/>").unwrap_err();
        assert!(odd.contains("sharp; expected one of bilinear"), "{odd}");
    }
}
