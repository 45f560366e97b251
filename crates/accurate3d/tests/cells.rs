//! The rerunnable cells hold every published number of Table 1, unchanged.
#![allow(clippy::unwrap_used)]

use std::path::Path;

use accurate3d::InputKind;
use accurate3d::eval::published_cells;
use accurate3d::table::{Outcome, paper_rows, parse_cells};

/// Method and command of a cell that waits for the network.
const NOT_YET: (&str, &str) = ("", "no segmentation network");

#[test]
fn every_published_number_is_a_cell() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../benchmarks/tables/table1.csv");
    let cells = parse_cells(&std::fs::read_to_string(path).unwrap()).unwrap();
    let published: Vec<_> = published_cells().collect();
    assert_eq!(cells.len(), published.len());
    for (cell, number) in cells.iter().zip(published) {
        assert_eq!(cell.row, number.row.id);
        assert_eq!(cell.dataset, number.row.dataset.name());
        assert_eq!(cell.metric, number.metric.heading());
        assert_eq!(cell.paper, number.value);
    }
}

#[test]
fn every_published_row_is_a_row_of_our_table() {
    let rows = paper_rows();
    for number in published_cells() {
        let row = rows.iter().find(|r| r.published == Some(number.row.id)).unwrap();
        assert_eq!(row.calibrated, number.row.calibrated, "{}", number.row.id);
    }
}

#[test]
fn a_cell_can_run_exactly_where_its_row_can() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../benchmarks/tables/table1.csv");
    let cells = parse_cells(&std::fs::read_to_string(path).unwrap()).unwrap();
    let rows = paper_rows();
    for cell in cells {
        let row = rows.iter().find(|r| r.published == Some(cell.row.as_str())).unwrap();
        match row.outcome {
            // No trained network ships yet: the image rows run with a model of the user's.
            Outcome::Run(_) if row.input == InputKind::Image => {
                assert_eq!((cell.method.as_str(), cell.command.as_str()), NOT_YET);
            }
            Outcome::Run(method) => assert_eq!(cell.method, method.name()),
            Outcome::NotAvailable(reason) => {
                assert_eq!((cell.method, cell.command), (String::new(), reason.to_owned()))
            }
        }
    }
}
