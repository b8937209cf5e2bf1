//! Pixels as they are stored: compactly, decoded by table when they are looked up.

use crate::spectrum::Spectrum;
use glam::DVec2;
use half::f16;
use std::fmt;
use std::sync::{LazyLock, OnceLock};

/// Samples, row by row from the top, the channels of a pixel side by side.
#[derive(Clone, PartialEq)]
pub enum Texels {
    /// 255ths, in the sRGB curve unless they are read raw.
    Bytes(Vec<u8>),
    /// 65535ths, in the sRGB curve unless they are read raw.
    Shorts(Vec<u16>),
    /// Linear, in half precision.
    Halves(Vec<f16>),
    /// Linear.
    Floats(Vec<f32>),
}

impl Texels {
    /// Linear samples, in half precision where this loses nothing.
    pub fn linear(samples: Vec<f32>) -> Self {
        if samples.iter().all(|sample| f16::from_f32(*sample).to_f32() == *sample) {
            return Self::Halves(samples.into_iter().map(f16::from_f32).collect());
        }
        Self::Floats(samples)
    }

    fn len(&self) -> usize {
        match self {
            Self::Bytes(samples) => samples.len(),
            Self::Shorts(samples) => samples.len(),
            Self::Halves(samples) => samples.len(),
            Self::Floats(samples) => samples.len(),
        }
    }
}

/// Most pixels along a side.
const MOST: usize = 1 << 30;

/// An image of one channel, which is grey, or of three.
#[derive(Clone, PartialEq)]
pub struct Picture {
    size: [usize; 2],
    channels: usize,
    texels: Texels,
    /// Mean colours, decoded and raw, once somebody has asked.
    means: [OnceLock<Spectrum>; 2],
}

impl fmt::Debug for Picture {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Picture({}x{}, {} channels)", self.size[0], self.size[1], self.channels)
    }
}

impl Picture {
    /// A picture of width × height pixels; `None` where there are none, too many, or not one or three
    /// samples for each.
    pub fn new(size: [usize; 2], texels: Texels) -> Option<Self> {
        let pixels = size[0].checked_mul(size[1]).filter(|pixels| *pixels > 0)?;
        size.iter().all(|side| *side <= MOST).then_some(())?;
        let channels = texels.len() / pixels;
        let whole = [1, 3].contains(&channels) && texels.len() == channels * pixels;
        whole.then(|| Self { size, channels, texels, means: Default::default() })
    }

    /// Width and height.
    #[inline]
    pub fn size(&self) -> [usize; 2] {
        self.size
    }

    /// The colour of the pixel in column `x` and row `y`; samples in the sRGB curve are decoded unless `raw`.
    #[inline]
    pub fn pixel(&self, x: usize, y: usize, raw: bool) -> Spectrum {
        self.weighted([(x, y, 1.0)], raw)
    }

    /// The colour between two columns and two rows, at `share` of the way from the first to the second.
    #[inline]
    pub fn between(&self, [left, right]: [usize; 2], [top, bottom]: [usize; 2], share: DVec2, raw: bool) -> Spectrum {
        let DVec2 { x, y } = share;
        let (above, below) = (1.0 - y, y);
        let places = [
            (left, top, (1.0 - x) * above),
            (right, top, x * above),
            (left, bottom, (1.0 - x) * below),
            (right, bottom, x * below),
        ];
        self.weighted(places, raw)
    }

    /// The sum of pixels, each given by column, row and weight.
    #[inline]
    fn weighted<const N: usize>(&self, pixels: [(usize, usize, f64); N], raw: bool) -> Spectrum {
        // One decision for all samples, not one for each.
        match &self.texels {
            Texels::Bytes(samples) if raw => self.sum(samples, pixels, |code| f64::from(code) * (1.0 / 255.0)),
            Texels::Bytes(samples) => {
                let decoded: &[f64; 256] = &BYTES;
                self.sum(samples, pixels, |code| decoded[usize::from(code)])
            }
            Texels::Shorts(samples) if raw => self.sum(samples, pixels, |code| f64::from(code) * (1.0 / 65535.0)),
            Texels::Shorts(samples) => {
                let decoded: &[f64] = &SHORTS;
                self.sum(samples, pixels, |code| decoded[usize::from(code)])
            }
            Texels::Halves(samples) => self.sum(samples, pixels, f16::to_f64),
            Texels::Floats(samples) => self.sum(samples, pixels, f64::from),
        }
    }

    #[inline(always)]
    fn sum<T: Copy, const N: usize>(
        &self,
        samples: &[T],
        pixels: [(usize, usize, f64); N],
        decode: impl Fn(T) -> f64,
    ) -> Spectrum {
        let number = |(x, y)| y * self.size[0] + x;
        if self.channels == 1 {
            let sum = pixels.iter().map(|&(x, y, weight)| decode(samples[number((x, y))]) * weight).sum();
            return Spectrum::grey(sum);
        }
        // In whole pixels, so that one check of bounds does for three samples.
        let (whole, _) = samples.as_chunks::<3>();
        let mut sum = [0.0; 3];
        for (x, y, weight) in pixels {
            let pixel = &whole[number((x, y))];
            for (channel, code) in sum.iter_mut().zip(pixel) {
                *channel += decode(*code) * weight;
            }
        }
        Spectrum::rgb(sum[0], sum[1], sum[2])
    }

    /// The mean of all pixels.
    pub fn mean(&self, raw: bool) -> Spectrum {
        *self.means[usize::from(raw)].get_or_init(|| {
            let [width, height] = self.size;
            let row = |y| (0..width).fold(Spectrum::BLACK, |sum, x| sum + self.pixel(x, y, raw));
            (0..height).map(row).fold(Spectrum::BLACK, |sum, row| sum + row) / (width * height) as f64
        })
    }
}

/// Linear value of each byte in the sRGB curve.
static BYTES: LazyLock<[f64; 256]> = LazyLock::new(|| std::array::from_fn(|code| decode(code as f64 / 255.0)));

static SHORTS: LazyLock<Vec<f64>> =
    LazyLock::new(|| (0..=65535).map(|code| decode(f64::from(code) / 65535.0)).collect());

/// Linear value of an sRGB code value in [0, 1] (IEC 61966-2-1).
fn decode(code: f64) -> f64 {
    if code <= 0.04045 { code / 12.92 } else { ((code + 0.055) / 1.055).powf(2.4) }
}
