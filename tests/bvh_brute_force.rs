//! The hierarchy against every primitive tried in turn, with a triangle test of another kind.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use glam::{DVec3, Vec3};
use pathblend::geometry::{Bvh, Dropped, Primitive, Ray, Solid};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus as Rng;

fn in_cube(rng: &mut Rng) -> DVec3 {
    DVec3::from_array(rng.random::<[f64; 3]>()) * 2.0 - 1.0
}

fn unit(rng: &mut Rng) -> DVec3 {
    std::iter::repeat_with(|| in_cube(rng))
        .find(|p| p.length_squared() <= 1.0 && p.length_squared() > 1e-3)
        .unwrap()
        .normalize()
}

struct Scene {
    vertices: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    solids: Vec<Solid>,
}

impl Scene {
    /// Triangles of very different sizes, spheres and disks within about a unit of the shift, all times the scale.
    fn random(rng: &mut Rng, triangles: u32, solids: usize, scale: f64, shift: DVec3) -> Self {
        let mut vertices = Vec::new();
        for _ in 0..triangles {
            let (centre, size) = (in_cube(rng), 10f64.powf(rng.random_range(-2.5..0.0)));
            vertices.extend([0; 3].map(|_| (scale * (centre + size * in_cube(rng)) + shift).as_vec3()));
        }
        let solids = (0..solids).map(|i| {
            let center = scale * in_cube(rng) + shift;
            let radius = scale * rng.random_range(0.01..0.3);
            match i % 3 {
                0 => Solid::sphere(center, radius),
                1 => Solid::disk(center, unit(rng), radius),
                _ => Solid::cylinder(center, center + scale * in_cube(rng), radius),
            }
        });
        Self {
            solids: solids.collect(),
            vertices,
            triangles: (0..triangles).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        }
    }

    fn corners(&self, index: usize) -> [DVec3; 3] {
        self.triangles[index].map(|i| self.vertices[i as usize].as_dvec3())
    }

    /// Nearest distance, and which primitive (triangles first).
    fn brute(&self, ray: &Ray) -> Option<(f64, usize)> {
        let triangles = (0..self.triangles.len()).filter_map(|i| Some((moeller_trumbore(self.corners(i), ray)?.0, i)));
        let solids = (0..).zip(&self.solids).filter_map(|(i, s)| Some((textbook(s, ray)?, self.triangles.len() + i)));
        triangles.chain(solids).filter(|(t, _)| *t > 0.0 && *t < ray.tmax).min_by(|a, b| a.0.total_cmp(&b.0))
    }
}

/// Distance and barycentrics; in `f64`, by Cramer's rule.
fn moeller_trumbore([a, b, c]: [DVec3; 3], ray: &Ray) -> Option<(f64, f64, f64)> {
    let (e1, e2, s) = (b - a, c - a, ray.origin - a);
    let p = ray.direction.cross(e2);
    let determinant = e1.dot(p);
    let q = s.cross(e1);
    let (u, v) = (s.dot(p) / determinant, ray.direction.dot(q) / determinant);
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then_some((e2.dot(q) / determinant, u, v))
}

/// The schoolbook formulas.
fn textbook(solid: &Solid, ray: &Ray) -> Option<f64> {
    match *solid {
        Solid::Sphere { center, radius, .. } => {
            let oc = ray.origin - center;
            let (b, c) = (2.0 * oc.dot(ray.direction), oc.length_squared() - radius * radius);
            let root = (b * b - 4.0 * c).sqrt();
            [(-b - root) / 2.0, (-b + root) / 2.0].into_iter().find(|t| *t > 0.0)
        }
        Solid::Disk { center, normal, radius, .. } => {
            let t = (center - ray.origin).dot(normal) / ray.direction.dot(normal);
            (t > 0.0 && ray.at(t).distance(center) <= radius).then_some(t)
        }
        Solid::Cylinder { bottom, axes, length, radius } => {
            let (o, d) = (axes.to_local(ray.origin - bottom), axes.to_local(ray.direction));
            let (a, b) = (d.x * d.x + d.y * d.y, 2.0 * (o.x * d.x + o.y * d.y));
            let root = (b * b - 4.0 * a * (o.x * o.x + o.y * o.y - radius * radius)).sqrt();
            let on_side = |t: &f64| *t > 0.0 && (0.0..=length).contains(&(o.z + t * d.z));
            [(-b - root) / (2.0 * a), (-b + root) / (2.0 * a)].into_iter().find(on_side)
        }
    }
}

fn check(scene: &Scene, rng: &mut Rng, rays: usize, scale: f64, shift: DVec3) {
    let bvh = Bvh::build(&scene.vertices, &scene.triangles, &scene.solids);
    let (mut hits, mut differences) = (0, 0);
    for i in 0..rays {
        // From inside, from outside, and from very far.
        let distance = [1.0, 3.0, 1000.0][i % 3];
        let origin = distance * unit(rng);
        let direction = (in_cube(rng) - origin).normalize();
        let tmax = if i % 2 == 0 { f64::INFINITY } else { scale * distance * rng.random_range(0.1..2.0) };
        let ray = Ray { origin: scale * origin + shift, direction, tmax };
        let (found, expected) = (bvh.intersect(&ray), scene.brute(&ray));
        assert_eq!(bvh.occluded(&ray), found.is_some());
        hits += usize::from(found.is_some());
        let same = match (found, expected) {
            (None, None) => true,
            (Some(hit), Some((t, index))) => {
                let (named, position) = match hit.primitive {
                    Primitive::Triangle { index, u, v } => {
                        let [a, b, c] = scene.corners(index as usize);
                        (index as usize, (1.0 - u - v) * a + u * b + v * c)
                    }
                    Primitive::Solid { index } => {
                        let solid = &scene.solids[index as usize];
                        (scene.triangles.len() + index as usize, solid.surface_point(ray.at(hit.t)).position)
                    }
                };
                let tolerance = 1e-10 * (distance * scale + shift.length());
                (hit.t - t).abs() < tolerance && named == index && position.distance(ray.at(hit.t)) < tolerance
            }
            _ => false,
        };
        differences += usize::from(!same);
    }
    assert!(hits > rays / 1000, "{hits} hits of {rays} rays");
    // Both sides round: a ray within 1e-15 of an edge may fall either way, but hardly one in a run.
    assert!(differences <= rays / 100_000, "{differences} of {rays} rays differ at scale {scale}, shift {shift}");
}

#[test]
fn agrees_at_every_scale_and_shift() {
    let mut rng = Rng::seed_from_u64(7);
    for (triangles, solids) in [(1, 0), (0, 1), (5, 3), (40, 0), (30, 20), (700, 60)] {
        for scale in [1e-4, 1.0, 1e4f64] {
            for shift in [DVec3::ZERO, DVec3::new(1e5, -3e4, 7e4) * scale.min(1.0)] {
                let scene = Scene::random(&mut rng, triangles, solids, scale, shift);
                let rays = if triangles > 100 { 6000 } else { 30_000 };
                if triangles + solids as u32 > 1 {
                    check(&scene, &mut rng, rays, scale, shift);
                }
            }
        }
    }
}

#[test]
fn a_small_object_on_a_vast_plane_is_resolved() {
    let mut rng = Rng::seed_from_u64(8);
    let mut scene = Scene::random(&mut rng, 200, 4, 1.0, DVec3::ZERO);
    let first = scene.vertices.len() as u32;
    scene.vertices.extend([Vec3::new(-1e5, -2.0, -1e5), Vec3::new(3e5, -2.0, -1e5), Vec3::new(-1e5, -2.0, 3e5)]);
    scene.triangles.push([first, first + 1, first + 2]);
    check(&scene, &mut rng, 20_000, 1.0, DVec3::ZERO);
}

#[test]
fn empty_scene_hits_nothing() {
    let bvh = Bvh::build(&[], &[], &[]);
    let ray = Ray::new(DVec3::ZERO, DVec3::X);
    assert_eq!(bvh.intersect(&ray), None);
    assert!(!bvh.occluded(&ray) && bvh.bounds().is_empty());
}

#[test]
fn unusable_primitives_are_dropped_and_counted() {
    let (nan, inf) = (f32::NAN, f32::INFINITY);
    let vertices = [
        Vec3::ZERO,
        Vec3::X,
        Vec3::Y,
        Vec3::splat(nan),
        Vec3::new(inf, 0.0, 0.0),
        Vec3::new(0.0, 1e30, 0.0),
        Vec3::new(2.0, 0.0, 0.0),
    ];
    let triangles =
        [[0, 1, 2], [3, 3, 3], [0, 1, 3], [4, 1, 2], [0, 5, 1], [0, 1, 99], [0, 1, 6], [0, 0, 1], [2, 1, 0]];
    let solids = [
        Solid::sphere(DVec3::splat(f64::NAN), 1.0),
        Solid::sphere(DVec3::ZERO, -1.0),
        Solid::sphere(DVec3::new(0.2, 0.2, 3.0), 0.1),
        Solid::disk(DVec3::ZERO, DVec3::new(2.0, 0.0, 0.0), 1.0),
        Solid::sphere(DVec3::ZERO, f64::INFINITY),
    ];
    let bvh = Bvh::build(&vertices, &triangles, &solids);
    assert_eq!(bvh.dropped(), Dropped { invalid: 5 + 4, degenerate: 2 });
    let down = bvh.intersect(&Ray::new(DVec3::new(0.2, 0.2, 2.0), -DVec3::Z)).unwrap();
    assert!(matches!(down.primitive, Primitive::Triangle { index: 0 | 8, .. }) && down.t == 2.0);
    let up = bvh.intersect(&Ray::new(DVec3::new(0.2, 0.2, 2.0), DVec3::Z)).unwrap();
    assert!(matches!(up.primitive, Primitive::Solid { index: 2 }) && (up.t - 0.9).abs() < 1e-15);
    // Everything dropped is as good as empty.
    assert_eq!(Bvh::build(&vertices, &[[3, 3, 3]], &solids[..2]).intersect(&Ray::new(DVec3::ZERO, DVec3::X)), None);
}

#[test]
fn rays_that_are_not_rays_hit_nothing() {
    let scene = Scene::random(&mut Rng::seed_from_u64(9), 50, 5, 1.0, DVec3::ZERO);
    let bvh = Bvh::build(&scene.vertices, &scene.triangles, &scene.solids);
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 0.0, 1e300] {
        for axis in 0..3 {
            let (mut far, mut odd) = (DVec3::ZERO, DVec3::X);
            far[axis] = bad;
            odd[axis] = bad;
            if bad != 0.0 {
                assert_eq!(bvh.intersect(&Ray::new(far, DVec3::X)), None);
            }
            if !odd.is_normalized() {
                assert_eq!(bvh.intersect(&Ray::new(DVec3::ZERO, odd)), None);
                assert!(!bvh.occluded(&Ray::new(far, odd)));
            }
        }
    }
    for tmax in [f64::NAN, 0.0, -1.0] {
        assert_eq!(bvh.intersect(&Ray { origin: DVec3::new(0.0, 0.0, 5.0), direction: -DVec3::Z, tmax }), None);
    }
}

#[test]
fn the_interval_is_open_at_both_ends() {
    let vertices = [Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, -1.0, 0.0), Vec3::new(0.0, 2.0, 0.0)];
    let bvh = Bvh::build(&vertices, &[[0, 1, 2]], &[]);
    let ray = |z: f64, tmax: f64| Ray { origin: DVec3::new(0.0, 0.0, z), direction: -DVec3::Z, tmax };
    assert!(bvh.intersect(&ray(0.0, 1.0)).is_none());
    assert!(bvh.intersect(&ray(1.0, 1.0)).is_none());
    assert_eq!(bvh.intersect(&ray(1.0, 1.0f64.next_up())).unwrap().t, 1.0);
    assert_eq!(bvh.intersect(&ray(1e-300, 1.0)).unwrap().t, 1e-300);
}

#[test]
fn thousands_of_equal_triangles_and_solids_are_fine() {
    let mut scene = Scene::random(&mut Rng::seed_from_u64(10), 1, 0, 1.0, DVec3::ZERO);
    scene.triangles = vec![[0, 1, 2]; 20_000];
    scene.solids = vec![Solid::sphere(DVec3::new(0.0, 5.0, 0.0), 0.5); 2000];
    let started = std::time::Instant::now();
    let bvh = Bvh::build(&scene.vertices, &scene.triangles, &scene.solids);
    println!("built in {:?}", started.elapsed());
    let [a, b, c] = scene.corners(0);
    let origin = DVec3::new(0.3, 0.2, 4.0);
    let ray = Ray::new(origin, ((a + b + c) / 3.0 - origin).normalize());
    assert!(matches!(bvh.intersect(&ray).unwrap().primitive, Primitive::Triangle { .. }));
    assert!(bvh.occluded(&Ray::new(origin, (DVec3::Y * 5.0 - origin).normalize())));
}
