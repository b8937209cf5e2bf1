//! Film, filter, sampler and integrator.

use super::Importer;
use super::params::Params;
use super::source::Spot;
use super::xml::Node;
use crate::load::{LARGEST_DEPTH, LoadError};

/// Bounces of pbrt's integrators where nothing is said.
const BOUNCES: i64 = 5;

/// Width and height of pbrt's film where nothing is said.
const SIZE: [i64; 2] = [1280, 720];

/// Most pixels along an axis.
const MOST: i64 = 1 << 16;

const INTEGRATORS: [&str; 11] = [
    "path",
    "volpath",
    "simplepath",
    "simplevolpath",
    "bdpt",
    "mlt",
    "sppm",
    "lightpath",
    "directlighting",
    "whitted",
    "randomwalk",
];

const SAMPLERS: [&str; 11] = [
    "independent",
    "random",
    "halton",
    "sobol",
    "zsobol",
    "paddedsobol",
    "pmj02bn",
    "stratified",
    "lowdiscrepancy",
    "02sequence",
    "maxmindist",
];

const FILTERS: [&str; 5] = ["box", "gaussian", "mitchell", "sinc", "triangle"];

/// What stands before the world.
pub(super) struct Render {
    max_depth: i64,
    samples: i64,
    filter: Node,
    film: Node,
    /// The camera without film and sampler.
    pub camera: Option<Node>,
    /// Where the camera stands in the source.
    pub camera_spot: Option<Spot>,
}

impl Default for Render {
    fn default() -> Self {
        let film = Node::new("film", "hdrfilm").integer("width", SIZE[0]).integer("height", SIZE[1]);
        Self { max_depth: BOUNCES + 1, samples: 16, filter: gaussian(0.5), film, camera: None, camera_spot: None }
    }
}

impl Render {
    pub fn integrator_node(&self) -> Node {
        Node::new("integrator", "path").integer("max_depth", self.max_depth)
    }

    pub fn sensor_node(&self) -> Node {
        // pbrt's own camera: at the origin, with +x on the right.
        let camera = self.camera.clone().unwrap_or_else(super::camera::default);
        let sampler = Node::new("sampler", "independent").integer("sample_count", self.samples);
        camera.child(self.film.clone().child(self.filter.clone())).child(sampler)
    }
}

fn gaussian(stddev: f64) -> Node {
    Node::new("rfilter", "gaussian").float("stddev", stddev)
}

impl Importer<'_> {
    /// Directives that say how to render.
    pub(super) fn render_directive(&mut self, directive: &str, kind: &str, params: Params) -> Result<(), LoadError> {
        match directive {
            "Camera" => self.camera(kind, params),
            "Film" => self.film(params),
            "PixelFilter" => self.filter(kind, params),
            "Sampler" => self.sampler(kind, params),
            _ => self.integrator(kind, params),
        }
    }

    /// pbrt counts bounces, of which a path has one less than edges.
    fn integrator(&mut self, kind: &str, mut params: Params) -> Result<(), LoadError> {
        match kind {
            "path" | "volpath" | "simplepath" | "simplevolpath" | "bdpt" | "mlt" | "sppm" | "lightpath" => (),
            "directlighting" | "whitted" | "randomwalk" => {
                self.report.approximated(&params.spot, format!("the integrator `{kind}`: path"));
            }
            _ => self.unknown(&params.spot, "the integrator", kind, &INTEGRATORS, "path")?,
        }
        if let Some(param) = params.take("maxdepth", &["integer"])? {
            let bounces = param.numbers(1)?[0];
            if bounces.fract() != 0.0 || !(0.0..LARGEST_DEPTH as f64).contains(&bounces) {
                return Err(param.error_at(0, &format!("a whole number from 0 to {}", LARGEST_DEPTH - 1)));
            }
            self.render.max_depth = bounces as i64 + 1;
        }
        // The others choose how the same image is computed.
        params.list.retain(|param| param.name == "regularize");
        if params.boolean("regularize")? == Some(true) {
            self.report.left_out(&params.spot, "`regularize` of the integrator");
        }
        Ok(())
    }

    fn sampler(&mut self, kind: &str, mut params: Params) -> Result<(), LoadError> {
        if !SAMPLERS.contains(&kind) {
            self.unknown(&params.spot, "the sampler", kind, &SAMPLERS, "independent")?;
        }
        let mut count = |name: &str| -> Result<Option<i64>, LoadError> {
            let Some(param) = params.take(name, &["integer"])? else { return Ok(None) };
            let value = param.numbers(1)?[0];
            if value.fract() == 0.0 && (1.0..=1e9).contains(&value) {
                return Ok(Some(value as i64));
            }
            Err(param.error_at(0, "a whole number from 1 to 1000000000"))
        };
        let (pixel, x, y) = (count("pixelsamples")?, count("xsamples")?, count("ysamples")?);
        self.render.samples = match (pixel, x, y) {
            (Some(count), ..) => count,
            (None, None, None) => 16,
            (None, x, y) => x.unwrap_or(4).saturating_mul(y.unwrap_or(4)).min(1_000_000_000),
        };
        Ok(())
    }

    fn filter(&mut self, kind: &str, mut params: Params) -> Result<(), LoadError> {
        let mut float = |name, default| Ok::<_, LoadError>(params.positive(name)?.unwrap_or(default));
        self.render.filter = match kind {
            "box" => {
                let radius = [float("xradius", 0.5)?, float("yradius", 0.5)?];
                if radius != [0.5; 2] {
                    self.report.approximated(&params.spot, "the radius of the box filter: 0.5");
                }
                Node::new("rfilter", "box")
            }
            "triangle" => {
                let radius = [float("xradius", 2.0)?, float("yradius", 2.0)?];
                if radius != [1.0; 2] {
                    self.report.approximated(&params.spot, "the radius of the triangle filter: a tent of radius 1");
                }
                Node::new("rfilter", "tent")
            }
            "gaussian" => {
                // Version 3 has exp(−α x²), version 4 the standard deviation.
                let stddev = match params.positive("alpha")? {
                    Some(alpha) => (0.5 / alpha).sqrt(),
                    None => params.positive("sigma")?.unwrap_or(0.5),
                };
                gaussian(stddev)
            }
            "mitchell" | "sinc" => {
                self.report.approximated(&params.spot, format!("the filter `{kind}`: a gaussian"));
                gaussian(0.5)
            }
            _ => {
                self.unknown(&params.spot, "the filter", kind, &FILTERS, "a gaussian")?;
                gaussian(0.5)
            }
        };
        Ok(())
    }

    fn film(&mut self, mut params: Params) -> Result<(), LoadError> {
        // How the image is written is decided elsewhere.
        params.ignore(&["filename", "diagonal", "savefp16", "coordinatesystem"]);
        let mut size = SIZE;
        for (axis, name) in ["xresolution", "yresolution"].into_iter().enumerate() {
            let Some(param) = params.take(name, &["integer"])? else { continue };
            let pixels = param.numbers(1)?[0];
            if pixels.fract() != 0.0 || !(1.0..=MOST as f64).contains(&pixels) {
                return Err(param.error_at(0, &format!("a whole number from 1 to {MOST}")));
            }
            size[axis] = pixels as i64;
        }
        let mut film = Node::new("film", "hdrfilm").integer("width", size[0]).integer("height", size[1]);
        if let Some([x0, x1, y0, y1]) = crop(&mut params, size)? {
            film = film.integer("crop_offset_x", x0).integer("crop_offset_y", y0);
            film = film.integer("crop_width", x1 - x0).integer("crop_height", y1 - y0);
        }
        self.render.film = film;
        self.finish(params);
        Ok(())
    }
}

/// The part of the film that is rendered: from and to along x, then along y, in pixels.
fn crop(params: &mut Params, size: [i64; 2]) -> Result<Option<[i64; 4]>, LoadError> {
    let [width, height] = size;
    let (param, bounds) = if let Some(param) = params.take("pixelbounds", &["integer"])? {
        let numbers = param.numbers(4)?.to_vec();
        (param, numbers)
    } else if let Some(param) = params.take("cropwindow", &["float"])? {
        // A pixel belongs to the window that holds its upper left corner, as in pbrt.
        let scaled = param.numbers(4)?.iter().enumerate();
        let numbers = scaled.map(|(i, share)| (share * size[i / 2] as f64).ceil()).collect();
        (param, numbers)
    } else {
        return Ok(None);
    };
    let [x0, x1, y0, y1] = [0, 1, 2, 3].map(|i| bounds[i].clamp(0.0, size[i / 2] as f64) as i64);
    if x0 >= x1 || y0 >= y1 {
        return Err(param.error_at(0, "a window with pixels: from and to along x, then along y"));
    }
    Ok(Some([x0, x1, y0, y1]).filter(|bounds| *bounds != [0, width, 0, height]))
}
