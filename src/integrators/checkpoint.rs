//! The file in which a render waits to go on.
//!
//! After a line that names format and version come the length of the rest, its BLAKE3 hash, and the rest in the coding of
//! the crate postcard: what is rendered how, and what the passes have gathered. A file is written whole and renamed, so a
//! render that is killed leaves the one before; whatever is not as it was written is told by the hash.

use super::Counts;
use super::render::{Elapsed, Run};
use crate::film::Sums;
use crate::image::{ImageError, write_whole};
use serde::{Deserialize, Serialize};
use std::fs::File;
use std::io::{self, BufWriter, ErrorKind, IntoInnerError, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// How every version of the format begins; a number and a line feed follow.
const MAGIC: &[u8] = b"pathblend checkpoint ";
/// Version of the format.
const VERSION: &str = "1";
/// Bytes of the length and of the hash.
const SEAL: usize = 8 + blake3::OUT_LEN;

/// Why a render cannot go on from a file, or cannot leave one. What was there stays there.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// The file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// The file cannot be written.
    #[error(transparent)]
    Write(#[from] ImageError),
    /// The file is something else.
    #[error("{} is not a checkpoint: expected it to start with `pathblend checkpoint`; delete it to start afresh",
        path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// The file has the format of another time.
    #[error("{} has version {found} of the format, expected {VERSION}; delete it to start afresh", path.display())]
    Version {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: String,
    },
    /// The file ends early.
    #[error("{} is truncated: found {found} bytes, expected {expected}; delete it to start afresh", path.display())]
    Truncated {
        /// The file.
        path: PathBuf,
        /// Bytes that it has.
        found: u64,
        /// Bytes that it should have.
        expected: u64,
    },
    /// The file is not what was written.
    #[error("{} is damaged: {reason}; delete it to start afresh", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What does not fit.
        reason: &'static str,
    },
    /// The file belongs to another render.
    #[error("cannot go on from {}: its {what} is {found}, expected {expected}; delete it to start afresh", path.display())]
    Other {
        /// The file.
        path: PathBuf,
        /// What differs.
        what: &'static str,
        /// What the file says.
        found: String,
        /// What was asked for.
        expected: String,
    },
}

/// What must be the same for a render to go on, in the order in which differences are told.
#[derive(Serialize, Deserialize)]
struct Identity {
    /// Fingerprint of the sources that make images.
    build: String,
    scene: String,
    method: String,
    seed: u64,
    max_depth: u64,
    /// Of the method.
    options: String,
    features: bool,
}

impl Identity {
    fn of(run: &Run<'_>) -> Self {
        Self {
            build: env!("PATHBLEND_RENDERER").to_owned(),
            scene: run.scene.hash.clone(),
            method: run.method.name().to_owned(),
            seed: run.settings.seed,
            max_depth: run.settings.max_depth as u64,
            options: run.settings.options().to_string(),
            features: run.settings.features,
        }
    }

    /// Names and values, as messages have them.
    fn words(&self) -> [(&'static str, String); 7] {
        let layers = if self.features { "with path layers" } else { "without path layers" };
        [
            ("build of pathblend", self.build.chars().take(12).collect()),
            ("scene", self.scene.clone()),
            ("method", self.method.clone()),
            ("seed", self.seed.to_string()),
            ("longest path", self.max_depth.to_string()),
            ("method's options", self.options.clone()),
            ("film", layers.to_owned()),
        ]
    }
}

/// Writes the state of `run` to `path`, whole or not at all.
pub(super) fn save(run: &Run<'_>, path: &Path) -> Result<(), CheckpointError> {
    let content = (Identity::of(run), run.elapsed(), run.counts.samples, run.counts.rays, run.film.sums());
    let io_error = |source| ImageError::Io { path: path.to_owned(), action: "write", source };
    write_whole(path, |file| write(file, &content).map_err(io_error))?;
    Ok(())
}

/// Writes `content` after its length and hash, which are known last.
fn write(file: &mut File, content: &impl Serialize) -> io::Result<()> {
    file.write_all(&[MAGIC, VERSION.as_bytes(), b"\n"].concat())?;
    let place = file.stream_position()?;
    file.write_all(&[0; SEAL])?;
    let sealed = Sealed { file: &mut *file, hasher: blake3::Hasher::new(), bytes: 0 };
    let mut buffered = BufWriter::with_capacity(1 << 20, sealed);
    // What the crate says of a full disk is less than the system says when the rest is written.
    let encoded = postcard::to_io(content, &mut buffered).map(|_| ());
    let Sealed { hasher, bytes, .. } = buffered.into_inner().map_err(IntoInnerError::into_error)?;
    encoded.map_err(io::Error::other)?;
    file.seek(SeekFrom::Start(place))?;
    file.write_all(&[&bytes.to_le_bytes()[..], hasher.finalize().as_bytes()].concat())
}

/// Counts and hashes what passes.
struct Sealed<'a> {
    file: &'a mut File,
    hasher: blake3::Hasher,
    bytes: u64,
}

impl Write for Sealed<'_> {
    fn write(&mut self, part: &[u8]) -> io::Result<usize> {
        let written = self.file.write(part)?;
        self.hasher.update(&part[..written]);
        self.bytes += written as u64;
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// Lets `run`, which has not begun, go on from the file at `path`; `false` where there is none.
pub(super) fn resume(run: &mut Run<'_>, path: &Path) -> Result<bool, CheckpointError> {
    let bytes = match std::fs::read(path) {
        Ok(bytes) => bytes,
        Err(source) if source.kind() == ErrorKind::NotFound => return Ok(false),
        Err(source) => return Err(CheckpointError::Read { path: path.to_owned(), source }),
    };
    let damaged = |reason| CheckpointError::Damaged { path: path.to_owned(), reason };
    let undecoded = |_| damaged("its content cannot be decoded");
    let content = unseal(&bytes, path)?;
    let (found, rest) = postcard::take_from_bytes::<Identity>(content).map_err(undecoded)?;
    for ((what, found), (_, expected)) in found.words().into_iter().zip(Identity::of(run).words()) {
        if found != expected {
            return Err(CheckpointError::Other { path: path.to_owned(), what, found, expected });
        }
    }
    let (elapsed, samples, rays, sums): (Elapsed, u64, u64, Sums) = postcard::from_bytes(rest).map_err(undecoded)?;
    if !run.film.restore(sums) {
        return Err(damaged("its film has another form than the scene's"));
    }
    run.go_on(elapsed, Counts { samples, rays, ..Counts::default() });
    Ok(true)
}

/// The content of a file whose version, length and hash are right.
fn unseal<'a>(bytes: &'a [u8], path: &Path) -> Result<&'a [u8], CheckpointError> {
    let path = || path.to_owned();
    let rest = bytes.strip_prefix(MAGIC).ok_or_else(|| CheckpointError::Foreign { path: path() })?;
    let damaged = |reason| CheckpointError::Damaged { path: path(), reason };
    let end = rest.iter().position(|byte| *byte == b'\n').ok_or_else(|| damaged("it has no version"))?;
    let (version, rest) = (String::from_utf8_lossy(&rest[..end]), &rest[end + 1..]);
    if version != VERSION {
        return Err(CheckpointError::Version { path: path(), found: version.chars().take(12).collect() });
    }
    let truncated = |missing: u64| {
        let found = bytes.len() as u64;
        CheckpointError::Truncated { path: path(), found, expected: found.saturating_add(missing) }
    };
    let (length, rest) = rest.split_first_chunk::<8>().ok_or_else(|| truncated((SEAL - rest.len()) as u64))?;
    let (hash, content) = rest
        .split_first_chunk::<{ blake3::OUT_LEN }>()
        .ok_or_else(|| truncated((blake3::OUT_LEN - rest.len()) as u64))?;
    let (length, found) = (u64::from_le_bytes(*length), content.len() as u64);
    if found < length {
        return Err(truncated(length - found));
    }
    if found > length || blake3::hash(content) != blake3::Hash::from_bytes(*hash) {
        return Err(damaged("its checksum does not fit its content"));
    }
    Ok(content)
}
