//! The scene file as a tree of elements whose `$parameters` are replaced and whose ids are known.

use super::error::{LoadError, Place};
use super::picture::Pictures;
use super::value::Text;
use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::path::{Path, PathBuf};

pub(super) type Node<'a> = roxmltree::Node<'a, 'a>;

/// The text of a scene file.
pub(super) struct Source {
    pub path: PathBuf,
    pub text: String,
}

impl Source {
    /// Reads the file at `path`, which must be UTF-8 text.
    pub fn read(path: &Path) -> Result<Self, LoadError> {
        let bytes =
            std::fs::read(path).map_err(|e| LoadError::whole(path, format!("cannot read the scene file: {e}")))?;
        String::from_utf8(bytes).map(|text| Self { path: path.to_owned(), text }).map_err(|error| {
            let at = error.utf8_error().valid_up_to();
            let text = String::from_utf8_lossy(error.as_bytes()).into_owned();
            Self { path: path.to_owned(), text }.error(at, "this is not UTF-8 text; expected a scene in XML")
        })
    }

    /// An error at the byte `offset`.
    pub fn error(&self, offset: usize, message: impl Into<String>) -> LoadError {
        let place = Some(Place::at(&self.text, offset));
        LoadError { place, ..LoadError::whole(&self.path, message) }
    }

    /// The tree of the file's elements.
    pub fn parse(&self) -> Result<roxmltree::Document<'_>, LoadError> {
        roxmltree::Document::parse(&self.text).map_err(|error| {
            let position = error.pos();
            let line_start: usize = self.text.split_inclusive('\n').take(position.row as usize - 1).map(str::len).sum();
            let rest = self.text.get(line_start..).unwrap_or_default();
            let in_line: usize = rest.chars().take(position.col as usize - 1).map(char::len_utf8).sum();
            self.error(line_start + in_line, format!("not well-formed XML: {error}"))
        })
    }

    /// The path that `name` means in this file.
    pub fn beside(&self, name: &str) -> PathBuf {
        self.path.parent().unwrap_or(Path::new("")).join(name)
    }
}

/// A scene file with its parameters and ids.
pub(super) struct Document<'a> {
    pub source: &'a Source,
    /// Values of the attributes that contain parameters, by their offset in the text.
    replaced: HashMap<usize, String>,
    ids: HashMap<String, Node<'a>>,
    /// Images that its textures show.
    pub pictures: Pictures,
}

impl<'a> Document<'a> {
    /// Replaces parameters in the order of the document, as Mitsuba does: an override wins over every `<default>`, and
    /// the first `<default>` over later ones.
    pub fn new(
        source: &'a Source,
        tree: &'a roxmltree::Document<'a>,
        overrides: &BTreeMap<String, String>,
    ) -> Result<Self, LoadError> {
        let mut document =
            Self { source, replaced: HashMap::new(), ids: HashMap::new(), pictures: Pictures::default() };
        let mut parameters = overrides.clone();
        let mut used = BTreeSet::new();
        for node in tree.root_element().descendants().filter(Node::is_element) {
            for attribute in node.attributes().filter(|attribute| attribute.value().contains('$')) {
                let text = replace(attribute.value(), &parameters, &mut used)
                    .map_err(|name| source.error(attribute.range_value().start, undefined(name, &parameters)))?;
                document.replaced.insert(attribute.range_value().start, text);
            }
            document.register(node, &mut parameters)?;
        }
        match overrides.keys().find(|name| !used.contains(*name)) {
            Some(name) => Err(LoadError::whole(&source.path, unused(name, &used))),
            None => Ok(document),
        }
    }

    /// Notes what `node` defines: a parameter or an id.
    fn register(&mut self, node: Node<'a>, parameters: &mut BTreeMap<String, String>) -> Result<(), LoadError> {
        let element = Element { document: &*self, node };
        if element.tag() == "default" {
            element.only(&["name", "value"])?;
            let value = element.required("value")?.text.to_owned();
            parameters.entry(element.required("name")?.text.to_owned()).or_insert(value);
            return Ok(());
        }
        let Some(id) = element.attribute("id").filter(|_| element.tag() != "ref") else {
            return Ok(());
        };
        let (name, offset) = (id.text.to_owned(), id.offset);
        match self.ids.insert(name.clone(), node) {
            Some(_) => Err(self.source.error(offset, format!("the id `{name}` is given twice"))),
            None => Ok(()),
        }
    }

    /// The element with the id that `reference` names.
    pub fn find(&'a self, reference: Element<'a>) -> Result<Element<'a>, LoadError> {
        reference.only(&["id", "name"])?;
        let id = reference.required("id")?;
        match self.ids.get(id.text) {
            Some(node) => Ok(Element { document: self, node: *node }),
            None => Err(id.error(format!("nothing in this file has the id `{}`", id.text))),
        }
    }
}

fn undefined(name: &str, parameters: &BTreeMap<String, String>) -> String {
    let known: Vec<_> = parameters.keys().map(|name| format!("${name}")).collect();
    format!("the parameter `${name}` has no <default> before this place; expected {}", super::error::one_of(&known))
}

fn unused(name: &str, used: &BTreeSet<String>) -> String {
    let known: Vec<_> = used.iter().collect();
    format!("nothing in this file uses the parameter `{name}`; expected {}", super::error::one_of(&known))
}

/// Replaces each `$name` in `text`; the name that is not defined otherwise.
fn replace<'t>(
    text: &'t str,
    parameters: &BTreeMap<String, String>,
    used: &mut BTreeSet<String>,
) -> Result<String, &'t str> {
    let mut pieces = text.split('$');
    let mut result = pieces.next().unwrap_or_default().to_owned();
    for piece in pieces {
        let end = piece.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(piece.len());
        let (name, rest) = piece.split_at(end);
        result.push_str(parameters.get(name).ok_or(name)?);
        result.push_str(rest);
        used.insert(name.to_owned());
    }
    Ok(result)
}

/// An element of a scene file.
#[derive(Clone, Copy)]
pub(super) struct Element<'a> {
    pub document: &'a Document<'a>,
    pub node: Node<'a>,
}

impl<'a> Element<'a> {
    /// Its name, such as `bsdf`.
    pub fn tag(self) -> &'a str {
        self.node.tag_name().name()
    }

    /// The elements inside, without definitions of parameters.
    pub fn children(self) -> impl Iterator<Item = Element<'a>> {
        let elements = self.node.children().filter(|node| node.is_element() && node.tag_name().name() != "default");
        elements.map(move |node| Element { document: self.document, node })
    }

    /// The attribute `name` with its parameters replaced.
    pub fn attribute(self, name: &str) -> Option<Text<'a>> {
        let attribute = self.node.attribute_node(name)?;
        let offset = attribute.range_value().start;
        let text = self.document.replaced.get(&offset).map_or(attribute.value(), String::as_str);
        Some(Text { text: text.trim(), offset, source: self.document.source })
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
                let expected = super::error::one_of(names);
                let message = format!("unexpected attribute `{}` in <{}>; expected {expected}", odd.name(), self.tag());
                Err(self.document.source.error(odd.range().start, message))
            }
        }
    }

    /// An error at the start of this element.
    pub fn error(self, message: impl Into<String>) -> LoadError {
        self.document.source.error(self.node.range().start, message)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_are_replaced_by_their_longest_name() {
        let parameters = BTreeMap::from([("w".to_owned(), "1".to_owned()), ("wx".to_owned(), "2".to_owned())]);
        let mut used = BTreeSet::new();
        assert_eq!(replace("$wx $w.5", &parameters, &mut used).as_deref(), Ok("2 1.5"));
        assert_eq!(replace("a $v", &parameters, &mut used), Err("v"));
        assert_eq!(used.len(), 2);
    }
}
