//! Which channels of a file belong together, and which of them are the picture.
//!
//! Renderers name channels in many ways. What stands before the last dot is the layer; in files of several
//! parts the part's name stands in where there is no dot. Only `R`, `G`, `B` together and `Y` count.

use std::collections::{BTreeMap, BTreeSet};

use ::exr::meta::header::Header;

use super::super::layers::is_name_char;

/// Last words of layer names that mean the picture itself, by Blender and by custom.
const BEAUTY_NAMES: [&str; 8] = ["combined", "beauty", "rgba", "rgb", "color", "colour", "image", "main"];

/// Beside these, `Y` is a coordinate (of a normal, say), or luminance whose chroma lies elsewhere.
const NOT_GREY: [&str; 3] = ["X", "RY", "BY"];

/// The channels of one layer of one part.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Group {
    /// Index of the part.
    pub part: usize,
    /// What the channels' names have before the last dot, or the part's name; empty for top-level channels.
    name: String,
    /// Whether the channels' own names have no dot.
    top: bool,
    /// Indices of its channels within the part: one for luminance, three (R, G, B) for colour.
    pub channels: Vec<usize>,
}

/// The picture and the layers of a file.
#[derive(Debug)]
pub(super) struct Selection {
    /// The picture: three channels, or one for grey.
    pub beauty: Group,
    /// Further groups of the same size, with proper and distinct names.
    pub layers: Vec<(String, Group)>,
}

/// Finds the picture and the layers; `None` where there is no picture. A file of layers alone (the second
/// half of a split image) is asked for with [`all_layers`].
pub(super) fn select(headers: &[Header]) -> Option<Selection> {
    let mut groups = all_groups(headers);
    let beauty = groups.remove(beauty_index(&groups)?);
    let size = headers[beauty.part].layer_size;
    groups.retain(|group| headers[group.part].layer_size == size);
    Some(Selection { beauty, layers: named(groups) })
}

/// Every group of a file as a layer.
pub(super) fn all_layers(headers: &[Header]) -> Vec<(String, Group)> {
    named(all_groups(headers))
}

fn all_groups(headers: &[Header]) -> Vec<Group> {
    (0..headers.len()).flat_map(|part| groups_of(part, &headers[part])).collect()
}

/// The picture's place among the groups: top-level colour, else colour under a telling name, else grey. Any other
/// colour may be albedo or variance: taking it for the picture would mislead.
fn beauty_index(groups: &[Group]) -> Option<usize> {
    let find = |test: &dyn Fn(&Group) -> bool| groups.iter().position(test);
    let is_colour = |group: &Group| group.channels.len() == 3;
    let says_beauty = |group: &Group| {
        let last = group.name.rsplit('.').next().unwrap_or_default();
        BEAUTY_NAMES.contains(&last.to_ascii_lowercase().as_str())
    };
    find(&|g| g.top && is_colour(g)).or_else(|| find(&|g| is_colour(g) && says_beauty(g))).or_else(|| find(&|g| g.top))
}

fn groups_of(part: usize, header: &Header) -> Vec<Group> {
    let mut letters: BTreeMap<String, BTreeMap<String, usize>> = BTreeMap::new();
    for (index, channel) in header.channels.list.iter().enumerate() {
        let full = channel.name.to_string();
        let (layer, letter) = full.rsplit_once('.').unwrap_or(("", &full));
        let known = letters.entry(layer.to_owned()).or_default();
        known.insert(letter.to_owned(), index);
    }
    let part_name = header.own_attributes.layer_name.as_ref();
    let part_name = part_name.map(ToString::to_string).unwrap_or_default();
    let group = |(layer, letters): (String, BTreeMap<String, usize>)| {
        let index = |letter| letters.get(letter).copied();
        let colour = || Some(vec![index("R")?, index("G")?, index("B")?]);
        let is_grey = !NOT_GREY.iter().any(|letter| letters.contains_key(*letter));
        let grey = || is_grey.then(|| index("Y")).flatten().map(|y| vec![y]);
        let channels = colour().or_else(grey)?;
        let top = layer.is_empty();
        let name = if top { part_name.clone() } else { layer };
        Some(Group { part, name, top, channels })
    };
    letters.into_iter().filter_map(group).collect()
}

/// Gives every group with a name a proper one of its own.
fn named(groups: Vec<Group>) -> Vec<(String, Group)> {
    let mut taken = BTreeSet::new();
    let unnamed = |group: &Group| group.name.is_empty();
    let mut layers = Vec::with_capacity(groups.len());
    for group in groups.into_iter().filter(|group| !unnamed(group)) {
        let proper = proper_name(&group.name);
        let mut name = proper.clone();
        let mut count = 1;
        while !taken.insert(name.clone()) {
            count += 1;
            name = format!("{proper}_{count}");
        }
        layers.push((name, group));
    }
    layers
}

/// Another renderer's layer name as one of ours: other characters become `_`, and a letter comes first.
fn proper_name(name: &str) -> String {
    let replace = |c| if is_name_char(c) { c } else { '_' };
    let body: String = name.chars().map(replace).collect();
    if body.starts_with(|c: char| c.is_ascii_alphabetic()) { body } else { format!("layer_{body}") }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::*;
    use ::exr::meta::attribute::{ChannelDescription, SampleType, Text};

    fn part(name: &str, size: (usize, usize), channels: &[&str]) -> Header {
        let describe = |name: &&str| ChannelDescription::named(*name, SampleType::F16);
        Header::new(Text::from(name), size, channels.iter().map(describe).collect())
    }

    fn names(selection: &Selection) -> Vec<&str> {
        selection.layers.iter().map(|(name, _)| name.as_str()).collect()
    }

    #[test]
    fn own_files_have_top_level_colour() {
        let header = part("", (4, 4), &["B", "G", "R", "path_LDE.Y", "v.B", "v.G", "v.R"]);
        let found = select(&[header]).unwrap();
        assert_eq!(found.beauty.channels, [2, 1, 0]);
        assert_eq!(names(&found), ["path_LDE", "v"]);
        assert_eq!(found.layers[1].1.channels, [6, 5, 4]);
    }

    #[test]
    fn blender_names_the_picture_combined() {
        let channels = ["V.Combined.A", "V.Combined.B", "V.Combined.G", "V.Combined.R"];
        let other = ["V.Albedo.B", "V.Albedo.G", "V.Albedo.R", "V.Depth.Z"];
        let header = part("", (4, 4), &[&other[..], &channels[..]].concat());
        let found = select(&[header]).unwrap();
        assert_eq!(found.beauty.channels, [7, 6, 5]);
        assert_eq!(names(&found), ["V_Albedo"]);
    }

    #[test]
    fn parts_of_another_size_and_unknown_channels_are_left_out() {
        let parts = [
            part("depth", (4, 4), &["Z"]),
            part("rgba", (4, 4), &["A", "B", "G", "R"]),
            part("small", (2, 2), &["B", "G", "R"]),
            part("2nd, try", (4, 4), &["Y"]),
            part("2nd. try", (4, 4), &["Y"]),
        ];
        let found = select(&parts).unwrap();
        assert_eq!((found.beauty.part, &found.beauty.channels[..]), (1, &[3, 2, 1][..]));
        assert_eq!(names(&found), ["layer_2nd__try", "layer_2nd__try_2"]);
    }

    #[test]
    fn grey_is_a_picture_but_luminance_with_chroma_is_not() {
        let grey = select(&[part("", (1, 1), &["A", "Y"])]).unwrap();
        assert_eq!(grey.beauty.channels, [1]);
        assert!(select(&[part("", (1, 1), &["BY", "RY", "Y"])]).is_none());
        assert!(select(&[part("", (1, 1), &["Z", "w.Y"])]).is_none());
        let normals = ["B", "G", "R", "n.X", "n.Y", "n.Z", "p.Y"];
        assert_eq!(names(&select(&[part("", (1, 1), &normals)]).unwrap()), ["p"]);
    }
}
