//! Paths: subpaths from the camera and from the lights, their connections, and the weights of the techniques.
//!
//! A path x_0 … x_k has its first vertex on a light and its last on the camera. Technique (s, t) with s + t = k + 1
//! samples x_0 … x_{s-1} from the light and the rest from the camera. One `trace`, one `connect` and one weight serve
//! all integrators; they differ in where the rows of primary samples come from.

mod connect;
mod course;
mod direct;
mod found;
mod full;
mod merge;
mod mis;
mod rows;
mod subpath;
mod trace;

pub use connect::{Connection, connect, connect_visible};
pub use course::{Course, Node};
pub use direct::{Direct, direct_pdf, sample_direct};
pub use found::{Found, TECHNIQUES};
pub use full::{Event, FullPath};
pub use merge::merge;
pub use mis::{Heuristic, Junction, Techniques};
pub use rows::{Open, Random, Rows, Use, uses};
pub use subpath::{Subpath, Vertex, VertexKind};
pub use trace::{light_vertex_for, shading_correction, trace_camera, trace_light};
