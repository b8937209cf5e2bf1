//! Rays and shapes (by brute force for now).
use glam::{DVec3, Vec3};
/// A ray.
#[derive(Clone, Copy, Debug)]
pub struct Ray {
    /// Origin.
    pub origin: DVec3,
    /// Unit direction.
    pub direction: DVec3,
    /// Largest distance.
    pub tmax: f64,
}
/// A hit.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    /// Distance.
    pub t: f64,
    /// What was hit.
    pub primitive: Primitive,
}
/// What was hit.
#[derive(Clone, Copy, Debug)]
#[allow(missing_docs)]
pub enum Primitive {
    /// A triangle.
    Triangle { index: u32, u: f64, v: f64 },
    /// A solid.
    Solid { index: u32 },
}
/// An analytic shape.
#[derive(Clone, Copy, Debug)]
#[allow(missing_docs)]
pub enum Solid {
    /// Sphere.
    Sphere { center: DVec3, radius: f64 },
    /// Disk.
    Disk { center: DVec3, normal: DVec3, radius: f64 },
}
impl Solid {
    fn intersect(&self, ray: &Ray) -> Option<f64> {
        match self {
            Solid::Sphere { center, radius } => {
                let o = ray.origin - *center;
                let b = o.dot(ray.direction);
                let c = o.length_squared() - radius * radius;
                let d = b * b - c;
                if d < 0.0 {
                    return None;
                }
                let s = d.sqrt();
                let q = if b > 0.0 { -b - s } else { -b + s };
                let (t0, t1) = (q.min(c / q), q.max(c / q));
                if t0 > 0.0 {
                    Some(t0)
                } else if t1 > 0.0 {
                    Some(t1)
                } else {
                    None
                }
            }
            Solid::Disk { center, normal, radius } => {
                let t = (*center - ray.origin).dot(*normal) / ray.direction.dot(*normal);
                ((ray.origin + ray.direction * t - *center).length() < *radius && t > 0.0).then_some(t)
            }
        }
    }
}
/// Acceleration structure.
pub struct Bvh {
    triangles: Vec<[DVec3; 3]>,
    solids: Vec<Solid>,
}
impl Bvh {
    /// Builds.
    pub fn build(vertices: &[Vec3], triangles: &[[u32; 3]], solids: &[Solid]) -> Self {
        Self {
            triangles: triangles.iter().map(|t| t.map(|i| vertices[i as usize].as_dvec3())).collect(),
            solids: solids.to_vec(),
        }
    }
    /// Bounds.
    pub fn bounds(&self) -> (DVec3, DVec3) {
        let (mut lo, mut hi) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for p in self.triangles.iter().flatten() {
            lo = lo.min(*p);
            hi = hi.max(*p);
        }
        for s in &self.solids {
            let (Solid::Sphere { center, radius } | Solid::Disk { center, radius, .. }) = s;
            lo = lo.min(*center - *radius);
            hi = hi.max(*center + *radius);
        }
        (lo, hi)
    }
    /// Closest hit.
    pub fn intersect(&self, ray: &Ray) -> Option<Hit> {
        let mut best: Option<Hit> = None;
        let mut tmax = ray.tmax;
        for (index, [a, b, c]) in self.triangles.iter().enumerate() {
            let (e1, e2) = (*b - *a, *c - *a);
            let p = ray.direction.cross(e2);
            let det = e1.dot(p);
            let s = ray.origin - *a;
            let u = s.dot(p) / det;
            let q = s.cross(e1);
            let v = ray.direction.dot(q) / det;
            let t = e2.dot(q) / det;
            if u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0 && t < tmax {
                tmax = t;
                best = Some(Hit { t, primitive: Primitive::Triangle { index: index as u32, u, v } });
            }
        }
        for (index, solid) in self.solids.iter().enumerate() {
            if let Some(t) = solid.intersect(ray).filter(|t| *t < tmax) {
                tmax = t;
                best = Some(Hit { t, primitive: Primitive::Solid { index: index as u32 } });
            }
        }
        best
    }
    /// Any hit.
    pub fn occluded(&self, ray: &Ray) -> bool {
        self.intersect(ray).is_some()
    }
}
