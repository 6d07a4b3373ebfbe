//! Error against run time: what a second of rendering buys.

mod page;
mod results;

pub use page::page;
pub use results::*;
