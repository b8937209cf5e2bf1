//! pathblend

pub mod geometry;
