//! Environment images of pbrt 4: the sphere folded onto a square so that areas stay in proportion (Clarberg 2008).

use crate::image::Image;
use glam::{DVec2, DVec3};
use std::f64::consts::{FRAC_2_PI, PI, TAU};

/// The image by longitude and latitude, as Mitsuba has environments: the first row is up, the middle of the first column
/// is at -z.
pub(super) fn to_equirectangular(square: &Image) -> Image {
    let height = square.height();
    let mut result = Image::new(2 * height, height);
    for row in 0..height {
        let theta = PI * (row as f64 + 0.5) / height as f64;
        for column in 0..2 * height {
            let phi = TAU * (column as f64 + 0.5) / (2 * height) as f64;
            let direction = DVec3::new(phi.sin() * theta.sin(), theta.cos(), -phi.cos() * theta.sin());
            // +y up becomes +z up.
            let colour = look_up(square, to_square(DVec3::new(direction.x, -direction.z, direction.y)));
            for (channel, value) in colour.into_iter().enumerate() {
                result.colour[[row, column, channel]] = value;
            }
        }
    }
    result
}

/// The place in the unit square that a direction with +z up has.
fn to_square(direction: DVec3) -> DVec2 {
    let DVec3 { x, y, z } = direction.abs();
    let radius = (1.0 - z).max(0.0).sqrt();
    // How far the direction has turned from the x axis to the y axis.
    let turn = if x == 0.0 && y == 0.0 { 0.0 } else { y.atan2(x) * FRAC_2_PI };
    let mut folded = DVec2::new(1.0 - turn, turn) * radius;
    if direction.z < 0.0 {
        folded = DVec2::new(1.0 - folded.y, 1.0 - folded.x);
    }
    let signed = DVec2::new(folded.x.copysign(direction.x), folded.y.copysign(direction.y));
    (signed + 1.0) * 0.5
}

/// The value between the four nearest pixels.
fn look_up(image: &Image, place: DVec2) -> [f32; 3] {
    let size = image.width() as i64;
    let at = place * size as f64 - 0.5;
    let (low, part) = (at.floor(), at - at.floor());
    let mut sum = [0.0; 3];
    for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let share = (if dx == 1 { part.x } else { 1.0 - part.x }) * (if dy == 1 { part.y } else { 1.0 - part.y });
        let [x, y] = wrap(low.x as i64 + dx, low.y as i64 + dy, size);
        for (channel, sum) in sum.iter_mut().enumerate() {
            *sum += share as f32 * image.colour[[y, x, channel]];
        }
    }
    sum
}

/// The pixel that lies beyond an edge: each edge is folded at its middle.
fn wrap(x: i64, y: i64, size: i64) -> [usize; 2] {
    let (mut x, mut y) = (x, y);
    if x < 0 || x >= size {
        (x, y) = (if x < 0 { -x - 1 } else { 2 * size - 1 - x }, size - 1 - y);
    }
    if y < 0 || y >= size {
        (x, y) = (size - 1 - x, if y < 0 { -y - 1 } else { 2 * size - 1 - y });
    }
    [x, y].map(|index| index.clamp(0, size - 1) as usize)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_fold_onto_the_square() {
        let near = |a: DVec2, x: f64, y: f64| assert!((a - DVec2::new(x, y)).length() < 1e-9, "{a}");
        near(to_square(DVec3::Z), 0.5, 0.5);
        near(to_square(DVec3::X), 1.0, 0.5);
        near(to_square(DVec3::NEG_Y), 0.5, 0.0);
        near(to_square(DVec3::new(1.0, 1.0, 0.0).normalize()), 0.75, 0.75);
        near(to_square(DVec3::new(1e-12, 1e-12, -1.0)), 1.0, 1.0);
    }

    #[test]
    fn areas_stay_in_proportion() {
        // A cap of 60 degrees is a quarter of the sphere, and a diamond of a quarter of the square.
        let edge = to_square(DVec3::new(0.75_f64.sqrt(), 0.0, 0.5));
        assert!((edge.x - 0.5 - 0.125_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn up_stays_up() {
        let mut square = Image::new(32, 32);
        for (y, x) in (12..20).flat_map(|y| (12..20).map(move |x| (y, x))) {
            square.colour[[y, x, 1]] = 1.0;
        }
        let round = to_equirectangular(&square);
        assert_eq!((round.width(), round.height()), (64, 32));
        assert!(round.colour[[0, 5, 1]] > 0.99 && round.colour[[16, 5, 1]] == 0.0 && round.colour[[31, 5, 1]] == 0.0);
    }
}
