//! Classical two-view reconstruction of thin curves: Baert, Hoffmann, Baur.

mod chain;
mod error;
mod grid_path;
mod pchip;

pub use chain::longest_chain;
pub use error::BaselineError;
pub use grid_path::{GridPath, cheapest_grid_path, cheapest_of_each_run};
pub use pchip::Pchip;
