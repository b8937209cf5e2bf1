//! Heckbert's path classes as small integers.
//!
//! A path is a word `L…E` with one letter per scattering vertex, written from the light. Its code is a leading one bit
//! and one bit per letter (D = 0, S = 1), the letter next to the light first: words of up to eight letters have the
//! codes 1 to 511, and 0 collects the longer ones. The 512 classes are as many as in Otsu 2017, section 5.3.1.

use crate::bsdf::Letter;

/// Number of classes.
pub const CLASSES: usize = 512;

/// Letters that a class can tell apart.
pub const MAX_LETTERS: u32 = 8;

/// The class of a path.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct PathClass(u16);

impl PathClass {
    /// All words with more than eight letters.
    pub const LONGER: Self = Self(0);

    /// All classes, by code.
    pub fn all() -> impl Iterator<Item = Self> {
        (0..CLASSES as u16).map(Self)
    }

    /// The code, below [`CLASSES`].
    #[inline]
    pub fn code(self) -> usize {
        usize::from(self.0)
    }

    /// Heckbert's word, such as `LSDE`; `longer` for [`PathClass::LONGER`].
    pub fn word(self) -> String {
        if self == Self::LONGER {
            return "longer".to_owned();
        }
        let letters = 15 - self.0.leading_zeros();
        let middle = (0..letters).rev().map(|bit| if self.0 >> bit & 1 == 1 { 'S' } else { 'D' });
        std::iter::once('L').chain(middle).chain(std::iter::once('E')).collect()
    }

    /// Name of the image layer.
    pub fn layer_name(self) -> String {
        format!("path_{}", self.word())
    }

    /// The light-path expression of the class, from the camera, as production renderers write it.
    pub fn light_path_expression(self) -> String {
        if self == Self::LONGER {
            return "C.{9,}L".to_owned();
        }
        let word = self.word();
        let middle = word[1..word.len() - 1].chars().rev();
        let middle: String =
            middle.map(|letter| if letter == 'S' { "[SG]".to_owned() } else { letter.to_string() }).collect();
        format!("C{middle}L")
    }
}

/// A part of a word: the letters of a subpath.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Word {
    bits: u32,
    letters: u32,
}

impl Word {
    /// No letters.
    pub const EMPTY: Self = Self { bits: 0, letters: 0 };

    fn bit(letter: Letter) -> u32 {
        u32::from(letter == Letter::S)
    }

    /// The word with a letter added on the camera's side: how a walk from the light spells.
    #[inline]
    pub fn then(self, letter: Letter) -> Self {
        Self { bits: self.bits << 1 | Self::bit(letter), letters: self.letters + 1 }
    }

    /// The word with a letter added on the light's side: how a walk from the camera spells.
    #[inline]
    pub fn preceded_by(self, letter: Letter) -> Self {
        if self.letters >= MAX_LETTERS {
            return Self { bits: self.bits, letters: self.letters + 1 };
        }
        Self { bits: self.bits | Self::bit(letter) << self.letters, letters: self.letters + 1 }
    }

    /// The light's word followed by the camera's.
    #[inline]
    pub fn join(self, camera: Self) -> PathClass {
        let letters = self.letters + camera.letters;
        if letters > MAX_LETTERS {
            return PathClass::LONGER;
        }
        PathClass((1 << letters | self.bits << camera.letters | camera.bits) as u16)
    }

    /// The class of a word that is complete.
    #[inline]
    pub fn class(self) -> PathClass {
        Self::EMPTY.join(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::check_layer_name;
    use Letter::{D, S};
    use std::collections::HashSet;

    #[test]
    fn words_read_from_the_light_however_they_were_made() {
        let light = Word::EMPTY.then(S).then(D);
        let camera = Word::EMPTY.preceded_by(S).preceded_by(D);
        assert_eq!(light.join(camera).word(), "LSDDSE");
        assert_eq!(Word::EMPTY.class().word(), "LE");
        assert_eq!(Word::EMPTY.preceded_by(S).preceded_by(D).class().light_path_expression(), "C[SG]DL");
        let all_from_camera = Word::EMPTY.preceded_by(S).preceded_by(D).preceded_by(D).preceded_by(S);
        assert_eq!(all_from_camera.class(), light.join(camera));
    }

    #[test]
    fn every_class_has_its_own_layer_name() {
        let names: HashSet<String> = PathClass::all().map(PathClass::layer_name).collect();
        assert_eq!(names.len(), CLASSES);
        assert!(names.iter().all(|name| check_layer_name(name).is_ok()));
    }

    #[test]
    fn long_words_share_a_class() {
        let eight = (0..8).fold(Word::EMPTY, |word, _| word.then(S));
        assert_eq!(eight.class().word(), "LSSSSSSSSE");
        assert_eq!(eight.then(D).class(), PathClass::LONGER);
        assert_eq!((0..70).fold(Word::EMPTY, |word, _| word.then(S)).class(), PathClass::LONGER);
        assert_eq!((0..70).fold(Word::EMPTY, |word, _| word.preceded_by(S)).class(), PathClass::LONGER);
    }
}
