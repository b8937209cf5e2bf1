//! Where the sun stands (Blanco-Muriel et al. 2001, *Computing the Solar Vector*).

use glam::DVec3;
use std::f64::consts::TAU;

/// A time and a place on Earth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct When {
    /// Year, month from 1, day from 1.
    pub date: [i64; 3],
    /// Hour, minute, second of the local clock.
    pub clock: [f64; 3],
    /// Hours by which the clock is ahead of universal time.
    pub timezone: f64,
    /// Degrees north.
    pub latitude: f64,
    /// Degrees east.
    pub longitude: f64,
}

impl When {
    /// Unit vector towards the sun: +y is up, +x east and −z north.
    pub fn towards(&self) -> DVec3 {
        let [hour, minute, second] = self.clock;
        let hours = hour - self.timezone + (minute + second / 60.0) / 60.0;
        let days = self.days() + hours / 24.0;
        let [ascension, declination] = equatorial(days);
        let sidereal = 6.697_424_324_2 + 0.065_709_828_3 * days + hours;
        let hour_angle = (sidereal * 15.0 + self.longitude).to_radians() - ascension;
        let (sin_latitude, cos_latitude) = self.latitude.to_radians().sin_cos();
        let height = cos_latitude * hour_angle.cos() * declination.cos() + declination.sin() * sin_latitude;
        let zenith = height.clamp(-1.0, 1.0).acos();
        let north = declination.tan() * cos_latitude - sin_latitude * hour_angle.cos();
        let azimuth = (-hour_angle.sin()).atan2(north);
        // Seen from the surface instead of the centre of the Earth.
        let zenith = zenith + 6371.01 / 149_597_890.0 * zenith.sin();
        DVec3::new(azimuth.sin() * zenith.sin(), zenith.cos(), -azimuth.cos() * zenith.sin())
    }

    /// Days since noon of the first of January 2000 at the date's midnight, by the Julian calendar's formula.
    fn days(&self) -> f64 {
        let [year, month, day] = self.date;
        let early = (month - 14) / 12;
        let julian = 1461 * (year + 4800 + early) / 4 + 367 * (month - 2 - 12 * early) / 12
            - 3 * ((year + 4900 + early) / 100) / 4
            + day
            - 32075;
        julian as f64 - 0.5 - 2_451_545.0
    }
}

/// Right ascension and declination of the sun.
fn equatorial(days: f64) -> [f64; 2] {
    let omega = 2.1429 - 0.001_039_459_4 * days;
    let mean = 4.895_063_0 + 0.017_202_791_698 * days;
    let anomaly = 6.240_060_0 + 0.017_201_969_9 * days;
    let longitude = (mean + 0.033_416_07 * anomaly.sin() + 0.000_348_94 * (2.0 * anomaly).sin()
        - 0.000_113_4
        - 0.000_020_3 * omega.sin())
        % TAU;
    let obliquity = 0.409_092_8 - 6.214_0e-9 * days + 0.000_039_6 * omega.cos();
    let ascension = (obliquity.cos() * longitude.sin()).atan2(longitude.cos());
    [ascension, (obliquity.sin() * longitude.sin()).asin()]
}
