use std::path::Path;

use accurate3d::eval::{self, curve_scores, reprojection_rms};
use accurate3d::geom::{LengthUnit, Point2, Point3, Polyline3, View1};
use accurate3d::io::{NamedView, PairParts, Truth, read_curve, read_mask, read_pair, read_points};
use accurate3d::seg::{Mask, Skeleton, zhang_suen};
use serde_json::{Value, json};

use crate::args::EvalArgs;
use crate::console::Console;
use crate::failure::Failure;
use crate::text::has_extension;
use crate::two_views::one_view;
use crate::units::common_unit;

/// `accurate eval`: the paper's scores and the point-to-polyline ones, as JSON.
pub fn run(args: &EvalArgs, console: &Console) -> Result<(), Failure> {
    if let Some(spacing) = args.spacing.filter(|spacing| !(*spacing > 0.0 && spacing.is_finite())) {
        let message = format!("--spacing is {spacing}; expected a positive length");
        return Err(Failure::new(Failure::USAGE, message));
    }
    if let (Some(option), None) = (args.stated.given(), &args.third) {
        return Err(Failure::new(Failure::USAGE, format!("{option} is for the file of --third"))
            .with_hint("curves and pair folders say it themselves: leave it out"));
    }
    let curve = read_curve(&args.curve)?;
    let truth = read_curve(&args.truth)?;
    let mut unit = common_unit(("the curve", curve.unit), ("the truth", truth.unit))?;
    let mut scores = table_scores(&curve.points, &truth.points)?;
    // A curve in disorder may be many times as long as the truth: its scores are poor, not missing.
    let [length, truth_length] = [&curve, &truth].map(|c| polyline_length(&c.points));
    let spacing = args.spacing.unwrap_or_else(|| (truth_length / 4000.0).max(length / 40_000.0));
    let polyline = curve_scores(&curve.points, &truth.points, spacing)?;
    scores["polyline"] = json!({
        "spacing": spacing,
        "accuracy": polyline.accuracy,
        "completeness": polyline.completeness,
        "overall": polyline.overall,
        "hausdorff": polyline.hausdorff,
        "percentile_95": polyline.percentile_95,
        "frechet": polyline.frechet,
        "length_error": polyline.length_error,
    });
    if let Some(dir) = &args.pair {
        let parts = PairParts { points: false, masks: false, images: false, truth: Truth::Ignore };
        let pair = read_pair(dir, parts)?;
        unit = common_unit(("the curve", unit), ("the pair", pair.rig.unit()))?;
        let rms = reprojection_rms(&curve.points, &truth.points, &pair.rig, spacing)?;
        scores["reprojection_rms_px"] = json!([rms.view1_px, rms.view2_px]);
    }
    if let (Some(camera), Some(seen)) = (&args.third, &args.seen) {
        let view = one_view(camera, args.view.as_deref(), &args.stated.defaults())?;
        scores["third_view"] = third_view(&curve.points, unit, (camera, &view), seen, spacing)?;
    }
    scores["unit"] = json!(unit.label());
    console.json(&scores)
}

/// How far the image of a curve lies from what a view shows that took no part, px.
fn third_view(
    curve: &[Point3],
    unit: LengthUnit,
    (camera, view): (&Path, &NamedView),
    seen: &Path,
    spacing: f64,
) -> Result<Value, Failure> {
    common_unit(("the curve", unit), ("the third view", view.unit))?;
    let is_csv = has_extension(seen, "csv");
    let shown: Vec<Point2> = if is_csv {
        let points = read_points::<View1>(seen)?;
        points
            .iter()
            .map(|p| view.camera.undistort(&p.point()))
            .collect::<Result<_, _>>()
            .map_err(|e| Failure::new(Failure::BAD_INPUT, format!("{}: {e}", seen.display())))?
    } else {
        let mask = read_mask(seen)?;
        view.check_size(seen, mask.dim())?;
        let skeleton = Skeleton::of(&zhang_suen(&Mask::from_array(mask)?))?;
        skeleton.pixels_as::<View1>().iter().map(|p| p.point()).collect()
    };
    let line = Polyline3::new(curve.to_vec())
        .and_then(|line| line.resample(spacing))
        .map_err(|e| Failure::new(Failure::BAD_INPUT, e.to_string()))?;
    let mut distances = Vec::with_capacity(line.points().len());
    for x in line.points() {
        let p = view.camera.project(x).map_err(|e| {
            Failure::new(Failure::BAD_INPUT, format!("{}: {e}", camera.display()))
                .with_hint("is this camera in the world of the curve?")
        })?;
        let nearest = shown.iter().map(|q| (q - p).norm()).min_by(f64::total_cmp);
        distances.extend(nearest);
    }
    distances.sort_unstable_by(f64::total_cmp);
    let mean = distances.iter().sum::<f64>() / distances.len() as f64;
    let at = |share: f64| distances[(share * (distances.len() - 1) as f64).round() as usize];
    Ok(json!({
        "camera": camera.display().to_string(),
        "mean_px": mean,
        "median_px": at(0.5),
        "percentile_95_px": at(0.95),
    }))
}

/// The paper's four scores.
pub fn table_scores(curve: &[Point3], truth: &[Point3]) -> Result<Value, Failure> {
    let s = eval::table_scores(curve, truth)?;
    Ok(json!({
        "accuracy": s.accuracy,
        "completeness": s.completeness,
        "overall": s.overall,
        "max_error": s.max_error,
    }))
}

fn polyline_length(points: &[Point3]) -> f64 {
    points.windows(2).map(|w| (w[1] - w[0]).norm()).sum()
}
