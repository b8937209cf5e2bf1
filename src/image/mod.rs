//! Images (stand-in until the room is furnished).
use ndarray::{Array2, Array3};
use std::collections::BTreeMap;
/// A layer.
#[derive(Clone, Debug)]
pub enum Layer {
    /// One channel.
    Luminance(Array2<f32>),
    /// Three channels.
    Colour(Array3<f32>),
}
/// An image.
#[derive(Clone, Debug)]
pub struct Image {
    /// Height × width × 3.
    pub colour: Array3<f32>,
    /// Layers.
    pub layers: BTreeMap<String, Layer>,
    /// Manifest.
    pub manifest: serde_json::Map<String, serde_json::Value>,
}
impl Image {
    /// Black.
    pub fn new(w: usize, h: usize) -> Self {
        Self { colour: Array3::zeros((h, w, 3)), layers: BTreeMap::new(), manifest: Default::default() }
    }
}
/// Whether a name is a layer name.
pub fn is_layer_name(name: &str) -> bool {
    !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}
