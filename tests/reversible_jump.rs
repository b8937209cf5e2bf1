//! Reversible jumps in one dimension: the right ones keep the distribution, both mistakes of the paper show.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../examples/one_dimension/mod.rs"]
mod one_dimension;

use one_dimension::{CHAINS, Chain, TECHNIQUES, run};
use pathblend::math::Stream;

/// Of 128 bins of a correct chain one exceeds this less than once in 10⁴ runs.
const SIGMAS: f64 = 5.2;

#[test]
fn only_full_jumps_keep_the_distribution() {
    for chain in CHAINS {
        let [states, techniques] = run(chain, 1).worst();
        println!("{chain:?}: worst deviation {states:.1} standard errors of states, {techniques:.1} of techniques");
        match chain {
            Chain::Multiplexed | Chain::ReversibleJump => assert!(states.max(techniques) < SIGMAS, "{chain:?}"),
            Chain::WithoutJacobian | Chain::FixedPoint => {
                assert!(states.min(techniques) > 2.0 * SIGMAS, "{chain:?} goes unnoticed");
            }
        }
    }
}

#[test]
fn techniques_invert_and_follow_their_density() {
    let mut stream = Stream::new(2, &[]);
    for technique in TECHNIQUES {
        let (mut counts, samples) = ([0.0f64; 20], 200_000);
        for _ in 0..samples {
            let x = technique.sample([stream.number(), stream.number()]);
            let again = technique.sample(technique.invert(x, [stream.number(), stream.number()]));
            assert!((again - x).abs() < 1e-9, "{technique:?}: {x} {again}");
            counts[((x * 20.0) as usize).min(19)] += 1.0;
        }
        for (bin, count) in counts.iter().enumerate() {
            let at = |i: usize| (bin as f64 + (i as f64 + 0.5) / 100.0) / 20.0;
            let mean = (0..100).map(|i| technique.pdf(at(i))).sum::<f64>() / 2000.0 * f64::from(samples);
            assert!((count - mean).abs() < 5.0 * mean.sqrt() + 1.0, "{technique:?}, bin {bin}: {count} for {mean}");
        }
    }
}
