//! Mergers of a light subpath with a camera subpath that end close to each other.

use super::connect::Connection;
use super::mis::{self, Joint, Junction, Techniques};
use super::subpath::Vertex;
use super::trace::reverse_pdf;
use crate::math::Walk;
use crate::scene::Caster;

/// Merges all of `light` (at least two vertices, the last on a surface) with all of `camera` (likewise), whose ends lie
/// within the merging radius: the contribution of one of the light subpaths that `techniques.merging` counts, with its
/// weight. `None` where nothing is contributed.
#[inline]
pub fn merge(scene: &Caster<'_>, light: &[Vertex], camera: &[Vertex], techniques: &Techniques) -> Option<Connection> {
    let ([.., from, photon], [before @ .., end]) = (light, camera) else { return None };
    let (surface, towards) = (end.surface()?, before.last()?);
    let (wi, wo) = (surface.frame.to_local(end.back), surface.frame.to_local(photon.back));
    let scattered = scene.evaluate(surface, wi, wo, Walk::FromCamera)?;
    // Photons arrive per true area, scattering counts area seen along the shading normal.
    let geometric = photon.back.dot(surface.geometric).abs();
    if geometric == 0.0 {
        return None;
    }
    let junction = Junction {
        light: end.forward.0,
        light_previous: reverse_pdf(from, photon, scattered.pdf).0,
        camera: reverse_pdf(towards, end, scattered.pdf_reverse).0,
        camera_previous: before.len().checked_sub(2).map_or(0.0, |i| before[i].reverse.0),
        preference: light[0].preference,
    };
    let share = mis::weight(light, before, &junction, Joint::Merged, techniques);
    let density = techniques.merging * end.forward.0;
    let weight = share * techniques.heuristic.map_or(1.0, |heuristic| heuristic.apply(density));
    let value = photon.throughput * scattered.value * end.throughput * (wo.z.abs() / geometric * weight);
    let class = photon.word.then(scattered.letter).join(end.word);
    Some(Connection { value: value / techniques.merging, class, film: None, junction })
}
