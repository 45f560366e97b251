//! How the kernels grow: least processor times over sizes, the exponents fitted to them, and a plot.
//!
//! `growth FILE.json FILE.svg` writes both. Takes about a minute on a quiet machine.
#![allow(clippy::print_stdout, clippy::print_stderr)]

use std::error::Error;
use std::hint::black_box;
use std::path::Path;
use std::process::ExitCode;
use std::time::Duration;

use accurate_eval::{polyline_distances, table_scores};
use accurate_geom::{Pixel, Point3, Triangulation, Triangulator, View2};
use accurate_match::{CostModel, DistanceKind, TieOrder, align_curves};
use accurate_seg::zhang_suen;
use accurate_speed::{Wire, wire_mask};
use cpu_time::ProcessTime;
use plotters::prelude::*;
use serde_json::{Value, json};

type Failure = Box<dyn Error>;

const POINTS: [usize; 7] = [256, 512, 1024, 2048, 4096, 8192, 16_384];
const SIDES: [usize; 5] = [256, 512, 1024, 2048, 4096];

/// Every size runs at least this long in all, and at least three times.
const ENOUGH: Duration = Duration::from_millis(150);
const LEAST_RUNS: usize = 3;

/// A kernel over its sizes.
#[derive(Clone)]
struct Growth {
    name: &'static str,
    /// What a size counts.
    unit: &'static str,
    /// Size, least processor time in seconds.
    times: Vec<(usize, f64)>,
}

impl Growth {
    /// The exponent of the power law through the upper half of the sizes, by least squares in the
    /// logarithms: what the fixed costs of small inputs do not bend.
    fn exponent(&self) -> f64 {
        let upper = &self.times[self.times.len() / 2..];
        let logs: Vec<(f64, f64)> = upper.iter().map(|&(n, t)| ((n as f64).ln(), t.ln())).collect();
        let count = logs.len() as f64;
        let (mean_x, mean_y) = (
            logs.iter().map(|p| p.0).sum::<f64>() / count,
            logs.iter().map(|p| p.1).sum::<f64>() / count,
        );
        let covariance: f64 = logs.iter().map(|p| (p.0 - mean_x) * (p.1 - mean_y)).sum();
        covariance / logs.iter().map(|p| (p.0 - mean_x).powi(2)).sum::<f64>()
    }

    fn json(&self) -> Value {
        let times: Vec<Value> =
            self.times.iter().map(|&(n, t)| json!({"size": n, "least_ms": 1e3 * t})).collect();
        json!({"kernel": self.name, "size": self.unit, "exponent": self.exponent(), "times": times})
    }
}

fn main() -> ExitCode {
    let files: Vec<String> = std::env::args().skip(1).collect();
    let done = match &files[..] {
        [numbers, picture] => run(Path::new(numbers), Path::new(picture)),
        _ => Err("usage: growth FILE.json FILE.svg".into()),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("{failure}");
            ExitCode::FAILURE
        }
    }
}

fn run(numbers: &Path, picture: &Path) -> Result<(), Failure> {
    let growths = [points()?, masks()?].concat();
    for growth in &growths {
        println!("{:<34} {} ^ {:.2}", growth.name, growth.unit, growth.exponent());
    }
    let all: Vec<Value> = growths.iter().map(Growth::json).collect();
    std::fs::write(numbers, format!("{:#}\n", Value::from(all)))?;
    plot(picture, &growths)
}

fn least_time<T>(mut work: impl FnMut() -> Result<T, Failure>) -> Result<f64, Failure> {
    black_box(work()?);
    let (mut least, mut total, mut runs) = (Duration::MAX, Duration::ZERO, 0);
    while runs < LEAST_RUNS || total < ENOUGH {
        let start = ProcessTime::try_now()?;
        let answer = work()?;
        let time = start.try_elapsed()?;
        drop(black_box(answer));
        least = least.min(time);
        total += time;
        runs += 1;
    }
    Ok(least.as_secs_f64())
}

fn points() -> Result<Vec<Growth>, Failure> {
    let wire = Wire::new()?;
    let f = wire.rig().fundamental();
    let names = [
        "ECDP, one wire in both views",
        "ECDP, curves apart: all cells",
        "triangulation, Lindstrom",
        "triangulation, DLT",
        "nearest points, both ways",
        "nearest segments, both ways",
    ];
    let mut growths = names.map(|name| Growth { name, unit: "points", times: Vec::new() });
    for n in POINTS {
        let (one, two) = wire.curves(n, true)?;
        // Far from every epipolar line that it could belong to: nothing can be left out.
        let apart: Vec<Pixel<View2>> =
            two.iter().map(|p| Pixel::new(p.x + 300.0, p.y + 300.0)).collect();
        let align = |two: &[Pixel<View2>]| -> Result<_, Failure> {
            let costs = CostModel::new(f, &one, two, DistanceKind::View1)?;
            Ok(align_curves(&costs, TieOrder::UpLeftDiagonal)?)
        };
        let triangulate = |method| {
            let triangulator = Triangulator::new(wire.rig(), method);
            let (one, two) = (&one, &two);
            move || Ok(triangulator.triangulate_all(one.iter().copied().zip(two.iter().copied())))
        };
        let truth = wire.points(n);
        let curve: Vec<Point3> = truth.iter().map(|p| p + (p.coords.yzx() * 1e-3)).collect();
        let times = [
            least_time(|| align(&two))?,
            least_time(|| align(&apart))?,
            least_time(triangulate(Triangulation::LindstromNiter2))?,
            least_time(triangulate(Triangulation::Dlt))?,
            least_time(|| Ok(table_scores(&curve, &truth)?))?,
            least_time(|| {
                Ok((polyline_distances(&curve, &truth)?, polyline_distances(&truth, &curve)?))
            })?,
        ];
        for (growth, time) in growths.iter_mut().zip(times) {
            growth.times.push((n, time));
        }
    }
    Ok(growths.into())
}

fn masks() -> Result<Vec<Growth>, Failure> {
    let mut growth = Growth { name: "thinning, wire of 6 px", unit: "side", times: Vec::new() };
    for side in SIDES {
        let mask = wire_mask(side)?;
        growth.times.push((side, least_time(|| Ok(zhang_suen(&mask)))?));
    }
    Ok(vec![growth])
}

fn plot(file: &Path, growths: &[Growth]) -> Result<(), Failure> {
    let times = growths.iter().flat_map(|g| &g.times);
    let (low, high) = times.fold((f64::INFINITY, 0.0_f64), |(low, high), &(_, t)| {
        (low.min(1e3 * t), high.max(1e3 * t))
    });
    let area = SVGBackend::new(file, (860, 560)).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .margin(16)
        .x_label_area_size(44)
        .y_label_area_size(64)
        .build_cartesian_2d((200.0..20_000.0).log_scale(), (low / 2.0..high * 2.0).log_scale())?;
    chart
        .configure_mesh()
        .x_desc("points, or side of the mask in px")
        .y_desc("least processor time, ms")
        .light_line_style(TRANSPARENT)
        .draw()?;
    for (k, growth) in growths.iter().enumerate() {
        let colour = Palette99::pick(k).to_rgba();
        let curve = growth.times.iter().map(|&(n, t)| (n as f64, 1e3 * t));
        chart
            .draw_series(LineSeries::new(curve.clone(), colour.stroke_width(2)))?
            .label(format!("{}: ^{:.2}", growth.name, growth.exponent()))
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(2)));
        chart.draw_series(curve.map(|at| Circle::new(at, 3, colour.filled())))?;
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperLeft)
        .background_style(WHITE.mix(0.9))
        .border_style(BLACK.mix(0.3))
        .draw()?;
    area.present()?;
    Ok(())
}
