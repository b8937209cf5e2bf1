//! Casts rays and counts them; chooses lights.

use super::{EmitterId, LightChoice, Scene, Surface};
use crate::emitter::{LightTree, Start};
use crate::geometry::{NO_TRIANGLE, Ray};
use crate::math::{AreaPdf, Row};
use glam::DVec3;
use std::cell::Cell;
use std::ops::Deref;

/// Where a ray starts.
#[derive(Clone, Copy, Debug)]
pub struct Origin {
    /// The point, moved off the surface that it lies on.
    pub point: DVec3,
    /// The triangle that it was on; any other number on none.
    pub triangle: u32,
}

impl From<DVec3> for Origin {
    /// A point that is on no triangle.
    #[inline]
    fn from(point: DVec3) -> Self {
        Self { point, triangle: NO_TRIANGLE }
    }
}

/// The scene as one job sees it: every ray that it casts is counted.
pub struct Caster<'a> {
    scene: &'a Scene,
    rays: Cell<u64>,
    /// For the choice of lights by position.
    tree: Option<&'a LightTree>,
}

impl<'a> Caster<'a> {
    /// No rays cast yet; lights are chosen by power.
    pub fn new(scene: &'a Scene) -> Self {
        Self::choosing(scene, LightChoice::Power)
    }

    /// No rays cast yet.
    pub fn choosing(scene: &'a Scene, choice: LightChoice) -> Self {
        let tree = match choice {
            LightChoice::Power => None,
            LightChoice::Position => scene.light_tree.as_ref(),
        };
        Self { scene, rays: Cell::new(0), tree }
    }

    /// Samples where light starts that may reach `point` directly. The density includes the choice of the emitter; the
    /// last number is [`Caster::preference`].
    #[inline]
    pub fn sample_start_for(&self, point: DVec3, row: Row) -> Option<(EmitterId, Start, AreaPdf, f64)> {
        let Some(tree) = self.tree else {
            let (id, start, pdf) = self.scene.sample_start(row)?;
            return Some((id, start, pdf, 1.0));
        };
        let (index, choice) = tree.sample(point, row[0])?;
        let (start, pdf) = self.scene.emitters[index].start(row);
        let id = EmitterId(index as u32);
        Some((id, start, AreaPdf(pdf.0 * choice), choice / self.scene.choice_by_power(id)))
    }

    /// How much more often an emitter is chosen for direct light at `point` than by power.
    #[inline]
    pub fn preference(&self, id: EmitterId, point: DVec3) -> f64 {
        let by_power = self.scene.choice_by_power(id);
        match self.tree {
            Some(tree) if by_power > 0.0 => tree.probability(point, id.0 as usize) / by_power,
            // A light that is never chosen is never preferred either.
            _ => 1.0,
        }
    }

    /// Rays cast so far.
    pub fn rays(&self) -> u64 {
        self.rays.get()
    }

    /// The closest surface from `origin` along the unit vector `direction`.
    #[inline]
    pub fn intersect(&self, origin: Origin, direction: DVec3) -> Option<Surface> {
        self.rays.set(self.rays.get() + 1);
        self.scene.intersect(&Ray::new(origin.point, direction), origin.triangle)
    }

    /// The closest surface that the camera sees from `origin` along `direction`.
    #[inline]
    pub fn see(&self, origin: Origin, direction: DVec3) -> Option<Surface> {
        let mut met = self.intersect(origin, direction);
        while let Some(surface) = &met
            && self.scene.hide_emitters
            && surface.emitter.is_some()
        {
            met = self.intersect(surface.leave(direction), direction);
        }
        if met.as_ref().is_some_and(|surface| !self.scene.camera.reaches(surface.position)) {
            met = None;
        }
        met
    }

    /// Whether the camera sees the point that `from` starts at from its lens at `lens`; `surface` is what it lies on.
    #[inline]
    pub fn seen(&self, from: Origin, surface: Option<&Surface>, lens: DVec3) -> bool {
        if !self.scene.hide_emitters {
            return self.visible(from, lens);
        }
        if surface.is_none_or(|surface| surface.emitter.is_some()) {
            return false;
        }
        let (mut at, distance) = (from, (lens - from.point).length());
        let direction = (lens - from.point) / distance;
        loop {
            match self.intersect(at, direction) {
                Some(hit) if (hit.position - from.point).length() >= distance => return true,
                Some(hit) if hit.emitter.is_some() => at = hit.leave(direction),
                Some(_) => return false,
                None => return true,
            }
        }
    }

    /// Whether nothing lies between two points, which the caller has moved off their surfaces. The ray ends short of the
    /// far point by 1e-10 of its length, since the rounding of a hit's distance grows with it.
    #[inline]
    pub fn visible(&self, from: Origin, to: DVec3) -> bool {
        let offset = to - from.point;
        let distance = offset.length();
        let direction = offset * (1.0 / distance);
        !self.occluded(&Ray { origin: from.point, direction, tmax: distance * (1.0 - 1e-10) }, from.triangle)
    }

    /// Whether the ray from `origin` along `direction` leaves the scene.
    #[inline]
    pub fn escapes(&self, origin: Origin, direction: DVec3) -> bool {
        !self.occluded(&Ray::new(origin.point, direction), origin.triangle)
    }

    #[inline]
    fn occluded(&self, ray: &Ray, leaving: u32) -> bool {
        self.rays.set(self.rays.get() + 1);
        self.scene.bvh.occluded_from(ray, leaving)
    }
}

impl Deref for Caster<'_> {
    type Target = Scene;

    #[inline]
    fn deref(&self) -> &Scene {
        self.scene
    }
}
