//! The stages: one file each, none calls another. A stage reads the compiled scene and the wave's
//! queues and writes the wave's queues; it neither allocates nor locks nor prints.

mod appearance;
mod connect;
mod connect_transparent;
mod emission;
mod generate;
mod intersect;
pub mod kernels;
mod numbers;
mod record_aux;
mod roulette;
mod shade;
mod shade_emission;
mod shade_escaped;
mod sort;
pub(crate) mod surface;

pub use kernels::Kernels;
pub use roulette::MOST_SURVIVAL;
