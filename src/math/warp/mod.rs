//! Maps from the unit square to the shapes that paths are sampled on; one file each, with sample, density and
//! inverse side by side. `sample(invert(x)) = x`, and the density is the inverse of the map's Jacobian.

pub mod cone;
pub mod disk;
pub mod hemisphere;
pub mod sphere;
pub mod triangle;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Stream;

    /// Density from the Jacobian by central differences: |∂x/∂u| as the area spanned by the two derivatives.
    fn density_by_differences(u: [f64; 2], map: impl Fn([f64; 2]) -> glam::DVec3) -> f64 {
        let h = 1e-6;
        let du = (map([u[0] + h, u[1]]) - map([u[0] - h, u[1]])) / (2.0 * h);
        let dv = (map([u[0], u[1] + h]) - map([u[0], u[1] - h])) / (2.0 * h);
        1.0 / du.cross(dv).length()
    }

    #[test]
    fn every_warp_inverts_and_its_density_is_its_jacobian() {
        let mut stream = Stream::new(7, &[]);
        for _ in 0..20_000 {
            let u = [stream.number(), stream.number()].map(|v| 0.001 + 0.998 * v);
            let near_seam = |v: f64| (v * 8.0 - (v * 8.0).round()).abs() < 1e-3;

            let square_round_trips = [
                disk::invert(disk::sample(u)),
                hemisphere::invert(hemisphere::sample(u)),
                sphere::invert(sphere::sample(u)),
                triangle::invert(triangle::sample(u)),
                cone::invert(cone::sample(u, 0.3), 0.3),
                cone::invert(cone::sample(u, 1e-5), 1e-5),
            ];
            for back in square_round_trips {
                assert!((back[0] - u[0]).abs() < 1e-9 && (back[1] - u[1]).abs() < 1e-9, "{u:?} {back:?}");
            }
            // The concentric map has kinks on its diagonals, where differences mean nothing.
            if near_seam(u[0]) || near_seam(u[1]) || (u[0] - u[1]).abs() < 1e-3 || (u[0] + u[1] - 1.0).abs() < 1e-3 {
                continue;
            }
            let checks = [
                (disk::PDF, density_by_differences(u, |u| disk::sample(u).extend(0.0))),
                (hemisphere::pdf(hemisphere::sample(u)).0, density_by_differences(u, hemisphere::sample)),
                (sphere::PDF.0, density_by_differences(u, sphere::sample)),
                (cone::pdf(0.3).0, density_by_differences(u, |u| cone::sample(u, 0.3))),
                (2.0, density_by_differences(u, |u| triangle::sample(u).extend(0.0))),
            ];
            for (pdf, by_differences) in checks {
                assert!((pdf - by_differences).abs() < 1e-3 * pdf.max(1e-3), "{u:?}: {pdf} {by_differences}");
            }
        }
    }
}
