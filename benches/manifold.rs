//! Walks of chains of one thread, by length and by how far half-vectors are off the normals: `cargo bench --bench manifold`.
//! The goal moves by a twentieth of its distance at most.

use cpu_time::ThreadTime;
use glam::{DVec2, DVec3};
use pathblend::bsdf::{Bsdf, Conductor, Dielectric};
use pathblend::camera::{Camera, Projection};
use pathblend::film::Filter;
use pathblend::geometry::Solid;
use pathblend::manifold::{Chain, Goal, MOST_STEPS, Turn};
use pathblend::math::{Frame, Stream};
use pathblend::paths::Node;
use pathblend::scene::{Builder, Caster, FilmSpec, Origin, Scene, Surface};
use pathblend::spectrum::Spectrum;
use std::f64::consts::TAU;

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

/// A chain that walks: where it starts, and to which goal from which.
struct Example {
    start: Node,
    chain: Chain,
    old: Goal,
    new: Goal,
}

/// A chain through the ball, reflected within it between its ends if it has more than two vertices; its half-vectors are off
/// the normals by `offset`.
fn example(scene: &Caster<'_>, links: usize, offset: f64, stream: &mut Stream) -> Option<Example> {
    let [a, b, c, d] = stream.row();
    let start = DVec3::new(0.6 * (a - 0.5), 0.6 * (b - 0.5), 2.0);
    let mut direction = (DVec3::new(0.9 * (c - 0.5), 0.9 * (d - 0.5), 0.0) - start).normalize();
    let mut origin = Origin::from(start);
    let mut surfaces: Vec<(Surface, bool)> = Vec::new();
    for number in 0..links {
        let surface = scene.intersect(origin, direction)?;
        let turn = match scene.bsdf(surface.bsdf).refractive_index() {
            Some(index) if number == 0 => Turn::Refracted { eta: index },
            Some(index) if number + 1 == links => Turn::Refracted { eta: 1.0 / index },
            _ => Turn::Reflected,
        };
        let aside = DVec2::from_angle(TAU * stream.number()) * offset;
        let up = (1.0 - offset * offset).sqrt();
        let facet = Frame::around(surface.frame.normal).to_world(aside.extend(up));
        direction = turn.onward(facet, -direction)?;
        origin = surface.leave(direction);
        surfaces.push((surface, offset == 0.0));
    }
    let end = surfaces.last()?.0.position + direction * 1.5;
    let Frame { tangent, bitangent, .. } = Frame::around(direction);
    let aside = (tangent * (stream.number() - 0.5) + bitangent * (stream.number() - 0.5)) * 0.1;
    let goal = |at: DVec3| Goal::new(at, [tangent, bitangent]);
    let chain = Chain::new(scene, start, &surfaces, end).ok()?;
    Some(Example { start: Node::lens(start), chain, old: goal(end), new: goal(end + aside) })
}

/// The most traces of a walk in each column.
const COLUMNS: [usize; 5] = [3, 4, 5, 8, MOST_STEPS];

fn main() {
    let mirror = Bsdf::Conductor(Conductor { index: None, specular_reflectance: Spectrum::ONE.into() });
    let one = Spectrum::ONE;
    let glass = Bsdf::Dielectric(Dielectric { eta: 1.5, specular_reflectance: one, specular_transmittance: one });
    println!("| chain | half-vectors off by | arrive | return | µs a walk | traces: up to 3 | 4 | 5 | 8 | 20 |");
    println!("|---|---|---|---|---|---|---|---|---|---|");
    let chains = [("mirror ball", &mirror, 1), ("ball of glass", &glass, 2), ("ball of glass", &glass, 3)];
    for (name, bsdf, links) in chains.into_iter().chain([("ball of glass", &glass, 5)]) {
        let Some(scene) = scene(bsdf.clone()) else { return eprintln!("the scene cannot be built") };
        let scene = Caster::new(&scene);
        for offset in [0.0, 0.05, 0.1, 0.2] {
            let mut stream = Stream::new(1, &[]);
            let examples: Vec<_> = (0..20_000).filter_map(|_| example(&scene, links, offset, &mut stream)).collect();
            let clock = ThreadTime::now();
            let walks: Vec<_> =
                examples.iter().map(|Example { start, chain, new, .. }| chain.walk(&scene, start, new).ok()).collect();
            let time = clock.elapsed().as_secs_f64();
            let (mut returned, mut traces) = (0, [0; COLUMNS.len()]);
            for (Example { start, chain, old, .. }, walk) in examples.iter().zip(&walks) {
                let Some((there, steps)) = walk else { continue };
                traces[COLUMNS.iter().position(|most| steps <= most).unwrap_or(COLUMNS.len() - 1)] += 1;
                let Ok((back, _)) = there.walk(&scene, start, old) else { continue };
                let same = back.surfaces().zip(chain.surfaces()).all(|(a, b)| a.position.distance(b.position) < 1e-8);
                returned += u32::from(same);
            }
            let all = examples.len() as f64;
            let percent = |count: u32| 100.0 * f64::from(count) / all;
            let arrived: u32 = traces.iter().sum();
            print!(
                "| {name}, {links} | {offset} | {:.1} % | {:.1} % | {:.2} |",
                percent(arrived),
                percent(returned),
                1e6 * time / all
            );
            traces.iter().for_each(|count| print!(" {:.1} % |", percent(*count)));
            println!();
        }
    }
}
