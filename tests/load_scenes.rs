//! Every scene of the repository loads, with something to see and something that shines.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use pathblend::load::{self, Options};
use std::path::{Path, PathBuf};

fn scenes() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let entries = std::fs::read_dir(&folder).expect("the repository has scenes");
    let paths = entries.map(|entry| entry.unwrap().path().join("scene.xml"));
    let mut paths: Vec<_> = paths.filter(|path| path.exists()).collect();
    paths.sort();
    assert!(paths.len() >= 5, "{paths:?}");
    paths
}

#[test]
fn every_scene_loads() {
    for path in scenes() {
        let loaded = load::read(&path, &Options::default()).unwrap_or_else(|error| panic!("{error}"));
        assert!(loaded.warnings.is_empty(), "{}: {:?}", path.display(), loaded.warnings);
        let (triangles, solids) = loaded.scene.primitive_counts();
        assert!(triangles + solids > 0 && loaded.scene.has_lights(), "{}", path.display());
        assert_eq!(loaded.scene.camera.size, loaded.scene.film.size);
    }
}

#[test]
fn sizes_and_parameters_can_be_overridden() {
    for path in scenes() {
        let load = |options: &Options| load::read(&path, options).unwrap_or_else(|error| panic!("{error}")).scene;
        let plain = load(&Options::default());
        let sized = load(&Options { size: Some([20, 10]), ..Options::default() });
        let overrides = [("width", "20"), ("height", "10")].map(|(name, value)| (name.to_owned(), value.to_owned()));
        let set = load(&Options { overrides: overrides.into(), ..Options::default() });
        assert_eq!((sized.film, &sized.camera), (set.film, &set.camera), "{}", path.display());
        assert_eq!(sized.film.size, [20, 10]);
        assert_ne!(plain.hash, sized.hash);
        assert_eq!(plain.hash, load(&Options::default()).hash);
    }
}
