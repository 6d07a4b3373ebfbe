//! Error against run time: what a second of rendering buys.

mod results;

pub use results::*;
