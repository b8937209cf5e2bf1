//! Specular chains: derivatives of their law, and walks to where an end has moved.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use common::{build, diffuse, glass, pinhole};
use glam::{DMat2, DVec2, DVec3, Vec3};
use pathblend::bsdf::{Bsdf, Conductor};
use pathblend::geometry::Solid;
use pathblend::manifold::{Chain, Goal, MOST_LINKS, Rejection, Turn, derivatives, offset};
use pathblend::math::{Frame, Stream};
use pathblend::paths::Node;
use pathblend::scene::{Builder, Caster, Mesh, Origin, Patch, Scene, Surface};
use pathblend::spectrum::Spectrum;

/// Surfaces as delta vertices.
fn deltas(surfaces: &[Surface]) -> Vec<(Surface, bool)> {
    surfaces.iter().map(|surface| (*surface, true)).collect()
}

fn mirror() -> Bsdf {
    Bsdf::Conductor(Conductor { index: None, specular_reflectance: Spectrum::grey(0.9).into() })
}

fn scene(add: impl FnOnce(&mut Builder)) -> Scene {
    let mut builder = Builder::new();
    add(&mut builder);
    build(builder, pinhole(4, 0.5, DVec3::splat(9.0), -DVec3::Z), 8)
}

fn solid(bsdf: Bsdf, solid: Solid) -> Scene {
    scene(|builder| {
        let bsdf = builder.bsdf(bsdf);
        builder.solid(solid, bsdf, None).unwrap();
    })
}

/// A square of water from −1 to 1, of waves with interpolated normals.
fn waves() -> Mesh {
    let side = 12u32;
    let at = |i: u32| 2.0 * i as f32 / side as f32 - 1.0;
    let grid: Vec<(f32, f32)> = (0..=side).flat_map(|i| (0..=side).map(move |j| (at(i), at(j)))).collect();
    let positions = grid.iter().map(|(x, y)| Vec3::new(*x, *y, 0.03 * (4.0 * x).sin() * (3.0 * y).cos())).collect();
    let slope = |x: f32, y: f32| {
        Vec3::new(-0.12 * (4.0 * x).cos() * (3.0 * y).cos(), 0.09 * (4.0 * x).sin() * (3.0 * y).sin(), 1.0).normalize()
    };
    let normals = grid.iter().map(|(x, y)| slope(*x, *y)).collect();
    let corner = |i: u32, j: u32| i * (side + 1) + j;
    let cell = |i: u32, j: u32| {
        let [a, b, c, d] = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
        [[a, b, c], [a, c, d]]
    };
    let triangles = (0..side).flat_map(|i| (0..side).flat_map(move |j| cell(i, j))).collect();
    Mesh { positions, normals, triangles, ..Mesh::default() }
}

/// A scene, and what light does there: whether it is reflected, vertex by vertex.
struct Case {
    name: &'static str,
    scene: Scene,
    reflects: &'static [bool],
}

fn cases() -> Vec<Case> {
    let ball = Solid::sphere(DVec3::ZERO, 0.7);
    let pipe = Solid::cylinder(DVec3::new(-2.0, 0.3, 0.1), DVec3::new(2.0, -0.2, 0.0), 0.6);
    let water = scene(|builder| {
        let water = builder.bsdf(glass(1.33));
        builder.mesh(waves(), water, None).unwrap();
    });
    vec![
        Case { name: "mirror ball", scene: solid(mirror(), ball), reflects: &[true] },
        Case { name: "mirror pipe", scene: solid(mirror(), pipe), reflects: &[true] },
        Case { name: "waves", scene: water, reflects: &[false] },
        Case { name: "pipe of glass", scene: solid(glass(1.5), pipe), reflects: &[false, false] },
        Case { name: "ball of glass", scene: solid(glass(1.5), ball), reflects: &[false, false] },
        Case { name: "reflection within it", scene: solid(glass(1.5), ball), reflects: &[false, true, false] },
    ]
}

struct Example {
    start: DVec3,
    surfaces: Vec<Surface>,
    goal: DVec3,
    tangents: [DVec3; 2],
}

impl Example {
    fn chain(&self, scene: &Caster<'_>) -> Chain {
        Chain::new(scene, self.start, &deltas(&self.surfaces), self.goal).unwrap()
    }

    fn aim(&self, by: DVec2) -> Goal {
        Goal::new(self.goal + self.tangents[0] * by.x + self.tangents[1] * by.y, self.tangents)
    }
}

/// Any chain of the case, traced from a random point; `None` where it misses or is reflected totally.
fn example(case: &Case, scene: &Caster<'_>, stream: &mut Stream) -> Option<Example> {
    let [a, b, c, d] = stream.row();
    let start = DVec3::new(0.6 * (a - 0.5), 0.6 * (b - 0.5), 2.0);
    let target = DVec3::new(0.9 * (c - 0.5), 0.9 * (d - 0.5), 0.0);
    let mut direction = (target - start).normalize();
    let mut origin = Origin::from(start);
    let mut surfaces = Vec::new();
    for reflects in case.reflects {
        let surface = scene.intersect(origin, direction)?;
        let outside = direction.dot(surface.frame.normal) < 0.0;
        let turn = match scene.bsdf(surface.bsdf).refractive_index() {
            Some(index) if !reflects => Turn::Refracted { eta: if outside { index } else { 1.0 / index } },
            _ => Turn::Reflected,
        };
        direction = turn.onward(surface.frame.normal, -direction)?;
        origin = surface.leave(direction);
        surfaces.push(surface);
    }
    let goal = surfaces.last()?.position + direction * (1.0 + stream.number());
    let Frame { tangent, bitangent, .. } = Frame::around(direction);
    Some(Example { start, surfaces, goal, tangents: [tangent, bitangent] })
}

fn examples(case: &Case, scene: &Caster<'_>, count: usize) -> Vec<Example> {
    let mut stream = Stream::new(7, &[count as u64]);
    (0..2 * count).filter_map(|_| example(case, scene, &mut stream)).take(count).collect()
}

fn flat(position: DVec3) -> Patch {
    let tangents = [DVec3::X, DVec3::new(0.0, 0.6, 0.8)];
    Patch { position, tangents, normal: DVec3::X, turning: [DVec3::ZERO; 2] }
}

fn moved(patch: &Patch, axis: usize, by: f64) -> Patch {
    Patch { position: patch.position + patch.tangents[axis] * by, ..*patch }
}

/// The surface where a vertex comes to lie that moves along a tangent.
fn slid(scene: &Caster<'_>, surface: &Surface, axis: usize, by: f64) -> Option<Patch> {
    let patch = scene.patch(surface).unwrap();
    let above = moved(&patch, axis, by).position + surface.geometric * 0.01;
    let found = scene.intersect(Origin::from(above), -surface.geometric)?;
    // Normals have no derivative on the edges between triangles.
    (found.primitive == surface.primitive).then(|| scene.patch(&found).unwrap())
}

fn relative(found: DMat2, expected: DMat2) -> f64 {
    let largest = |m: DMat2| m.to_cols_array().iter().fold(0.0, |most, x| f64::max(most, x.abs()));
    largest(found - expected) / largest(expected)
}

#[test]
fn derivatives_are_those_of_the_law() {
    const STEP: f64 = 1e-5;
    for case in cases() {
        let scene = Caster::new(&case.scene);
        let (mut worst, mut seen) = (0.0, 0);
        for example in examples(&case, &scene, 300) {
            let chain_ends = |i: usize| {
                let before = if i == 0 { example.start } else { example.surfaces[i - 1].position };
                (flat(before), flat(example.surfaces.get(i + 1).map_or(example.goal, |next| next.position)))
            };
            for (i, surface) in example.surfaces.iter().enumerate() {
                let (before, after) = chain_ends(i);
                let here = scene.patch(surface).unwrap();
                let back = (before.position - here.position).normalize();
                let turn = Turn::at(&scene, surface, back, (after.position - here.position).normalize()).unwrap();
                let frame = Frame::around(here.normal);
                let law = |before: &Patch, here: &Patch, after: &Patch| {
                    let off = offset(before.position, (here, turn), after.position).unwrap();
                    DVec2::new(frame.tangent.dot(off), frame.bitangent.dot(off))
                };
                assert!(law(&before, &here, &after).length() < 1e-9, "{}: not on the manifold", case.name);
                let by = |change: &dyn Fn(usize, f64) -> Option<DVec2>| {
                    let column = |axis: usize| Some((change(axis, STEP)? - change(axis, -STEP)?) / (2.0 * STEP));
                    Some(DMat2::from_cols(column(0)?, column(1)?))
                };
                let Some(own) = by(&|axis, step| Some(law(&before, &slid(&scene, surface, axis, step)?, &after)))
                else {
                    continue;
                };
                let first = by(&|axis, step| Some(law(&moved(&before, axis, step), &here, &after))).unwrap();
                let last = by(&|axis, step| Some(law(&before, &here, &moved(&after, axis, step)))).unwrap();
                let found = derivatives(&before, (&here, turn), &after).unwrap();
                for (found, expected) in [(found.before, first), (found.here, own), (found.after, last)] {
                    worst = f64::max(worst, relative(found, expected));
                }
                seen += 1;
            }
        }
        println!("| {} | {seen} | {worst:.1e} |", case.name);
        assert!(seen > 150 && worst < 1e-6, "{}: {worst}", case.name);
    }
}

/// Where a chain ends that sets out a little beside another, the walk from the other leads: an end moved back and forth
/// brings the chain back, to within 1e-8, unless it is rejected.
#[test]
fn walks_arrive_and_return() {
    for case in cases() {
        let scene = Caster::new(&case.scene);
        let mut stream = Stream::new(8, &[]);
        let [mut arrived, mut returned, mut steps, mut elsewhere] = [0; 4];
        let examples = examples(&case, &scene, 1000);
        for example in &examples {
            let start = &Node::lens(example.start);
            let by = DVec2::new(stream.number() - 0.5, stream.number() - 0.5) * 0.1;
            let chain = example.chain(&scene);
            let Ok((there, count)) = chain.walk(&scene, start, &example.aim(by)) else { continue };
            arrived += 1;
            steps += count;
            // By the law, and not by the walk's own word.
            let mut before = example.start;
            let places: Vec<DVec3> = there.surfaces().map(|surface| surface.position).collect();
            let end = example.aim(by);
            for (i, surface) in there.surfaces().enumerate() {
                let after = places.get(i + 1).copied().unwrap_or_else(|| end.position());
                let here = scene.patch(surface).unwrap();
                let ends = [before, after].map(|p| (p - here.position).normalize());
                let turn = Turn::at(&scene, surface, ends[0], ends[1]).unwrap();
                assert!(offset(before, (&here, turn), after).unwrap().length() < 1e-8, "{}", case.name);
                before = here.position;
            }
            let Ok((back, _)) = there.walk(&scene, start, &example.aim(DVec2::ZERO)) else { continue };
            let apart = back.surfaces().zip(&example.surfaces).map(|(a, b)| a.position.distance(b.position));
            if apart.fold(0.0, f64::max) < 1e-8 { returned += 1 } else { elsewhere += 1 }
        }
        let mean = steps as f64 / f64::from(arrived as u32);
        println!("| {} | {} | {arrived} | {returned} | {elsewhere} | {mean:.1} |", case.name, examples.len());
        assert!(examples.len() > 500 && arrived * 10 > examples.len() * 7, "{}: {arrived} arrived", case.name);
        assert!(returned * 100 > arrived * 90, "{}: {returned} of {arrived} returned", case.name);
    }
}

#[test]
fn first_vertices_follow_the_goal() {
    const STEP: f64 = 1e-5;
    const BESIDE: f64 = 0.05;
    for case in cases() {
        let scene = Caster::new(&case.scene);
        let mut errors = Vec::new();
        // As delta vertices, and as glossy ones whose half-vectors lead to a goal beside.
        for (example, glossy) in
            examples(&case, &scene, 200).iter().flat_map(|example| [(example, false), (example, true)])
        {
            let start = Node::lens(example.start);
            let aside = if glossy { DVec2::splat(BESIDE) } else { DVec2::ZERO };
            let surfaces: Vec<(Surface, bool)> = example.surfaces.iter().map(|surface| (*surface, !glossy)).collect();
            let Ok(chain) = Chain::new(&scene, example.start, &surfaces, example.aim(aside).position()) else {
                continue;
            };
            let Ok(expected) = chain.transfer(&scene, &start, &example.aim(aside)) else { continue };
            let [s, t] = scene.patch(&example.surfaces[0]).unwrap().tangents;
            let first = |by: DVec2| {
                let (chain, _) = chain.walk(&scene, &start, &example.aim(aside + by)).ok()?;
                let moved = chain.surfaces().next()?.position - example.surfaces[0].position;
                Some(DVec2::new(s.dot(moved), t.dot(moved)))
            };
            let column = |axis: DVec2| Some((first(axis * STEP)? - first(-axis * STEP)?) / (2.0 * STEP));
            let (Some(x), Some(y)) = (column(DVec2::X), column(DVec2::Y)) else { continue };
            errors.push(relative(DMat2::from_cols(x, y), expected));
        }
        errors.sort_by(f64::total_cmp);
        // Near the edges of triangles normals have a kink, and near caustics higher orders count.
        let (median, most) = (errors[errors.len() / 2], errors[errors.len() * 9 / 10]);
        println!("| {} | {} | {median:.1e} | {most:.1e} |", case.name, errors.len());
        assert!(errors.len() > 250 && median < 1e-6 && most < 1e-3, "{}: {median} {most}", case.name);
    }
}

/// A mirror shows the image behind it, and water bends light by Snell's law, found by bisection.
#[test]
fn flat_surfaces_have_the_textbook_solution() {
    let (start, goal) = (DVec3::new(-0.4, 0.1, 1.0), DVec3::new(0.5, -0.2, 0.6));
    let disk = Solid::disk(DVec3::ZERO, DVec3::Z, 3.0);
    let walk = |bsdf: Bsdf, old: DVec3, goal: DVec3| {
        let scene = solid(bsdf, disk);
        let scene = Caster::new(&scene);
        let surface = scene.intersect(Origin::from(old + DVec3::Z), -DVec3::Z).unwrap();
        let near = Turn::at(&scene, &surface, (start - old).normalize(), (goal - old).normalize()).unwrap();
        let onward = near.onward(surface.frame.normal, (start - old).normalize()).unwrap();
        let chain = Chain::new(&scene, start, &deltas(&[surface]), old + onward).unwrap();
        let (found, _) = chain.walk(&scene, &Node::lens(start), &Goal::new(goal, [DVec3::X, DVec3::Y])).unwrap();
        found.surfaces().next().unwrap().position
    };
    let mirrored = start + (goal * DVec3::new(1.0, 1.0, -1.0) - start) * (1.0 / 1.6);
    assert!((walk(mirror(), DVec3::new(0.3, 0.3, 0.0), goal) - mirrored).length() < 1e-9);
    let below = goal * DVec3::new(1.0, 1.0, -1.0);
    let across = (below - start) * DVec3::new(1.0, 1.0, 0.0);
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..100 {
        let share: f64 = 0.5 * (low + high);
        let sine = |length: f64, height: f64| length / length.hypot(height);
        let [above, under] = [share, 1.0 - share].map(|share| share * across.length());
        *if sine(above, 1.0) < 1.33 * sine(under, 0.6) { &mut low } else { &mut high } = share;
    }
    let bent = start * DVec3::new(1.0, 1.0, 0.0) + across * low;
    assert!((walk(glass(1.33), DVec3::new(0.1, 0.3, 0.0), below) - bent).length() < 1e-9);
}

/// A vertex may lie close to a boundary: the ray that sets out from it, off its surface, meets what it is aimed at.
#[test]
fn walks_set_out_from_next_to_a_boundary() {
    const GAP: f64 = 1e-3;
    let scene = scene(|builder| {
        let [water, floor] = [glass(1.33), diffuse(0.5)].map(|bsdf| builder.bsdf(bsdf));
        for (height, bsdf) in [(0.0, water), (-GAP, floor)] {
            builder.solid(Solid::disk(DVec3::Z * height, DVec3::Z, 3.0), bsdf, None).unwrap();
        }
    });
    let scene = Caster::new(&scene);
    let floor = scene.intersect(Origin::from(DVec3::new(-0.4, 0.1, -0.5 * GAP)), -DVec3::Z).unwrap();
    let start = Node::on(floor, false);
    for tangent in 1..=20 {
        let direction = DVec3::new(0.05 * f64::from(tangent), 0.0, 1.0).normalize();
        let water = scene.intersect(start.leave(direction), direction).unwrap();
        let onward = Turn::at(&scene, &water, -direction, direction).unwrap();
        let goal = water.position + onward.onward(water.frame.normal, -direction).unwrap() * 3.0;
        let chain = Chain::new(&scene, start.position, &deltas(&[water]), goal).unwrap();
        let aim = Goal::new(goal + DVec3::new(0.1, -0.2, 0.0), [DVec3::X, DVec3::Y]);
        assert!(chain.walk(&scene, &start, &aim).is_ok(), "{tangent}");
    }
}

/// Seen in a flat mirror a light is as far away as its image; seen through water, light of all azimuths tells how narrow the
/// cone is that reaches a ring of the floor.
#[test]
fn geometric_terms_have_the_textbook_values() {
    let (above, below) = (1.0, 0.6);
    let plane = [DVec3::X, DVec3::Y];
    let term = |bsdf: Bsdf, at: DVec3, start: DVec3, end: DVec3| {
        let scene = solid(bsdf, Solid::disk(DVec3::ZERO, DVec3::Z, 9.0));
        let scene = Caster::new(&scene);
        let surface = scene.intersect(Origin::from(at + DVec3::Z), -DVec3::Z).unwrap();
        let chain = Chain::new(&scene, start, &deltas(&[surface]), end).unwrap();
        chain.geometric_term(&scene, &Node::lens(start), &Goal::new(end, plane)).unwrap()
    };
    let start = DVec3::new(0.2, 0.1, above);
    for sine in [0.05f64, 0.3, 0.7, 0.95] {
        let cos = (1.0 - sine * sine).sqrt();
        let out = DVec3::new(0.6, 0.8, 0.0);
        let at = start + out * (above * sine / cos) - DVec3::Z * above;
        let image = at + out * (below * sine / cos) - DVec3::Z * below;
        let mirrored = cos / start.distance_squared(image);
        let found = term(mirror(), at, start, image * DVec3::new(1.0, 1.0, -1.0));
        assert!((found / mirrored - 1.0).abs() < 1e-9, "{found}, expected {mirrored}");
        let eta = 1.33;
        let cos_below = (1.0 - (sine / eta).powi(2)).sqrt();
        let tangents = [sine / cos, sine / eta / cos_below];
        let end = at + out * (below * tangents[1]) - DVec3::Z * below;
        let radius = above * tangents[0] + below * tangents[1];
        let widening = above / (cos * cos) + below * cos / (eta * cos_below.powi(3));
        let refracted = sine / (radius * widening);
        let found = term(glass(eta), at, start, end);
        assert!((found / refracted - 1.0).abs() < 1e-9, "{found}, expected {refracted}");
    }
}

#[test]
fn what_cannot_walk_is_rejected() {
    let ball = Solid::sphere(DVec3::ZERO, 0.7);
    let start = DVec3::new(0.1, 0.0, 2.0);
    let with = |eta: f64| {
        let scene = solid(glass(eta), ball);
        let caster = Caster::new(&scene);
        let case = Case { name: "", scene: solid(glass(eta), ball), reflects: &[false, false] };
        let example = example(&case, &caster, &mut Stream::new(3, &[])).unwrap();
        let chain = example.chain(&caster);
        chain.walk(&caster, &Node::lens(example.start), &example.aim(DVec2::splat(0.002))).map(|(_, steps)| steps)
    };
    assert!(with(1.5).is_ok());
    assert_eq!(with(1.0), Err(Rejection::Singular));
    let scene = solid(glass(1.5), ball);
    let scene = Caster::new(&scene);
    let surface = scene.intersect(Origin::from(start), -DVec3::Z).unwrap();
    let onward = Turn::Reflected.onward(surface.frame.normal, DVec3::Z).unwrap();
    let end = surface.position + onward;
    let long = Chain::new(&scene, start, &deltas(&[surface; MOST_LINKS + 1]), end);
    assert_eq!(long.err(), Some(Rejection::TooLong));
    let goal = |at: DVec3| Goal::new(at, [DVec3::X, DVec3::Y]);
    let empty = Chain::new(&scene, start, &[], end).unwrap();
    assert_eq!(empty.walk(&scene, &Node::lens(start), &goal(end)).err(), Some(Rejection::Unsuitable));
    // Behind the ball, where no single reflection leads, and where numbers end.
    let chain = Chain::new(&scene, start, &deltas(&[surface]), end).unwrap();
    for at in [DVec3::new(0.0, 0.0, -3.0), DVec3::splat(f64::NAN), DVec3::splat(f64::INFINITY), start] {
        assert!(chain.walk(&scene, &Node::lens(start), &goal(at)).is_err() || at == start, "{at}");
    }
}
