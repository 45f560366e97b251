use accurate3d::eval::{self, curve_scores, reprojection_rms};
use accurate3d::geom::Point3;
use accurate3d::io::{PairParts, Truth, read_curve, read_pair};
use serde_json::{Value, json};

use crate::args::EvalArgs;
use crate::console::Console;
use crate::failure::Failure;

/// `accurate eval`: the paper's scores and the point-to-polyline ones, as JSON.
pub fn run(args: &EvalArgs, console: &Console) -> Result<(), Failure> {
    let curve = read_curve(&args.curve)?;
    let truth = read_curve(&args.truth)?;
    let mut scores = table_scores(&curve.points, &truth.points)?;
    scores["unit"] = json!(curve.unit.label());
    let spacing = args.spacing.unwrap_or_else(|| polyline_length(&truth.points) / 4000.0);
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
        let rms = reprojection_rms(&curve.points, &truth.points, &pair.rig, spacing)?;
        scores["reprojection_rms_px"] = json!([rms.view1_px, rms.view2_px]);
    }
    console.json(&scores)
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
