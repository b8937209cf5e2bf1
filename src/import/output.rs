//! The files of the result. They are made in a folder of their own and moved to their places when all is done.

use super::ImportError;
use crate::image::{Image, Precision, WriteOptions, write_whole};
use std::io::Write as _;
use std::path::{Component, Path, PathBuf};
use tempfile::TempDir;

/// Folder of the files beside the scene.
const FOLDER: &str = "meshes";

/// Where the result goes.
pub(super) struct Output {
    scene: PathBuf,
    /// The folder of the scene.
    folder: PathBuf,
    /// Holds the files until they are published; deleted if they are not.
    staging: TempDir,
    /// Names of the files in [`FOLDER`].
    files: Vec<String>,
}

impl Output {
    /// For the scene file `scene`.
    pub fn new(scene: &Path) -> Result<Self, ImportError> {
        let parent = scene.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let failed = |source| ImportError::Write { path: scene.to_owned(), source };
        let folder = std::fs::canonicalize(parent).map_err(failed)?;
        let staging = tempfile::Builder::new().prefix(".pathblend-").tempdir_in(&folder).map_err(failed)?;
        Ok(Self { scene: scene.to_owned(), folder, staging, files: Vec::new() })
    }

    /// The next file's name, after the scene's: several scenes may share a folder.
    fn next_name(&mut self, extension: &str) -> String {
        let stem = self.scene.file_stem().unwrap_or_default().to_string_lossy();
        let stem: String =
            stem.chars().map(|c| if c.is_alphanumeric() || "-_".contains(c) { c } else { '_' }).collect();
        let name = format!("{stem}_{:03}.{extension}", self.files.len() + 1);
        self.files.push(name.clone());
        name
    }

    /// Adds a file with these bytes; its path relative to the scene.
    pub fn bytes(&mut self, extension: &str, bytes: &[u8]) -> Result<String, String> {
        let name = self.next_name(extension);
        let written = std::fs::File::create(self.staging.path().join(&name)).and_then(|mut file| file.write_all(bytes));
        written.map_err(|error| format!("cannot write {FOLDER}/{name}: {error}"))?;
        Ok(format!("{FOLDER}/{name}"))
    }

    /// Adds an image; its path relative to the scene.
    pub fn image(&mut self, image: &Image, precision: Precision) -> Result<String, String> {
        let name = self.next_name("exr");
        let options = WriteOptions { precision, ..WriteOptions::default() };
        let written = image.write(&self.staging.path().join(&name), &options);
        written.map_err(|error| format!("cannot write {FOLDER}/{name}: {error}"))?;
        Ok(format!("{FOLDER}/{name}"))
    }

    /// The path of an existing file relative to the scene, or what would have to be different.
    pub fn relative(&self, file: &Path) -> Result<String, String> {
        let file = std::fs::canonicalize(file).map_err(|error| format!("a file that exists: {error}"))?;
        let (mut from, mut to) = (self.folder.components().peekable(), file.components().peekable());
        while from.peek().is_some() && from.peek() == to.peek() {
            from.next();
            to.next();
        }
        let up = from.map(|_| Component::ParentDir);
        let path: PathBuf = up.chain(to).collect();
        match path.to_str() {
            // Mitsuba takes a dollar sign for the start of a parameter.
            Some(text) if !text.contains('$') => Ok(text.replace('\\', "/")),
            _ => Err(format!("a path in UTF-8 without `$`; {} has other characters", path.display())),
        }
    }

    /// Moves the files to their places and writes the scene; what was written besides it.
    pub fn publish(self, scene: &str) -> Result<Vec<PathBuf>, ImportError> {
        let folder = self.folder.join(FOLDER);
        if !self.files.is_empty() {
            std::fs::create_dir_all(&folder).map_err(|source| ImportError::Write { path: folder.clone(), source })?;
        }
        for name in &self.files {
            let to = folder.join(name);
            let moved = std::fs::rename(self.staging.path().join(name), &to);
            moved.map_err(|source| ImportError::Write { path: to, source })?;
        }
        write_whole(&self.scene, |file| {
            let failed = |source| crate::image::ImageError::Io { path: self.scene.clone(), action: "write", source };
            file.write_all(scene.as_bytes()).map_err(failed)
        })?;
        Ok(self.files.iter().map(|name| Path::new(FOLDER).join(name)).collect())
    }
}
