//! Rays per CPU second of one thread: `cargo bench --bench rays`.
//!
//! The clock is the thread's own, so that other work on the machine disturbs as little as it can.

use std::hint::black_box;
use std::time::Duration;

use cpu_time::ThreadTime;
use criterion::measurement::{Measurement, ValueFormatter, WallTime};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use glam::{DVec3, Vec3};
use pathblend::geometry::{Bvh, Primitive, Ray, geometric_normal, offset};
use rand::{RngExt, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// Criterion's formatting with the thread's CPU time.
struct CpuTime;

impl Measurement for CpuTime {
    type Intermediate = ThreadTime;
    type Value = Duration;
    fn start(&self) -> ThreadTime {
        ThreadTime::now()
    }
    fn end(&self, start: ThreadTime) -> Duration {
        start.elapsed()
    }
    fn add(&self, a: &Duration, b: &Duration) -> Duration {
        *a + *b
    }
    fn zero(&self) -> Duration {
        Duration::ZERO
    }
    fn to_f64(&self, value: &Duration) -> f64 {
        value.as_nanos() as f64
    }
    fn formatter(&self) -> &dyn ValueFormatter {
        WallTime.formatter()
    }
}

type Mesh = (Vec<Vec3>, Vec<[u32; 3]>);

/// Adds the parallelogram `corner + [0, 1] a + [0, 1] b`.
fn quad(mesh: &mut Mesh, corner: Vec3, a: Vec3, b: Vec3) {
    let first = mesh.0.len() as u32;
    mesh.0.extend([corner, corner + a, corner + a + b, corner + b]);
    mesh.1.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
}

/// A closed room (12 triangles) with two turned blocks (24): 36 triangles.
fn room() -> Mesh {
    let mut mesh = Mesh::default();
    let mut block = |corner: Vec3, a: Vec3, b: Vec3, c: Vec3| {
        for (p, s, t) in
            [(corner, a, b), (corner, b, c), (corner, c, a), (corner + c, a, b), (corner + a, b, c), (corner + b, c, a)]
        {
            quad(&mut mesh, p, s, t);
        }
    };
    block(Vec3::splat(-1.0), Vec3::X * 2.0, Vec3::Y * 2.0, Vec3::Z * 2.0);
    block(Vec3::new(-0.65, -1.0, -0.1), Vec3::new(0.57, 0.0, -0.18), Vec3::Y * 1.2, Vec3::new(0.18, 0.0, 0.57));
    block(Vec3::new(0.1, -1.0, 0.2), Vec3::new(0.57, 0.0, 0.18), Vec3::Y * 0.6, Vec3::new(-0.18, 0.0, 0.57));
    mesh
}

/// A bumpy sphere of `4 rings²` triangles.
fn bumpy_sphere(rings: u32) -> Mesh {
    let columns = 2 * rings;
    let point = |i: u32, j: u32| {
        let (theta, phi) = (
            std::f64::consts::PI * f64::from(i) / f64::from(rings),
            std::f64::consts::TAU * f64::from(j) / f64::from(columns),
        );
        let radius =
            1.0 + 0.05 * (17.0 * theta).sin() * (23.0 * phi).cos() + 0.01 * (91.0 * theta).cos() * (83.0 * phi).sin();
        (radius * DVec3::new(theta.sin() * phi.cos(), theta.cos(), theta.sin() * phi.sin())).as_vec3()
    };
    let vertices = (0..=rings).flat_map(|i| (0..columns).map(move |j| point(i, j))).collect();
    let index = |i: u32, j: u32| i * columns + j % columns;
    let triangles = (0..rings)
        .flat_map(|i| {
            (0..columns).flat_map(move |j| {
                [
                    [index(i, j), index(i, j + 1), index(i + 1, j)],
                    [index(i, j + 1), index(i + 1, j + 1), index(i + 1, j)],
                ]
            })
        })
        .collect();
    (vertices, triangles)
}

fn unit(rng: &mut Xoshiro256PlusPlus) -> DVec3 {
    loop {
        let p = DVec3::from_array(rng.random::<[f64; 3]>()) * 2.0 - 1.0;
        if p.length_squared() <= 1.0 && p.length_squared() > 1e-6 {
            return p.normalize();
        }
    }
}

/// Pinhole rays through a square of 512 × 512 pixels, row by row.
fn primary(eye: DVec3, towards: DVec3, half_angle: f64) -> Vec<Ray> {
    let forward = (towards - eye).normalize();
    let right = forward.cross(DVec3::Y).normalize();
    let up = right.cross(forward);
    let at = |i: usize| (2.0 * (i as f64 + 0.5) / 512.0 - 1.0) * half_angle.tan();
    (0..512 * 512).map(|i| Ray::new(eye, (forward + right * at(i % 512) - up * at(i / 512)).normalize())).collect()
}

/// Where the rays hit, each with a direction of the upper hemisphere of a random side of the surface that they came from.
fn bounced(bvh: &Bvh, mesh: &Mesh, rays: &[Ray], rng: &mut Xoshiro256PlusPlus) -> Vec<Ray> {
    rays.iter()
        .filter_map(|ray| {
            let Primitive::Triangle { index, u, v } = bvh.intersect(ray)?.primitive else { return None };
            let [a, b, c] = mesh.1[index as usize].map(|i| mesh.0[i as usize].as_dvec3());
            let normal = geometric_normal(a, b, c)?;
            let normal = -normal * normal.dot(ray.direction).signum();
            let point = (1.0 - u - v) * a + u * b + v * c;
            let direction = (normal + 0.999 * unit(rng)).normalize();
            Some(Ray::new(point + offset::of_triangle(a, b, c) * normal, direction))
        })
        .collect()
}

/// Segments from the rays' origins to random points on a small square light.
fn shadow(rays: &[Ray], light: DVec3, size: f64, rng: &mut Xoshiro256PlusPlus) -> Vec<Ray> {
    rays.iter()
        .map(|ray| {
            let to = light + size * DVec3::new(rng.random::<f64>(), 0.0, rng.random::<f64>()) - ray.origin;
            Ray { origin: ray.origin, direction: to.normalize(), tmax: to.length() * (1.0 - 1e-12) }
        })
        .collect()
}

fn measure(criterion: &mut Criterion<CpuTime>, scene: &str, mesh: &Mesh, eye: DVec3, light: DVec3) {
    let bvh = Bvh::build(&mesh.0, &mesh.1, &[]);
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
    let camera = primary(eye, DVec3::ZERO, 0.45);
    let first = bounced(&bvh, mesh, &camera, &mut rng);
    let second = bounced(&bvh, mesh, &first, &mut rng);
    let shadows = shadow(&second, light, 0.3, &mut rng);
    let size = bvh.bounds().max_abs();
    let random: Vec<Ray> =
        (0..1 << 18).map(|_| Ray::new(0.9 * size * unit(&mut rng) * rng.random::<f64>(), unit(&mut rng))).collect();
    let mut group = criterion.benchmark_group(scene);
    group.sample_size(10).warm_up_time(Duration::from_millis(500)).measurement_time(Duration::from_secs(2));
    for (name, rays) in
        [("primary", &camera), ("first bounce", &first), ("second bounce", &second), ("random", &random)]
    {
        group.throughput(Throughput::Elements(rays.len() as u64));
        group.bench_with_input(BenchmarkId::new("closest", name), rays, |bench, rays| {
            bench.iter(|| rays.iter().map(|ray| bvh.intersect(black_box(ray)).map_or(0.0, |hit| hit.t)).sum::<f64>());
        });
    }
    group.throughput(Throughput::Elements(shadows.len() as u64));
    group.bench_with_input(BenchmarkId::new("any", "shadow"), &shadows, |bench, rays| {
        bench.iter(|| rays.iter().filter(|ray| bvh.occluded(black_box(ray))).count());
    });
    group.finish();
}

fn rays(criterion: &mut Criterion<CpuTime>) {
    measure(criterion, "room 36", &room(), DVec3::new(0.0, 0.0, 0.99), DVec3::new(-0.15, 0.999, -0.15));
    let mesh = bumpy_sphere(500);
    let name = format!("sphere {}k", mesh.1.len() / 1000);
    // From outside for the primary rays and the first bounce's shadows; later bounces mostly leave, so `random` rays
    // start inside.
    measure(criterion, &name, &mesh, DVec3::new(0.3, 0.5, 2.6), DVec3::new(1.0, 3.0, 1.0));
    // The same mesh seen from within: every ray hits, bounces are incoherent.
    measure(criterion, &format!("{name} inside"), &mesh, DVec3::new(0.3, 0.1, 0.6), DVec3::new(0.1, 0.2, 0.1));
    let mut group = criterion.benchmark_group(name);
    group.sample_size(10).warm_up_time(Duration::from_millis(500));
    group.throughput(Throughput::Elements(mesh.1.len() as u64));
    group.bench_function("build", |bench| bench.iter(|| Bvh::build(&mesh.0, &mesh.1, &[])));
    group.finish();
}

criterion_group! { name = benches; config = Criterion::default().with_measurement(CpuTime).without_plots(); targets = rays }
criterion_main!(benches);
