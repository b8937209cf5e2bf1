//! What a mutation's course contributes, and how likely it is accepted: see the head of [`super`].

use super::{Draft, PathSpace, View, connection};
use crate::math::Stream;
use crate::paths::{Course, Found, FullPath, Techniques, connect_visible};
use crate::scene::Caster;

impl PathSpace {
    /// What the new course contributes, and the acceptance; `None` where it carries no light.
    pub(super) fn judge(
        &mut self,
        scene: &Caster<'_>,
        draft: &Draft,
        (path, current): (&FullPath, &Found),
        proposal: &mut FullPath,
    ) -> Option<(Found, f64)> {
        let Self { new, densities, target, .. } = self;
        let found = realise(scene, new, draft.technique, (&target.techniques(), target.count(new)), proposal)?;
        // The density of both paths, as far as T leaves something of it.
        let mut density = |path: &FullPath, which: usize| match draft.ranges {
            None => path.density(),
            Some(ranges) => {
                path.densities(densities);
                1.0 / densities[ranges[which].techniques()].iter().sum::<f64>()
            }
        };
        let ratio = found.luminance / current.luminance * density(proposal, 1) / density(path, 0) * draft.ratio;
        // Neither infinite nor NaN: a path whose density is none at all was not found by this technique.
        (ratio.is_finite()).then_some((found, ratio))
    }

    /// [`PathSpace::judge`], for a path whose light's end was replaced below x_d. It may take another technique: one is drawn
    /// by the weights, as jumps do, so that the acceptance has f in place of C.
    pub(super) fn judge_linked(
        &mut self,
        view: &View<'_>,
        (draft, d): (&Draft, usize),
        (path, current): (&FullPath, &Found),
        stream: &mut Stream,
        proposal: &mut FullPath,
    ) -> Option<(Found, f64)> {
        let Self { old, new, densities, target, walked, .. } = self;
        // The density of the mutation in units of that of the technique, but for what stays.
        let mut density = |course: &mut Course, densities: &[f64]| {
            let sampled = densities[..=d].iter().sum::<f64>();
            sampled + (d + 1) as f64 * densities[0] * connection::share(view, course, d, walked)
        };
        path.densities(densities);
        let alone = current.luminance / (target.count(old) * target.weight(densities, current.technique));
        let before = alone / density(old, densities);

        let mut found = realise(view.scene, new, draft.technique, (&Techniques::ALONE, 1.0), proposal)?;
        proposal.densities(densities);
        let ratio = found.luminance / density(new, densities) / before;
        if let Some(technique) = target.pick(densities, stream) {
            found = realise(view.scene, new, technique, (&target.techniques(), target.count(new)), proposal)?;
        }
        (ratio.is_finite()).then_some((found, ratio))
    }
}

/// What `course` contributes by a technique, times `count`, with the path as that finds it; `None` where that is nothing.
pub(super) fn realise(
    scene: &Caster<'_>,
    course: &mut Course,
    technique: usize,
    (techniques, count): (&Techniques, f64),
    path: &mut FullPath,
) -> Option<Found> {
    if technique == 0 {
        course.light_up(scene)?;
    }
    path.assemble(scene, course, technique)?;
    let connection = connect_visible(scene, &path.light.vertices, &path.camera.vertices, techniques)?;
    let value = connection.value * count;
    let luminance = value.luminance();
    // Of a path that a technique can hardly find the contribution may be beyond numbers: it is no proposal.
    if !(value.is_valid() && luminance > 0.0) {
        return None;
    }
    path.film = connection.film.unwrap_or(path.film);
    course.film = path.film;
    path.junction = connection.junction;
    Some(Found { value, luminance, class: connection.class, film: path.film, technique })
}
