use accurate_eval::{CurveScores, TableScores};

use super::cells::text_of;
use super::measure::Table;
use super::rows::Row;
use crate::Suspicion;

/// What a row came to on one case.
#[derive(Debug, Clone, PartialEq)]
pub struct CaseOutcome {
    /// The case's id.
    pub case: String,
    /// Its curve against the truth, or why there is none.
    pub result: Result<CaseScores, String>,
}

/// A curve against its truth: of the two kinds of scores those that were asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct CaseScores {
    /// Between the points as they are, as in the paper.
    pub table: Option<TableScores>,
    /// Between the curves.
    pub curve: Option<CurveScores>,
    /// The world length that one pixel sees at the truth's centre, mean of both views.
    pub world_per_px: f64,
    /// Why the result is doubted.
    pub suspicions: Vec<Suspicion>,
}

/// The Hausdorff distance below which a curve counts as right, px.
pub(super) const RIGHT_PX: f64 = 5.0;

impl CaseScores {
    /// Hausdorff distance of the curves in pixels at the truth's centre.
    pub fn hausdorff_px(&self) -> Option<f64> {
        self.curve.map(|scores| scores.hausdorff / self.world_per_px)
    }

    /// Whether that is below 5 px.
    pub fn is_right(&self) -> Option<bool> {
        self.hausdorff_px().map(|px| px < RIGHT_PX)
    }
}

/// How a row's doubts fall upon its right and its wrong curves: `[flagged, all]` of either.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Flags {
    /// Of the wrong curves.
    pub wrong: [usize; 2],
    /// Of the right ones.
    pub right: [usize; 2],
}

impl Flags {
    /// Counts the cases whose curves were scored as curves.
    pub fn of(outcomes: &[CaseOutcome]) -> Self {
        let mut flags = Self { wrong: [0; 2], right: [0; 2] };
        for scores in outcomes.iter().flat_map(|outcome| &outcome.result) {
            let Some(right) = scores.is_right() else { continue };
            let count = if right { &mut flags.right } else { &mut flags.wrong };
            count[0] += usize::from(!scores.suspicions.is_empty());
            count[1] += 1;
        }
        flags
    }
}

/// One CSV line a row and case: the scores of both kinds, right or not, the doubts, or the failure.
/// Distances are in the table's unit unless a heading says px.
///
/// # Errors
/// What the CSV writer says.
pub fn cases_csv(table: &Table) -> Result<String, String> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(HEADINGS).map_err(|e| e.to_string())?;
    for row in &table.rows {
        for outcome in row.result.iter().flat_map(|measured| &measured.cases) {
            writer.write_record(record(table, &row.row, outcome)).map_err(|e| e.to_string())?;
        }
    }
    text_of(writer)
}

const HEADINGS: [&str; 18] = [
    "set",
    "unit",
    "case",
    "label",
    "input",
    "accuracy",
    "completeness",
    "overall",
    "max_error",
    "curve_overall",
    "hausdorff",
    "percentile_95",
    "frechet",
    "length_error",
    "hausdorff_px",
    "right",
    "suspicions",
    "failure",
];

fn record(table: &Table, row: &Row, outcome: &CaseOutcome) -> [String; 18] {
    let scores = outcome.result.as_ref().ok();
    let number = |value: Option<f64>| value.map_or_else(String::new, |v| v.to_string());
    let points = |of: fn(&TableScores) -> f64| number(scores.and_then(|s| s.table).map(|t| of(&t)));
    let curve = |of: fn(&CurveScores) -> f64| number(scores.and_then(|s| s.curve).map(|c| of(&c)));
    let right = scores.and_then(CaseScores::is_right);
    let doubts: Vec<String> = scores.iter().flat_map(|s| &s.suspicions).map(name_of).collect();
    [
        table.set.clone(),
        table.unit.label().to_owned(),
        outcome.case.clone(),
        row.label.to_owned(),
        row.input.to_string(),
        points(|s| s.accuracy),
        points(|s| s.completeness),
        points(|s| s.overall),
        points(|s| s.max_error),
        curve(|s| s.overall),
        curve(|s| s.hausdorff),
        curve(|s| s.percentile_95),
        curve(|s| s.frechet),
        curve(|s| s.length_error),
        number(scores.and_then(CaseScores::hausdorff_px)),
        right.map_or_else(String::new, |right| right.to_string()),
        doubts.join("; "),
        outcome.result.as_ref().err().cloned().unwrap_or_default(),
    ]
}

/// As in `result.json`.
fn name_of(suspicion: &Suspicion) -> String {
    serde_json::to_value(suspicion)
        .ok()
        .and_then(|name| name.as_str().map(str::to_owned))
        .unwrap_or_else(|| suspicion.to_string())
}
