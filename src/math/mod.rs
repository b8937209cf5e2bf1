//! Frames, measures, warps, discrete distributions and random streams: what every other room stands on.

pub mod discrete;
pub mod frame;
pub mod measure;
pub mod stream;
pub mod warp;

pub use discrete::{Discrete, pick};
pub use frame::Frame;
pub use measure::{AreaPdf, SolidAnglePdf, Walk};
pub use stream::{Row, Stream};
