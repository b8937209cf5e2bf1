//! Casts rays and counts them.

use super::{Scene, Surface};
use crate::geometry::Ray;
use glam::DVec3;
use std::cell::Cell;
use std::ops::Deref;

/// The scene as one job sees it: every ray that it casts is counted.
pub struct Caster<'a> {
    scene: &'a Scene,
    rays: Cell<u64>,
}

impl<'a> Caster<'a> {
    /// No rays cast yet.
    pub fn new(scene: &'a Scene) -> Self {
        Self { scene, rays: Cell::new(0) }
    }

    /// Rays cast so far.
    pub fn rays(&self) -> u64 {
        self.rays.get()
    }

    /// The closest surface from `origin` along the unit vector `direction`.
    #[inline]
    pub fn intersect(&self, origin: DVec3, direction: DVec3) -> Option<Surface> {
        self.rays.set(self.rays.get() + 1);
        self.scene.intersect(&Ray { origin, direction, tmax: f64::INFINITY })
    }

    /// Whether nothing lies between two points, which the caller has moved off their surfaces.
    #[inline]
    pub fn visible(&self, from: DVec3, to: DVec3) -> bool {
        let offset = to - from;
        let distance = offset.length();
        !self.occluded(&Ray { origin: from, direction: offset / distance, tmax: distance })
    }

    /// Whether the ray from `origin` along `direction` leaves the scene.
    #[inline]
    pub fn escapes(&self, origin: DVec3, direction: DVec3) -> bool {
        !self.occluded(&Ray { origin, direction, tmax: f64::INFINITY })
    }

    #[inline]
    fn occluded(&self, ray: &Ray) -> bool {
        self.rays.set(self.rays.get() + 1);
        self.scene.bvh.occluded(ray)
    }
}

impl Deref for Caster<'_> {
    type Target = Scene;

    #[inline]
    fn deref(&self) -> &Scene {
        self.scene
    }
}
