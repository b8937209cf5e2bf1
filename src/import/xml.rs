//! The result as a tree of elements.

use crate::spectrum::Spectrum;
use glam::{DAffine3, DVec3};
use std::fmt::Write as _;

/// An element of a Mitsuba scene.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Node {
    tag: &'static str,
    attributes: Vec<(&'static str, String)>,
    children: Vec<Node>,
}

impl Node {
    /// An element without attributes.
    pub fn element(tag: &'static str) -> Self {
        Self { tag, attributes: Vec::new(), children: Vec::new() }
    }

    /// `<tag type="kind">`.
    pub fn new(tag: &'static str, kind: &str) -> Self {
        Self::element(tag).with("type", kind)
    }

    /// The element with one more attribute, which is to come last.
    pub fn with(mut self, name: &'static str, value: impl Into<String>) -> Self {
        self.attributes.push((name, value.into()));
        self
    }

    /// The element as the parameter `name` of another.
    pub fn named(self, name: &str) -> Self {
        self.with("name", name)
    }

    /// The element with one more child.
    pub fn child(mut self, child: Node) -> Self {
        self.children.push(child);
        self
    }

    /// The element with one more child, where there is one.
    pub fn maybe(self, child: Option<Node>) -> Self {
        match child {
            Some(child) => self.child(child),
            None => self,
        }
    }

    fn value(self, tag: &'static str, name: &str, value: impl Into<String>) -> Self {
        self.child(Self::element(tag).named(name).with("value", value))
    }

    /// A number as parameter.
    pub fn float(self, name: &str, value: f64) -> Self {
        self.value("float", name, value.to_string())
    }

    /// A whole number as parameter.
    pub fn integer(self, name: &str, value: i64) -> Self {
        self.value("integer", name, value.to_string())
    }

    /// A truth value as parameter.
    pub fn boolean(self, name: &str, value: bool) -> Self {
        self.value("boolean", name, value.to_string())
    }

    /// A text as parameter.
    pub fn string(self, name: &str, value: impl Into<String>) -> Self {
        self.value("string", name, value)
    }

    /// A colour as parameter.
    pub fn rgb(self, name: &str, colour: Spectrum) -> Self {
        self.child(rgb(name, colour))
    }

    /// A point or vector as parameter.
    pub fn triple(self, tag: &'static str, name: &str, value: DVec3) -> Self {
        let [x, y, z] = value.to_array();
        self.child(
            Self::element(tag).named(name).with("x", x.to_string()).with("y", y.to_string()).with("z", z.to_string()),
        )
    }

    /// A reference to the element with this id.
    pub fn reference(self, id: &str) -> Self {
        self.child(Self::element("ref").with("id", id))
    }

    /// The placement in the world, unless it changes nothing.
    pub fn placed(self, transform: &DAffine3) -> Self {
        if *transform == DAffine3::IDENTITY {
            return self;
        }
        let rows = transform.matrix3.transpose();
        let shift = transform.translation.to_array();
        let axes = [rows.x_axis, rows.y_axis, rows.z_axis];
        let mut cells: Vec<_> = Vec::new();
        for (row, shift) in axes.iter().zip(shift) {
            cells.extend(row.to_array().iter().chain([&shift]).map(f64::to_string));
        }
        let matrix = format!("{} 0 0 0 1", cells.join(" "));
        self.child(Self::element("transform").named("to_world").child(Self::element("matrix").with("value", matrix)))
    }

    /// Whether this element or one inside of it has the tag.
    pub fn contains(&self, tag: &str) -> bool {
        self.tag == tag || self.children.iter().any(|child| child.contains(tag))
    }

    /// How many elements there are in all.
    pub fn count(&self) -> usize {
        self.children.iter().map(Node::count).sum::<usize>() + 1
    }

    /// The element as text, indented `depth` times.
    pub fn write(&self, depth: usize, out: &mut String) {
        let indent = "    ".repeat(depth);
        let _ = write!(out, "{indent}<{}", self.tag);
        for (name, value) in &self.attributes {
            let _ = write!(out, " {name}=\"{}\"", escape(value));
        }
        if self.children.is_empty() {
            out.push_str("/>\n");
            return;
        }
        out.push_str(">\n");
        self.children.iter().for_each(|child| child.write(depth + 1, out));
        let _ = writeln!(out, "{indent}</{}>", self.tag);
    }
}

/// A colour as the parameter `name`.
pub(super) fn rgb(name: &str, colour: Spectrum) -> Node {
    let [r, g, b] = colour.to_rgb();
    let value = if r == g && g == b { r.to_string() } else { format!("{r} {g} {b}") };
    Node::element("rgb").named(name).with("value", value)
}

/// The text with the characters replaced that XML gives a meaning to.
fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '"' => escaped.push_str("&quot;"),
            c if c.is_control() => escaped.push(char::REPLACEMENT_CHARACTER),
            c => escaped.push(c),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn elements_nest_and_escape() {
        let node = Node::new("bsdf", "a<\"b\"&").rgb("r", Spectrum::rgb(0.5, 1.0, 0.0)).child(Node::element("x"));
        let mut text = String::new();
        node.write(1, &mut text);
        let expected = "    <bsdf type=\"a&lt;&quot;b&quot;&amp;\">\n        <rgb name=\"r\" value=\"0.5 1 0\"/>\n        \
                        <x/>\n    </bsdf>\n";
        assert_eq!(text, expected);
    }

    #[test]
    fn the_identity_is_not_written() {
        assert_eq!(Node::new("shape", "s").placed(&DAffine3::IDENTITY), Node::new("shape", "s"));
    }
}
