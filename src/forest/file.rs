//! The model file: one JSON document, described in `models/README.md`.

use std::collections::HashSet;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::rows::MAX_FEATURES;
use super::tree::{Forest, LEAF, MAX_DEPTH, MAX_NODES, Node, Tree};
use super::{ForestError, Rows};

/// What the `format` field of every model file says.
pub const FORMAT: &str = "pathblend-forest";
/// Version of the file format that this program writes and reads.
pub const VERSION: u64 = 1;
/// Longest model file that is read, in bytes.
pub const MAX_FILE_BYTES: u64 = 64 << 20;

/// A trained forest with all that is known about it.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// The two methods that the forest chooses between; it predicts the weight of the first.
    pub integrators: [String; 2],
    /// How the rows were made and the trees grown; whatever the trainer wants to have on record.
    pub settings: Map<String, Value>,
    /// [`Rows::hash`] of the training rows.
    pub training_hash: String,
    /// Errors on scenes that the trees did not see; whatever the trainer wants to have on record.
    pub held_out: Value,
    /// The trees.
    pub forest: Forest,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    format: String,
    version: u64,
    integrators: [String; 2],
    settings: Map<String, Value>,
    training_hash: String,
    held_out: Value,
    features: Vec<String>,
    trees: Vec<TreeDocument>,
}

/// A tree in preorder: column of the split's feature, or −1 at a leaf; threshold, or the leaf's value.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct TreeDocument {
    feature: Vec<i32>,
    value: Vec<f32>,
}

impl Model {
    /// A model with empty records, to be filled in by the caller.
    pub fn new(integrators: [String; 2], rows: &Rows, forest: Forest) -> Self {
        Self { integrators, settings: Map::new(), training_hash: rows.hash(), held_out: Value::Null, forest }
    }

    /// The file's text.
    ///
    /// # Errors
    /// [`ForestError::Malformed`], naming `path`, if a record cannot be written as JSON.
    pub fn to_json(&self, path: &Path) -> Result<String, ForestError> {
        let document = Document {
            format: FORMAT.to_owned(),
            version: VERSION,
            integrators: self.integrators.clone(),
            settings: self.settings.clone(),
            training_hash: self.training_hash.clone(),
            held_out: self.held_out.clone(),
            features: self.forest.features.clone(),
            trees: self.forest.trees.iter().map(TreeDocument::of).collect(),
        };
        lines(&document).map_err(|e| malformed(path, e, "numbers and text"))
    }

    /// Writes the model; the file appears whole or not at all.
    ///
    /// # Errors
    /// [`ForestError::Io`] if the folder is missing or not writable.
    pub fn save(&self, path: &Path) -> Result<(), ForestError> {
        let text = self.to_json(path)?;
        let io = |source| ForestError::Io { path: path.to_owned(), source };
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let mut builder = tempfile::Builder::new();
        // Temporary files are private by default; a model is as readable as any other file.
        #[cfg(unix)]
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        let mut file = builder.tempfile_in(folder).map_err(io)?;
        file.write_all(text.as_bytes()).map_err(io)?;
        file.as_file().sync_all().map_err(io)?;
        file.persist(path).map_err(|e| io(e.error))?;
        Ok(())
    }

    /// Reads and checks a model file.
    ///
    /// # Errors
    /// [`ForestError::Io`], [`ForestError::Version`], [`ForestError::Malformed`]; each names the file.
    pub fn load(path: &Path) -> Result<Self, ForestError> {
        let io = |source| ForestError::Io { path: path.to_owned(), source };
        let length = std::fs::metadata(path).map_err(io)?.len();
        if length > MAX_FILE_BYTES {
            return Err(malformed(path, format!("{length} bytes"), format!("at most {MAX_FILE_BYTES}")));
        }
        let bytes = std::fs::read(path).map_err(io)?;
        let text = std::str::from_utf8(&bytes).map_err(|e| malformed(path, e, "UTF-8 text"))?;
        Self::from_json(text, path)
    }

    /// Reads and checks the text of a model file; `path` is what errors call it.
    ///
    /// # Errors
    /// [`ForestError::Version`], [`ForestError::Malformed`].
    pub fn from_json(text: &str, path: &Path) -> Result<Self, ForestError> {
        #[derive(Deserialize)]
        struct Head {
            format: Option<String>,
            version: Option<u64>,
        }
        // Another version may have other fields, so who the file is comes before what it holds.
        let head: Head = serde_json::from_str(text).map_err(|e| malformed(path, e, "a JSON model file"))?;
        if head.format.as_deref() != Some(FORMAT) {
            let found = head.format.map_or("no `format`".to_owned(), |f| format!("format `{f}`"));
            return Err(malformed(path, found, format!("format `{FORMAT}`")));
        }
        match head.version {
            Some(VERSION) => {}
            Some(found) => return Err(ForestError::Version { path: path.to_owned(), found, expected: VERSION }),
            None => return Err(malformed(path, "no `version`", VERSION)),
        }
        let document: Document =
            serde_json::from_str(text).map_err(|e| malformed(path, e, "the fields of models/README.md"))?;
        document.check(path)
    }
}

impl Document {
    fn check(self, path: &Path) -> Result<Model, ForestError> {
        if self.features.len() > MAX_FEATURES {
            return Err(malformed(path, format!("{} features", self.features.len()), "at most 65535"));
        }
        let mut seen = HashSet::new();
        for name in &self.features {
            if name.is_empty() || !seen.insert(name) {
                return Err(malformed(path, format!("feature `{name}` empty or twice"), "different names"));
            }
        }
        if self.integrators.iter().any(String::is_empty) {
            return Err(malformed(path, "an empty integrator name", "two names"));
        }
        if self.trees.is_empty() {
            return Err(malformed(path, "no trees", "at least one"));
        }
        let trees = self.trees.iter().enumerate();
        let trees = trees.map(|(i, t)| {
            t.check(self.features.len()).map_err(|(what, to_be)| malformed(path, format!("tree {i}: {what}"), to_be))
        });
        let trees = trees.collect::<Result<Vec<Tree>, ForestError>>()?;
        Ok(Model {
            integrators: self.integrators,
            settings: self.settings,
            training_hash: self.training_hash,
            held_out: self.held_out,
            forest: Forest { features: self.features, trees },
        })
    }
}

impl TreeDocument {
    fn of(tree: &Tree) -> Self {
        let feature = |n: &Node| if n.feature == LEAF { -1 } else { i32::from(n.feature) };
        Self { feature: tree.nodes.iter().map(feature).collect(), value: tree.nodes.iter().map(|n| n.value).collect() }
    }

    /// The tree, or what was found and what was expected. The order of the nodes says how they hang together, so a file
    /// cannot describe a cycle; it can only end too early or too late.
    fn check(&self, features: usize) -> Result<Tree, (String, String)> {
        let (n, m) = (self.feature.len(), self.value.len());
        if n != m || !(1..=MAX_NODES).contains(&n) {
            let expected = format!("as many of one as of the other, 1 to {MAX_NODES}");
            return Err((format!("{n} features and {m} values"), expected));
        }
        let mut nodes = Vec::with_capacity(n);
        // Splits whose upper child is still to come.
        let mut open: Vec<usize> = Vec::new();
        for (i, (&feature, &value)) in self.feature.iter().zip(&self.value).enumerate() {
            let node = match usize::try_from(feature) {
                Err(_) if feature == -1 && (0.0..=1.0).contains(&value) => Node { feature: LEAF, value, above: 0 },
                Err(_) if feature == -1 => {
                    return Err((format!("node {i} is a leaf of value {value}"), "0 to 1".into()));
                }
                Ok(f) if f < features && value.is_finite() => Node { feature: f as u16, value, above: 0 },
                Ok(f) if f < features => {
                    return Err((format!("node {i} has threshold {value}"), "a finite number".into()));
                }
                _ => {
                    return Err((
                        format!("node {i} asks for feature {feature}"),
                        format!("-1 to {}", features as i64 - 1),
                    ));
                }
            };
            nodes.push(node);
            if node.feature != LEAF {
                open.push(i);
            } else if let Some(parent) = open.pop() {
                nodes[parent].above = i as u32 + 1;
            } else if i + 1 < n {
                return Err((format!("the tree is complete after {} nodes", i + 1), format!("{n} nodes")));
            } else {
                return shallow(Tree { nodes });
            }
        }
        Err((format!("the tree ends after {n} nodes with {} children missing", open.len() + 1), "a whole tree".into()))
    }
}

fn shallow(tree: Tree) -> Result<Tree, (String, String)> {
    match tree.depth() {
        0..=MAX_DEPTH => Ok(tree),
        depth => Err((format!("{depth} splits on the way to a leaf"), format!("at most {MAX_DEPTH}"))),
    }
}

/// The document with one field, and one tree, per line: short, and still readable by a person.
fn lines(document: &Document) -> serde_json::Result<String> {
    let head = [
        ("format", Value::from(document.format.as_str())),
        ("version", Value::from(document.version)),
        ("integrators", serde_json::to_value(&document.integrators)?),
        ("settings", Value::from(document.settings.clone())),
        ("training_hash", Value::from(document.training_hash.as_str())),
        ("held_out", document.held_out.clone()),
        ("features", Value::from(document.features.clone())),
    ];
    let mut text = String::from("{\n");
    for (name, value) in head {
        let _ = writeln!(text, "  \"{name}\": {value},");
    }
    text.push_str("  \"trees\": [\n");
    for (i, tree) in document.trees.iter().enumerate() {
        let comma = if i + 1 < document.trees.len() { "," } else { "" };
        let _ = writeln!(text, "    {}{comma}", serde_json::to_string(tree)?);
    }
    text.push_str("  ]\n}\n");
    Ok(text)
}

fn malformed(path: &Path, what: impl ToString, expected: impl ToString) -> ForestError {
    ForestError::Malformed { path: PathBuf::from(path), what: what.to_string(), expected: expected.to_string() }
}
