//! The integration tests, as one binary.

mod agreement;
mod builder;
mod cli;
mod determinism;
mod furnace;
mod oracles;
mod reference_closed_forms;
mod support;
mod ztest;
