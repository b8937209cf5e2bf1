//! Dependencies point down: a room of `src/` uses only rooms below it.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::fs;
use std::path::Path;

/// The rooms, lowest first. Rooms on one line may use each other's types only downwards in the order given.
const ROOMS: [&str; 22] = [
    "math",
    "spectrum",
    "forest",
    "image",
    "geometry",
    "texture",
    "bsdf",
    "emitter",
    "camera",
    "film",
    "scene",
    "load",
    "import",
    "paths",
    "manifold",
    "path_space",
    "markov",
    "integrators",
    "blend",
    "report",
    "cli",
    "main",
];

fn sources(folder: &Path, found: &mut Vec<std::path::PathBuf>) {
    for entry in fs::read_dir(folder).expect("the source folder") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

#[test]
fn rooms_use_only_rooms_below_them() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    assert!(files.len() > 50, "the sources were not found");
    let mut seen = 0;
    for file in files {
        let inside = file.strip_prefix(&root).expect("below src");
        let first = inside.iter().next().expect("a name").to_string_lossy();
        let room = first.trim_end_matches(".rs");
        if room == "lib" {
            continue;
        }
        let level = ROOMS.iter().position(|r| *r == room);
        let level = level.unwrap_or_else(|| panic!("{}: room `{room}` has no place in the order", inside.display()));
        for (number, line) in fs::read_to_string(&file).expect("readable").lines().enumerate() {
            let code = line.split("//").next().unwrap_or_default();
            for used in code.split("crate::").skip(1) {
                let used: String = used.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect();
                let Some(other) = ROOMS.iter().position(|r| *r == used) else { continue };
                seen += 1;
                assert!(other <= level, "{}:{}: `{room}` uses `{used}`", inside.display(), number + 1);
            }
        }
    }
    assert!(seen > 100, "only {seen} uses were found: does the test still read the sources?");
}
