//! Every figure that `accurate` mode promises on generated data, beside `paper` mode on the same cases.
//!
//! `cargo run --release -p accurate3d --example acceptance -- [--seed 12] [--cases 100] [SCENE...]`
//! prints one Markdown row a figure: goal, value with its 95 % interval (Wilson's for fractions,
//! bootstrap for means, order statistics for quantiles), `paper` beside it, and whether the goal is
//! reached. Evaluation seeds are 1 to 999; nothing was tuned on them. A case without a curve counts as
//! wrong by infinity; means leave it out and say so.
#![allow(clippy::print_stdout)]

use std::error::Error;

use accurate3d::eval::{
    DEFAULT_RESAMPLES, bootstrap_mean, curve_scores, quantile_interval, table_scores,
    wilson_interval,
};
use accurate3d::fit::CalibrationPriors;
use accurate3d::geom::{Camera, Point3, Triangulation, Triangulator};
use accurate3d::synth::{CalibrationError, CaseOptions, Family, SynthCase, generate};
use accurate3d::{InputKind, Method, Params, ViewPair, reconstruct};
use rayon::prelude::*;

type Failure = Box<dyn Error + Send + Sync>;

const RIGHT_PX: f64 = 5.0;

/// What a case is scored by.
#[derive(Debug, Clone, Copy)]
enum Figure {
    /// Fraction of the cases with a Hausdorff distance below 5 px.
    Right,
    /// Quantile of the Hausdorff distance, px.
    HausdorffPx(f64),
    /// The same in the world's unit.
    Hausdorff(f64),
    /// Median of Overall, points to polyline both ways, px.
    MedianOverallPx,
    /// Mean of the same.
    MeanOverallPx,
    /// Mean of the largest distance, px.
    MeanMaxPx,
    /// Mean Overall by the table's metric, world unit.
    TableOverall,
    /// Mean Max Err by the table's metric, world unit.
    TableMax,
    /// Fraction of the wrong that is flagged, and of the right that is not.
    WrongFlagged,
    RightFlagged,
}

impl Figure {
    fn name(self) -> String {
        match self {
            Self::Right => "Hausdorff < 5 px".to_owned(),
            Self::HausdorffPx(q) => format!("Hausdorff, quantile {q}, px"),
            Self::Hausdorff(q) => format!("Hausdorff, quantile {q}, world"),
            Self::MedianOverallPx => "Overall, median, px".to_owned(),
            Self::MeanOverallPx => "Overall, mean, px".to_owned(),
            Self::MeanMaxPx => "Max, mean, px".to_owned(),
            Self::TableOverall => "Overall (table), mean, world".to_owned(),
            Self::TableMax => "Max Err (table), mean, world".to_owned(),
            Self::WrongFlagged => "wrong and flagged".to_owned(),
            Self::RightFlagged => "right but flagged".to_owned(),
        }
    }

    fn more_is_better(self) -> bool {
        matches!(self, Self::Right | Self::WrongFlagged)
    }
}

/// A goal; `None`: printed without one.
type Goals = Vec<(Figure, Option<f64>)>;

struct Scene {
    name: &'static str,
    family: Family,
    input: InputKind,
    exact_points: bool,
    discs: u32,
    /// Rotation in degrees and shift in px of view 2; estimated with the curve if not zero.
    off: Option<(f64, f64)>,
    /// Whether the goal of figures without one is half of `paper` mode's.
    half_of_paper: bool,
    goals: Goals,
}

fn scenes() -> Vec<Scene> {
    use Figure::*;
    let masks = |name, family, right: f64| Scene {
        name,
        family,
        input: InputKind::Mask,
        exact_points: false,
        discs: 0,
        off: None,
        half_of_paper: family == Family::Tangency,
        goals: vec![
            (Right, Some(right)),
            (MedianOverallPx, Some(0.10)),
            (HausdorffPx(0.5), Some(0.6)),
            (WrongFlagged, Some(0.95)),
            (RightFlagged, Some(0.05)),
        ],
    };
    let points = |name, family, exact_points, goals| Scene {
        input: InputKind::Points,
        exact_points,
        goals,
        ..masks(name, family, 0.0)
    };
    let flags = [(WrongFlagged, Some(0.95)), (RightFlagged, Some(0.05))];
    let with = |mut goals: Goals| {
        goals.extend(flags);
        goals
    };
    let carm = |overall, hausdorff| {
        with(vec![(Right, None), (TableOverall, Some(overall)), (Hausdorff(0.95), Some(hausdorff))])
    };
    vec![
        masks("masks-easy", Family::Easy, 0.98),
        masks("masks-medium", Family::Medium, 0.95),
        masks("masks-hard", Family::Hard, 0.85),
        Scene {
            discs: 2,
            goals: with(vec![(Right, Some(0.90))]),
            ..masks("masks-medium-discs", Family::Medium, 0.0)
        },
        Scene {
            off: Some((0.05, 0.0)),
            goals: with(vec![(Right, Some(0.97))]),
            ..masks("masks-medium-turned", Family::Medium, 0.0)
        },
        Scene { goals: carm(0.08, 1.0), ..masks("masks-carm", Family::Carm, 0.0) },
        Scene {
            off: Some((0.03, 0.3)),
            goals: carm(0.22, 1.5),
            ..masks("masks-carm-off", Family::Carm, 0.0)
        },
        Scene {
            goals: with(vec![(Right, None), (TableOverall, Some(0.06)), (TableMax, Some(0.5))]),
            ..masks("masks-sim-paper", Family::SimPaper, 0.0)
        },
        points(
            "exact-medium",
            Family::Medium,
            true,
            vec![(MeanOverallPx, Some(0.01)), (MeanMaxPx, Some(0.10))],
        ),
        points(
            "exact-helix",
            Family::Helix,
            true,
            vec![(MeanOverallPx, Some(0.01)), (MeanMaxPx, Some(0.10))],
        ),
        points(
            "whole-medium",
            Family::Medium,
            false,
            vec![(MeanOverallPx, Some(0.15)), (MeanMaxPx, Some(1.0))],
        ),
        points(
            "whole-sim-paper",
            Family::SimPaper,
            false,
            vec![(TableOverall, Some(0.035)), (TableMax, Some(0.33))],
        ),
        points("whole-tangency", Family::Tangency, false, vec![(MeanMaxPx, None)]),
        points("exact-tangency", Family::Tangency, true, vec![(MeanMaxPx, None)]),
    ]
}

/// Scores of one case by one method; `None`: no curve.
#[derive(Debug, Clone, Copy)]
struct Scores {
    hausdorff: f64,
    overall: f64,
    table_overall: f64,
    table_max: f64,
    unit_per_px: f64,
    suspect: bool,
    /// Overall by the table's metric of the truth as the true cameras saw it, exactly, triangulated
    /// by the given ones: what a method leaves that makes no mistake but cannot tell how wrong the
    /// calibration is along the epipolar lines.
    floor: Option<f64>,
}

fn main() -> Result<(), Failure> {
    let (mut seed, mut cases, mut wanted) = (12, 100, Vec::new());
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        match arg.as_str() {
            "--seed" => seed = args.next().ok_or("--seed N")?.parse()?,
            "--cases" => cases = args.next().ok_or("--cases N")?.parse()?,
            _ => wanted.push(arg),
        }
    }
    println!("| scene | figure | goal | `accurate` | `paper` | reached |");
    println!("|---|---|---:|---|---|---|");
    for scene in scenes() {
        if wanted.is_empty() || wanted.iter().any(|name| name == scene.name) {
            print(&scene, seed, cases)?;
        }
    }
    Ok(())
}

fn print(scene: &Scene, seed: u64, cases: u64) -> Result<(), Failure> {
    let found: Vec<[Option<Scores>; 2]> = (0..cases)
        .into_par_iter()
        .map(|index| {
            let options = CaseOptions {
                occlusion_discs: scene.discs.min(1)..=scene.discs,
                calibration_error: scene
                    .off
                    .map(|(rotation_deg, shift_px)| CalibrationError { rotation_deg, shift_px }),
                ..CaseOptions::default()
            };
            let case = generate(scene.family, seed, index, &options)?;
            Ok([score(scene, &case, Method::Accurate), score(scene, &case, Method::Paper)])
        })
        .collect::<Result<_, Failure>>()?;
    let of = |k: usize| found.iter().map(|both| both[k]).collect::<Vec<_>>();
    let (ours, papers) = (of(0), of(1));
    for &(figure, goal) in &scene.goals {
        let [mine, paper] = [&ours, &papers].map(|scores| value(figure, scores));
        let (mine, paper) = (mine?, paper?);
        // Where nothing is known of what can be reached: half of what the paper's method leaves.
        let goal = goal.or_else(|| scene.half_of_paper.then(|| paper.value.map(|v| 0.5 * v))?);
        let reached = match (goal, mine.value) {
            (Some(goal), Some(value)) => {
                let enough = if figure.more_is_better() { value >= goal } else { value <= goal };
                if enough { "yes" } else { "**no**" }
            }
            _ => "-",
        };
        let goal = goal.map_or_else(|| "-".to_owned(), |goal| format!("{goal:.3}"));
        println!(
            "| {} | {} | {goal} | {} | {} | {reached} |",
            scene.name,
            figure.name(),
            mine.text,
            paper.text
        );
    }
    if scene.off.is_some() {
        let floors: Vec<f64> = found.iter().filter_map(|both| both[0]?.floor).collect();
        let m = bootstrap_mean(&floors, DEFAULT_RESAMPLES, "acceptance")?;
        println!(
            "| {} | Overall (table) of the true pixels under the given cameras | - | {:.4} [{:.4}, {:.4}] | | - |",
            scene.name, m.mean, m.low, m.high
        );
    }
    for (name, scores) in [("accurate", &ours), ("paper", &papers)] {
        let failures = scores.iter().filter(|s| s.is_none()).count();
        if failures > 0 {
            println!("| {} | cases without a curve, {name} | | {failures} | | |", scene.name);
        }
    }
    Ok(())
}

fn score(scene: &Scene, case: &SynthCase, method: Method) -> Option<Scores> {
    let mut params = Params::new(scene.input, method);
    params.robust.calibration = scene.off.map(|_| CalibrationPriors::DEFAULT);
    let mut pair = ViewPair::from(case.clone());
    if scene.exact_points {
        pair.points = Some(case.exact_points.clone());
    }
    let found = reconstruct(&pair, &params).ok()?;
    let curve = found.positions();
    let unit_per_px = unit_per_px(case);
    let scores = curve_scores(&curve, &case.truth, 0.5 * unit_per_px).ok()?;
    let table = table_scores(&curve, &case.truth).ok()?;
    Some(Scores {
        hausdorff: scores.hausdorff,
        overall: scores.overall,
        table_overall: table.overall,
        table_max: table.max_error,
        unit_per_px,
        suspect: !found.diagnostics.suspicions.is_empty(),
        floor: floor(case),
    })
}

fn floor(case: &SynthCase) -> Option<f64> {
    let triangulator = Triangulator::new(&case.rig, Triangulation::LindstromNiter2);
    let seen = |p: &Point3| {
        let (one, two) = case.true_rig.project(p).ok()?;
        triangulator.triangulate(one, two).ok()
    };
    let points: Vec<Point3> = case.truth.iter().filter_map(seen).collect();
    Some(table_scores(&points, &case.truth).ok()?.overall)
}

fn unit_per_px(case: &SynthCase) -> f64 {
    let depth = |camera: &Camera, points: &[Point3]| {
        let sum: f64 = points.iter().map(|p| camera.depth(p)).sum();
        sum / points.len() as f64 / camera.k()[(0, 0)].abs()
    };
    let truth = &case.truth;
    (depth(case.rig.camera1(), truth) + depth(case.rig.camera2(), truth)) / 2.0
}

struct Value {
    value: Option<f64>,
    text: String,
}

fn value(figure: Figure, scores: &[Option<Scores>]) -> Result<Value, Failure> {
    let px = |s: &Option<Scores>| s.map_or(f64::INFINITY, |s| s.hausdorff / s.unit_per_px);
    let wrong = |s: &&Option<Scores>| px(s) >= RIGHT_PX;
    let suspect = |s: &&Option<Scores>| s.is_none_or(|s| s.suspect);
    let fraction = |hits: usize, of: usize| -> Result<Value, Failure> {
        if of == 0 {
            return Ok(Value { value: None, text: "none".to_owned() });
        }
        let p = wilson_interval(hits, of)?;
        let text = format!("{:.3} [{:.3}, {:.3}] ({hits} of {of})", p.fraction, p.low, p.high);
        Ok(Value { value: Some(p.fraction), text })
    };
    let at = |values: Vec<f64>, q: f64| -> Result<Value, Failure> {
        let [middle, low, high] = interval_or_infinity(&values, q)?;
        Ok(Value { value: Some(middle), text: format!("{middle:.3} [{low:.3}, {high:.3}]") })
    };
    let mean = |value: fn(&Scores) -> f64| -> Result<Value, Failure> {
        let values: Vec<f64> = scores.iter().flatten().map(value).collect();
        let m = bootstrap_mean(&values, DEFAULT_RESAMPLES, "acceptance")?;
        let text = format!("{:.4} [{:.4}, {:.4}]", m.mean, m.low, m.high);
        Ok(Value { value: Some(m.mean), text })
    };
    let every = |value: fn(&Scores) -> f64| -> Vec<f64> {
        scores.iter().map(|s| s.as_ref().map_or(f64::INFINITY, value)).collect()
    };
    match figure {
        Figure::Right => fraction(scores.iter().filter(|s| !wrong(s)).count(), scores.len()),
        Figure::WrongFlagged => {
            let all = scores.iter().filter(wrong);
            fraction(all.clone().filter(suspect).count(), all.count())
        }
        Figure::RightFlagged => {
            let all = scores.iter().filter(|s| !wrong(s));
            fraction(all.clone().filter(suspect).count(), all.count())
        }
        Figure::HausdorffPx(q) => at(scores.iter().map(px).collect(), q),
        Figure::Hausdorff(q) => at(every(|s| s.hausdorff), q),
        Figure::MedianOverallPx => at(every(|s| s.overall / s.unit_per_px), 0.5),
        Figure::MeanOverallPx => mean(|s| s.overall / s.unit_per_px),
        Figure::MeanMaxPx => mean(|s| s.hausdorff / s.unit_per_px),
        Figure::TableOverall => mean(|s| s.table_overall),
        Figure::TableMax => mean(|s| s.table_max),
    }
}

/// The quantile of values of which some may be infinite, and its interval.
fn interval_or_infinity(values: &[f64], q: f64) -> Result<[f64; 3], Failure> {
    const FAR: f64 = 1e9;
    let bounded: Vec<f64> = values.iter().map(|v| v.min(FAR)).collect();
    let found = quantile_interval(&bounded, q)?;
    let far = |value: f64| if value > 0.5 * FAR { f64::INFINITY } else { value };
    Ok([found.value, found.low, found.high].map(far))
}
