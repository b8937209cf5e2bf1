//! Typed parameters, such as `"float radius" 2`. Each is taken once by the code that understands it.

use super::source::Spot;
use super::token::{Token, Tokens, cut, number};
use crate::load::{LoadError, one_of};
use glam::{DVec2, DVec3};

/// Types that a parameter can have.
const KINDS: [&str; 19] = [
    "float",
    "integer",
    "string",
    "bool",
    "texture",
    "spectrum",
    "rgb",
    "color",
    "xyz",
    "blackbody",
    "point",
    "point2",
    "point3",
    "vector",
    "vector2",
    "vector3",
    "normal",
    "normal3",
    "illuminant",
];

/// Types of triples: they differ in how they are transformed, which the code that takes them knows.
const TRIPLES: [&str; 6] = ["point", "point3", "vector", "vector3", "normal", "normal3"];

/// Types of pairs.
const PAIRS: [&str; 4] = ["point2", "vector2", "point", "float"];

/// Types of colours.
pub(super) const COLOURS: [&str; 6] = ["rgb", "color", "xyz", "spectrum", "illuminant", "blackbody"];

/// Largest whole number that is read: as many as single precision counts in indices.
const LARGEST: f64 = 2_147_483_647.0;

/// What a parameter holds.
#[derive(Clone)]
pub(super) enum Values {
    Numbers(Vec<f64>),
    Strings(Vec<String>),
    Truths(Vec<bool>),
}

/// A parameter.
#[derive(Clone)]
pub(super) struct Param {
    pub kind: &'static str,
    pub name: String,
    pub values: Values,
    pub spot: Spot,
    /// Where the values start.
    first: usize,
}

impl Param {
    /// An error at the value number `index`.
    pub fn error_at(&self, index: usize, message: &str) -> LoadError {
        let mut tokens = Tokens::new(&self.spot.source, self.first);
        let mut left = index;
        loop {
            let offset = tokens.position();
            match tokens.next() {
                Ok(Some(Token::Open)) => (),
                Ok(Some(token)) if left == 0 => {
                    return Spot { offset, ..self.spot.clone() }.expected(&token.shown(), message);
                }
                Ok(Some(Token::Word(_) | Token::Quoted(_))) => left -= 1,
                _ => return self.spot.error(format!("`{}` lacks values; expected {message}", self.name)),
            }
        }
    }

    /// The numbers; `count` of them, or any number where that is 0.
    pub fn numbers(&self, count: usize) -> Result<&[f64], LoadError> {
        let Values::Numbers(numbers) = &self.values else {
            return Err(self.error_at(0, "a number"));
        };
        if count > 0 && numbers.len() != count {
            let found = format!("{} values of `{}`", numbers.len(), self.name);
            return Err(self.spot.expected(&found, &count.to_string()));
        }
        Ok(numbers)
    }

    /// The texts.
    pub fn strings(&self) -> Result<&[String], LoadError> {
        match &self.values {
            Values::Strings(strings) => Ok(strings),
            _ => Err(self.error_at(0, "a string in quotation marks")),
        }
    }

    /// The one text.
    pub fn string(&self) -> Result<&str, LoadError> {
        match self.strings()? {
            [one] => Ok(one),
            more => Err(self.spot.expected(&format!("{} strings in `{}`", more.len(), self.name), "one")),
        }
    }

    fn chunks<const N: usize>(&self) -> Result<Vec<[f64; N]>, LoadError> {
        let numbers = self.numbers(0)?;
        if !numbers.len().is_multiple_of(N) {
            let found = format!("{} numbers in `{}`", numbers.len(), self.name);
            return Err(self.spot.expected(&found, &format!("a multiple of {N}")));
        }
        Ok(numbers.as_chunks::<N>().0.to_vec())
    }
}

/// The parameters of a directive.
pub(super) struct Params {
    /// What they belong to, such as ``shape `sphere` ``.
    pub what: String,
    pub spot: Spot,
    pub list: Vec<Param>,
}

impl Params {
    /// Reads the parameters that follow.
    pub fn read(tokens: &mut Tokens<'_>, what: String, spot: Spot) -> Result<Self, LoadError> {
        let mut list = Vec::new();
        while let Some(Token::Quoted(_)) = tokens.peek()? {
            list.push(param(tokens)?);
        }
        Ok(Self { what, spot, list })
    }

    /// Adds parameters that were set for all directives of a kind, where they are not given here.
    pub fn default_to(&mut self, defaults: &[Param]) {
        for default in defaults {
            if !self.list.iter().any(|param| param.name == default.name) {
                self.list.push(default.clone());
            }
        }
    }

    /// Whether the parameter is there.
    pub fn has(&self, name: &str) -> bool {
        self.list.iter().any(|param| param.name == name)
    }

    /// Takes the parameter `name`, whatever its type.
    pub fn any(&mut self, name: &str) -> Option<Param> {
        let index = self.list.iter().position(|param| param.name == name)?;
        Some(self.list.remove(index))
    }

    /// Takes the parameter `name`, which must have one of the types.
    pub fn take(&mut self, name: &str, kinds: &[&str]) -> Result<Option<Param>, LoadError> {
        match self.any(name) {
            Some(param) if !kinds.contains(&param.kind) => {
                let found = format!("`{name}` of type {}", param.kind);
                Err(param.spot.expected(&found, &one_of(kinds)))
            }
            found => Ok(found),
        }
    }

    /// A number.
    pub fn float(&mut self, name: &str) -> Result<Option<f64>, LoadError> {
        let param = self.take(name, &["float", "integer"])?;
        param.map(|param| Ok(param.numbers(1)?[0])).transpose()
    }

    /// A number above zero.
    pub fn positive(&mut self, name: &str) -> Result<Option<f64>, LoadError> {
        let Some(param) = self.take(name, &["float", "integer"])? else {
            return Ok(None);
        };
        match param.numbers(1)?[0] {
            value if value > 0.0 => Ok(Some(value)),
            _ => Err(param.error_at(0, "a number above 0")),
        }
    }

    /// A whole number.
    pub fn integer(&mut self, name: &str) -> Result<Option<i64>, LoadError> {
        match self.take(name, &["integer"])? {
            Some(param) => {
                param.numbers(1)?;
                Ok(Some(whole(&param)?[0]))
            }
            None => Ok(None),
        }
    }

    /// Whole numbers that count from 0.
    pub fn indices(&mut self, name: &str) -> Result<Option<(Vec<i64>, Param)>, LoadError> {
        let param = self.take(name, &["integer"])?;
        param.map(|param| Ok((whole(&param)?, param))).transpose()
    }

    /// A truth value. Version 3 has it in quotation marks.
    pub fn boolean(&mut self, name: &str) -> Result<Option<bool>, LoadError> {
        let Some(param) = self.take(name, &["bool"])? else {
            return Ok(None);
        };
        match &param.values {
            Values::Truths(values) if values.len() == 1 => Ok(Some(values[0])),
            Values::Strings(values) if values.len() == 1 && values[0] == "true" => Ok(Some(true)),
            Values::Strings(values) if values.len() == 1 && values[0] == "false" => Ok(Some(false)),
            _ => Err(param.error_at(0, "true or false")),
        }
    }

    /// A text.
    pub fn string(&mut self, name: &str) -> Result<Option<String>, LoadError> {
        self.take(name, &["string"])?.map(|param| param.string().map(str::to_owned)).transpose()
    }

    /// A point, vector or normal.
    pub fn triple(&mut self, name: &str) -> Result<Option<DVec3>, LoadError> {
        let param = self.take(name, &TRIPLES)?;
        param.map(|param| Ok(DVec3::from_slice(param.numbers(3)?))).transpose()
    }

    /// Points, vectors or normals.
    pub fn triples(&mut self, name: &str) -> Result<Option<Vec<DVec3>>, LoadError> {
        let param = self.take(name, &TRIPLES)?;
        param.map(|param| Ok(param.chunks::<3>()?.into_iter().map(DVec3::from).collect())).transpose()
    }

    /// Pairs, such as texture coordinates.
    pub fn pairs(&mut self, name: &str) -> Result<Option<Vec<DVec2>>, LoadError> {
        let param = self.take(name, &PAIRS)?;
        param.map(|param| Ok(param.chunks::<2>()?.into_iter().map(DVec2::from).collect())).transpose()
    }

    /// Drops parameters that do not change the image.
    pub fn ignore(&mut self, names: &[&str]) {
        self.list.retain(|param| !names.contains(&param.name.as_str()));
    }
}

fn whole(param: &Param) -> Result<Vec<i64>, LoadError> {
    let numbers = param.numbers(0)?;
    match numbers.iter().position(|value| value.fract() != 0.0 || value.abs() > LARGEST) {
        Some(index) => Err(param.error_at(index, "a whole number up to 2147483647")),
        None => Ok(numbers.iter().map(|value| *value as i64).collect()),
    }
}

/// Reads one parameter: its type and name, then one value or a list in brackets.
fn param(tokens: &mut Tokens<'_>) -> Result<Param, LoadError> {
    let at = tokens.position();
    let spot = tokens.spot(at);
    let declared = tokens.string("a type and a name")?;
    let mut words = declared.split_whitespace();
    let (Some(kind), Some(name), None) = (words.next(), words.next(), words.next()) else {
        return Err(
            spot.expected(&format!("the string \"{}\"", cut(&declared)), "a type and a name, such as \"float radius\"")
        );
    };
    let Some(kind) = KINDS.iter().find(|known| **known == kind) else {
        return Err(spot.expected(&format!("the type `{}`", cut(kind)), &one_of(&KINDS)));
    };
    let first = tokens.position();
    let values = values(tokens)?;
    Ok(Param { kind, name: name.to_owned(), values, spot, first })
}

fn values(tokens: &mut Tokens<'_>) -> Result<Values, LoadError> {
    let bracket = tokens.peek()? == Some(Token::Open);
    if bracket {
        tokens.next()?;
    }
    let mut values: Option<Values> = None;
    loop {
        let at = tokens.position();
        let token = tokens.next()?;
        let refuse = |expected: &str| {
            let found = token.as_ref().map_or("the end of the file".to_owned(), Token::shown);
            Err(tokens.spot(at).expected(&found, expected))
        };
        match (&token, &mut values) {
            (Some(Token::Close), _) if bracket => return Ok(values.unwrap_or(Values::Numbers(Vec::new()))),
            (Some(Token::Quoted(text)), None) => values = Some(Values::Strings(vec![text.clone()])),
            (Some(Token::Quoted(text)), Some(Values::Strings(texts))) => texts.push(text.clone()),
            (Some(Token::Word(word @ ("true" | "false"))), None) => {
                values = Some(Values::Truths(vec![*word == "true"]))
            }
            (Some(Token::Word(word @ ("true" | "false"))), Some(Values::Truths(all))) => all.push(*word == "true"),
            (Some(Token::Word(word)), None) => match number(word) {
                Some(value) => values = Some(Values::Numbers(vec![value])),
                None => return refuse("a finite number, a string, true or false"),
            },
            (Some(Token::Word(word)), Some(Values::Numbers(all))) => match number(word) {
                Some(value) => all.push(value),
                None => return refuse("a finite number or `]`"),
            },
            _ => return refuse(if bracket { "a value like the one before or `]`" } else { "a value" }),
        }
        if !bracket {
            return Ok(values.unwrap_or(Values::Numbers(Vec::new())));
        }
    }
}
