//! pathblend
