//! Values that a mesh has for its vertices or faces, and the textures that show them. All as in Mitsuba 3.9.1, but that
//! it looks for values of vertices in the wrong place on instances, and cannot sample lights that show values.

use super::document::Element;
use super::error::{LoadError, one_of};
use super::plugin::Plugin;
use crate::scene::Mesh;
use crate::texture::{Attribute, Draped, Texture};
use glam::{Vec2, Vec3};
use std::collections::HashSet;
use std::sync::Arc;

/// The texture that shows them.
pub(super) const KIND: &str = "mesh_attribute";

/// What the values of a mesh belong to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Per {
    Vertex,
    Face,
}

/// An attribute as a mesh file has it.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct RawAttribute {
    pub name: String,
    pub per: Per,
    /// Number of channels: 1 stands in all three places, a fourth is left aside.
    pub channels: usize,
    /// Whether a channel is stored as whole numbers.
    pub whole: bool,
    /// By vertex or by triangle.
    pub values: Vec<Vec3>,
}

/// Properties of a file that are one attribute.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Group {
    pub name: String,
    /// Indices of its properties in the order of its channels.
    pub members: Vec<usize>,
}

/// Channels that go together without a prefix; a fourth may be missing.
const COLOURS: [[&str; 4]; 2] = [["r", "g", "b", "a"], ["red", "green", "blue", "alpha"]];

/// Last letters of properties that go together, in this order.
const SEQUENCES: [&str; 4] = ["xyzw", "rgba", "0123", "1234"];

/// Groups `properties` into attributes, as Mitsuba 3.9.1 does: r, g, b of any order are `vertex_color`; neighbours
/// heat_x, heat_y, heat_z are `vertex_heat`, heat_r, heat_g, heat_b are `vertex_heat_color`, and so on. Others are no
/// attributes.
pub(super) fn group(per: Per, properties: &[&str]) -> Vec<Group> {
    let prefix = match per {
        Per::Vertex => "vertex",
        Per::Face => "face",
    };
    let find = |name: &&str| properties.iter().position(|property| property == name);
    let colour =
        |names: &[&str; 4]| names[..3].iter().map(find).collect::<Option<Vec<usize>>>().zip(Some(find(&names[3])));
    let mut groups = Vec::new();
    if let Some((mut members, alpha)) = COLOURS.iter().find_map(colour) {
        members.extend(alpha);
        groups.push(Group { name: format!("{prefix}_color"), members });
    }
    let taken: Vec<usize> = groups.iter().flat_map(|group: &Group| group.members.clone()).collect();
    let mut rest = (0..properties.len()).filter(|index| !taken.contains(index)).peekable();
    let mut seen = HashSet::new();
    while let Some(first) = rest.next() {
        let Some((stem, last)) = parts(properties[first]) else { continue };
        let Some(sequence) = SEQUENCES.iter().find(|sequence| sequence.starts_with(last)) else { continue };
        if !seen.insert(stem) {
            continue;
        }
        let mut members = vec![first];
        while let Some(next) = rest.next_if(|index| parts(properties[*index]).is_some_and(|(other, _)| other == stem)) {
            members.push(next);
        }
        let letters: String =
            members.iter().filter_map(|index| parts(properties[*index])).map(|(_, last)| last).collect();
        if sequence.starts_with(&letters) && [1, 3].contains(&members.len()) {
            let colour = if *sequence == "rgba" { "_color" } else { "" };
            groups.push(Group { name: format!("{prefix}_{stem}{colour}"), members });
        }
    }
    groups
}

/// What stands before the last underscore, and the one letter after it.
fn parts(property: &str) -> Option<(&str, char)> {
    let (stem, last) = property.rsplit_once('_')?;
    let mut letters = last.chars();
    letters.next().filter(|_| letters.next().is_none()).map(|letter| (stem, letter))
}

/// Whether the shape `element`, with what it holds and refers to, shows an attribute.
pub(super) fn shows(element: Element<'_>) -> Result<bool, LoadError> {
    Ok(element.document.shows_attributes && holds(element)?)
}

fn holds(element: Element<'_>) -> Result<bool, LoadError> {
    if is_attribute(element) {
        return Ok(true);
    }
    for child in element.children() {
        let child = if child.tag() == "ref" { child.document.find(child)? } else { child };
        if holds(child)? {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Whether it is a texture that shows an attribute.
pub(super) fn is_attribute(element: Element<'_>) -> bool {
    element.tag() == "texture" && element.attribute("type").is_some_and(|kind| kind.text == KIND)
}

/// The shape that textures lie on, where one of them shows an attribute.
pub(super) struct Skin {
    /// What to call the shape.
    shape: String,
    attributes: Vec<(RawAttribute, Arc<[Vec3]>)>,
    triangles: Arc<[[u32; 3]]>,
    uvs: Arc<[Vec2]>,
}

impl Skin {
    /// A shape that has no attributes.
    pub fn bare(shape: String) -> Self {
        Self { shape, attributes: Vec::new(), triangles: Arc::new([]), uvs: Arc::new([]) }
    }

    /// A mesh as it lies in the world.
    pub fn of(shape: String, mesh: &Mesh, attributes: Vec<RawAttribute>) -> Self {
        let shared = |mut raw: RawAttribute| {
            let values = std::mem::take(&mut raw.values).into();
            (raw, values)
        };
        Self {
            shape,
            attributes: attributes.into_iter().map(shared).collect(),
            triangles: mesh.triangles.as_slice().into(),
            uvs: mesh.uvs.as_slice().into(),
        }
    }

    /// A texture by texture coordinates, as it lies on this shape.
    pub fn drape(&self, texture: Texture) -> Texture {
        let (triangles, uvs) = (self.triangles.clone(), self.uvs.clone());
        Texture::Draped(Draped { triangles, uvs, texture: Arc::new(texture) })
    }
}

/// Reads the texture that shows an attribute, where one of `channels` is wanted. Without a shape it is only checked, and
/// a black one stands in.
pub(super) fn read(plugin: &mut Plugin<'_>, channels: &[usize]) -> Result<Texture, LoadError> {
    let skin = plugin.skin;
    let name = plugin.string("name")?.ok_or_else(|| plugin.lacks("name"))?;
    let scale = plugin.number("scale", 1.0)?;
    if !["vertex_", "face_"].iter().any(|prefix| name.value.text.starts_with(prefix)) {
        return Err(name.refuse("a name that starts with vertex_ or face_"));
    }
    let Some(skin) = skin else {
        return Ok(Texture::Attribute(Attribute { triangles: None, values: Arc::new([]), scale }));
    };
    let Some((raw, values)) = skin.attributes.iter().find(|(raw, _)| raw.name == name.value.text) else {
        let names: Vec<&str> = skin.attributes.iter().map(|(raw, _)| raw.name.as_str()).collect();
        return Err(name.refuse(&match names.is_empty() {
            true => format!("an attribute of {}, which has none", skin.shape),
            false => format!("{}, what {} has", one_of(&names), skin.shape),
        }));
    };
    if !channels.contains(&raw.channels) {
        let wanted: Vec<String> = channels.iter().map(usize::to_string).collect();
        let wanted = format!("an attribute with {} channels here; this one of {} has", wanted.join(" or "), skin.shape);
        return Err(name.refuse(&format!("{wanted} {}", raw.channels)));
    }
    if !values.iter().all(|value| value.is_finite()) {
        return Err(name.refuse(&format!("finite numbers, which {} does not have there", skin.shape)));
    }
    if raw.whole {
        let message = format!("`{}` is stored as whole numbers, which are taken as they are: 255 is not 1", raw.name);
        plugin.element.warn(message);
    }
    let triangles = (raw.per == Per::Vertex).then(|| skin.triangles.clone());
    Ok(Texture::Attribute(Attribute { triangles, values: values.clone(), scale }))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Names with the indices of their channels.
    fn grouped(properties: &str) -> String {
        let names: Vec<&str> = properties.split_whitespace().collect();
        let shown = |Group { name, members }: Group| format!("{name}: {members:?}");
        group(Per::Vertex, &names).into_iter().map(shown).collect::<Vec<_>>().join(", ")
    }

    /// As measured in Mitsuba 3.9.1.
    #[test]
    fn properties_are_grouped_as_in_mitsuba() {
        let cases = [
            ("r g b", "vertex_color: [0, 1, 2]"),
            ("blue red green", "vertex_color: [1, 2, 0]"),
            ("red green blue alpha", "vertex_color: [0, 1, 2, 3]"),
            ("r green b", ""),
            ("r g quality", ""),
            ("r g b red green blue", "vertex_color: [0, 1, 2]"),
            ("q_x r g b q_y q_z", "vertex_color: [1, 2, 3], vertex_q: [0, 4, 5]"),
            ("q_r q_g q_b", "vertex_q_color: [0, 1, 2]"),
            ("a_b_r", "vertex_a_b_color: [0]"),
            ("q_1 q_2 q_3 p_0", "vertex_q: [0, 1, 2], vertex_p: [3]"),
            ("q_r q_g", ""),
            ("q_x q_y q_z q_w", ""),
            ("q_r q_b q_g", ""),
            ("q_x q_y q_z q_r q_g q_b", ""),
            ("q_b q_g q_r", "vertex_q_color: [2]"),
            ("q_x other q_y q_z", "vertex_q: [0]"),
            ("q_r p_r q_g p_g", "vertex_q_color: [0], vertex_p_color: [1]"),
            ("q_x q_y q_z q_x2", "vertex_q: [0, 1, 2]"),
            ("q_red q_R _r", "vertex__color: [2]"),
        ];
        for (properties, expected) in cases {
            assert_eq!(grouped(properties), expected, "{properties}");
        }
        assert_eq!(group(Per::Face, &["r", "g", "b"])[0].name, "face_color");
    }
}
