//! pathblend

pub mod blend;
pub mod forest;
