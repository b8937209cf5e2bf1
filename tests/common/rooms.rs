//! Rooms in which chains are put to the test.

use super::{build, diffuse, glass, pinhole, room};
use glam::DVec3;
use pathblend::bsdf::{Blend, Bsdf, Conductor, Distribution, RoughConductor, RoughDielectric, Roughness};
use pathblend::camera::{Camera, Projection};
use pathblend::geometry::Solid;
use pathblend::scene::{Builder, Scene};
use pathblend::spectrum::Spectrum;

/// A room with a light under its ceiling, a ball of glass, and one of which a part is rough metal everywhere.
pub fn balls(size: usize) -> Scene {
    let mut builder = Builder::new();
    let wall = builder.bsdf(diffuse(0.6));
    builder.mesh(room(), wall, None).unwrap();
    let clear = builder.bsdf(glass(1.5));
    builder.solid(Solid::sphere(DVec3::new(-0.4, -0.5, 0.1), 0.35), clear, None).unwrap();
    let metal = Conductor { index: None, specular_reflectance: Spectrum::grey(0.9).into() };
    let rough = RoughConductor { metal, roughness: Roughness::isotropic(Distribution::Ggx, 0.15) };
    let nested = Box::new([diffuse(0.7), Bsdf::RoughConductor(rough)]);
    let mixed = builder.bsdf(Bsdf::Blend(Blend { weight: 0.6.into(), nested }));
    builder.solid(Solid::sphere(DVec3::new(0.45, -0.6, -0.2), 0.35), mixed, None).unwrap();
    let lamp = Solid::disk(DVec3::new(0.2, 0.95, 0.0), -DVec3::Y, 0.4);
    builder.solid(lamp, wall, Some(Spectrum::grey(5.0).into())).unwrap();
    build(builder, pinhole(size, 0.7, DVec3::new(0.0, 0.0, 0.95), -DVec3::Z), 5)
}

/// A mirror on the wall and a small lamp: light that mirrors and a ball of glass hide from straight seeds.
pub fn mirrored(size: usize) -> Scene {
    let mut builder = Builder::new();
    let wall = builder.bsdf(diffuse(0.6));
    builder.mesh(room(), wall, None).unwrap();
    let clear = builder.bsdf(glass(1.5));
    builder.solid(Solid::sphere(DVec3::new(-0.3, -0.5, 0.0), 0.4), clear, None).unwrap();
    let metal = Conductor { index: None, specular_reflectance: Spectrum::grey(0.9).into() };
    let mirror = builder.bsdf(Bsdf::Conductor(metal));
    builder.solid(Solid::disk(DVec3::new(0.9, 0.0, 0.0), -DVec3::X, 0.7), mirror, None).unwrap();
    let lamp = Solid::disk(DVec3::new(0.2, 0.9, 0.0), -DVec3::Y, 0.1);
    builder.solid(lamp, wall, Some(Spectrum::grey(50.0).into())).unwrap();
    build(builder, pinhole(size, 0.7, DVec3::new(0.0, 0.0, 0.95), -DVec3::Z), 5)
}

/// Water over the floor of a room, with a light above it, through a lens: chains on either side of what the camera sees.
pub fn water(size: usize) -> Scene {
    let mut builder = Builder::new();
    let wall = builder.bsdf(diffuse(0.7));
    builder.mesh(room(), wall, None).unwrap();
    let surface = builder.bsdf(glass(1.33));
    builder.solid(Solid::disk(DVec3::new(0.0, -0.3, 0.0), DVec3::Y, 1.5), surface, None).unwrap();
    let lamp = Solid::disk(DVec3::new(0.2, 0.9, -0.1), -DVec3::Y, 0.3);
    builder.solid(lamp, wall, Some(Spectrum::grey(9.0).into())).unwrap();
    let projection = Projection::Perspective { lens_radius: 0.05, focus_distance: 1.3 };
    let camera = pinhole(size, 0.6, DVec3::new(0.0, 0.5, 0.9), DVec3::new(0.0, -1.0, -0.9).normalize());
    build(builder, Camera { projection, ..camera }, 5)
}

/// A polished floor and a ball of frosted glass, under a light.
pub fn polished(size: usize) -> Scene {
    let mut builder = Builder::new();
    let wall = builder.bsdf(diffuse(0.6));
    builder.mesh(room(), wall, None).unwrap();
    let metal = Conductor { index: None, specular_reflectance: Spectrum::grey(0.8).into() };
    let polish = RoughConductor { metal, roughness: Roughness::isotropic(Distribution::Ggx, 0.05) };
    let floor = builder.bsdf(Bsdf::RoughConductor(polish));
    builder.solid(Solid::disk(DVec3::new(0.0, -0.8, 0.0), DVec3::Y, 1.5), floor, None).unwrap();
    let one = Spectrum::ONE;
    let roughness = Roughness::isotropic(Distribution::Ggx, 0.06);
    let frosted = RoughDielectric { eta: 1.5, roughness, specular_reflectance: one, specular_transmittance: one };
    let frosted = builder.bsdf(Bsdf::RoughDielectric(frosted));
    builder.solid(Solid::sphere(DVec3::new(0.1, -0.3, 0.0), 0.4), frosted, None).unwrap();
    let clear = builder.bsdf(glass(1.4));
    builder.solid(Solid::disk(DVec3::new(0.0, 0.6, 0.0), DVec3::Y, 1.5), clear, None).unwrap();
    let lamp = Solid::disk(DVec3::new(0.2, 0.9, -0.1), -DVec3::Y, 0.3);
    builder.solid(lamp, wall, Some(Spectrum::grey(9.0).into())).unwrap();
    build(builder, pinhole(size, 0.7, DVec3::new(0.0, 0.1, 0.95), DVec3::new(0.0, -0.3, -1.0).normalize()), 5)
}
