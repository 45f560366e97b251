//! Classical two-view reconstruction of thin curves: Baert, Hoffmann, Baur.

mod banded;
mod chain;
mod grid_path;
mod hoffmann_table;
mod pchip;
mod range;
mod reprojection_fit;
mod uniform_spline;

pub use chain::longest_chain;
pub use grid_path::{GridPath, cheapest_grid_path, cheapest_of_each_run};
pub use hoffmann_table::HoffmannTable;
pub use pchip::Pchip;
