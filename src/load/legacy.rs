//! What Mitsuba 0.5 and 0.6 spell differently.

use super::document::Element;
use std::borrow::Cow;

/// The name of a parameter of a plugin `kind` as Mitsuba 3 spells it: `toWorld` of older files is `to_world`.
pub(super) fn name<'a>(parameter: Element<'a>, kind: &str, given: &'a str) -> Cow<'a, str> {
    if !parameter.is_legacy() {
        return Cow::Borrowed(given);
    }
    match (kind, snake(given)) {
        ("diffuse", name) if name == "diffuse_reflectance" => Cow::Borrowed("reflectance"),
        (_, name) => name,
    }
}

/// `snake_case` of a name in `lowerCamelCase`.
fn snake(name: &str) -> Cow<'_, str> {
    if !name.contains(char::is_uppercase) {
        return Cow::Borrowed(name);
    }
    let mut result = String::with_capacity(name.len() + 4);
    let mut after_lower = false;
    for c in name.chars() {
        if c.is_uppercase() && after_lower {
            result.push('_');
        }
        after_lower = c.is_lowercase() || c.is_ascii_digit();
        result.extend(c.to_lowercase());
    }
    Cow::Owned(result)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_become_snake_case() {
        for (given, expected) in [
            ("toWorld", "to_world"),
            ("intIOR", "int_ior"),
            ("maxDepth", "max_depth"),
            ("kNN", "k_nn"),
            ("alphaU", "alpha_u"),
            ("already_snake", "already_snake"),
            ("p0", "p0"),
        ] {
            assert_eq!(snake(given), expected);
        }
    }
}
