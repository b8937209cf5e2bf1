//! Damaged files load or are refused, and never panic.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use pathblend::load::{self, Options};
use pathblend::math::Stream;
use std::path::{Path, PathBuf};

fn reference(name: &str) -> Vec<u8> {
    std::fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/load_reference").join(name)).unwrap()
}

/// A folder with a scene, and the files that it needs.
struct Bench {
    _folder: tempfile::TempDir,
    path: PathBuf,
}

impl Bench {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        for name in ["bare.obj", "bare.ply", "smooth.obj", "smooth.ply"] {
            std::fs::write(folder.path().join(name), reference(name)).unwrap();
        }
        let path = folder.path().join("scene.xml");
        Self { _folder: folder, path }
    }

    /// Loads `bytes` as the scene file; whether it is accepted.
    fn scene(&self, bytes: &[u8]) -> bool {
        std::fs::write(&self.path, bytes).unwrap();
        match load::read(&self.path, &Options::default()) {
            Ok(_) => true,
            Err(error) => {
                let text = error.to_string();
                // A parser that panics is caught: that must not be needed.
                assert!(!text.contains("confuses the parser") && !text.contains('\u{1b}'), "{text}");
                false
            }
        }
    }

    /// Loads a scene with `bytes` as a mesh file of the form `kind`.
    fn mesh(&self, kind: &str, bytes: &[u8]) -> bool {
        std::fs::write(self.path.with_file_name("mesh"), bytes).unwrap();
        let sensor = "<sensor type=\"perspective\"><float name=\"fov\" value=\"40\"/></sensor>";
        let shape = format!("<shape type=\"{kind}\"><string name=\"filename\" value=\"mesh\"/></shape>");
        self.scene(format!("<scene version=\"3.0.0\">{sensor}{shape}</scene>").as_bytes())
    }
}

/// Changes one byte or two.
fn damage(bytes: &[u8], stream: &mut Stream) -> Vec<u8> {
    let mut damaged = bytes.to_vec();
    let mut below = |n: usize| (stream.number() * n as f64) as usize;
    for _ in 0..=below(2) {
        let at = below(damaged.len());
        match below(4) {
            0 => damaged[at] ^= 1 << below(8),
            1 => damaged[at] = b"0123456789-.e/$<> \n\\"[below(20)],
            2 => drop(damaged.remove(at)),
            _ => damaged.insert(at, damaged[below(bytes.len() / 2)]),
        }
    }
    damaged
}

#[test]
fn truncated_scenes_are_refused() {
    let (bench, whole) = (Bench::new(), reference("shapes.xml"));
    assert!(bench.scene(&whole));
    for length in (0..whole.len() - 10).step_by(97) {
        assert!(!bench.scene(&whole[..length]), "{length}");
    }
}

#[test]
fn damaged_scenes_do_not_panic() {
    let (bench, whole) = (Bench::new(), reference("shapes.xml"));
    let mut stream = Stream::new(1, &[]);
    let accepted = (0..300).filter(|_| bench.scene(&damage(&whole, &mut stream))).count();
    assert!((10..290).contains(&accepted), "{accepted}");
}

#[test]
fn damaged_meshes_do_not_panic() {
    let bench = Bench::new();
    let mut stream = Stream::new(2, &[]);
    for name in ["bare.obj", "smooth.obj", "bare.ply", "smooth.ply"] {
        let (kind, whole) = (&name[name.len() - 3..], reference(name));
        assert!(bench.mesh(kind, &whole));
        for length in (0..whole.len()).step_by(11) {
            bench.mesh(kind, &whole[..length]);
        }
        let accepted = (0..150).filter(|_| bench.mesh(kind, &damage(&whole, &mut stream))).count();
        assert!((1..150).contains(&accepted), "{name}: {accepted}");
    }
}

#[test]
fn garbage_is_refused() {
    let bench = Bench::new();
    let mut stream = Stream::new(3, &[]);
    for length in [0, 1, 7, 1000, 100_000] {
        let garbage: Vec<_> = (0..length).map(|_| (256.0 * stream.number()) as u8).collect();
        assert!(!bench.scene(&garbage), "{length}");
        assert!(!bench.mesh("obj", &garbage) && !bench.mesh("ply", &garbage), "{length}");
        let head = b"ply\nformat binary_little_endian 1.0\nelement vertex 9\nproperty float x\nproperty float y\n\
                     property float z\nelement face 99\nproperty list uint int vertex_indices\nend_header\n";
        assert!(!bench.mesh("ply", &[&head[..], &garbage].concat()), "{length}");
    }
}

/// Nesting without end must not use up the stack.
#[test]
fn deep_nesting_is_refused() {
    let bench = Bench::new();
    for tag in ["shape type=\"sphere\"", "bsdf type=\"twosided\"", "x"] {
        let name = tag.split(' ').next().unwrap();
        let deep = [format!("<{tag}>").repeat(100_000), format!("</{name}>").repeat(100_000)].concat();
        assert!(!bench.scene(format!("<scene version=\"3.0.0\">{deep}</scene>").as_bytes()));
    }
}

/// Coordinates up to the largest that are accepted, down to the smallest, and faces without area.
#[test]
fn extreme_meshes_do_not_panic() {
    let bench = Bench::new();
    for scale in [1e18, 1e-18, 1e-38, 1e-45, 0.0] {
        let mesh = format!("v 0 0 0\nv {scale:e} 0 0\nv 0 {scale:e} 0\n{}", "f 1 2 3\nf 1 1 1\n".repeat(200));
        assert!(bench.mesh("obj", mesh.as_bytes()), "{scale:e}");
    }
    assert!(!bench.mesh("obj", b"v 0 0 0\nv 1e19 0 0\nv 0 1 0\nf 1 2 3\n"));
}
