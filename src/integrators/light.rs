//! Light tracing: walks from the lights, every vertex of which is connected with the lens (Veach 1997, section 10.2,
//! technique t = 1). One path per pixel and pass.
//!
//! It finds caustics on surfaces that the camera sees best of all, and nothing that is seen in a mirror or through smooth
//! glass: a path whose last vertex before the lens has delta lobes only has no technique here. Light that the camera sees
//! directly is found by a walk from there.

use super::bdpt::{ROULETTE_FROM, connect_with_lens};
use super::path::Path;
use super::photons::{JOBS, job_range};
use super::{Counts, render::Settings};
use crate::film::{Film, Kernel, Splats};
use crate::math::Stream;
use crate::paths::{Random, Subpath, Techniques, trace_light};
use crate::scene::{Caster, Scene};
use rayon::prelude::*;

/// The method's settings.
pub(super) struct Light {
    seed: u64,
    max_depth: usize,
    /// For light that the camera sees.
    seen: Path,
}

impl Light {
    pub(super) fn start(settings: &Settings) -> Self {
        Self { seed: settings.seed, max_depth: settings.max_depth, seen: Path::up_to(settings, 1) }
    }

    pub(super) fn pass(&self, scene: &Scene, film: &mut Film, pass: u64, counts: &mut Counts) {
        self.seen.pass(scene, film, pass, counts);
        let (kernel, size) = (film.kernel.clone(), film.size);
        let jobs: Vec<(Splats, u64)> =
            (0..JOBS).into_par_iter().map(|job| self.shoot(scene, &kernel, size, pass, job)).collect();
        counts.add((size[0] * size[1]) as u64, jobs.iter().map(|job| job.1).sum());
        let splats: Vec<Splats> = jobs.into_iter().map(|job| job.0).collect();
        film.splat(&splats);
    }

    /// The light subpaths of one job, connected with the lens.
    fn shoot(&self, scene: &Scene, kernel: &Kernel, size: [usize; 2], pass: u64, job: usize) -> (Splats, u64) {
        let caster = Caster::new(scene);
        let mut stream = Stream::new(self.seed, &[1, pass, job as u64]);
        let (mut light, mut lens) = (Subpath::default(), Subpath::default());
        let mut splats = Splats::new(size);
        for _ in job_range(size[0] * size[1], job) {
            trace_light(&caster, &mut Random(&mut stream), self.max_depth, ROULETTE_FROM, &mut light);
            connect_with_lens(&caster, &light.vertices, &mut lens, &Techniques::ALONE, &mut stream, |film, found| {
                splats.add(kernel, film, found.class, found.value);
            });
        }
        (splats, caster.rays())
    }
}
