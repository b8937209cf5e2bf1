//! Words, quoted strings and brackets.

use super::source::{Source, Spot};
use crate::load::LoadError;
use std::rc::Rc;

/// Most characters of a token that a message shows.
const SHOWN: usize = 60;

/// The smallest piece of a pbrt file.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Token<'a> {
    Open,
    Close,
    /// What stands between quotation marks, its escapes resolved.
    Quoted(String),
    /// A directive, a number or a truth value.
    Word(&'a str),
}

impl Token<'_> {
    /// The token as a message shows it.
    pub fn shown(&self) -> String {
        let text = match self {
            Self::Open => "[",
            Self::Close => "]",
            Self::Quoted(text) => return format!("the string \"{}\"", cut(text)),
            Self::Word(word) => word,
        };
        format!("`{}`", cut(text))
    }
}

/// The text, cut where it is long.
pub(super) fn cut(text: &str) -> String {
    let mut shown: String = text.chars().take(SHOWN).collect();
    if shown.len() < text.len() {
        shown.push('…');
    }
    shown
}

/// The tokens of a file, one after the other.
#[derive(Clone)]
pub(super) struct Tokens<'a> {
    source: &'a Rc<Source>,
    at: usize,
}

impl<'a> Tokens<'a> {
    /// The tokens from the byte `at` on.
    pub fn new(source: &'a Rc<Source>, at: usize) -> Self {
        Self { source, at }
    }

    /// The place at the byte `offset`.
    pub fn spot(&self, offset: usize) -> Spot {
        Spot { source: self.source.clone(), offset }
    }

    /// Where the next token starts, behind blanks and comments.
    pub fn position(&mut self) -> usize {
        loop {
            let rest = &self.source.text[self.at..];
            let blanks = rest.len() - rest.trim_start().len();
            self.at += blanks;
            if !rest[blanks..].starts_with('#') {
                return self.at;
            }
            self.at += rest[blanks..].find('\n').unwrap_or(rest.len() - blanks);
        }
    }

    /// The next token, which stays where it is; `None` at the end.
    pub fn peek(&mut self) -> Result<Option<Token<'a>>, LoadError> {
        self.clone().next()
    }

    /// The next token; `None` at the end.
    pub fn next(&mut self) -> Result<Option<Token<'a>>, LoadError> {
        let start = self.position();
        let rest = &self.source.text[start..];
        let Some(first) = rest.chars().next() else {
            return Ok(None);
        };
        let (token, length) = match first {
            '[' => (Token::Open, 1),
            ']' => (Token::Close, 1),
            '"' => {
                let (text, length) = quoted(rest).map_err(|message| self.spot(start).error(message))?;
                (Token::Quoted(text), length)
            }
            _ => {
                let ends = |c: char| c.is_whitespace() || matches!(c, '[' | ']' | '"' | '#');
                let length = rest.find(ends).unwrap_or(rest.len());
                (Token::Word(&rest[..length]), length)
            }
        };
        self.at = start + length;
        Ok(Some(token))
    }

    /// The next token, which must be a string in quotation marks; `what` says what it is for.
    pub fn string(&mut self, what: &str) -> Result<String, LoadError> {
        let at = self.position();
        match self.next()? {
            Some(Token::Quoted(text)) => Ok(text),
            other => {
                let found = other.map_or("the end of the file".to_owned(), |token| token.shown());
                Err(self.spot(at).expected(&found, &format!("{what} in quotation marks")))
            }
        }
    }

    /// The next `N` numbers, in brackets or not.
    pub fn numbers<const N: usize>(&mut self) -> Result<[f64; N], LoadError> {
        let bracket = self.peek()? == Some(Token::Open);
        if bracket {
            self.next()?;
        }
        let mut values = [0.0; N];
        for (index, value) in values.iter_mut().enumerate() {
            let at = self.position();
            let token = self.next()?;
            let number = match &token {
                Some(Token::Word(word)) => number(word),
                _ => None,
            };
            *value = number.ok_or_else(|| {
                let found = token.map_or("the end of the file".to_owned(), |token| token.shown());
                self.spot(at).expected(&found, &format!("a finite number, {} of {N}", index + 1))
            })?;
        }
        let at = self.position();
        if bracket && self.next()? != Some(Token::Close) {
            return Err(self.spot(at).error(format!("found more than {N} values; expected `]`")));
        }
        Ok(values)
    }
}

/// A finite number.
pub(super) fn number(word: &str) -> Option<f64> {
    word.parse().ok().filter(|value: &f64| value.is_finite())
}

/// The string that `rest` starts with and the bytes that it takes, marks included.
fn quoted(rest: &str) -> Result<(String, usize), &'static str> {
    let unterminated = "found a string without its end; expected a closing quotation mark on the same line";
    let mut text = String::new();
    let mut characters = rest.char_indices().skip(1);
    while let Some((at, character)) = characters.next() {
        match character {
            '"' => return Ok((text, at + 1)),
            '\n' => return Err(unterminated),
            '\\' => match characters.next() {
                Some((_, 'n')) => text.push('\n'),
                Some((_, 't')) => text.push('\t'),
                Some((_, 'r')) => text.push('\r'),
                Some((_, other @ ('\\' | '"' | '\''))) => text.push(other),
                _ => return Err("found an unknown escape in a string; expected one of \\\\, \\\", \\n, \\t, \\r"),
            },
            other => text.push(other),
        }
    }
    Err(unterminated)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;
    use std::path::Path;

    #[test]
    fn tokens_are_told_apart() {
        let text = "Shape \"a \\\"b\\\"\" # \"no\n\t[1 -2e3]true#x";
        let source = Source::new(Path::new("x"), text.to_owned());
        let mut tokens = Tokens::new(&source, 0);
        let mut found = Vec::new();
        while let Some(token) = tokens.next().unwrap() {
            found.push(token);
        }
        let word = Token::Word;
        let string = Token::Quoted("a \"b\"".to_owned());
        let expected = [word("Shape"), string, Token::Open, word("1"), word("-2e3"), Token::Close, word("true")];
        assert_eq!(found, expected);
    }

    #[test]
    fn numbers_come_with_and_without_brackets() {
        let read = |text: &str| {
            let source = Source::new(Path::new("x"), text.to_owned());
            Tokens::new(&source, 0).numbers::<3>().map_err(|error| error.message)
        };
        assert_eq!(read("1 2 3 4").unwrap(), [1.0, 2.0, 3.0]);
        assert_eq!(read("[1 2 3]").unwrap(), [1.0, 2.0, 3.0]);
        for bad in ["1 2", "[1 2 3 4]", "1 nan 3", "1 \"2\" 3", "[1 2 inf]", "[1 2 3"] {
            assert!(read(bad).is_err(), "{bad}");
        }
    }
}
