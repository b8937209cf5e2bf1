//! Random streams. Each job of a render owns one, keyed by what the job is (seed, pass, band, …) and never by the
//! thread that happens to run it: this is what makes images independent of the number of threads.

use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::{Rng, SeedableRng};

/// Four primary samples: what one vertex of a subpath reads (lobe or light choice, two for the direction or the
/// point, survival). Each in [0, 1).
pub type Row = [f64; 4];

/// A stream of uniform numbers in [0, 1).
#[derive(Clone, Debug)]
pub struct Stream(Xoshiro256PlusPlus);

impl Stream {
    /// The stream of `seed` and `key`; different keys give independent streams.
    pub fn new(seed: u64, key: &[u64]) -> Self {
        let mut hasher = blake3::Hasher::new();
        hasher.update(&seed.to_le_bytes());
        for part in key {
            hasher.update(&part.to_le_bytes());
        }
        Self(Xoshiro256PlusPlus::from_seed(*hasher.finalize().as_bytes()))
    }

    /// The next number, uniform in [0, 1) with 53 bits.
    #[inline]
    pub fn number(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// A number with the standard normal distribution.
    #[inline]
    pub fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }

    /// The next four numbers.
    #[inline]
    pub fn row(&mut self) -> Row {
        [self.number(), self.number(), self.number(), self.number()]
    }
}
