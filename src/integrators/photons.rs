//! What the methods that estimate densities of photons have in common.

use glam::DVec3;
use std::ops::Range;

/// Share of the photons in a radius that is kept from pass to pass (Knaus and Zwicker 2011, eq. 20); the field's usual
/// value.
const ALPHA: f64 = 2.0 / 3.0;

/// First radius in units of the size that a pixel has where photons are looked for, by default.
pub(super) const FIRST_RADIUS: f64 = 2.5;

/// Most light subpaths of a pass by default.
pub const MOST_PHOTONS: usize = 1 << 20;

/// Photons whose distance from the tangent plane exceeds this share of the radius lie on another surface.
const FLATNESS: f64 = 0.3;

/// Jobs that the light subpaths of a pass are split into, independent of the number of threads.
pub(super) const JOBS: usize = 32;

/// What becomes of the square of the radius after pass number `pass`, counted from 0.
pub(super) fn shrinkage(pass: u64) -> f64 {
    let n = (pass + 1) as f64;
    (n + ALPHA) / (n + 1.0)
}

/// The light subpaths of a job, out of `paths`.
pub(super) fn job_range(paths: usize, job: usize) -> Range<usize> {
    paths * job / JOBS..paths * (job + 1) / JOBS
}

/// Whether a photon at `offset` from a point lies on the surface through it that has this `normal`.
#[inline]
pub(super) fn is_beside(offset: DVec3, normal: DVec3, radius: f64) -> bool {
    offset.dot(normal).abs() <= FLATNESS * radius
}
