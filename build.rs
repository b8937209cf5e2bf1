//! Fingerprints the rooms that make images, so that cached renders are kept while other rooms change.

use std::fs;
use std::path::{Path, PathBuf};

/// Rooms of `src/` that no pixel of a render depends on.
const OTHERS: [&str; 7] = ["blend", "cli", "forest", "image", "import", "lib.rs", "main.rs"];

fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() {
            collect(&path, files);
        } else {
            files.push(path);
        }
    }
}

fn main() {
    println!("cargo::rerun-if-changed=src");
    let mut files = Vec::new();
    for entry in fs::read_dir("src").into_iter().flatten().flatten() {
        if OTHERS.iter().all(|name| entry.file_name() != *name) {
            if entry.path().is_dir() { collect(&entry.path(), &mut files) } else { files.push(entry.path()) }
        }
    }
    files.sort();
    let mut hasher = blake3::Hasher::new();
    for file in files {
        hasher.update(file.to_string_lossy().as_bytes());
        hasher.update(&fs::read(&file).unwrap_or_default());
    }
    println!("cargo::rustc-env=PATHBLEND_RENDERER={}", hasher.finalize().to_hex());
}
