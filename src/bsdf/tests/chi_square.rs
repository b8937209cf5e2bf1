//! Counts of samples in bins over the sphere against the integral of the density over them.

use super::*;
use rayon::prelude::*;

/// Bins over the cosine, and over the angle around the normal.
const SIZE: [usize; 2] = [10, 20];

const SAMPLES: usize = 10_000;

/// Incident directions per model.
const DIRECTIONS: usize = 20;

/// Bins that expect fewer samples are thrown together.
const FEWEST: f64 = 10.0;

/// Standard deviations at which a test fails. With 60 to 100 models of 20 directions a correct program fails with a
/// probability below 1e-4 (Bonferroni: 2000 times that of 5.5 deviations of a normal variable, and a margin for tails
/// of bins with few samples).
const LIMIT: f64 = 6.0;

/// Deviation of a sum of squares with the given degrees of freedom in units of a normal variable (Wilson and Hilferty
/// 1931).
pub fn deviation(sum: f64, freedom: f64) -> f64 {
    let spread = 2.0 / (9.0 * freedom);
    ((sum / freedom).cbrt() - (1.0 - spread)) / spread.sqrt()
}

#[test]
fn samples_follow_the_density() {
    cases().par_iter().for_each(|case| {
        let mut stream = Stream::new(11, &[]);
        for _ in 0..DIRECTIONS {
            let wi = incident(&mut stream);
            let (counts, inside) = count(&case.bsdf, wi, &mut stream);
            let expected = expect(&case.bsdf, wi);
            let found = compare(&counts, &expected);
            assert!(found < LIMIT, "{} from {wi}: {found} deviations", case.name);
            // The density adds up to what is neither absorbed nor scattered by delta lobes.
            let (n, share) = (SAMPLES as f64, expected.iter().sum::<f64>());
            let error = (share * (1.0 - share)).max(0.0).sqrt() / n.sqrt() + 2e-4;
            assert!((inside / n - share).abs() < LIMIT * error, "{} from {wi}: {} {share}", case.name, inside / n);
        }
    });
}

fn count(bsdf: &Bsdf, wi: DVec3, stream: &mut Stream) -> (Vec<f64>, f64) {
    let (mut counts, mut inside) = (vec![0.0; SIZE[0] * SIZE[1]], 0.0);
    for _ in 0..SAMPLES {
        let scatter = bsdf.sample(&here(), wi, stream.row(), Walk::FromCamera);
        let Some(scatter) = scatter.filter(|scatter| !scatter.delta) else { continue };
        let [u, v] = warp::sphere::invert(scatter.direction);
        let bin = |x: f64, n: usize| ((x * n as f64) as usize).min(n - 1);
        counts[bin(u, SIZE[0]) * SIZE[1] + bin(v, SIZE[1])] += 1.0;
        inside += 1.0;
    }
    (counts, inside)
}

/// Integral of the density over each bin.
fn expect(bsdf: &Bsdf, wi: DVec3) -> Vec<f64> {
    let pdf = |u: [f64; 2]| {
        let wo = warp::sphere::sample(u);
        bsdf.evaluate(&here(), wi, wo, Walk::FromCamera).map_or(0.0, |evaluation| evaluation.pdf.0)
            / warp::sphere::PDF.0
    };
    let [rows, columns] = SIZE.map(|n| 1.0 / n as f64);
    let bin = |i: usize| [(i / SIZE[1]) as f64 * rows, (i % SIZE[1]) as f64 * columns];
    (0..SIZE[0] * SIZE[1]).map(|i| integrate(&pdf, bin(i), [rows, columns], 0)).collect()
}

/// Integral over a rectangle, which is split until halves agree with the whole, and twice at least.
fn integrate(f: &impl Fn([f64; 2]) -> f64, corner: [f64; 2], size: [f64; 2], depth: usize) -> f64 {
    let half = size.map(|s| 0.5 * s);
    let quarters = [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0]];
    let corners = quarters.map(|[i, j]| [corner[0] + i * half[0], corner[1] + j * half[1]]);
    if depth >= 1 {
        let (whole, parts) = (gauss(f, corner, size), corners.map(|corner| gauss(f, corner, half)).iter().sum::<f64>());
        if (whole - parts).abs() < 2e-6 + 1e-3 * parts || depth == 8 {
            return parts;
        }
    }
    corners.iter().map(|corner| integrate(f, *corner, half, depth + 1)).sum()
}

/// The product of two rules of Gauss and Legendre with three nodes.
fn gauss(f: &impl Fn([f64; 2]) -> f64, corner: [f64; 2], size: [f64; 2]) -> f64 {
    let step = 0.5 * 0.6f64.sqrt();
    let nodes = [(0.5 - step, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.5 + step, 5.0 / 18.0)];
    let along = |x: f64| nodes.iter().map(|(y, w)| w * f([x, corner[1] + y * size[1]])).sum::<f64>();
    nodes.iter().map(|(x, w)| w * along(corner[0] + x * size[0])).sum::<f64>() * size[0] * size[1]
}

fn compare(counts: &[f64], expected: &[f64]) -> f64 {
    let (mut sum, mut bins) = (0.0, 0.0);
    let mut rest = (0.0, 0.0);
    let mut add = |count: f64, expected: f64| {
        sum += (count - expected) * (count - expected) / expected;
        bins += 1.0;
    };
    for (count, share) in counts.iter().zip(expected) {
        let expected = share * SAMPLES as f64;
        if expected >= FEWEST {
            add(*count, expected);
        } else {
            rest = (rest.0 + count, rest.1 + expected);
        }
    }
    if rest.1 >= FEWEST {
        add(rest.0, rest.1);
    } else {
        assert!(rest.0 < 5.0 * FEWEST, "samples where the density is zero");
    }
    if bins == 0.0 { 0.0 } else { deviation(sum, bins) }
}
