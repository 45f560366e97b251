use std::fmt::Write;

use accurate3d::geom::{Point2, View, View1};
use accurate3d::io::read_mask;
use accurate3d::seg::{Mask, Skeleton, zhang_suen};
use accurate3d::traverse::{TraverseParams, trace_single};
use accurate3d::{Error, MaskTrace, trace_mask};
use ndarray::Array2;
use serde_json::{Value, json};

use crate::args::{TraceArgs, TraceMethod};
use crate::console::Console;
use crate::failure::Failure;
use crate::text::{make_place_apart, write_text};

/// `accurate trace`: a mask's skeleton in order, as `x,y` lines.
pub fn run(args: &TraceArgs, console: &Console) -> Result<(), Failure> {
    if let Some(path) = &args.out {
        make_place_apart(path, [&args.mask])?;
    }
    let traced = ordered(&read_mask(&args.mask)?, args.method)
        .map_err(|failure| failure.of_file(&args.mask))?;
    let mut csv = String::from("x,y\n");
    for p in &traced.points {
        let _ = writeln!(csv, "{},{}", p.x, p.y);
    }
    if let Some(path) = &args.out {
        write_text(path, &csv)?;
    }
    match (console.json, &args.out) {
        (true, _) => console.json(&traced.report)?,
        (false, None) => console.data(csv.trim_end())?,
        (false, Some(_)) => {}
    }
    traced.details.iter().for_each(|line| console.detail(line));
    console.remark(&traced.summary);
    Ok(())
}

/// A centreline in order, and what is said about it.
struct Ordered {
    points: Vec<Point2>,
    summary: String,
    details: Vec<String>,
    report: Value,
}

fn ordered(mask: &Array2<bool>, method: TraceMethod) -> Result<Ordered, Failure> {
    match method {
        TraceMethod::Accurate => Ok(described(cheapest_walk::<View1>(mask)?)),
        TraceMethod::Paper => greedy(mask),
    }
}

/// The mask of view `V` by [`trace_mask`], with errors that name no case.
pub fn cheapest_walk<V: View>(mask: &Array2<bool>) -> Result<MaskTrace, Failure> {
    trace_mask::<V>(mask, "mask").map_err(|error| match error {
        Error::Segmentation { source, .. } => source.into(),
        Error::Traversal { source, .. } => source.into(),
        other => other.into(),
    })
}

fn described(trace: MaskTrace) -> Ordered {
    let MaskTrace { points, closed, coverage, bridges, margin, junctions } = trace;
    let mut summary = format!(
        "{} points{}, coverage {:.1} %, {} decisions, {bridges} bridges",
        points.len(),
        if closed { " of a closed curve" } else { "" },
        100.0 * coverage,
        junctions.len()
    );
    // Where nothing was decided the next walk only turns round at a tip.
    if let Some(margin) = margin.filter(|_| !junctions.is_empty()) {
        let _ = write!(summary, "; the next walk is dearer by {margin:.2}");
    }
    let details = junctions
        .iter()
        .map(|junction| {
            let [x, y] = junction.at;
            let others: Vec<String> = junction
                .alternatives
                .iter()
                .map(|other| format!("{} for {:.2}", other.way, other.price))
                .collect();
            let others = if others.is_empty() { "nothing".into() } else { others.join(", ") };
            let (taken, price) = (&junction.taken, junction.price);
            format!("at {x:.0}, {y:.0}: {taken} for {price:.2}, not {others}")
        })
        .collect();
    let report = json!({
        "method": "accurate",
        "points": coordinates(&points),
        "closed": closed,
        "coverage": coverage,
        "bridges": bridges,
        "margin": margin,
        "junctions": junctions,
    });
    Ordered { points, summary, details, report }
}

fn greedy(mask: &Array2<bool>) -> Result<Ordered, Failure> {
    let skeleton = Skeleton::of(&zhang_suen(&Mask::from_array(mask.clone())?))?;
    let trace = trace_single(&skeleton.pixels_as::<View1>(), &TraverseParams::PAPER)?;
    let points: Vec<Point2> = trace.points.iter().map(|p| p.point()).collect();
    let (count, jumps) = (points.len(), trace.jumps.len());
    let summary = format!(
        "{count} points, coverage {:.1} %, {jumps} jumps over 3 px",
        100.0 * trace.coverage
    );
    let report = json!({
        "method": "paper",
        "points": coordinates(&points),
        "coverage": trace.coverage,
        "jumps": jumps,
    });
    Ok(Ordered { points, summary, details: Vec::new(), report })
}

fn coordinates(points: &[Point2]) -> Vec<[f64; 2]> {
    points.iter().map(|p| [p.x, p.y]).collect()
}
