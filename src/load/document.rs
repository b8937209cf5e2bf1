//! A scene as a tree of elements, over all the files that it is made of, whose ids are known.

use super::attributes;
use super::bsdf::Coats;
use super::error::{LoadError, one_of};
use super::files::{At, Files};
use super::picture::Pictures;
use super::references;
use super::source::Source;
use super::value::Text;
use crate::scene::Builder;
use std::cell::RefCell;
use std::collections::HashMap;

pub(super) type Node<'a> = roxmltree::Node<'a, 'a>;

/// The tree of a file.
pub(super) type Tree<'a> = roxmltree::Document<'a>;

/// Tags that say something about the file, and not about the scene.
const ASIDE: [&str; 3] = ["default", "path", "alias"];

/// A scene with its parameters and ids.
pub(super) struct Document<'a> {
    files: &'a Files,
    trees: &'a [Tree<'a>],
    /// Whether a file is in the format of Mitsuba 0.5 and 0.6.
    legacy: Vec<bool>,
    ids: HashMap<String, (usize, Node<'a>)>,
    /// Fingerprints of what else was read: files with spectra.
    read: RefCell<Vec<blake3::Hash>>,
    /// Whether any texture shows an attribute of a mesh.
    pub shows_attributes: bool,
    /// Images that its textures show.
    pub pictures: Pictures,
    /// Rough coats of its scattering models.
    pub coats: Coats,
    /// Whether what is not known is replaced or left out.
    pub approximate: bool,
    /// What was read over in files of Mitsuba 0.5 and 0.6, and what is hardly meant.
    pub warnings: RefCell<Vec<String>>,
}

impl<'a> Document<'a> {
    /// The scene in `files`, of which `trees` has the trees in the same order; `approximate` as in [`super::Options`].
    pub fn new(files: &'a Files, trees: &'a [Tree<'a>], approximate: bool) -> Result<Self, LoadError> {
        let mut document = Self {
            files,
            trees,
            legacy: vec![false; trees.len()],
            ids: HashMap::new(),
            read: RefCell::default(),
            shows_attributes: false,
            pictures: Pictures::default(),
            coats: Coats::default(),
            approximate,
            warnings: RefCell::default(),
        };
        document.versions()?;
        for (file, tree) in trees.iter().enumerate() {
            for node in tree.root_element().descendants().filter(Node::is_element) {
                document.register(file, node)?;
            }
        }
        document.aliases()?;
        references::check(&document)?;
        let shows_attributes = document.elements().any(attributes::is_attribute);
        Ok(Self { shows_attributes, ..document })
    }

    /// The outermost element of the scene file.
    pub fn root(&self) -> Element<'_> {
        self.root_of(0)
    }

    fn root_of(&self, file: usize) -> Element<'_> {
        Element { document: self, file, node: self.trees[file].root_element() }
    }

    /// Takes the versions of the files; a file without one has that of the file that includes it.
    fn versions(&mut self) -> Result<(), LoadError> {
        for (file, tree) in self.trees.iter().enumerate() {
            let root = Element { document: &*self, file, node: tree.root_element() };
            let legacy = match root.attribute("version") {
                Some(version) => is_legacy(version)?,
                None => self
                    .files
                    .included
                    .iter()
                    .find(|(_, inner)| **inner == file)
                    .is_some_and(|((outer, _), _)| self.legacy[*outer]),
            };
            self.legacy[file] = legacy;
        }
        Ok(())
    }

    /// Notes the id of `node`.
    fn register(&mut self, file: usize, node: Node<'a>) -> Result<(), LoadError> {
        let element = Element { document: &*self, file, node };
        let Some(id) = element.attribute("id").filter(|_| !["ref", "alias"].contains(&element.tag())) else {
            return Ok(());
        };
        let (name, offset) = (id.text.to_owned(), id.offset);
        match self.ids.insert(name.clone(), (file, node)) {
            Some(_) => Err(self.files.sources[file].error(offset, format!("the id `{name}` is given twice"))),
            None => Ok(()),
        }
    }

    /// Notes the other names that `<alias id="a" as="b"/>` gives.
    fn aliases(&mut self) -> Result<(), LoadError> {
        for (file, tree) in self.trees.iter().enumerate() {
            let is_alias = |node: &Node<'_>| node.is_element() && node.tag_name().name() == "alias";
            for node in tree.root_element().descendants().filter(is_alias) {
                let alias = Element { document: &*self, file, node };
                alias.only(&["id", "as"])?;
                let (id, new) = (alias.required("id")?, alias.required("as")?);
                let Some(target) = self.ids.get(id.text).copied() else { return Err(unknown(&id)) };
                let (name, offset) = (new.text.to_owned(), new.offset);
                if self.ids.insert(name.clone(), target).is_some() {
                    return Err(self.files.sources[file].error(offset, format!("the id `{name}` is given twice")));
                }
            }
        }
        Ok(())
    }

    /// The element with the id that `reference` names.
    pub fn find<'d>(&'d self, reference: Element<'d>) -> Result<Element<'d>, LoadError> {
        reference.only(&["id", "name"])?;
        let id = reference.required("id")?;
        match self.ids.get(id.text) {
            Some((file, node)) => Ok(Element { document: self, file: *file, node: *node }),
            None => Err(unknown(&id)),
        }
    }

    /// Notes that the image depends on these bytes of another file.
    pub fn depends_on(&self, bytes: &[u8]) {
        self.read.borrow_mut().push(blake3::hash(bytes));
    }

    /// Adds all such files to the scene's fingerprint.
    pub fn fingerprint(&self, builder: &mut Builder) {
        self.read.borrow().iter().for_each(|hash| builder.fingerprint(hash.as_bytes()));
    }

    /// All elements, file by file.
    pub fn elements(&self) -> impl Iterator<Item = Element<'_>> {
        let of_file = move |(file, tree)| {
            let tree: &Tree<'_> = tree;
            let nodes = tree.root_element().descendants().filter(Node::is_element);
            nodes.map(move |node| Element { document: self, file, node })
        };
        self.trees.iter().enumerate().flat_map(of_file)
    }
}

fn unknown(id: &Text<'_>) -> LoadError {
    id.error(format!("nothing in this file has the id `{}`", id.text))
}

/// Whether `version` is that of a format before Mitsuba 2.
fn is_legacy(version: Text<'_>) -> Result<bool, LoadError> {
    let mut numbers = version.text.split('.').map(|number| number.parse::<u32>().ok());
    match (numbers.next().flatten(), numbers.next()) {
        (Some(0), Some(Some(4..=9))) | (Some(1), _) => Ok(true),
        (Some(2 | 3), _) => Ok(false),
        _ => Err(version.error(format!("scene format {} is not supported; expected 0.4 to 3", version.shown()))),
    }
}

/// An element of a scene.
#[derive(Clone, Copy)]
pub(super) struct Element<'a> {
    pub document: &'a Document<'a>,
    file: usize,
    pub node: Node<'a>,
}

impl<'a> Element<'a> {
    /// Its name, such as `bsdf`.
    pub fn tag(self) -> &'a str {
        self.node.tag_name().name()
    }

    /// What tells it from all other elements.
    pub fn key(self) -> At {
        (self.file, self.node.range().start)
    }

    /// Whether it stands in a file of Mitsuba 0.5 or 0.6.
    pub fn is_legacy(self) -> bool {
        self.document.legacy[self.file]
    }

    fn source(self) -> &'a Source {
        &self.document.files.sources[self.file]
    }

    /// The elements inside, with those of included files in their places, without definitions of parameters.
    pub fn children(self) -> impl Iterator<Item = Element<'a>> {
        let mut children = Vec::new();
        self.collect(&mut children);
        children.into_iter()
    }

    fn collect(self, children: &mut Vec<Element<'a>>) {
        for node in self.node.children().filter(|node| node.is_element()) {
            let child = Element { node, ..self };
            match child.included() {
                // The files of a scene are a tree, so this ends.
                Some(root) if root.tag() == "scene" => root.collect(children),
                Some(root) => children.push(root),
                None if ASIDE.contains(&child.tag()) => {}
                None => children.push(child),
            }
        }
    }

    /// The outermost element of the file that this `<include>` means.
    pub fn included(self) -> Option<Element<'a>> {
        self.document.files.included.get(&self.key()).map(|file| self.document.root_of(*file))
    }

    /// The attribute `name` with its parameters replaced.
    pub fn attribute(self, name: &str) -> Option<Text<'a>> {
        let attribute = self.node.attribute_node(name)?;
        let offset = attribute.range_value().start;
        let text = self.document.files.replaced.get(&(self.file, offset)).map_or(attribute.value(), String::as_str);
        Some(Text { text: text.trim(), offset, source: self.source() })
    }

    /// The attribute `name`, or an error that it is missing.
    pub fn required(self, name: &str) -> Result<Text<'a>, LoadError> {
        self.attribute(name).ok_or_else(|| self.error(format!("<{}> lacks the attribute `{name}`", self.tag())))
    }

    /// Refuses attributes other than `names`.
    pub fn only(self, names: &[&str]) -> Result<(), LoadError> {
        match self.node.attributes().find(|attribute| !names.contains(&attribute.name())) {
            None => Ok(()),
            Some(odd) => {
                let expected = one_of(names);
                let message = format!("unexpected attribute `{}` in <{}>; expected {expected}", odd.name(), self.tag());
                Err(self.source().error(odd.range().start, message))
            }
        }
    }

    /// An error at the start of this element.
    pub fn error(self, message: impl Into<String>) -> LoadError {
        self.source().error(self.node.range().start, message)
    }

    /// Warns of this element: its place and the message on one line.
    pub fn warn(self, message: impl Into<String>) {
        let line = self.error(message).to_string().lines().next().unwrap_or_default().to_owned();
        self.document.warnings.borrow_mut().push(line);
    }
}

/// Runs a test on the outermost element of a scene file at `path` with the given text.
#[cfg(test)]
pub(super) fn with_root<R>(
    path: &std::path::Path,
    text: &str,
    test: impl FnOnce(Element<'_>) -> R,
) -> Result<R, LoadError> {
    let files = Files::read(Source::new(path, text.to_owned()), &std::collections::BTreeMap::new())?;
    let trees = files.trees()?;
    let document = Document::new(&files, &trees, false)?;
    Ok(test(document.root()))
}
