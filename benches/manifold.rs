//! Walks of specular chains, in microseconds of one thread: `cargo bench --bench manifold`. The goal moves by a twentieth
//! of its distance at most, which takes about four traces of the chain.

use cpu_time::ThreadTime;
use glam::DVec3;
use pathblend::bsdf::{Bsdf, Conductor, Dielectric};
use pathblend::camera::{Camera, Projection};
use pathblend::film::Filter;
use pathblend::geometry::Solid;
use pathblend::manifold::{Chain, Goal, Turn};
use pathblend::math::{Frame, Stream};
use pathblend::paths::Node;
use pathblend::scene::{Builder, Caster, FilmSpec, Origin, Scene, Surface};
use pathblend::spectrum::Spectrum;

fn scene(bsdf: Bsdf) -> Option<Scene> {
    let mut builder = Builder::new();
    let bsdf = builder.bsdf(bsdf);
    builder.solid(Solid::sphere(DVec3::ZERO, 0.7), bsdf, None).ok()?;
    let camera = Camera {
        origin: DVec3::splat(9.0),
        axes: Frame::around(-DVec3::Z),
        size: [4, 4],
        half: glam::DVec2::ONE,
        center: glam::DVec2::ZERO,
        projection: Projection::Perspective { lens_radius: 0.0, focus_distance: 1.0 },
    };
    builder.build(camera, FilmSpec { size: [4, 4], filter: Filter::Box }, 8).ok()
}

/// A chain through the ball, with its start and where to walk.
fn example(scene: &Caster<'_>, links: usize, stream: &mut Stream) -> Option<(DVec3, Chain, Goal)> {
    let [a, b, c, d] = stream.row();
    let start = DVec3::new(0.6 * (a - 0.5), 0.6 * (b - 0.5), 2.0);
    let mut direction = (DVec3::new(0.9 * (c - 0.5), 0.9 * (d - 0.5), 0.0) - start).normalize();
    let mut origin = Origin::from(start);
    let mut surfaces: Vec<Surface> = Vec::new();
    for _ in 0..links {
        let surface = scene.intersect(origin, direction)?;
        let turn = match scene.bsdf(surface.bsdf).refractive_index() {
            Some(index) if surfaces.is_empty() => Turn::Refracted { eta: index },
            Some(index) => Turn::Refracted { eta: 1.0 / index },
            None => Turn::Reflected,
        };
        direction = turn.onward(surface.frame.normal, -direction)?;
        origin = surface.leave(direction);
        surfaces.push(surface);
    }
    let end = surfaces.last()?.position + direction * 1.5;
    let Frame { tangent, bitangent, .. } = Frame::around(direction);
    let aside = (tangent * (stream.number() - 0.5) + bitangent * (stream.number() - 0.5)) * 0.1;
    let deltas: Vec<(Surface, bool)> = surfaces.iter().map(|surface| (*surface, true)).collect();
    Some((start, Chain::new(scene, start, &deltas, end).ok()?, Goal::new(end + aside, [tangent, bitangent])))
}

fn main() {
    let mirror = Bsdf::Conductor(Conductor { index: None, specular_reflectance: Spectrum::ONE.into() });
    let one = Spectrum::ONE;
    let glass = Bsdf::Dielectric(Dielectric { eta: 1.5, specular_reflectance: one, specular_transmittance: one });
    println!("| chain | arrive | traces a walk | µs a walk |\n|---|---|---|---|");
    for (name, bsdf, links) in [("mirror ball", mirror, 1), ("ball of glass", glass, 2)] {
        let Some(scene) = scene(bsdf) else { return eprintln!("the scene cannot be built") };
        let scene = Caster::new(&scene);
        let mut stream = Stream::new(1, &[]);
        let examples: Vec<_> = (0..20_000).filter_map(|_| example(&scene, links, &mut stream)).collect();
        let clock = ThreadTime::now();
        let (mut arrived, mut traces) = (0, 0);
        for (start, chain, goal) in &examples {
            if let Ok((_, steps)) = chain.walk(&scene, &Node::lens(*start), goal) {
                arrived += 1;
                traces += steps;
            }
        }
        let (all, time) = (examples.len() as f64, clock.elapsed().as_secs_f64());
        let share = 100.0 * f64::from(arrived) / all;
        println!("| {name} | {share:.1} % | {:.1} | {:.2} |", traces as f64 / f64::from(arrived), 1e6 * time / all);
    }
}
