//! Renders a compiled scene into a film.

pub mod stats;
