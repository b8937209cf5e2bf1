//! pathblend renders a scene with several light transport algorithms, learns from path features which blend of them
//! errs least, and blends. `ARCHITECTURE.md` is the map of the rooms below.

pub mod blend;
pub mod bsdf;
pub mod camera;
pub mod cli;
pub mod emitter;
pub mod film;
pub mod forest;
pub mod geometry;
pub mod image;
pub mod import;
pub mod integrators;
pub mod load;
pub mod manifold;
pub mod markov;
pub mod math;
pub mod path_space;
pub mod paths;
pub mod report;
pub mod scene;
pub mod spectrum;
pub mod texture;
