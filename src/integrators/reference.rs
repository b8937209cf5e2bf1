//! Renders that take long enough to be interrupted: until the noise is small, and with a file to go on from.

use super::checkpoint::{self, CheckpointError};
use super::render::Run;
use super::{Method, Outcome, Progress, Settings};
use crate::scene::Scene;
use glam::DVec3;
use std::path::Path;
use std::time::{Duration, Instant};

/// Writing checkpoints takes no more than this share of the time.
const MOST_WRITING: f64 = 0.05;

/// Where and how often a render leaves its state.
#[derive(Clone, Copy, Debug)]
pub struct Keep<'a> {
    /// The file. Where it is there, the render goes on from it.
    pub path: &'a Path,
    /// Time between two states; more where writing one takes long.
    pub every: Duration,
}

/// Why there is no reference.
#[derive(Debug, thiserror::Error)]
pub enum ReferenceError {
    /// The method's state is more than its film.
    #[error("a reference cannot be rendered by {}: its chains are not in checkpoints; expected path, bdpt, sppm or vcm",
        .0.name())]
    Method(Method),
    /// The state cannot be read or written.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
}

/// The method for a scene where the user names none: bidirectional path tracing, which is unbiased, where no scattering
/// model has delta lobes; vertex connection and merging elsewhere, because mirror images of caustics can be found by photons
/// alone. What is noisy for other reasons is not seen by this rule.
pub fn usual_method(scene: &Scene) -> Method {
    let has_delta = |wi| scene.bsdfs().iter().any(|bsdf| bsdf.has_delta(wi));
    if has_delta(DVec3::Z) || has_delta(DVec3::NEG_Z) { Method::Vcm } else { Method::Bdpt }
}

/// Renders as [`render`](super::render) does, and leaves the state in a file now and then and at the end, from which the
/// same call goes on: with as many passes the image is the same, bit for bit, however often it was interrupted. The budget
/// may be another one, so that a finished reference can be made better; its times are those of all runs together.
///
/// The file stays when all is done. A state that cannot be written ends the render, since the hours to come would be lost
/// with it; the state before stays.
///
/// # Errors
/// [`ReferenceError`].
pub fn reference(
    scene: &Scene,
    method: Method,
    settings: &Settings,
    keep: Keep<'_>,
    mut progress: impl FnMut(Progress),
) -> Result<Outcome, ReferenceError> {
    if !method.resumes() {
        return Err(ReferenceError::Method(method));
    }
    let mut run = Run::start(scene, method, settings);
    if checkpoint::resume(&mut run, keep.path)? {
        progress(run.progress());
    }
    let (mut last, mut pause) = (Instant::now(), keep.every);
    while !run.is_done() {
        run.pass();
        progress(run.progress());
        if last.elapsed() >= pause {
            let start = Instant::now();
            checkpoint::save(&run, keep.path)?;
            last = Instant::now();
            pause = keep.every.max((last - start).div_f64(MOST_WRITING));
        }
    }
    checkpoint::save(&run, keep.path)?;
    Ok(run.finish())
}
