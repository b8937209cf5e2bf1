//! pathblend

pub mod image;
