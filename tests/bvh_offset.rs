//! A ray that starts off a surface by the documented offset leaves it, and still meets what lies just beyond.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use glam::{DVec3, Vec3};
use pathblend::geometry::{Bvh, Ray, Solid, geometric_normal, offset};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus as Rng;

fn in_ball(rng: &mut Rng) -> DVec3 {
    std::iter::repeat_with(|| DVec3::from_array(rng.random::<[f64; 3]>()) * 2.0 - 1.0)
        .find(|p| p.length_squared() <= 1.0 && p.length_squared() > 1e-6)
        .unwrap()
}

/// Unit direction to the side of `normal`, from perpendicular down to grazing at 1e-12.
fn leaving(normal: DVec3, rng: &mut Rng) -> DVec3 {
    let tangent = in_ball(rng).cross(normal).normalize();
    let cosine = 10f64.powf(rng.random_range(-12.0..0.0));
    (cosine * normal + tangent).normalize()
}

/// A random triangle, from regular to a sliver of aspect 1e5.
fn triangle(scale: f64, shift: DVec3, rng: &mut Rng) -> [Vec3; 3] {
    let (a, b) = (in_ball(rng), in_ball(rng));
    let flat = 10f64.powf(rng.random_range(-5.0..0.0));
    let c = a.lerp(b, rng.random()) + flat * in_ball(rng);
    [a, b, c].map(|p| (scale * p + shift).as_vec3())
}

/// Barycentrics inside, on an edge, or at a corner.
fn barycentrics(rng: &mut Rng) -> (f64, f64) {
    let (u, v) = (rng.random::<f64>(), rng.random::<f64>());
    let (u, v) = if u + v > 1.0 { (1.0 - u, 1.0 - v) } else { (u, v) };
    [(u, v), (u, v), (u, v), (0.0, v), (u, 0.0), (u, 1.0 - u), (0.0, 1.0)][rng.random_range(0..7)]
}

/// Calls with random triangles at scales from 1e-4 to 1e4 and shifts up to 1e5: corners, normal, a point, its offset.
fn for_each_point(seed: u64, mut check: impl FnMut([Vec3; 3], DVec3, DVec3, f64, &mut Rng)) {
    let mut rng = Rng::seed_from_u64(seed);
    for round in 0..60_000 {
        let scale = [1e-4, 1e-2, 1.0, 1e2, 1e4][round % 5];
        let shift = [0.0, 0.0, 1e2, 1e5][round % 4] * in_ball(&mut rng);
        let corners = triangle(scale, shift, &mut rng);
        let [a, b, c] = corners.map(Vec3::as_dvec3);
        let Some(normal) = geometric_normal(a, b, c) else { continue };
        for _ in 0..4 {
            let normal = if rng.random() { normal } else { -normal };
            let (u, v) = barycentrics(&mut rng);
            check(corners, normal, (1.0 - u - v) * a + u * b + v * c, offset::of_triangle(a, b, c), &mut rng);
        }
    }
}

#[test]
fn offset_rays_leave_their_triangle() {
    let mut tested = 0;
    for_each_point(1, |corners, normal, point, distance, rng| {
        let bvh = Bvh::build(&corners, &[[0, 1, 2]], &[]);
        let ray = Ray::new(point + distance * normal, leaving(normal, rng));
        assert_eq!(bvh.intersect(&ray), None, "{corners:?} {ray:?}");
        assert!(!bvh.occluded(&ray));
        tested += 1;
    });
    assert!(tested > 150_000);
}

/// The offset is not wasteful: from the same points the other way, the surface is met, and nearly at the offset.
#[test]
fn offset_rays_towards_their_triangle_meet_it() {
    let (mut tested, mut met) = (0, 0);
    for_each_point(2, |corners, normal, point, distance, _| {
        let bvh = Bvh::build(&corners, &[[0, 1, 2]], &[]);
        if let Some(hit) = bvh.intersect(&Ray::new(point + distance * normal, -normal)) {
            assert!((hit.t - distance).abs() < 0.1 * distance, "{} instead of {distance}", hit.t);
            met += 1;
        }
        tested += 1;
    });
    // Points on edges and corners, and within 1e-13 of them on slivers, may fall outside.
    assert!(met > tested / 3, "{met} of {tested}");
}

#[test]
fn a_wall_slightly_farther_is_met() {
    for scale in [1e-4f32, 1.0, 1e4] {
        // Two walls as close to each other as f32 coordinates allow.
        let (near, far) = (0.75 * scale, (0.75 * scale).next_up());
        let wall = |z: f32| {
            [Vec3::new(-1.0, -1.0, 0.0), Vec3::new(1.0, -1.0, 0.0), Vec3::new(0.0, 1.0, 0.0)]
                .map(|v| v * scale + Vec3::Z * z)
        };
        let vertices = [wall(near), wall(far)].concat();
        let bvh = Bvh::build(&vertices, &[[0, 1, 2], [3, 4, 5]], &[]);
        let [a, b, c] = wall(near).map(Vec3::as_dvec3);
        let origin = (a + b + c) / 3.0 + offset::of_triangle(a, b, c) * DVec3::Z;
        let hit = bvh.intersect(&Ray::new(origin, DVec3::Z)).expect("the farther wall");
        let gap = f64::from(far) - f64::from(near);
        assert!((hit.t - gap).abs() < 1e-4 * gap, "{} instead of {gap}", hit.t);
    }
}

#[test]
fn offset_rays_leave_spheres_disks_and_cylinders() {
    let mut rng = Rng::seed_from_u64(4);
    for round in 0..200_000 {
        let scale = [1e-4, 1e-2, 1.0, 1e2, 1e4][round % 5];
        let center = scale * in_ball(&mut rng) + [0.0, 1e5][round % 2] * in_ball(&mut rng);
        let radius = scale * rng.random_range(0.1..1.0);
        let normal = in_ball(&mut rng).normalize();
        let sphere = Solid::sphere(center, radius);
        let disk = Solid::disk(center, normal, radius);
        // A hit found from afar, as a renderer finds it.
        let from = center + 10.0 * scale * in_ball(&mut rng).normalize();
        let towards = (center + 0.5 * radius * in_ball(&mut rng) - from).normalize();
        let half = radius * normal;
        let can = Solid::cylinder(center - half, center + half, radius);
        for solid in [sphere, disk, can] {
            let ray = Ray::new(from, towards);
            let Some(t) = solid.intersect(&ray) else { continue };
            let point = solid.surface_point(ray.at(t));
            let bound = point.error + 64.0 * f64::EPSILON * (scale + center.length());
            let distance = match solid {
                Solid::Sphere { .. } => (point.position - center).length() - radius,
                Solid::Disk { .. } => (point.position - center).dot(normal),
                Solid::Cylinder { .. } => {
                    let away = point.position - center;
                    (away - away.dot(normal) * normal).length() - radius
                }
            };
            assert!(distance.abs() <= point.error + 4.0 * f64::EPSILON * radius, "{distance:e} {:e}", point.error);
            assert!(point.position.distance(ray.at(t)) < 100.0 * bound);
            let bvh = Bvh::build(&[], &[], &[solid]);
            let leave = Ray::new(point.position + point.offset * point.normal, leaving(point.normal, &mut rng));
            assert_eq!(solid.intersect(&leave), None, "{solid:?} {leave:?}");
            assert!(!bvh.occluded(&leave));
            // Inwards: a sphere's far side, never its near one; a disk not at all.
            let enter = Ray::new(point.position - point.offset * point.normal, leaving(-point.normal, &mut rng));
            match solid {
                Solid::Disk { .. } => assert_eq!(solid.intersect(&enter), None),
                Solid::Cylinder { .. } => {
                    let flat = enter.direction - enter.direction.dot(normal) * normal;
                    let chord = -2.0 * flat.dot(point.normal) * radius / flat.length_squared();
                    let t = solid.intersect(&enter);
                    assert!(t.is_none_or(|t| t > 0.9 * chord), "{t:?} on a chord of {chord}");
                }
                Solid::Sphere { .. } => {
                    let t = solid.intersect(&enter).expect("the far side");
                    assert_eq!(bvh.intersect(&enter).map(|hit| hit.t), Some(t));
                    let chord = -2.0 * enter.direction.dot(point.normal) * radius;
                    assert!(t > 0.9 * chord, "{t} on a chord of {chord}");
                }
            }
        }
    }
}
