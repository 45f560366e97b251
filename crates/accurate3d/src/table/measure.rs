use accurate_eval::{CurveScores, Interval, TableScores, bootstrap_mean, quantile};
use accurate_geom::{LengthUnit, Point3, Rig};
use accurate_synth::{CaseOptions, Family, generate};
use rayon::prelude::*;

use super::rows::{Outcome, Row};
use crate::{Error, Params, ViewPair, reconstruct};

/// The cases that a table is measured on.
#[derive(Debug, Clone)]
pub enum CaseSet {
    /// `cases` cases for each seed of a generated family.
    Generated {
        /// The family.
        family: Family,
        /// Its disturbances.
        options: CaseOptions,
        /// One block of cases per seed.
        seeds: Vec<u64>,
        /// Cases per seed.
        cases: u64,
        /// Which ordered points the "Points" rows get.
        points: PointsProtocol,
    },
    /// Pairs with truth, as they are.
    Given {
        /// How the table calls them.
        name: String,
        /// The pairs.
        pairs: Vec<ViewPair>,
    },
}

/// Which ordered points of a generated case are used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PointsProtocol {
    /// The paper's: visible truth points rounded to whole pixels.
    Rounded,
    /// Exact sub-pixel projections.
    Exact,
}

impl CaseSet {
    /// How the table calls the set.
    pub fn name(&self) -> String {
        match self {
            Self::Generated { family, .. } => family.to_string(),
            Self::Given { name, .. } => name.clone(),
        }
    }

    /// Number of cases.
    pub fn len(&self) -> usize {
        match self {
            Self::Generated { seeds, cases, .. } => seeds.len() * *cases as usize,
            Self::Given { pairs, .. } => pairs.len(),
        }
    }

    /// Whether there is no case.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn case(&self, index: usize) -> Result<ViewPair, Error> {
        match self {
            Self::Generated { family, options, seeds, cases, points } => {
                let (seed, index) = (seeds[index / *cases as usize], index as u64 % cases);
                let case = generate(*family, seed, index, options)?;
                let exact = (*points == PointsProtocol::Exact).then(|| case.exact_points.clone());
                let mut pair = ViewPair::from(case);
                if exact.is_some() {
                    pair.points = exact;
                }
                Ok(pair)
            }
            Self::Given { pairs, .. } => Ok(pairs[index].clone()),
        }
    }
}

/// The scores of one case.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scored {
    /// The paper's scores.
    pub table: TableScores,
    /// Point-to-polyline scores.
    pub curve: CurveScores,
    /// World length that one pixel sees at the truth's centre, mean over both views.
    pub world_per_px: f64,
}

/// A measured row: means over the cases that gave a curve, and the cases that did not.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// Column name and mean with its interval, or a median or fraction without one.
    pub columns: Vec<(&'static str, Interval)>,
    /// Cases that were scored.
    pub scored: usize,
    /// Case id and reason of each failure.
    pub failures: Vec<(String, String)>,
}

/// A row of the finished table.
#[derive(Debug, Clone, PartialEq)]
pub struct TableRow {
    /// What the row is.
    pub row: Row,
    /// Its figures, or why there are none.
    pub result: Result<Measured, &'static str>,
}

/// A finished table.
#[derive(Debug, Clone, PartialEq)]
pub struct Table {
    /// Name of the case set.
    pub set: String,
    /// Number of cases.
    pub cases: usize,
    /// Unit of all distances.
    pub unit: LengthUnit,
    /// The lines.
    pub rows: Vec<TableRow>,
}

/// Arc length between samples of the point-to-polyline scores, as a fraction of the truth's length.
const SPACING_FRACTION: f64 = 1.0 / 4000.0;

/// Measures every row on every case; the same numbers for any number of threads.
///
/// `on_case` is called when a case is done.
///
/// # Errors
/// [`Error::Synthesis`] if a case cannot be generated. A method that fails on a case is counted in
/// its row, not an error here.
pub fn measure(
    set: &CaseSet,
    rows: &[Row],
    kind: super::ScoreKind,
    on_case: &(dyn Fn() + Sync),
) -> Result<Table, Error> {
    let per_case: Vec<(LengthUnit, Vec<Result<Scored, (String, String)>>)> = (0..set.len())
        .into_par_iter()
        .map(|index| {
            let pair = set.case(index)?;
            let scores = runnable(rows).map(|(row, method)| score(&pair, row, method)).collect();
            on_case();
            Ok((pair.rig.unit(), scores))
        })
        .collect::<Result<_, Error>>()?;
    let mut measured = runnable(rows).enumerate().map(|(column, _)| {
        let (mut scored, mut failures) = (Vec::new(), Vec::new());
        for (_, scores) in &per_case {
            match &scores[column] {
                Ok(s) => scored.push(*s),
                Err(failure) => failures.push(failure.clone()),
            }
        }
        Measured { columns: columns(kind, &scored), scored: scored.len(), failures }
    });
    let rows = rows
        .iter()
        .map(|row| TableRow {
            row: row.clone(),
            result: match row.outcome {
                Outcome::Run(_) => measured.next().ok_or("not measured"),
                Outcome::NotAvailable(reason) => Err(reason),
            },
        })
        .collect();
    Ok(Table {
        set: set.name(),
        cases: set.len(),
        unit: per_case.first().map_or(LengthUnit::Unit, |(unit, _)| *unit),
        rows,
    })
}

fn runnable(rows: &[Row]) -> impl Iterator<Item = (&Row, crate::Method)> {
    rows.iter().filter_map(|row| match row.outcome {
        Outcome::Run(method) => Some((row, method)),
        Outcome::NotAvailable(_) => None,
    })
}

fn score(pair: &ViewPair, row: &Row, method: crate::Method) -> Result<Scored, (String, String)> {
    let fail = |reason: String| (pair.id.clone(), reason);
    let truth = pair.truth.as_deref().ok_or_else(|| fail("the pair has no truth".to_owned()))?;
    let params = Params::new(row.input, method);
    let reconstruction = reconstruct(pair, &params).map_err(|e| fail(e.to_string()))?;
    let curve = reconstruction.positions();
    let spacing = length(truth) * SPACING_FRACTION;
    Ok(Scored {
        table: TableScores::of(&curve, truth).map_err(|e| fail(e.to_string()))?,
        curve: CurveScores::of(&curve, truth, spacing).map_err(|e| fail(e.to_string()))?,
        world_per_px: world_per_px(&pair.rig, truth),
    })
}

fn length(points: &[Point3]) -> f64 {
    points.windows(2).map(|w| (w[1] - w[0]).norm()).sum()
}

/// Depth of the truth's centre over the focal length, mean of both views.
fn world_per_px(rig: &Rig, truth: &[Point3]) -> f64 {
    let centre = truth.iter().map(|p| p.coords).sum::<accurate_geom::nalgebra::Vector3<f64>>()
        / truth.len() as f64;
    let one = |camera: &accurate_geom::Camera| {
        camera.depth(&centre.into()) / camera.k()[(0, 0)].abs()
    };
    (one(rig.camera1()) + one(rig.camera2())) / 2.0
}

/// The Hausdorff distance below which a case counts as right, px.
const RIGHT_PX: f64 = 5.0;

fn columns(kind: super::ScoreKind, scored: &[Scored]) -> Vec<(&'static str, Interval)> {
    if scored.is_empty() {
        return Vec::new();
    }
    let mean = |name, value: fn(&Scored) -> f64| {
        (name, bootstrap_mean(&scored.iter().map(value).collect::<Vec<_>>(), name))
    };
    let point = |name, value: f64| (name, Interval { mean: value, low: value, high: value });
    match kind {
        super::ScoreKind::Table => vec![
            mean("Acc", |s| s.table.accuracy),
            mean("Comp", |s| s.table.completeness),
            mean("Overall", |s| s.table.overall),
            mean("Max Err", |s| s.table.max_error),
        ],
        super::ScoreKind::Polyline => {
            let overall: Vec<f64> = scored.iter().map(|s| s.curve.overall).collect();
            let hausdorff: Vec<f64> = scored.iter().map(|s| s.curve.hausdorff).collect();
            vec![
                mean("Overall", |s| s.curve.overall),
                point("Overall median", quantile(&overall, 0.5)),
                mean("Hausdorff", |s| s.curve.hausdorff),
                point("Hausdorff median", quantile(&hausdorff, 0.5)),
                point("Hausdorff p95", quantile(&hausdorff, 0.95)),
                mean("share < 5 px", |s| {
                    f64::from(u8::from(s.curve.hausdorff < RIGHT_PX * s.world_per_px))
                }),
            ]
        }
    }
}
