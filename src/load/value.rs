//! Numbers, vectors and colours as the scene format writes them.

use super::error::LoadError;
use super::source::Source;
use crate::spectrum::Spectrum;
use glam::DVec3;
use std::path::PathBuf;

/// Most characters of a value that a message shows.
const SHOWN: usize = 60;

/// The text of an attribute, and where it stands.
#[derive(Clone, Copy)]
pub(super) struct Text<'a> {
    pub text: &'a str,
    pub offset: usize,
    pub source: &'a Source,
}

impl Text<'_> {
    /// The file that this text names.
    pub fn path(&self) -> PathBuf {
        self.source.beside(self.text)
    }

    /// An error at this text.
    pub fn error(&self, message: impl Into<String>) -> LoadError {
        self.source.error(self.offset, message)
    }

    /// An error that says what this text should be.
    pub fn expected(&self, what: &str) -> LoadError {
        self.error(format!("found `{}`; expected {what}", self.shown()))
    }

    /// The text, cut where it is long.
    pub fn shown(&self) -> String {
        let mut shown: String = self.text.chars().take(SHOWN).collect();
        if shown.len() < self.text.len() {
            shown.push('…');
        }
        shown
    }

    /// A finite number.
    pub fn number(&self) -> Result<f64, LoadError> {
        number(self.text).ok_or_else(|| self.expected("a finite number"))
    }

    /// A whole number.
    pub fn integer(&self) -> Result<i64, LoadError> {
        self.text.parse().map_err(|_| self.expected("a whole number"))
    }

    /// `true` or `false`, in upper or lower case.
    pub fn boolean(&self) -> Result<bool, LoadError> {
        match self.text.to_ascii_lowercase().as_str() {
            "true" => Ok(true),
            "false" => Ok(false),
            _ => Err(self.expected("true or false")),
        }
    }

    /// Finite numbers between commas or blanks.
    pub fn numbers(&self) -> Result<Vec<f64>, LoadError> {
        let words = self.text.split(|c: char| c == ',' || c.is_whitespace()).filter(|word| !word.is_empty());
        words.map(number).collect::<Option<_>>().ok_or_else(|| self.expected("finite numbers"))
    }

    /// Three numbers, or one for all three.
    pub fn triple(&self) -> Result<DVec3, LoadError> {
        match self.numbers()?[..] {
            [value] => Ok(DVec3::splat(value)),
            [x, y, z] => Ok(DVec3::new(x, y, z)),
            _ => Err(self.expected("three numbers, or one for all three")),
        }
    }

    /// Red, green and blue in linear Rec.709: three numbers, one for all three, or #RRGGBB as 255ths.
    pub fn colour(&self) -> Result<Spectrum, LoadError> {
        let Some(digits) = self.text.strip_prefix('#') else {
            let [r, g, b] = self.triple()?.to_array();
            return Ok(Spectrum::rgb(r, g, b));
        };
        let code = u32::from_str_radix(digits, 16).ok().filter(|_| digits.len() == 6 && !digits.starts_with('+'));
        let [_, r, g, b] = code.ok_or_else(|| self.expected("#RRGGBB in hexadecimal digits"))?.to_be_bytes();
        Ok(Spectrum::rgb(r.into(), g.into(), b.into()) / 255.0)
    }
}

fn number(word: &str) -> Option<f64> {
    word.parse().ok().filter(|value: &f64| value.is_finite())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    fn with<R>(text: &str, read: impl FnOnce(Text<'_>) -> R) -> R {
        let source = Source::new("x".as_ref(), text.to_owned());
        read(Text { text: &source.text, offset: 0, source: &source })
    }

    #[test]
    fn colours_have_four_forms() {
        for text in ["0.2, 0.4 ,0.6", "0.2 0.4\n0.6", "#336699"] {
            let rgb = with(text, |text| text.colour()).unwrap().to_rgb();
            assert!(rgb.iter().zip([0.2, 0.4, 0.6]).all(|(a, b)| (a - b).abs() < 1e-12), "{text}: {rgb:?}");
        }
        assert_eq!(with("0.3", |text| text.colour()).unwrap(), Spectrum::grey(0.3));
        for text in ["", "1 2", "1 2 3 4", "1;2;3", "nan", "1 inf 1", "1e999", "#12345", "#12345é", "#+12345"] {
            assert!(with(text, |text| text.colour()).is_err(), "{text}");
        }
    }

    #[test]
    fn numbers_are_finite_and_whole() {
        assert_eq!(with("-1.5e2", |text| text.number()).unwrap(), -150.0);
        assert_eq!(with("-12", |text| text.integer()).unwrap(), -12);
        assert!(with("True", |text| text.boolean()).unwrap());
        for text in ["", "nan", "-inf", "infinity", "1e400", "1,5", "0x10", "1 2"] {
            assert!(with(text, |text| text.number()).is_err(), "{text}");
        }
        for text in ["", "1.0", "99999999999999999999"] {
            assert!(with(text, |text| text.integer()).is_err(), "{text}");
        }
        assert!(with("yes", |text| text.boolean()).is_err());
    }
}
