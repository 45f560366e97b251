use std::collections::BTreeSet;

use accurate_fit::CalibrationPriors;
use accurate_seg::Segmenter;
use accurate_synth::{CalibrationError, CaseOptions, Family};
use serde::{Deserialize, Serialize};

use super::Table;
use super::measure::{CaseSet, Measuring, PointsProtocol, measure};
use super::rows::{Outcome, Row, paper_rows};
use crate::{Error, InputKind, Method, UnknownName};

/// Seeds and cases per seed behind every cell: 5 draws of as many cases as the paper's simulation
/// test split has.
const SEEDS: [u64; 5] = [1, 2, 3, 4, 5];
const CASES: u64 = 26;

/// Image cells cost seconds a case: they are watched on a few (`docs/table.md` has more).
const IMAGE_SEEDS: [u64; 1] = [1];
const IMAGE_CASES: u64 = 3;
/// The phantom's calibration is a real one, never exact.
const PHANTOM_CALIBRATION_ERROR: CalibrationError =
    CalibrationError { rotation_deg: 0.03, shift_px: 0.3 };

/// One published number, the command that makes ours, and the interval ours must lie in.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// Row id of the published table.
    pub row: String,
    /// `simulation` or `phantom`.
    pub dataset: String,
    /// Column: `Acc.`, `Comp.`, `Overall` or `Max Err.`.
    pub metric: String,
    /// The paper's value.
    pub paper: f64,
    /// Family that stands for the paper's data set.
    pub set: String,
    /// Our method, or empty where the row cannot run.
    pub method: String,
    /// Lower end of the accepted interval, empty where the row cannot run.
    pub low: Option<f64>,
    /// Upper end of the accepted interval.
    pub high: Option<f64>,
    /// How to make the number again, or why it cannot be made.
    pub command: String,
}

impl Cell {
    /// Sets the interval to what watches a `value` that was measured once: 3 % to both sides, three
    /// digits. 20 % for an image: the sums of a network depend on the vectors of the machine, and a few
    /// pixels of a mask may decide a way.
    pub fn accept(&mut self, value: f64) {
        let share = if input_of(self) == Some(InputKind::Image) { 0.2 } else { 0.03 };
        let three_digits = |v: f64| format!("{v:.2e}").parse().unwrap_or(v);
        [self.low, self.high] =
            [value * (1.0 - share), value * (1.0 + share)].map(|v| Some(three_digits(v)));
    }
}

/// A cell beside what was measured.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CellCheck {
    /// The cell.
    pub cell: Cell,
    /// Our value; `None` where the row cannot run.
    pub measured: Option<f64>,
    /// Cases that gave no curve and are not in the value.
    pub failures: usize,
    /// Whether it lies in the accepted interval; a row that cannot run is no failure.
    pub accepted: bool,
}

/// Reads cells from CSV text with a header.
///
/// # Errors
/// The first line that does not fit, in words.
pub fn parse_cells(text: &str) -> Result<Vec<Cell>, String> {
    let cells: Vec<Cell> = csv::Reader::from_reader(text.as_bytes())
        .deserialize()
        .collect::<Result<_, _>>()
        .map_err(|error| error.to_string())?;
    for cell in &cells {
        if cell.method.is_empty() != (cell.low.is_none() || cell.high.is_none()) {
            return Err(format!(
                "cell {} {} {}: a method needs both ends of an accepted interval, and only a method",
                cell.row, cell.dataset, cell.metric
            ));
        }
    }
    Ok(cells)
}

/// The cells as CSV text with a header, as [`parse_cells`] reads it.
///
/// # Errors
/// What the writer says.
pub fn write_cells(cells: &[Cell]) -> Result<String, String> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for cell in cells {
        writer.serialize(cell).map_err(|error| error.to_string())?;
    }
    text_of(writer)
}

/// What was written.
pub(super) fn text_of(writer: csv::Writer<Vec<u8>>) -> Result<String, String> {
    let bytes = writer.into_inner().map_err(|error| error.to_string())?;
    String::from_utf8(bytes).map_err(|error| error.to_string())
}

/// Whether one of the cells reads images, so that [`check_cells`] needs a segmenter.
pub fn need_images(cells: &[Cell]) -> bool {
    benches(cells).into_iter().any(|(_, images)| images)
}

/// The cases of image rows and how they are measured: as the points and masks of the family, but
/// that the phantom's calibration is never exact, so `carm` has an error and `accurate` mode looks
/// for it.
pub fn image_cases<'s>(
    family: Family,
    seeds: &[u64],
    cases: u64,
    segmenter: &'s dyn Segmenter,
) -> (CaseSet, Measuring<'s>) {
    let calibration_error = (family == Family::Carm).then_some(PHANTOM_CALIBRATION_ERROR);
    let set = CaseSet::Generated {
        family,
        options: CaseOptions { calibration_error, ..CaseOptions::default() },
        seeds: seeds.to_vec(),
        cases,
        points: PointsProtocol::Rounded,
    };
    let how = Measuring {
        calibration: calibration_error.map(|_| CalibrationPriors::DEFAULT),
        segmenter: Some(segmenter),
        ..Measuring::default()
    };
    (set, how)
}

/// Runs every cell that can run and compares it with its accepted interval.
///
/// Cells of images need the `segmenter`; without one they count as not measured, which is a failure
/// of theirs.
///
/// # Errors
/// [`Error::Synthesis`], or [`Error::Name`] if a cell names an unknown set or method.
pub fn check_cells(
    cells: &[Cell],
    segmenter: Option<&dyn Segmenter>,
    on_case: &(dyn Fn() + Sync),
) -> Result<Vec<CellCheck>, Error> {
    let mut tables: Vec<(Bench<'_>, Table)> = Vec::new();
    for bench in benches(cells) {
        let (set, images) = bench;
        let family: Family = set.parse().map_err(|_| UnknownName {
            what: "set",
            name: set.to_owned(),
            expected: Family::ALL.map(|f| f.to_string()).join(", "),
        })?;
        let rows: Vec<Row> = paper_rows()
            .into_iter()
            .filter(|row| cells.iter().any(|c| bench_of(c) == Some(bench) && answers(row, c)))
            .collect();
        let (cases, how) = match (images, segmenter) {
            (true, Some(segmenter)) => image_cases(family, &IMAGE_SEEDS, IMAGE_CASES, segmenter),
            (true, None) => continue,
            (false, _) => {
                let cases = CaseSet::Generated {
                    family,
                    options: CaseOptions::default(),
                    seeds: SEEDS.to_vec(),
                    cases: CASES,
                    points: PointsProtocol::Rounded,
                };
                (cases, Measuring::default())
            }
        };
        tables.push((bench, measure(&cases, &rows, &how, on_case)?));
    }
    cells.iter().map(|cell| check(cell, &tables)).collect()
}

/// Number of cases that [`check_cells`] goes through, for a progress bar.
pub fn check_case_count(cells: &[Cell]) -> usize {
    let cases = |images| {
        if images { IMAGE_SEEDS.len() * IMAGE_CASES as usize } else { SEEDS.len() * CASES as usize }
    };
    benches(cells).into_iter().map(|(_, images)| cases(images)).sum()
}

/// A set, and whether its images are read: what is measured together.
type Bench<'c> = (&'c str, bool);

fn benches(cells: &[Cell]) -> BTreeSet<Bench<'_>> {
    cells.iter().filter_map(bench_of).collect()
}

/// None for a cell that cannot run.
fn bench_of(cell: &Cell) -> Option<Bench<'_>> {
    (!cell.method.is_empty()).then(|| (cell.set.as_str(), input_of(cell) == Some(InputKind::Image)))
}

/// The input of the published row that a cell belongs to.
fn input_of(cell: &Cell) -> Option<InputKind> {
    paper_rows().iter().find(|r| r.published == Some(cell.row.as_str())).map(|row| row.input)
}

/// Whether a row is the cell's method on the cell's input.
fn answers(row: &Row, cell: &Cell) -> bool {
    input_of(cell) == Some(row.input)
        && cell.method.parse().is_ok_and(|method| row.outcome == Outcome::Run(method))
}

fn check(cell: &Cell, tables: &[(Bench<'_>, Table)]) -> Result<CellCheck, Error> {
    let (Some(low), Some(high)) = (cell.low, cell.high) else {
        return Ok(CellCheck { cell: cell.clone(), measured: None, failures: 0, accepted: true });
    };
    cell.method.parse::<Method>()?;
    let row = tables
        .iter()
        .filter(|(bench, _)| bench_of(cell) == Some(*bench))
        .flat_map(|(_, table)| &table.rows)
        .filter(|row| answers(&row.row, cell))
        .find_map(|row| row.result.as_ref().ok());
    let column = row.and_then(|row| row.columns.iter().find(|(name, _)| *name == cell.metric));
    let measured = column.map(|(_, figure)| figure.value);
    // A cell whose row or column does not exist has measured nothing, and that is a failure.
    let accepted = measured.is_some_and(|value| (low..=high).contains(&value));
    let failures = row.map_or(0, |row| row.failures().count());
    Ok(CellCheck { cell: cell.clone(), measured, failures, accepted })
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "row,dataset,metric,paper,set,method,low,high,command\n";

    #[test]
    fn a_cell_without_interval_must_be_one_that_cannot_run() {
        let bad = format!("{HEADER}baert,simulation,Acc,0.88,sim-paper,baert-table,,,x\n");
        assert!(parse_cells(&bad).unwrap_err().contains("accepted interval"));
        let good = format!("{HEADER}vggt,simulation,Acc,2.85,sim-paper,,,,no weights\n");
        assert_eq!(parse_cells(&good).unwrap().len(), 1);
    }

    #[test]
    fn a_cell_that_names_no_row_is_not_accepted() {
        let text = format!("{HEADER}nobody,simulation,Acc,1,sim-paper,paper,0,9,x\n");
        let cells = parse_cells(&text).unwrap();
        assert!(!check(&cells[0], &[]).unwrap().accepted);
    }

    #[test]
    fn cells_are_written_as_they_are_read() {
        let text = format!(
            "{HEADER}vggt,simulation,Acc.,2.8532,sim-paper,,,,no weights\n\
             baert,simulation,Acc.,0.8843,sim-paper,baert-table,0.915,0.972,accurate table\n"
        );
        assert_eq!(write_cells(&parse_cells(&text).unwrap()).unwrap(), text);
    }

    #[test]
    fn the_interval_around_a_value_holds_it() {
        for (row, share) in [("ours-points", 0.03), ("ours-image", 0.2)] {
            let mut cell =
                parse_cells(&format!("{HEADER}{row},simulation,Acc.,1,sim-paper,paper,0,9,x\n"))
                    .unwrap()
                    .remove(0);
            for value in [0.0, 1e-9, 0.2815, 3.593, 117.0] {
                cell.accept(value);
                let (low, high) = (cell.low.unwrap(), cell.high.unwrap());
                assert!((low..=high).contains(&value), "{low} {value} {high}");
                // The share and half a unit of the third digit, which is at most 0.5 %.
                assert!(high - low <= value * (2.0 * share + 2.0 * 0.006), "{low} {high}");
                assert!(high - low >= value * (2.0 * share - 2.0 * 0.006), "{low} {high}");
            }
        }
    }

    #[test]
    fn image_cells_without_a_segmenter_are_not_accepted() {
        let text = format!("{HEADER}ours-image,phantom,Acc.,0.6,carm,paper,0,9,x\n");
        let cells = parse_cells(&text).unwrap();
        assert!(need_images(&cells));
        let checks = check_cells(&cells, None, &|| ()).unwrap();
        assert!(!checks[0].accepted && checks[0].measured.is_none());
    }
}
