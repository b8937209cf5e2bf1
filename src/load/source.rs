//! The text of a scene file, and where the files are that it names.

use super::error::{LoadError, Place};
use std::io::Read as _;
use std::path::{Path, PathBuf};

/// Most bytes of a scene file.
const MOST_BYTES: u64 = 1 << 28;

/// The text of a scene file.
pub(super) struct Source {
    pub path: PathBuf,
    pub text: String,
    /// Folders that files are looked for in, in this order.
    pub folders: Vec<PathBuf>,
}

impl Source {
    /// A scene file with the given text, which looks for files beside itself.
    pub fn new(path: &Path, text: String) -> Self {
        let own = path.parent().unwrap_or(Path::new("")).to_owned();
        Self { path: path.to_owned(), text, folders: vec![own] }
    }

    /// Reads the file at `path`, which must be UTF-8 text; the reason where it cannot be read.
    pub fn read(path: &Path) -> Result<Self, LoadError> {
        let bytes = read_bounded(path, MOST_BYTES)
            .map_err(|reason| LoadError::whole(path, format!("cannot read the scene file: {reason}")))?;
        String::from_utf8(bytes).map(|text| Self::new(path, text)).map_err(|error| {
            let at = error.utf8_error().valid_up_to();
            let text = String::from_utf8_lossy(error.as_bytes()).into_owned();
            Self::new(path, text).error(at, "this is not UTF-8 text; expected a scene in XML")
        })
    }

    /// An error at the byte `offset`.
    pub fn error(&self, offset: usize, message: impl Into<String>) -> LoadError {
        let place = Some(Place::at(&self.text, offset));
        LoadError { place, ..LoadError::whole(&self.path, message) }
    }

    /// The tree of the file's elements. Documents with their own entities are refused: these could grow without bound.
    pub fn parse(&self) -> Result<roxmltree::Document<'_>, LoadError> {
        roxmltree::Document::parse(&self.text).map_err(|error| match error {
            roxmltree::Error::DtdDetected => {
                let at = self.text.find("<!DOCTYPE").unwrap_or_default();
                self.error(at, "a <!DOCTYPE> with entities is not supported; expected a scene without one")
            }
            roxmltree::Error::UnclosedRootNode => self
                .error(self.text.trim_end().len(), "not well-formed XML: the file ends before its outermost element"),
            other => {
                let (place, text) = (other.pos(), other.to_string());
                // The place is said elsewhere.
                let text = text.strip_suffix(&format!(" at {place}")).unwrap_or(&text);
                self.error(self.offset(place), format!("not well-formed XML: {text}"))
            }
        })
    }

    /// The byte at a place that the XML parser names.
    fn offset(&self, place: roxmltree::TextPos) -> usize {
        let start: usize = self.text.split_inclusive('\n').take(place.row as usize - 1).map(str::len).sum();
        let rest = self.text.get(start..).unwrap_or_default();
        start + rest.chars().take(place.col as usize - 1).map(char::len_utf8).sum::<usize>()
    }

    /// The file that `name` means: the first that exists, or the one beside this file where none does.
    pub fn beside(&self, name: &str) -> PathBuf {
        let mut places = self.folders.iter().map(|folder| folder.join(name));
        places.find(|path| path.exists()).unwrap_or_else(|| self.path.parent().unwrap_or(Path::new("")).join(name))
    }

    /// Where a file was looked for in vain, as an addition to a message; nothing where there was one place only.
    pub fn looked(&self, name: &str) -> String {
        let places: Vec<_> = self.folders.iter().map(|folder| folder.join(name)).collect();
        if places.len() < 2 || places.iter().any(|place| place.exists()) {
            return String::new();
        }
        let places: Vec<_> = places.iter().map(|place| place.display().to_string()).collect();
        format!("; looked for {}", places.join(", "))
    }
}

/// The bytes of a plain file, at most `most` of them.
pub(super) fn read_bounded(path: &Path, most: u64) -> Result<Vec<u8>, String> {
    let file = std::fs::File::open(path).map_err(|error| error.to_string())?;
    let about = file.metadata().map_err(|error| error.to_string())?;
    if !about.is_file() {
        return Err("it is not a plain file".to_owned());
    }
    if about.len() > most {
        return Err(format!("it has {} bytes; expected at most {most}", about.len()));
    }
    let mut bytes = Vec::with_capacity(about.len() as usize);
    file.take(most).read_to_end(&mut bytes).map_err(|error| error.to_string())?;
    Ok(bytes)
}
