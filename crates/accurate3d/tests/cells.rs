//! The rerunnable cells hold every published number of Table 1, unchanged.
#![allow(clippy::unwrap_used)]

use std::path::Path;

use accurate3d::Method;
use accurate3d::eval::published_cells;
use accurate3d::table::{Cell, Outcome, paper_rows, parse_cells};

#[test]
fn every_published_number_is_a_cell() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../benchmarks/tables/table1.csv");
    let cells = parse_cells(&std::fs::read_to_string(path).unwrap()).unwrap();
    let published: Vec<_> = published_cells().collect();
    let (first, ours) = cells.split_at(published.len());
    for (cell, number) in first.iter().zip(published) {
        assert_eq!(cell.row, number.row.id);
        assert_eq!(cell.dataset, number.row.dataset.name());
        assert_eq!(cell.metric, number.metric.heading());
        assert_eq!(cell.paper, number.value);
    }
    // What follows answers to the same numbers with our own method.
    for cell in ours {
        let of =
            |c: &&Cell| (&c.row, &c.dataset, &c.metric) == (&cell.row, &cell.dataset, &cell.metric);
        let number = first.iter().find(of).unwrap();
        assert_eq!((cell.paper, &cell.set), (number.paper, &number.set));
        assert_eq!(cell.method, Method::Accurate.name());
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
    let published = published_cells().count();
    let rows = paper_rows();
    for cell in cells.into_iter().take(published) {
        let row = rows.iter().find(|r| r.published == Some(cell.row.as_str())).unwrap();
        match row.outcome {
            Outcome::Run(method) => assert_eq!(cell.method, method.name()),
            Outcome::NotAvailable(reason) => {
                assert_eq!((cell.method, cell.command), (String::new(), reason.to_owned()))
            }
        }
    }
}
