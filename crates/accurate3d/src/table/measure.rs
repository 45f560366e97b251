use accurate_eval::{
    CurveScores, DEFAULT_RESAMPLES, EvalError, Metric, TableScores, bootstrap_mean, curve_scores,
    fraction_below, quantile_interval, table_scores,
};
use accurate_fit::CalibrationPriors;
use accurate_geom::{LengthUnit, Point3, Rig};
use accurate_seg::{Segmenter, unwatched};
use accurate_synth::{CaseOptions, Family, XrayOptions, generate, render_xray};
use rayon::prelude::*;

use super::ScoreKind;
use super::outcome::{CaseOutcome, CaseScores, RIGHT_PX};
use super::rows::{Outcome, Row};
use crate::{Error, InputKind, Params, ViewPair, reconstruct, reconstruct_images, segment_images};

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

    /// BLAKE3 hash of every case's cameras, points, masks and truth, and of the images of given pairs, so
    /// that two machines can tell whether they measured the same data. Those of generated cases are drawn
    /// from the rest, by the version that a table's manifest names.
    ///
    /// # Errors
    /// [`Error::Synthesis`] if a case cannot be generated.
    pub fn fingerprint(&self) -> Result<String, Error> {
        let cases: Vec<String> = (0..self.len())
            .into_par_iter()
            .map(|index| Ok(accurate_io::hash_bytes(&bytes_of(&self.case(index, false)?))))
            .collect::<Result<_, Error>>()?;
        Ok(accurate_io::hash_bytes(cases.concat().as_bytes()))
    }

    /// A generated case gets X-ray pictures if it is asked `with_images`.
    fn case(&self, index: usize, with_images: bool) -> Result<ViewPair, Error> {
        match self {
            Self::Generated { family, options, seeds, cases, points } => {
                let (seed, index) = (seeds[index / *cases as usize], index as u64 % cases);
                let case = generate(*family, seed, index, options)?;
                let exact = (*points == PointsProtocol::Exact).then(|| case.exact_points.clone());
                let images = with_images.then(|| render_xray(&case, &XrayOptions::default()));
                let mut pair = ViewPair::from(case);
                pair.images = images.map(|both| both.map(|image| image.mapv(f32::from)));
                if exact.is_some() {
                    pair.points = exact;
                }
                Ok(pair)
            }
            Self::Given { pairs, .. } => Ok(pairs[index].clone()),
        }
    }
}

/// All numbers of a pair in a fixed order, little-endian.
fn bytes_of(pair: &ViewPair) -> Vec<u8> {
    let mut bytes = pair.id.clone().into_bytes();
    let mut push = |value: f64| bytes.extend(value.to_le_bytes());
    for camera in [pair.rig.camera1(), pair.rig.camera2()] {
        camera.k().iter().chain(camera.r().iter()).chain(camera.t().iter()).for_each(|v| push(*v));
    }
    if let Some(points) = &pair.points {
        points.0.iter().flat_map(|p| [p.x, p.y]).for_each(&mut push);
        points.1.iter().flat_map(|p| [p.x, p.y]).for_each(&mut push);
    }
    pair.truth.iter().flatten().flat_map(|p| p.iter()).for_each(|v| push(*v));
    pair.images.iter().flatten().flatten().for_each(|v| push(f64::from(*v)));
    bytes.extend(pair.masks.iter().flatten().flatten().map(|on| u8::from(*on)));
    bytes
}

/// A mean, quantile or share with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Figure {
    /// The value itself.
    pub value: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
}

/// A measured row: means over the cases that gave a curve, and every case by itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// Column name and figure; empty if no case gave a curve.
    pub columns: Vec<(&'static str, Figure)>,
    /// The cases, in the set's order.
    pub cases: Vec<CaseOutcome>,
}

impl Measured {
    /// Number of cases that were scored.
    pub fn scored(&self) -> usize {
        self.cases.len() - self.failures().count()
    }

    /// Case id and reason of each failure.
    pub fn failures(&self) -> impl Iterator<Item = (&str, &str)> {
        self.cases.iter().filter_map(|outcome| {
            outcome.result.as_ref().err().map(|reason| (outcome.case.as_str(), reason.as_str()))
        })
    }
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

/// Arc length between samples of the point-to-polyline scores, in pixels at the truth's depth.
const SPACING_PX: f64 = 0.5;

/// How rows are measured.
#[derive(Debug, Clone, Copy, Default)]
pub struct Measuring<'a> {
    /// Which distances are shown.
    pub scores: ScoreKind,
    /// Whether the [outcomes](Measured::cases) hold both kinds of scores, where curves have both.
    pub both_scores: bool,
    /// What `accurate` mode may correct view 2 by, if anything.
    pub calibration: Option<CalibrationPriors>,
    /// What segments the images; without it the image rows have no figures.
    pub segmenter: Option<&'a dyn Segmenter>,
}

/// Why an image row has no figures without a segmenter.
const NOT_SEGMENTED: &str = "ask for --input image";

/// Measures every row on every case; the same numbers for any number of threads.
///
/// The images of generated cases are X-ray pictures with the default options; each is segmented
/// once for all rows, and once more where `accurate` mode is not sure of its curve. `on_case` is called when
/// a case is done.
///
/// # Errors
/// [`Error::Synthesis`] if a case cannot be generated, [`Error::Scoring`] if a mean cannot be formed,
/// [`Error::MixedUnits`] if the pairs are in different units.
/// A method that fails on a case is counted in its row, not an error here.
pub fn measure(
    set: &CaseSet,
    rows: &[Row],
    how: &Measuring<'_>,
    on_case: &(dyn Fn() + Sync),
) -> Result<Table, Error> {
    let with_images = runnable(rows, how).any(|(row, _)| row.input == InputKind::Image);
    let per_case: Vec<(LengthUnit, Vec<CaseOutcome>)> = (0..set.len())
        .into_par_iter()
        .map(|index| {
            let pair = set.case(index, with_images)?;
            let segmented = how.segmenter.filter(|_| with_images).map(|segmenter| {
                segment_images(pair.clone(), segmenter, &unwatched).map_err(|e| e.to_string())
            });
            let outcomes = runnable(rows, how)
                .map(|(row, method)| CaseOutcome {
                    case: pair.id.clone(),
                    result: match (&segmented, row.input) {
                        (Some(Ok(segmented)), InputKind::Image) => {
                            score(segmented, row, method, how)
                        }
                        (Some(Err(reason)), InputKind::Image) => Err(reason.clone()),
                        _ => score(&pair, row, method, how),
                    },
                })
                .collect();
            on_case();
            Ok((pair.rig.unit(), outcomes))
        })
        .collect::<Result<_, Error>>()?;
    let unit = per_case.first().map_or(LengthUnit::Unit, |(unit, _)| *unit);
    if let Some((other, _)) = per_case.iter().find(|(other, _)| *other != unit) {
        return Err(Error::MixedUnits { set: set.name(), units: [unit, *other] });
    }
    let mut measured = Vec::new();
    for row in 0..runnable(rows, how).count() {
        let cases: Vec<CaseOutcome> =
            per_case.iter().map(|(_, outcomes)| outcomes[row].clone()).collect();
        let scored: Vec<&CaseScores> = cases.iter().flat_map(|outcome| &outcome.result).collect();
        measured.push(Measured { columns: columns(&scored, how.scores)?, cases });
    }
    let mut measured = measured.into_iter();
    let rows = rows
        .iter()
        .map(|row| TableRow {
            row: row.clone(),
            result: match row.outcome {
                Outcome::Run(_) if runs(row, how) => measured.next().ok_or("not measured"),
                Outcome::Run(_) => Err(NOT_SEGMENTED),
                Outcome::NotAvailable(reason) => Err(reason),
            },
        })
        .collect();
    Ok(Table { set: set.name(), cases: set.len(), unit, rows })
}

fn runnable<'r>(
    rows: &'r [Row],
    how: &Measuring<'_>,
) -> impl Iterator<Item = (&'r Row, crate::Method)> {
    rows.iter().filter(|row| runs(row, how)).filter_map(|row| match row.outcome {
        Outcome::Run(method) => Some((row, method)),
        Outcome::NotAvailable(_) => None,
    })
}

fn runs(row: &Row, how: &Measuring<'_>) -> bool {
    matches!(row.outcome, Outcome::Run(_))
        && (row.input != InputKind::Image || how.segmenter.is_some())
}

fn score(
    pair: &ViewPair,
    row: &Row,
    method: crate::Method,
    how: &Measuring<'_>,
) -> Result<CaseScores, String> {
    let truth = pair.truth.as_deref().ok_or("the pair has no truth")?;
    let mut params = Params::new(row.input, method);
    params.robust.calibration = how.calibration;
    let reconstruction = match (row.input, how.segmenter) {
        (InputKind::Image, Some(segmenter)) => {
            reconstruct_images(pair, &params, segmenter, &unwatched).map(|(curve, _)| curve)
        }
        _ => reconstruct(pair, &params),
    };
    let reconstruction = reconstruction.map_err(|e| e.to_string())?;
    let curve = reconstruction.positions();
    let world_per_px = world_per_px(&pair.rig, truth);
    let points = || table_scores(&curve, truth);
    let lines = || curve_scores(&curve, truth, SPACING_PX * world_per_px);
    let said = |e: EvalError| e.to_string();
    // Of the kind that is not shown a curve may have no scores, as one point after another may be the same.
    let (table, curve) = match how.scores {
        ScoreKind::Table => {
            (Some(points().map_err(said)?), how.both_scores.then(|| lines().ok()).flatten())
        }
        ScoreKind::Polyline => {
            (how.both_scores.then(|| points().ok()).flatten(), Some(lines().map_err(said)?))
        }
    };
    let suspicions = reconstruction.diagnostics.suspicions;
    Ok(CaseScores { table, curve, world_per_px, suspicions })
}

/// Depth of the truth's centre over the focal length, mean of both views.
fn world_per_px(rig: &Rig, truth: &[Point3]) -> f64 {
    let centre = truth.iter().map(|p| p.coords).sum::<accurate_geom::nalgebra::Vector3<f64>>()
        / truth.len() as f64;
    let one =
        |camera: &accurate_geom::Camera| camera.depth(&centre.into()) / camera.k()[(0, 0)].abs();
    (one(rig.camera1()) + one(rig.camera2())) / 2.0
}

fn columns(
    scored: &[&CaseScores],
    shown: ScoreKind,
) -> Result<Vec<(&'static str, Figure)>, EvalError> {
    if scored.is_empty() {
        return Ok(Vec::new());
    }
    if shown == ScoreKind::Table {
        let table: Vec<TableScores> = scored.iter().filter_map(|s| s.table).collect();
        return Metric::ALL
            .iter()
            .map(|metric| {
                let values: Vec<f64> = table.iter().map(|scores| metric.of(scores)).collect();
                Ok((metric.heading(), mean(&values, metric.heading())?))
            })
            .collect();
    }
    let curve: Vec<CurveScores> = scored.iter().filter_map(|s| s.curve).collect();
    let overall: Vec<f64> = curve.iter().map(|c| c.overall).collect();
    let hausdorff: Vec<f64> = curve.iter().map(|c| c.hausdorff).collect();
    let hausdorff_px: Vec<f64> = scored.iter().filter_map(|s| s.hausdorff_px()).collect();
    let point = |values: &[f64], probability| {
        quantile_interval(values, probability).map(|found| Figure {
            value: found.value,
            low: found.low,
            high: found.high,
        })
    };
    let right = fraction_below(&hausdorff_px, RIGHT_PX)?;
    Ok(vec![
        ("Overall", mean(&overall, "Overall")?),
        ("Overall median", point(&overall, 0.5)?),
        ("Hausdorff", mean(&hausdorff, "Hausdorff")?),
        ("Hausdorff median", point(&hausdorff, 0.5)?),
        ("Hausdorff p95", point(&hausdorff, 0.95)?),
        ("share < 5 px", Figure { value: right.fraction, low: right.low, high: right.high }),
    ])
}

fn mean(values: &[f64], name: &str) -> Result<Figure, EvalError> {
    let interval = bootstrap_mean(values, DEFAULT_RESAMPLES, name)?;
    Ok(Figure { value: interval.mean, low: interval.low, high: interval.high })
}
