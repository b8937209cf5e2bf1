//! Laws that every emitter keeps, and values of Mitsuba 3.9.1.

#![allow(clippy::unwrap_used)]

use super::*;
use crate::geometry::Solid;
use crate::math::{Stream, warp};
use crate::texture::{Bitmap, Colour, Lookup, Picture, Texels, Texture, Wrap};
use glam::{DAffine2, DMat3, Vec2};
use std::f64::consts::{PI, TAU};
use std::sync::Arc;

const REACH: Reach = Reach { center: DVec3::new(1.0, 2.0, -1.0), radius: 3.0 };

/// Four columns, three rows.
const PIXELS: [f32; 36] = [
    1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 2.0, 1.0, 0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 20.0, 8.0, 9.0, 0.2, 1.0,
    0.0, 3.0, 3.0, 3.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 0.0, 0.0, 5.0,
];

fn panorama(scale: f64) -> Panorama {
    let picture = Picture::new([4, 3], Texels::linear(PIXELS.to_vec())).unwrap();
    Panorama::new(Arc::new(picture), scale).unwrap()
}

/// A panorama of which most is black.
fn lonely_pixel() -> Panorama {
    let mut pixels = vec![0.0; 3 * 8 * 6];
    pixels[3 * (8 * 2 + 5)] = 4.0;
    Panorama::new(Arc::new(Picture::new([8, 6], Texels::linear(pixels)).unwrap()), 1.0).unwrap()
}

fn turned() -> DMat3 {
    DMat3::from_rotation_y(0.7) * DMat3::from_rotation_x(1.2)
}

fn environments() -> Vec<Emitter> {
    let sun = Sun { towards: DVec3::new(0.6, 0.0, 0.8), cap: 0.05, radiance: Spectrum::rgb(40.0, 30.0, 20.0) };
    let backdrops = [
        Backdrop { image: Some((panorama(1.0), DMat3::IDENTITY)), sun: None },
        Backdrop { image: Some((lonely_pixel(), turned())), sun: None },
        Backdrop { image: Some((panorama(0.5), turned())), sun: Some(sun) },
        Backdrop { image: None, sun: Some(sun) },
    ];
    let environments = backdrops.map(|backdrop| Emitter::Environment(Environment::new(backdrop, REACH).unwrap()));
    environments.into_iter().chain([Emitter::Constant(Constant { radiance: Spectrum::ONE, reach: REACH })]).collect()
}

fn spot() -> Spot {
    let (cutoff, beam) = (25f64.to_radians(), 18.75f64.to_radians());
    let axis = DVec3::new(1.0, 0.0, -5.0).normalize();
    Spot { position: DVec3::new(0.0, 0.0, 5.0), axis, intensity: Spectrum::rgb(3.0, 2.0, 1.0), cutoff, beam }
}

fn all() -> Vec<Emitter> {
    let grey = Spectrum::grey(2.0);
    let sphere = Solid::sphere(DVec3::X, 0.5);
    let disk = Solid::disk(DVec3::ONE, DVec3::new(0.6, 0.0, -0.8), 2.0);
    let cylinder = Solid::cylinder(DVec3::X, DVec3::new(1.0, 2.0, 3.0), 0.5);
    let others = [
        Emitter::Area(Area::new(grey.into(), Surface::Solid(disk))),
        Emitter::Area(Area::new(grey.into(), Surface::Solid(cylinder))),
        Emitter::Area(Area::new(grey.into(), mesh())),
        Emitter::Area(Area::new(grey.into(), Surface::Solid(sphere))),
        Emitter::Area(textured()),
        Emitter::Area(Area::new(textured().radiance, Surface::Solid(sphere))),
        Emitter::Point(Point { position: DVec3::ONE, intensity: grey }),
        Emitter::Spot(spot()),
        Emitter::Spot(Spot { beam: spot().cutoff, ..spot() }),
        Emitter::Spot(Spot { beam: 0.0, cutoff: PI, ..spot() }),
        Emitter::Directional(Directional { towards: DVec3::Y, irradiance: grey, reach: REACH }),
    ];
    environments().into_iter().chain(others).collect()
}

/// Triangles of several sizes, one of them without area, from the scene's seventh on.
fn mesh() -> Surface {
    let corners = [[0, 1, 2], [1, 2, 2], [1, 3, 2], [0, 2, 3]];
    let points = [DVec3::ZERO, DVec3::X, DVec3::Y * 2.0, DVec3::new(1.0, 2.0, 3.0)];
    Surface::triangles(7, corners.map(|corners| (corners.map(|i| points[i]), [Vec2::ZERO; 3])).into_iter()).unwrap()
}

/// A triangle whose brightness is its x coordinate.
fn textured() -> Area {
    let picture = Picture::new([2, 1], Texels::linear(vec![0.0, 1.0])).unwrap();
    let (lookup, wrap) = (Lookup::Bilinear, Wrap::Clamp);
    let bitmap = Bitmap { picture: Arc::new(picture), raw: false, lookup, wrap, to_uv: DAffine2::IDENTITY };
    let uvs = [[0.25, 0.0], [0.75, 0.0], [0.25, 1.0]].map(Vec2::from);
    let surface = Surface::triangles(0, [([DVec3::ZERO, DVec3::X, DVec3::Y * 2.0], uvs)].into_iter()).unwrap();
    Area::new(Colour::Textured(Arc::new(Texture::Bitmap(bitmap))), surface)
}

/// What is sampled on a textured light has the texture coordinates of the point.
#[test]
fn textured_lights_shine_by_their_texture() {
    let (area, mut stream) = (Emitter::Area(textured()), Stream::new(6, &[]));
    for _ in 0..1000 {
        let (start, _) = area.start(stream.row());
        let Start::Surface { position, .. } = start else { unreachable!() };
        let found = area.radiance(&start, DVec3::Z);
        assert!((found.luminance() - position.x).abs() < 1e-7, "{found:?} {position}");
        assert!(area.radiance(&start, -DVec3::Z).is_black());
    }
    // A sphere has u = 1/2 at −x and v, which the texture leaves aside, along z.
    let ball = Solid::sphere(DVec3::ZERO, 1.0);
    let area = Emitter::Area(Area::new(textured().radiance, Surface::Solid(ball)));
    for _ in 0..1000 {
        let (start, _) = area.start(stream.row());
        let Start::Surface { position, normal, .. } = start else { unreachable!() };
        let turn = 0.5 + (-position.y).atan2(-position.x) / TAU;
        let found = area.radiance(&start, normal).luminance();
        assert!((found - (2.0 * turn - 0.5).clamp(0.0, 1.0)).abs() < 1e-7, "{found} {position}");
    }
}

const BINS: [usize; 2] = [10, 20];

/// The bin of a direction: bands of the same area, cut by meridians.
fn bin(direction: DVec3) -> usize {
    let [u, v] = warp::sphere::invert(direction);
    let cell = |u: f64, count: usize| ((u * count as f64) as usize).min(count - 1);
    cell(u, BINS[0]) * BINS[1] + cell(v, BINS[1])
}

/// Density over each bin, by the midpoints of a fine grid.
fn expected(emitter: &Emitter) -> Vec<f64> {
    const FINE: [usize; 2] = [1500, 3000];
    let mut shares = vec![0.0; BINS[0] * BINS[1]];
    for i in 0..FINE[0] * FINE[1] {
        let u = [(i / FINE[1]) as f64 + 0.5, (i % FINE[1]) as f64 + 0.5];
        let towards = warp::sphere::sample([u[0] / FINE[0] as f64, u[1] / FINE[1] as f64]);
        let pdf = emitter.start_pdf(&Start::Infinite { towards }).0;
        shares[bin(towards)] += pdf * 2.0 * TAU / (FINE[0] * FINE[1]) as f64;
    }
    shares
}

/// The density of directions adds up to one, and samples follow it. The threshold is passed by chance less than once in
/// 100 000 times; the seed is fixed.
#[test]
fn directions_follow_their_density() {
    for emitter in environments() {
        let shares = expected(&emitter);
        let total: f64 = shares.iter().sum();
        assert!((total - 1.0).abs() < 2e-3, "{emitter:?}: {total}");
        let (mut counts, mut stream) = (vec![0.0; shares.len()], Stream::new(3, &[]));
        let samples = 200_000;
        for _ in 0..samples {
            let (start, pdf) = emitter.start(stream.row());
            let Start::Infinite { towards } = start else { unreachable!() };
            assert!(pdf == emitter.start_pdf(&start) && pdf.0 > 0.0 && (towards.length() - 1.0).abs() < 1e-12);
            counts[bin(towards)] += 1.0;
        }
        let (mut sum, mut freedom) = (0.0, -1.0);
        for (count, share) in counts.iter().zip(&shares) {
            let mean = share * f64::from(samples);
            // What a grid cannot tell from nothing is left out.
            if mean > 20.0 {
                // The grid's error at the edges of the density counts as noise.
                sum += (count - mean).powi(2) / (mean + (2e-3 * mean).powi(2));
                freedom += 1.0;
            } else {
                assert!(*count < 60.0);
            }
        }
        assert!(sum < freedom + 5.0 * f64::sqrt(2.0 * freedom) + 10.0, "{emitter:?}: {sum} for {freedom} bins");
    }
}

/// Power is what [`Emitter::emit`] sends out.
#[test]
fn power_is_what_is_emitted() {
    for emitter in all() {
        let mut stream = Stream::new(4, &[]);
        let (mut sum, mut squares, samples) = (0.0, 0.0, 100_000);
        for _ in 0..samples {
            let (start, pdf) = emitter.start(stream.row());
            let (_, direction, weight) = emitter.emit(&start, stream.row()).unwrap();
            assert!((direction.length() - 1.0).abs() < 1e-12);
            let value = weight.luminance() / pdf.0;
            (sum, squares) = (sum + value, squares + value * value);
        }
        let mean = sum / f64::from(samples);
        let error = ((squares / f64::from(samples) - mean * mean).max(0.0) / f64::from(samples)).sqrt();
        let off = (mean - emitter.power()).abs();
        // The power of a textured light, which lights are chosen by only, is measured at some points.
        let slack = if matches!(&emitter, Emitter::Area(area) if !area.radiance.is_constant()) { 0.03 } else { 1e-9 };
        assert!(off < 4.5 * error + slack * mean, "{emitter:?}: {mean} ± {error}, power {}", emitter.power());
    }
}

/// Position of a start, or its direction.
fn place(start: &Start) -> DVec3 {
    match *start {
        Start::Surface { position, .. } | Start::Point { position } => position,
        Start::Infinite { towards } | Start::Distant { towards } => towards,
    }
}

/// Samples of a start and of the ray from it come back from the rows that they are inverted to. Rows that are drawn evenly
/// are inverted to rows that are even: each of the numbers is counted in bins.
#[test]
fn starts_and_rays_invert() {
    const BINS: usize = 16;
    const SAMPLES: usize = 40_000;
    for emitter in all() {
        let mut stream = Stream::new(8, &[]);
        let mut counts = [[[0.0f64; BINS]; 3]; 2];
        for _ in 0..SAMPLES {
            let rows = [stream.row(), stream.row()];
            let (start, _) = emitter.start(rows[0]);
            let (origin, direction, _) = emitter.emit(&start, rows[1]).unwrap();
            let point = origin + direction * (0.1 + stream.number());
            let back = [
                emitter.invert_start(&start, stream.row()).unwrap(),
                emitter.invert_emission(&start, direction, point, stream.row()).unwrap(),
            ];
            let again = emitter.start(back[0]).0;
            assert!((place(&again) - place(&start)).length() < 1e-9, "{emitter:?}: {start:?} {again:?}");
            let (from, along, _) = emitter.emit(&start, back[1]).unwrap();
            let off = (from - origin).length().max((along - direction).length());
            assert!(off < 1e-9, "{emitter:?}: {off:e} from {:?} to {:?}", rows[1], back[1]);
            for (counts, row) in counts.iter_mut().zip(back) {
                for (counts, number) in counts.iter_mut().zip(row) {
                    counts[(number * BINS as f64) as usize] += 1.0;
                }
            }
        }
        let mean = SAMPLES as f64 / BINS as f64;
        for counts in counts.as_flattened() {
            // 15 degrees of freedom: 55 is passed by chance less than once in 10⁵ times; there are some hundred sums.
            let sum: f64 = counts.iter().map(|count| (count - mean).powi(2) / mean).sum();
            assert!(sum < 60.0, "{emitter:?}: {sum}");
        }
    }
}

#[test]
fn panoramas_invert() {
    let mut stream = Stream::new(5, &[]);
    for panorama in [panorama(1.0), lonely_pixel()] {
        for _ in 0..10_000 {
            let u = [stream.number(), stream.number()];
            let back = panorama.invert(panorama.sample(u));
            assert!((back[0] - u[0]).abs() < 1e-9 && (back[1] - u[1]).abs() < 1e-9, "{u:?} {back:?}");
        }
    }
}

fn assert_close(found: Spectrum, expected: [f64; 3], what: &str) {
    let close = found.to_rgb().iter().zip(expected).all(|(a, b)| (a - b).abs() < 2e-5 * (1.0 + b));
    assert!(close, "{what}: {:?}, expected {expected:?}", found.to_rgb());
}

#[test]
fn environment_images_agree_with_mitsuba() {
    let plain = [
        ([1.0, 0.0, 0.0], [0.25, 0.35, 0.45]),
        ([-1.0, 0.0, 0.0], [10.1, 4.5, 4.5]),
        ([0.0, 0.0, 1.0], [10.2, 4.25, 4.8]),
        ([0.0, 0.0, -1.0], [0.15, 0.6, 0.15]),
        ([0.3, 0.4, -0.5], [0.51382, 0.90631, 1.12553]),
        ([-0.2, -0.7, 0.6], [7.55641, 3.61394, 3.95743]),
        ([0.9, 0.05, 0.1], [0.35682, 0.48843, 0.62003]),
        ([-0.6, 0.8, 0.01], [6.91174, 4.57426, 4.59548]),
    ];
    let environment = panorama(1.0);
    for (direction, expected) in plain {
        let towards = DVec3::from(direction).normalize();
        assert_close(environment.radiance(towards), expected, &format!("{direction:?}"));
    }
    let rotation = DMat3::from_rotation_y(40f64.to_radians()) * DMat3::from_rotation_x(90f64.to_radians());
    let backdrop = Backdrop { image: Some((panorama(3.0), rotation)), sun: None };
    let environment = Environment::new(backdrop, REACH).unwrap();
    let rotated = [
        ([-1.0, 0.0, 0.0], [18.16667, 8.83333, 12.16667]),
        ([0.0, -1.0, 0.0], [30.6, 12.75, 14.4]),
        ([0.3, 0.4, -0.5], [1.77853, 2.02652, 2.27451]),
        ([-0.2, -0.7, 0.6], [47.19228, 22.40126, 25.22971]),
        ([-0.6, 0.8, 0.01], [0.77947, 2.32752, 3.56978]),
    ];
    for (direction, expected) in rotated {
        let towards = DVec3::from(direction).normalize();
        assert_close(environment.radiance(towards), expected, &format!("rotated {direction:?}"));
    }
}

/// Intensity over squared distance in Mitsuba.
#[test]
fn spots_agree_with_mitsuba() {
    let expected = [([1.0, 0.0], 0.115385), ([0.0, 0.0], 0.12), ([2.0, 0.5], 0.102564), ([3.0, 0.0], 0.0754754)];
    for ([x, y], red) in expected.into_iter().chain([([2.6, 0.0], 0.0944584)]) {
        let offset = DVec3::new(x, y, 0.0) - spot().position;
        let found = spot().intensity(offset.normalize()) / offset.length_squared();
        assert_close(found, [red, red * 2.0 / 3.0, red / 3.0], &format!("{x} {y}"));
    }
    assert!(spot().intensity(DVec3::Z).is_black());
}
