//! The paper's comparison table, made anew: the same cases for every method, means with bootstrap
//! intervals, failures counted, the published figures beside ours.

mod cells;
mod measure;
mod outcome;
mod render;
mod rows;

pub use cells::{
    Cell, CellCheck, check_case_count, check_cells, image_cases, need_images, parse_cells,
    write_cells,
};
pub use measure::{CaseSet, Figure, Measured, Measuring, PointsProtocol, Table, TableRow, measure};
pub use outcome::{CaseOutcome, CaseScores, Flags, cases_csv};
pub use render::{Format, grid, render};
pub use rows::{Outcome, Row, paper_rows};

use std::fmt;
use std::str::FromStr;

use crate::UnknownName;

/// Which distances a table shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum ScoreKind {
    /// The paper's: nearest neighbours between the point sets as they are.
    #[default]
    Table,
    /// Between densely sampled curves, point to polyline, both ways.
    Polyline,
}

impl fmt::Display for ScoreKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Table => "table",
            Self::Polyline => "polyline",
        })
    }
}

impl FromStr for ScoreKind {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        match name {
            "table" => Ok(Self::Table),
            "polyline" => Ok(Self::Polyline),
            _ => Err(UnknownName {
                what: "kind of scores",
                name: name.to_owned(),
                expected: "table, polyline".to_owned(),
            }),
        }
    }
}
