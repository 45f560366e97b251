//! Classical two-view reconstruction of thin curves, to compare with: Baert, Hoffmann, Baur.
//!
//! Every method is a [`CurveMatcher`], as ECDP is, so that a table treats them alike. Two of them
//! come twice: as comparison tables run them (`-table`, integer pixels and no ordering for Baert),
//! and in a fair reading of the publication (splines, exact crossings, order kept, optimal
//! triangulation). What is known from a publication and what is our choice stands with each method.
//!
//! | name | type | correspondence |
//! |---|---|---|
//! | `baert-table` | [`BaertTable`] | crossing nearest to the last one |
//! | `baert` | [`Baert`] | crossing nearest to the expected place, in order |
//! | `hoffmann-table` | [`HoffmannTable`] | longest chain of near pixel pairs |
//! | `hoffmann` | [`Hoffmann`] | longest chain of crossings |
//! | `baur` | [`Baur`] | least sum of distances, then a fit in space |
//!
//! # Examples
//! ```
//! let matcher = accurate_baselines::by_name("hoffmann").ok_or("no such method")?;
//! assert_eq!(matcher.name(), "hoffmann");
//! # Ok::<(), &str>(())
//! ```

mod baert;
mod baert_table;
mod banded;
mod baur;
mod chain;
mod grid_path;
mod hoffmann;
mod hoffmann_table;
mod pchip;
mod range;
mod reprojection_fit;
mod resample;
mod room;
mod track;
mod uniform_spline;

use accurate_match::CurveMatcher;

pub use baert::Baert;
pub use baert_table::BaertTable;
pub use baur::{Baur, BaurReconstruction, KnownLength, Refinement};
pub use chain::longest_chain;
pub use grid_path::{GridPath, cheapest_grid_path, cheapest_of_each_run};
pub use hoffmann::Hoffmann;
pub use hoffmann_table::HoffmannTable;
pub use pchip::Pchip;

/// The names of all methods, in the order of the table above.
pub const NAMES: [&str; 5] =
    [BaertTable::NAME, Baert::NAME, HoffmannTable::NAME, Hoffmann::NAME, Baur::NAME];

/// The method of this name with its default parameters, or `None` if there is none.
pub fn by_name(name: &str) -> Option<Box<dyn CurveMatcher>> {
    match name {
        BaertTable::NAME => Some(Box::new(BaertTable::default())),
        Baert::NAME => Some(Box::new(Baert::default())),
        HoffmannTable::NAME => Some(Box::new(HoffmannTable::default())),
        Hoffmann::NAME => Some(Box::new(Hoffmann::default())),
        Baur::NAME => Some(Box::new(Baur::default())),
        _ => None,
    }
}
