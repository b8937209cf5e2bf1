//! Values of scattering models against those of Mitsuba 3.9.1, see `tests/reference/bsdf_values.py`.

#![allow(clippy::unwrap_used, clippy::panic)]

use glam::DVec3;
use pathblend::bsdf::Bsdf;
use pathblend::load::{self, Options};
use pathblend::math::Walk;
use pathblend::texture::Site;

/// Mitsuba computes in single precision.
const TOLERANCE: f64 = 1e-4;

fn read(xml: &str) -> Bsdf {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.xml");
    let scene = format!(
        "<scene version=\"3.0.0\"><sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/></sensor><shape type=\"sphere\">{xml}</shape></scene>"
    );
    std::fs::write(&path, scene).unwrap();
    let loaded = load::read(&path, &Options::default()).unwrap_or_else(|error| panic!("{xml}: {error}"));
    loaded.scene.bsdfs()[0].clone()
}

#[test]
fn values_are_those_of_mitsuba() {
    let (mut model, mut name, mut rows, mut misses) = (None, "", 0, Vec::new());
    let table = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/reference/bsdf_values.csv");
    let table = std::fs::read_to_string(table).unwrap();
    for line in table.lines() {
        let (kind, rest) = line.split_at(2);
        if kind == "M " {
            (model, name) = (Some(read(rest)), rest);
            continue;
        }
        let numbers: Vec<f64> = rest.split(' ').map(|word| word.parse().unwrap()).collect();
        let [wi, wo] = [0, 3].map(|i| DVec3::from_slice(&numbers[i..]).normalize());
        let evaluation = model.as_ref().unwrap().evaluate(&Site::default(), wi, wo, Walk::FromCamera);
        let found = evaluation.map_or([0.0; 3], |evaluation| (evaluation.value * wo.z.abs()).to_rgb());
        let expected = &numbers[6..9];
        let scale = expected.iter().fold(0.0, |a: f64, b| a.max(*b));
        let error = found.iter().zip(expected).map(|(a, b)| (a - b).abs() / scale).fold(0.0, f64::max);
        rows += 1;
        if error.is_nan() || error > TOLERANCE {
            misses.push(format!("{name}\n  {wi} {wo}: {found:?}, expected {expected:?} ({error:.1e})"));
        }
    }
    assert!(misses.is_empty(), "{} of {rows} rows:\n{}", misses.len(), misses.join("\n"));
    assert!(rows > 250, "{rows}");
}
