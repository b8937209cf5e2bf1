//! Closed meshes lose no ray from inside, at any scale and shift, wherever it is aimed.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use glam::{DVec3, Vec3};
use pathblend::geometry::{Bvh, Primitive, Ray};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus as Rng;
use rayon::prelude::*;

type Mesh = (Vec<Vec3>, Vec<[u32; 3]>);

/// Scale and shift of the whole scene.
const PLACES: [(f64, f64); 5] = [(1.0, 0.0), (1e-4, 0.0), (1e4, 0.0), (1.0, 1e5), (1e4, 1e5)];

fn placed(points: impl Iterator<Item = DVec3>, scale: f64, shift: DVec3) -> Vec<Vec3> {
    points.map(|p| (scale * p + shift).as_vec3()).collect()
}

/// A bumpy sphere around the origin; every edge is shared by two triangles, through shared indices.
fn sphere(rings: u32, scale: f64, shift: DVec3) -> Mesh {
    let columns = 2 * rings;
    let point = |i: u32, j: u32| {
        let theta = std::f64::consts::PI * f64::from(i) / f64::from(rings);
        let phi = std::f64::consts::TAU * f64::from(j) / f64::from(columns);
        let radius = 1.0 + 0.1 * (5.0 * theta).sin() * (7.0 * phi).cos();
        radius * DVec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin())
    };
    let inner = (1..rings).flat_map(|i| (0..columns).map(move |j| point(i, j)));
    let vertices = placed([point(0, 0), point(rings, 0)].into_iter().chain(inner), scale, shift);
    let index = |i: u32, j: u32| match i {
        0 => 0,
        i if i == rings => 1,
        i => 2 + (i - 1) * columns + j % columns,
    };
    let quads = (0..rings).flat_map(|i| (0..columns).map(move |j| (i, j)));
    let triangles = quads.flat_map(|(i, j)| {
        let (a, b, c, d) = (index(i, j), index(i, j + 1), index(i + 1, j + 1), index(i + 1, j));
        [[a, b, d], [b, c, d]]
    });
    (vertices, triangles.filter(|[a, b, c]| a != b && b != c && a != c).collect())
}

/// The cube from -1 to 1 with each face cut into `n` × `n` squares: coplanar, axis-aligned neighbours.
fn cube(n: u32, scale: f64, shift: DVec3) -> Mesh {
    let mut points = Vec::new();
    let mut triangles = Vec::new();
    for face in 0..6u32 {
        let (axis, side) = (face as usize / 2, f64::from(2 * (face % 2)) - 1.0);
        let first = points.len() as u32;
        for k in 0..(n + 1) * (n + 1) {
            let at = |i: u32| 2.0 * f64::from(i) / f64::from(n) - 1.0;
            let mut p = [0.0; 3];
            (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (side, at(k % (n + 1)), at(k / (n + 1)));
            points.push(DVec3::from(p));
        }
        for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
            let a = first + j * (n + 1) + i;
            triangles.extend([[a, a + 1, a + n + 2], [a, a + n + 2, a + n + 1]]);
        }
    }
    (placed(points.into_iter(), scale, shift), triangles)
}

fn in_ball(rng: &mut Rng) -> DVec3 {
    std::iter::repeat_with(|| DVec3::from_array(rng.random::<[f64; 3]>()) * 2.0 - 1.0)
        .find(|p| p.length_squared() <= 1.0 && p.length_squared() > 1e-6)
        .unwrap()
}

/// A target: anywhere, a vertex, a point of an edge, or a point a few roundings beside an edge.
fn target(mesh: &Mesh, kind: usize, centre: DVec3, rng: &mut Rng) -> DVec3 {
    let triangle = mesh.1[rng.random_range(0..mesh.1.len())];
    let [a, b, _] = triangle.map(|i| mesh.0[i as usize].as_dvec3());
    match kind % 4 {
        0 => centre + in_ball(rng).normalize(),
        1 => a,
        2 => a.lerp(b, rng.random()),
        _ => a.lerp(b, rng.random()) + f64::EPSILON * 8.0 * a.length() * in_ball(rng),
    }
}

fn misses(mesh: &Mesh, rays: usize, scale: f64, shift: DVec3, rng: &mut Rng) -> usize {
    let bvh = Bvh::build(&mesh.0, &mesh.1, &[]);
    (0..rays)
        .filter(|i| {
            let origin = 0.7 * scale * in_ball(rng) + shift;
            let ray = Ray::new(origin, (target(mesh, *i, origin, rng) - origin).normalize());
            let hit = bvh.intersect(&ray);
            assert_eq!(bvh.occluded(&ray), hit.is_some());
            hit.is_none()
        })
        .count()
}

#[test]
fn no_ray_leaves_a_sphere() {
    let mut rng = Rng::seed_from_u64(1);
    for (scale, shift) in PLACES {
        let shift = shift * DVec3::new(1.0, -0.7, 0.9);
        // At a shift of 1e5 an f32 vertex moves by up to 0.004: rings far apart keep the mesh from folding.
        for rings in if shift == DVec3::ZERO { [8, 100] } else { [5, 12] } {
            let mesh = sphere(rings, scale, shift);
            assert_eq!(misses(&mesh, 500_000, scale, shift, &mut rng), 0, "scale {scale}, shift {shift}");
        }
    }
}

#[test]
fn no_ray_leaves_a_cube() {
    let mut rng = Rng::seed_from_u64(2);
    for (scale, shift) in PLACES {
        let shift = DVec3::splat(shift);
        for n in [1, 8] {
            let mesh = cube(n, scale, shift);
            assert_eq!(misses(&mesh, 500_000, scale, shift, &mut rng), 0, "scale {scale}, shift {shift}, {n} squares");
        }
    }
}

/// As above with a hundred million rays, which take minutes: `cargo test --release --test bvh_watertight -- --ignored`.
#[test]
#[ignore = "long"]
fn no_ray_of_a_hundred_million_leaves() {
    const RAYS: usize = 100_000_000;
    let jobs: Vec<(f64, f64, u64)> =
        PLACES.iter().flat_map(|&(scale, shift)| (0..16).map(move |job| (scale, shift, job))).collect();
    let missed: usize = jobs
        .par_iter()
        .map(|&(scale, shift, job)| {
            let mut rng = Rng::seed_from_u64(100 + job);
            let shift = shift * DVec3::new(1.0, -0.7, 0.9);
            let rays = RAYS / jobs.len() / 2;
            let round = sphere(if shift == DVec3::ZERO { 100 } else { 12 }, scale, shift);
            let flat = cube(8, scale, shift);
            misses(&round, rays, scale, shift, &mut rng) + misses(&flat, rays, scale, shift, &mut rng)
        })
        .sum();
    assert_eq!(missed, 0, "of {RAYS} rays");
}

/// Along the axes, from inside and from far outside, through grid points, edges and along the faces themselves.
#[test]
fn axis_aligned_rays_find_the_grid() {
    for (scale, shift) in PLACES {
        let shift = DVec3::splat(shift);
        let mesh = cube(8, scale, shift);
        let bvh = Bvh::build(&mesh.0, &mesh.1, &[]);
        for (axis, sign) in (0..3).flat_map(|axis| [(axis, 1.0), (axis, -1.0)]) {
            // Both zeros, since -0 is what negating a direction gives.
            for direction in [DVec3::AXES[axis] * sign, -(DVec3::AXES[axis] * -sign)] {
                for k in 0..17 * 17 {
                    let (i, j) = (f64::from(k % 17) / 8.0 - 1.0, f64::from(k / 17) / 8.0 - 1.0);
                    for start in [0.0, 0.3, -5.0 * sign] {
                        let mut p = [0.0; 3];
                        (p[axis], p[(axis + 1) % 3], p[(axis + 2) % 3]) = (start, i, j);
                        // Rounded as the vertices are, so that it lies on the grid exactly.
                        let origin = (scale * DVec3::from(p) + shift).as_vec3().as_dvec3();
                        let hit = bvh.intersect(&Ray::new(origin, direction));
                        let distance = if start.abs() > 1.0 { 4.0 } else { 1.0 - sign * start };
                        // On the rim the ray may run along a side face, and then meets its edge or the end.
                        let t = hit.unwrap_or_else(|| panic!("miss at {i} {j} {start}")).t / scale;
                        let rim = i.abs() == 1.0 || j.abs() == 1.0;
                        let rounding = 1e-6 + shift.length() * 1e-7 / scale;
                        assert!(rim || (t - distance).abs() < rounding, "{t} instead of {distance}");
                    }
                }
            }
        }
    }
}

/// A power of two moves no digit: the image is the same bit by bit.
#[test]
fn scaling_by_a_power_of_two_changes_no_bit() {
    let mut rng = Rng::seed_from_u64(3);
    let mesh = sphere(40, 1.0, DVec3::ZERO);
    let bvh = Bvh::build(&mesh.0, &mesh.1, &[]);
    let rays: Vec<Ray> =
        (0..20_000).map(|_| Ray::new(3.0 * in_ball(&mut rng), in_ball(&mut rng).normalize())).collect();
    for exponent in [-30, -13, 13, 30] {
        let factor = 2f32.powi(exponent);
        let vertices: Vec<Vec3> = mesh.0.iter().map(|v| *v * factor).collect();
        let scaled = Bvh::build(&vertices, &mesh.1, &[]);
        for ray in &rays {
            let there = scaled.intersect(&Ray { origin: ray.origin * f64::from(factor), ..*ray });
            let here = bvh.intersect(ray);
            assert_eq!(there.map(|h| (h.t / f64::from(factor), h.primitive)), here.map(|h| (h.t, h.primitive)));
            if let Some(Primitive::Triangle { u, v, .. }) = here.map(|h| h.primitive) {
                assert!(u >= 0.0 && v >= 0.0 && u + v <= 1.0 + 1e-15);
            }
        }
    }
}
