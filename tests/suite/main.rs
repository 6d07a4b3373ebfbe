//! The integration tests, as one binary.

mod builder;
mod oracles;
mod reference_closed_forms;
mod ztest;
