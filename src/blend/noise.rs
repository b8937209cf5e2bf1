//! Whose noise it is, from two images alone.
//!
//! Two independent unbiased estimates of one picture S are A = S + e_a and B = S + e_b. In a window around a pixel their
//! difference has the variance σ_a² + σ_b², and its covariance with B is −σ_b², since S is in both and falls out. So
//! σ_b² / (σ_a² + σ_b²) = −Cov(B, A − B) / Var(A − B), which is the weight of A that is best for the window, can be seen
//! without knowing S. With the few pixels of a window it is a rough estimate, the rougher the more contrast S has beside
//! the noise, hence a feature and not the weight itself.

use rayon::prelude::*;

use super::planes::Planes;
use crate::image::luminance;

/// Pixels from the middle of the window to its edge.
const REACH: usize = 4;
/// Rows that one task works on.
const ROWS: usize = 32;

/// Sums over some pixels: b, d = a − b, b d, d d.
type Sums = [f64; 4];

/// The share of b in the noise around each pixel, in [0, 1]; 0.5 where the images agree. Pixels that are not finite count
/// as black.
pub(super) fn share(planes: &Planes<'_>) -> Vec<f32> {
    let (width, height) = (planes.width, planes.pixels / planes.width.max(1));
    let mut shares = vec![0.5; planes.pixels];
    shares.par_chunks_mut(ROWS * width.max(1)).enumerate().for_each(|(task, out)| {
        let first = task * ROWS;
        let mut columns = vec![[0.0; 4]; width];
        for y in first.saturating_sub(REACH)..(first + REACH).min(height) {
            add_row(&mut columns, planes, y, 1.0);
        }
        for (y, out) in (first..).zip(out.chunks_mut(width)) {
            if y + REACH < height {
                add_row(&mut columns, planes, y + REACH, 1.0);
            }
            let rows = (y + REACH + 1).min(height) - y.saturating_sub(REACH);
            slide(&columns, rows, out);
            if y >= REACH {
                add_row(&mut columns, planes, y - REACH, -1.0);
            }
        }
    });
    shares
}

/// Adds row `y` to the sums of the columns, or with `sign` −1 takes it away.
fn add_row(columns: &mut [Sums], planes: &Planes<'_>, y: usize, sign: f64) {
    let width = columns.len();
    let row = 3 * y * width..3 * (y + 1) * width;
    let pixels = planes.a[row.clone()].chunks_exact(3).zip(planes.b[row].chunks_exact(3));
    for (sums, (a, b)) in columns.iter_mut().zip(pixels) {
        let finite = |v: &[f32]| Some(luminance([v[0], v[1], v[2]])).filter(|l| l.is_finite()).map_or(0.0, f64::from);
        let (a, b) = (finite(a), finite(b));
        let d = a - b;
        for (sum, term) in sums.iter_mut().zip([b, d, b * d, d * d]) {
            *sum += sign * term;
        }
    }
}

/// Shares of one row of pixels, from the sums of the columns around it.
fn slide(columns: &[Sums], rows: usize, out: &mut [f32]) {
    let mut window = [0.0; 4];
    let mut add = |column: &Sums, sign: f64| -> Sums {
        window.iter_mut().zip(column).for_each(|(sum, term)| *sum += sign * term);
        window
    };
    columns.iter().take(REACH).for_each(|column| {
        add(column, 1.0);
    });
    for (x, out) in out.iter_mut().enumerate() {
        let sums = add(columns.get(x + REACH).unwrap_or(&[0.0; 4]), 1.0);
        let width = (x + REACH + 1).min(columns.len()) - x.saturating_sub(REACH);
        let n = (rows * width) as f64;
        let [b, d, bd, dd] = sums.map(|sum| sum / n);
        let (variance, covariance) = (dd - d * d, bd - b * d);
        // What rounding leaves of a sum of squares is no variance.
        if variance > 1e-12 * dd {
            *out = (-covariance / variance).clamp(0.0, 1.0) as f32;
        }
        if x >= REACH {
            add(&columns[x - REACH], -1.0);
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::super::Input;
    use super::*;
    use crate::image::{Image, Layer};
    use ndarray::Array2;
    use rand::{RngExt, SeedableRng};

    fn images(width: usize, height: usize, noise: [f32; 2]) -> [Image; 2] {
        let mut random = rand_xoshiro::Xoshiro256PlusPlus::seed_from_u64(5);
        noise.map(|noise| {
            let mut image = Image::new(width, height);
            for y in 0..height {
                for x in 0..width {
                    // A picture with edges and slopes. What its contrast leaves in a window's covariance is a ninth of
                    // contrast times noise, so noise far below the contrast could not be told apart.
                    let s = if x / 7 % 2 == 0 { 3.0 } else { 0.5 + 0.1 * y as f32 };
                    let value = s + noise * (random.random::<f32>() - 0.5);
                    (0..3).for_each(|c| image.colour[[y, x, c]] = value);
                }
            }
            image.layers.insert("path_LE".into(), Layer::Luminance(Array2::ones((height, width))));
            image
        })
    }

    fn mean_share(width: usize, height: usize, noise: [f32; 2]) -> f32 {
        let [a, b] = images(width, height, noise);
        let planes = Planes::of(Input::new("a", &a), Input::new("b", &b)).unwrap();
        let shares = share(&planes);
        shares.iter().sum::<f32>() / shares.len() as f32
    }

    #[test]
    fn the_picture_falls_out_and_the_noise_is_told_apart() {
        assert!((mean_share(200, 100, [1.0, 1.0]) - 0.5).abs() < 0.05);
        assert!((mean_share(200, 100, [1.0, 2.0]) - 0.8).abs() < 0.1);
        assert!(mean_share(200, 100, [1.0, 0.0]) < 0.25);
        assert!(mean_share(200, 100, [0.0, 1.0]) > 0.75);
        assert_eq!(mean_share(200, 100, [0.0, 0.0]), 0.5);
    }

    /// Sliding sums against sums over each window.
    #[test]
    fn windows_at_borders_and_in_small_images_are_whole() {
        for (width, height) in [(1, 1), (3, 2), (5, 40), (40, 5), (33, 70)] {
            let [a, b] = images(width, height, [0.3, 0.7]);
            let planes = Planes::of(Input::new("a", &a), Input::new("b", &b)).unwrap();
            let shares = share(&planes);
            for y in 0..height {
                for x in 0..width {
                    let mut sums = [0.0f64; 5];
                    for v in y.saturating_sub(REACH)..(y + REACH + 1).min(height) {
                        for u in x.saturating_sub(REACH)..(x + REACH + 1).min(width) {
                            let (a, b) = (a.colour[[v, u, 0]], b.colour[[v, u, 0]]);
                            let (a, b) = (luminance([a; 3]), luminance([b; 3]));
                            let (b, d) = (f64::from(b), f64::from(a) - f64::from(b));
                            [1.0, b, d, b * d, d * d].into_iter().zip(&mut sums).for_each(|(t, s)| *s += t);
                        }
                    }
                    let [n, b, d, bd, dd] = sums;
                    let variance = dd / n - (d / n).powi(2);
                    let expected = if n > 1.0 { (-(bd / n - b / n * d / n) / variance).clamp(0.0, 1.0) } else { 0.5 };
                    let found = f64::from(shares[y * width + x]);
                    assert!((found - expected).abs() < 1e-4, "{width}×{height} at {x}, {y}: {found}, {expected}");
                }
            }
        }
    }
}
