//! pathblend

pub mod forest;
