//! Files that appear whole or not at all: written beside the target, then renamed onto it.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use tempfile::{Builder, NamedTempFile};

use super::ImageError;

/// Writes the file at `path` through `fill`; the name appears, or changes what it stands for, only when all
/// is written. A symbolic link is followed, so that the file it points to is replaced and the link stays.
///
/// # Errors
/// What `fill` returns; [`ImageError::Target`] where a folder or device is in the way; [`ImageError::Io`].
pub fn write_whole(path: &Path, fill: impl FnOnce(&mut fs::File) -> Result<(), ImageError>) -> Result<(), ImageError> {
    let target = resolve(path)?;
    let io_error = |source| ImageError::Io { path: path.to_owned(), action: "write", source };
    let mut temporary = beside(&target).map_err(io_error)?;
    fill(temporary.as_file_mut())?;
    temporary.as_file_mut().flush().map_err(io_error)?;
    temporary.persist(&target).map_err(|error| io_error(error.error))?;
    Ok(())
}

/// The real file behind `path`. Renaming onto a device such as `/dev/null` would replace it, so only plain
/// files and new names pass.
fn resolve(path: &Path) -> Result<PathBuf, ImageError> {
    let in_the_way = |found| ImageError::Target { path: path.to_owned(), found };
    match fs::metadata(path) {
        Ok(there) if there.is_dir() => Err(in_the_way("a folder")),
        Ok(there) if !there.is_file() => Err(in_the_way("a device or pipe")),
        Ok(_) => Ok(fs::canonicalize(path).unwrap_or_else(|_| path.to_owned())),
        Err(_) if path.file_name().is_none() => Err(in_the_way("no file name")),
        Err(_) => Ok(path.to_owned()),
    }
}

fn beside(target: &Path) -> io::Result<NamedTempFile> {
    let folder = match target.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let mut builder = Builder::new();
    builder.prefix(".pathblend-").suffix(".part");
    // Temporary files are private by default; the result is meant to be as readable as any other file.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect()
    }

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x");
        fs::write(&path, "old").unwrap();
        let result = write_whole(&path, |file| {
            file.write_all(b"half").unwrap();
            Err(ImageError::NothingToCompare { pixels: 0 })
        });
        assert!(result.is_err());
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(names(folder.path()), ["x"]);
    }

    #[test]
    fn folders_and_missing_folders_are_named_in_the_error() {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        let error = write_whole(folder, |_| Ok(())).unwrap_err();
        assert!(error.to_string().contains("found a folder"), "{error}");
        let error = write_whole(&folder.join("no/where"), |_| Ok(())).unwrap_err();
        assert!(error.to_string().contains("no/where"), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn links_stay_and_devices_are_spared() {
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("file"), folder.path().join("link"));
        fs::write(&file, "old").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        write_whole(&link, |f| {
            f.write_all(b"new").unwrap();
            Ok(())
        })
        .unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&file).unwrap(), b"new");
        assert!(write_whole(Path::new("/dev/null"), |_| Ok(())).is_err());
    }
}
