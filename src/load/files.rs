//! The scene file with everything that it includes, and its `$parameters` replaced.

use super::document::{Node, Tree};
use super::error::{LoadError, one_of};
use super::source::Source;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::{Path, PathBuf};

/// Most files that make up a scene.
const MOST_FILES: usize = 256;

/// Most files that include each other.
const DEEPEST: usize = 16;

/// Most bytes of XML that make up a scene.
const MOST_BYTES: usize = 1 << 28;

/// Most bytes of an attribute with parameters.
const LONGEST: usize = 1 << 20;

/// A byte of a file: the file's index and the offset.
pub(super) type At = (usize, usize);

/// The files of a scene. Each inclusion counts as a file of its own: its parameters may differ.
#[derive(Default)]
pub(super) struct Files {
    /// The scene file first.
    pub sources: Vec<Source>,
    /// Values of the attributes that contain parameters.
    pub replaced: HashMap<At, String>,
    /// The file that an `<include>` means.
    pub included: HashMap<At, usize>,
}

/// Files as they are being read.
struct Reading<'o> {
    files: Files,
    /// The files' texts; `None` for those that are not read to their end.
    sources: Vec<Option<Source>>,
    bytes: usize,
    parameters: BTreeMap<String, String>,
    used: BTreeSet<String>,
    /// What `<path>` says.
    folders: Vec<PathBuf>,
    main: &'o Path,
}

impl Files {
    /// Reads the scene file `main`. Parameters are replaced in the order of the document, as Mitsuba does: an override
    /// wins over every `<default>`, and the first `<default>` over later ones.
    pub fn read(main: Source, overrides: &BTreeMap<String, String>) -> Result<Self, LoadError> {
        let path = main.path.clone();
        let mut reading = Reading {
            files: Self::default(),
            sources: Vec::new(),
            bytes: 0,
            parameters: overrides.clone(),
            used: BTreeSet::new(),
            folders: Vec::new(),
            main: &path,
        };
        reading.file(main, &mut Vec::new())?;
        if let Some(name) = overrides.keys().find(|name| !reading.used.contains(*name)) {
            return Err(LoadError::whole(&path, unused(name, &reading.used)));
        }
        let Reading { mut files, sources, folders, .. } = reading;
        files.sources = sources.into_iter().flatten().collect();
        let main_folder = path.parent().unwrap_or(Path::new("")).to_owned();
        for source in &mut files.sources {
            let more = folders.iter().chain([&main_folder]).filter(|folder| **folder != source.folders[0]);
            let more: Vec<_> = more.cloned().collect();
            source.folders.extend(more);
        }
        Ok(files)
    }

    /// The trees of the files.
    pub fn trees(&self) -> Result<Vec<Tree<'_>>, LoadError> {
        self.sources.iter().map(Source::parse).collect()
    }
}

impl Reading<'_> {
    /// Reads a file and those that it includes; its index. `chain` holds the files that are open.
    fn file(&mut self, source: Source, chain: &mut Vec<PathBuf>) -> Result<usize, LoadError> {
        let index = self.sources.len();
        self.sources.push(None);
        self.bytes += source.text.len();
        chain.push(identity(&source.path));
        let tree = source.parse()?;
        for node in tree.root_element().descendants().filter(Node::is_element) {
            self.replace(&source, index, node)?;
            match node.tag_name().name() {
                "default" => self.default(&source, index, node)?,
                "path" => {
                    let (value, _) = self.attribute(&source, index, node, "value")?;
                    let folder = source.path.parent().unwrap_or(Path::new("")).join(value);
                    self.folders.push(folder);
                }
                "include" => {
                    let inner = self.include(&source, index, node, chain)?;
                    let file = self.file(inner, chain)?;
                    self.files.included.insert((index, node.range().start), file);
                }
                _ => {}
            }
        }
        drop(tree);
        chain.pop();
        self.sources[index] = Some(source);
        Ok(index)
    }

    /// Replaces the parameters in the attributes of `node`.
    fn replace(&mut self, source: &Source, index: usize, node: Node<'_>) -> Result<(), LoadError> {
        for attribute in node.attributes().filter(|attribute| attribute.value().contains('$')) {
            let start = attribute.range_value().start;
            let text = replace(attribute.value(), &self.parameters, &mut self.used)
                .map_err(|message| source.error(start, message))?;
            self.bytes += text.len();
            if self.bytes > MOST_BYTES {
                return Err(
                    source.error(start, format!("with its parameters this scene has more than {MOST_BYTES} bytes"))
                );
            }
            self.files.replaced.insert((index, start), text);
        }
        Ok(())
    }

    /// The attribute `name` with its parameters replaced, and where it stands.
    fn attribute(
        &self,
        source: &Source,
        index: usize,
        node: Node<'_>,
        name: &str,
    ) -> Result<(String, usize), LoadError> {
        let tag = node.tag_name().name();
        let lacks = || source.error(node.range().start, format!("<{tag}> lacks the attribute `{name}`"));
        let attribute = node.attribute_node(name).ok_or_else(lacks)?;
        let start = attribute.range_value().start;
        let text = self.files.replaced.get(&(index, start)).map_or(attribute.value(), String::as_str);
        Ok((text.trim().to_owned(), start))
    }

    fn default(&mut self, source: &Source, index: usize, node: Node<'_>) -> Result<(), LoadError> {
        if let Some(odd) = node.attributes().find(|attribute| !["name", "value"].contains(&attribute.name())) {
            let message = format!("unexpected attribute `{}` in <default>; expected one of name, value", odd.name());
            return Err(source.error(odd.range().start, message));
        }
        let (value, _) = self.attribute(source, index, node, "value")?;
        let (name, _) = self.attribute(source, index, node, "name")?;
        self.parameters.entry(name).or_insert(value);
        Ok(())
    }

    /// The file that an `<include>` names.
    fn include(&self, source: &Source, index: usize, node: Node<'_>, chain: &[PathBuf]) -> Result<Source, LoadError> {
        let (name, at) = self.attribute(source, index, node, "filename")?;
        let own = source.path.parent().unwrap_or(Path::new(""));
        let main = self.main.parent().unwrap_or(Path::new(""));
        let places = [own].into_iter().chain(self.folders.iter().map(PathBuf::as_path)).chain([main]);
        let mut places: Vec<_> = places.map(|folder| folder.join(&name)).collect();
        places.dedup();
        let Some(path) = places.iter().find(|path| path.exists()) else {
            let places: Vec<_> = places.iter().map(|place| place.display().to_string()).collect();
            return Err(source.error(at, format!("cannot find the file `{name}`; looked for {}", places.join(", "))));
        };
        let path_identity = identity(path);
        if let Some(start) = chain.iter().position(|open| *open == path_identity) {
            let names: Vec<_> = chain[start..].iter().chain([&path_identity]).map(|path| short(path)).collect();
            return Err(source.error(at, format!("files include each other in a circle: {}", names.join(" → "))));
        }
        if self.sources.len() >= MOST_FILES || chain.len() >= DEEPEST {
            let bound = format!("expected at most {MOST_FILES}, and at most {DEEPEST} one in the other");
            return Err(source.error(at, format!("this scene includes too many files; {bound}")));
        }
        let inner = Source::read(path)?;
        if self.bytes + inner.text.len() > MOST_BYTES {
            return Err(source.error(at, format!("this scene has more than {MOST_BYTES} bytes of XML")));
        }
        Ok(inner)
    }
}

/// The path by which a file is known again.
fn identity(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}

fn short(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

fn undefined(name: &str, parameters: &BTreeMap<String, String>) -> String {
    let known: Vec<_> = parameters.keys().map(|name| format!("${name}")).collect();
    format!("the parameter `${name}` has no <default> before this place; expected {}", one_of(&known))
}

fn unused(name: &str, used: &BTreeSet<String>) -> String {
    let known: Vec<_> = used.iter().collect();
    format!("nothing in this file uses the parameter `{name}`; expected {}", one_of(&known))
}

/// Replaces each `$name` in `text`; a message where that cannot be done.
fn replace(text: &str, parameters: &BTreeMap<String, String>, used: &mut BTreeSet<String>) -> Result<String, String> {
    let mut pieces = text.split('$');
    let mut result = pieces.next().unwrap_or_default().to_owned();
    for piece in pieces {
        let end = piece.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(piece.len());
        let (name, rest) = piece.split_at(end);
        result.push_str(parameters.get(name).ok_or_else(|| undefined(name, parameters))?);
        result.push_str(rest);
        // Parameters that name parameters can grow without bound.
        if result.len() > LONGEST {
            return Err(format!("with the parameter `${name}` this text has more than {LONGEST} bytes"));
        }
        used.insert(name.to_owned());
    }
    Ok(result)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_are_replaced_by_their_longest_name() {
        let parameters = BTreeMap::from([("w".to_owned(), "1".to_owned()), ("wx".to_owned(), "2".to_owned())]);
        let mut used = BTreeSet::new();
        assert_eq!(replace("$wx $w.5", &parameters, &mut used).as_deref(), Ok("2 1.5"));
        assert!(replace("a $v", &parameters, &mut used).is_err_and(|message| message.contains("`$v`")));
        assert_eq!(used.len(), 2);
    }
}
