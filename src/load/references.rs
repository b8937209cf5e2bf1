//! References must end: what refers to itself, or grows without bound when it is read, is refused before it is read.

use super::document::{Document, Element};
use super::error::LoadError;
use super::files::At;
use std::collections::HashMap;

/// Most references that are followed one after the other.
const DEEPEST: usize = 64;

/// Most elements that one element stands for, with everything that it refers to.
const MOST: usize = 1 << 20;

/// Refuses references to nothing, in a circle, or in too large a number.
pub(super) fn check<'d>(document: &'d Document<'d>) -> Result<(), LoadError> {
    let mut walk = Walk { known: HashMap::new(), open: Vec::new() };
    for element in document.elements().filter(|element| element.tag() == "ref") {
        walk.follow(element)?;
    }
    Ok(())
}

/// What an element amounts to with everything that it refers to.
#[derive(Clone, Copy)]
struct Extent {
    /// Number of elements.
    size: usize,
    /// Most references one after the other.
    depth: usize,
}

struct Walk<'d> {
    /// What is known of the elements that are finished.
    known: HashMap<At, Extent>,
    /// The elements that are being followed, and the names by which they were referred to.
    open: Vec<(At, &'d str)>,
}

impl<'d> Walk<'d> {
    /// What the target of `reference` amounts to.
    fn follow(&mut self, reference: Element<'d>) -> Result<Extent, LoadError> {
        let target = reference.document.find(reference)?;
        let name = reference.required("id")?.text;
        if let Some(extent) = self.known.get(&target.key()) {
            return Ok(*extent);
        }
        if let Some(start) = self.open.iter().position(|(key, _)| *key == target.key()) {
            let names: Vec<_> = self.open[start..].iter().map(|(_, name)| *name).chain([name]).collect();
            return Err(reference.error(format!("this refers to itself: {}", names.join(" → "))));
        }
        let deep = || reference.error(format!("more than {DEEPEST} references, one in the other"));
        if self.open.len() >= DEEPEST {
            return Err(deep());
        }
        self.open.push((target.key(), name));
        let mut extent = self.extent(target)?;
        self.open.pop();
        extent.depth += 1;
        if extent.depth > DEEPEST {
            return Err(deep());
        }
        if extent.size > MOST {
            return Err(reference.error(format!("this stands for more than {MOST} elements")));
        }
        self.known.insert(target.key(), extent);
        Ok(extent)
    }

    fn extent(&mut self, element: Element<'d>) -> Result<Extent, LoadError> {
        let mut whole = Extent { size: 1, depth: 0 };
        for child in element.children() {
            let part = if child.tag() == "ref" { self.follow(child)? } else { self.extent(child)? };
            whole = Extent { size: whole.size.saturating_add(part.size), depth: whole.depth.max(part.depth) };
        }
        Ok(whole)
    }
}

#[cfg(test)]
mod tests {
    use super::super::document::with_root;

    fn message(body: &str) -> Option<String> {
        let text = format!("<scene version=\"3.0.0\">{body}</scene>");
        with_root("s.xml".as_ref(), &text, |_| ()).err().map(|error| error.message)
    }

    #[test]
    fn references_end() {
        assert_eq!(message("<a id=\"x\"/><b><ref id=\"x\"/><ref id=\"x\"/></b>"), None);
        let circle = "<a id=\"x\"><b><ref id=\"y\"/></b></a><a id=\"y\"><ref id=\"x\"/></a>";
        assert_eq!(message(circle).as_deref(), Some("this refers to itself: y → x → y"));
        let link = |i: usize, twice: &str| format!("<a id=\"x{i}\"><ref id=\"x{}\"/>{twice}</a>", i + 1);
        let chain: String = (0..100).map(|i| link(i, "")).collect();
        let found = message(&(chain + "<a id=\"x100\"/>")).unwrap_or_default();
        assert!(found.contains("references, one in the other"), "{found}");
        // Each element holds the next one twice.
        let bomb: String = (0..40).rev().map(|i| link(i, &format!("<ref id=\"x{}\"/>", i + 1))).collect();
        let found = message(&("<a id=\"x40\"/>".to_owned() + &bomb)).unwrap_or_default();
        assert!(found.contains("this stands for more than"), "{found}");
    }
}
