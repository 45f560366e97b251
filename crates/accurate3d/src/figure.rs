use std::fmt::{self, Write};
use std::str::FromStr;

use accurate_geom::{Camera, Point2};

use crate::picture::{
    PANEL, curve_panel, escape, mask_runs, plane_panel, polyline, titled_frame, view_panel,
};
use crate::report::cost_url;
use crate::{
    Error, InputKind, Method, NOT_FOR_CLINICAL_USE, Params, Reconstruction, UnknownName, ViewPair,
    reconstruct,
};

/// The paper's kinds of figure, drawn from our own data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FigureKind {
    /// From two masks to the 3D curve, step by step.
    Overview,
    /// The order that the paper's traversal (GCTT) and ours give to the same masks.
    Gctt,
    /// Epipolar distances of all pairs of points, and the pairs that the paper's matching (ECDP)
    /// chose.
    Ecdp,
    /// Curves of several methods on the truth, simulated cases.
    Simulation,
    /// The same on the phantom's stand-in.
    Phantom,
}

impl FigureKind {
    /// Every kind.
    pub const ALL: [Self; 5] =
        [Self::Overview, Self::Gctt, Self::Ecdp, Self::Simulation, Self::Phantom];

    /// The name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Overview => "overview",
            Self::Gctt => "gctt",
            Self::Ecdp => "ecdp",
            Self::Simulation => "simulation",
            Self::Phantom => "phantom",
        }
    }
}

impl fmt::Display for FigureKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for FigureKind {
    type Err = UnknownName;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        Self::ALL.into_iter().find(|k| k.name() == name).ok_or_else(|| UnknownName {
            what: "figure",
            name: name.to_owned(),
            expected: Self::ALL.map(Self::name).join(", "),
        })
    }
}

/// What the comparing figures show, top to bottom.
const ROWS: [(Method, InputKind); 4] = [
    (Method::BaertTable, InputKind::Points),
    (Method::HoffmannTable, InputKind::Points),
    (Method::Paper, InputKind::Mask),
    (Method::Accurate, InputKind::Mask),
];

const GAP: f64 = 18.0;
/// A panel with its title.
const CELL: f64 = PANEL + 48.0;

/// Draws a figure as SVG. `cases` need masks and points; the first is the one shown where a figure
/// shows one. The same input gives the same bytes.
///
/// # Errors
/// [`Error::NoCase`] without a case; [`Error`] of a method that gives no curve where the figure is
/// about that method. In the comparing figures such a cell says why it is empty.
pub fn figure_svg(kind: FigureKind, cases: &[ViewPair]) -> Result<String, Error> {
    let first = cases.first().ok_or(Error::NoCase)?;
    match kind {
        FigureKind::Overview => overview(first),
        FigureKind::Gctt => gctt(first),
        FigureKind::Ecdp => ecdp(first),
        FigureKind::Simulation | FigureKind::Phantom => Ok(comparison(kind, cases)),
    }
}

fn run(pair: &ViewPair, method: Method, input: InputKind) -> Result<Reconstruction, Error> {
    reconstruct(pair, &Params::new(input, method))
}

/// Panels in rows, each drawn at the origin.
struct Sheet {
    body: String,
    columns: usize,
    rows: usize,
}

impl Sheet {
    fn new() -> Self {
        Self { body: String::new(), columns: 0, rows: 0 }
    }

    fn panel(&mut self, row: usize, column: usize, draw: impl FnOnce(&mut String)) {
        (self.rows, self.columns) = (self.rows.max(row + 1), self.columns.max(column + 1));
        let (x, y) = (GAP + column as f64 * (PANEL + GAP), row as f64 * CELL);
        let _ = writeln!(self.body, "<g transform=\"translate({x:.1} {y:.1})\">");
        draw(&mut self.body);
        self.body.push_str("</g>\n");
    }

    fn finish(self, caption: &str) -> String {
        let width = GAP + self.columns as f64 * (PANEL + GAP);
        let height = self.rows as f64 * CELL + 30.0;
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
             font-family=\"sans-serif\" font-size=\"14\">\n<rect width=\"100%\" height=\"100%\" \
             fill=\"#ffffff\"/>\n{}<text x=\"{GAP}\" y=\"{:.1}\" fill=\"#333\">{} {}</text>\n</svg>\n",
            self.body,
            height - 10.0,
            escape(caption),
            NOT_FOR_CLINICAL_USE,
        )
    }
}

fn traces(r: &Reconstruction) -> [Vec<Point2>; 2] {
    [
        r.traces.points1.iter().map(|p| p.point()).collect(),
        r.traces.points2.iter().map(|p| p.point()).collect(),
    ]
}

fn cameras(pair: &ViewPair) -> [&Camera; 2] {
    [pair.rig.camera1(), pair.rig.camera2()]
}

fn overview(pair: &ViewPair) -> Result<String, Error> {
    let r = run(pair, Method::Accurate, InputKind::Mask)?;
    let (mut sheet, traces) = (Sheet::new(), traces(&r));
    for (k, camera) in cameras(pair).into_iter().enumerate() {
        let mask = pair.masks.as_ref().map(|masks| &masks[k]);
        sheet.panel(k, 0, |svg| view_panel(svg, 0.0, k + 1, camera, mask, &[]));
        sheet.panel(k, 1, |svg| ordered(svg, "in order", pair, k, &traces[k]));
    }
    sheet.panel(0, 2, |svg| pairs(svg, pair, &r));
    sheet.panel(1, 2, |svg| curve_panel(svg, 0.0, pair, &r));
    Ok(sheet.finish(&format!(
        "{}: masks, ordered curves, correspondences, 3D curve ({}).",
        r.id, r.method
    )))
}

fn gctt(pair: &ViewPair) -> Result<String, Error> {
    let mut sheet = Sheet::new();
    for (row, method) in [Method::Paper, Method::Accurate].into_iter().enumerate() {
        let r = run(pair, method, InputKind::Mask)?;
        for (k, trace) in traces(&r).iter().enumerate() {
            let title = match method {
                Method::Paper => format!(
                    "GCTT, {} jumps over 3 px, {:.1} % covered",
                    r.traces.jumps[k],
                    100.0 * r.traces.coverage[k]
                ),
                _ => format!("accurate, {:.1} % covered", 100.0 * r.traces.coverage[k]),
            };
            sheet.panel(row, k, |svg| ordered(svg, &title, pair, k, trace));
        }
    }
    Ok(sheet.finish(&format!("{}: order along the body, blue to yellow.", pair.id)))
}

fn ecdp(pair: &ViewPair) -> Result<String, Error> {
    let input = if pair.points.is_some() { InputKind::Points } else { InputKind::Mask };
    let r = run(pair, Method::Paper, input)?;
    let url = cost_url(&r.traces, &pair.rig)?;
    let mut sheet = Sheet::new();
    sheet.panel(0, 0, |svg| {
        let (n1, n2) = (r.traces.points1.len(), r.traces.points2.len());
        titled_frame(svg, 0.0, &format!("{n1} x {n2} epipolar distances, black 0, white 12 px"));
        let _ = writeln!(
            svg,
            "<image href=\"{url}\" x=\"0\" y=\"30\" width=\"{PANEL}\" height=\"{PANEL}\" \
             preserveAspectRatio=\"none\"/>"
        );
        // Matched pixels are trace points as they are.
        let place = |p: &accurate_match::CurvePoint| {
            let i = r.traces.points1.iter().position(|q| *q == p.pixel1)?;
            let j = r.traces.points2.iter().position(|q| *q == p.pixel2)?;
            let at = |index: usize, count: usize| (index as f64 + 0.5) / count as f64 * PANEL;
            Some((at(j, n2), 30.0 + at(i, n1)))
        };
        polyline(svg, r.points.iter().filter_map(place), "#e8590c", 2.0);
    });
    sheet.panel(0, 1, |svg| pairs(svg, pair, &r));
    sheet.panel(0, 2, |svg| curve_panel(svg, 0.0, pair, &r));
    Ok(sheet.finish(&format!(
        "{}: ECDP, mean epipolar distance {:.2} px.",
        r.id, r.diagnostics.mean_epipolar_distance_px
    )))
}

fn comparison(kind: FigureKind, cases: &[ViewPair]) -> String {
    let mut sheet = Sheet::new();
    for (column, pair) in cases.iter().enumerate() {
        for (row, (method, input)) in ROWS.into_iter().enumerate() {
            let name = format!("{method}, {input}");
            match run(pair, method, input) {
                Ok(r) => {
                    let curve = r.positions();
                    let truth = pair.truth.as_deref().unwrap_or(&[]);
                    let title = match accurate_eval::table_scores(&curve, truth) {
                        Ok(s) => format!(
                            "{name}: Overall {:.3}, Max Err {:.2} {}",
                            s.overall, s.max_error, r.unit
                        ),
                        Err(_) => name,
                    };
                    sheet.panel(row, column, |svg| {
                        plane_panel(svg, 0.0, &title, truth, &curve, r.unit);
                    });
                }
                Err(error) => sheet.panel(row, column, |svg| {
                    titled_frame(svg, 0.0, &name);
                    let reason: String = error.to_string().chars().take(60).collect();
                    let _ = writeln!(
                        svg,
                        "<text x=\"12\" y=\"60\" fill=\"#b02a37\">{}</text>",
                        escape(&reason)
                    );
                }),
            }
        }
    }
    let ids: Vec<&str> = cases.iter().map(|pair| pair.id.as_str()).collect();
    sheet.finish(&format!("{kind}: curve (orange) on truth (grey); {}.", ids.join(", ")))
}

/// A trace over its mask, coloured by its order.
fn ordered(svg: &mut String, what: &str, pair: &ViewPair, view: usize, trace: &[Point2]) {
    let scale = open_view(svg, &format!("View {}, {what}", view + 1), pair, view);
    const STRETCHES: usize = 48;
    for k in 0..STRETCHES {
        let (from, to) = (k * trace.len() / STRETCHES, (k + 1) * trace.len() / STRETCHES);
        let to = (to + 1).min(trace.len());
        if from < to {
            let stretch = trace[from..to].iter().map(|p| (p.x, p.y));
            polyline(svg, stretch, &colour(k as f64 / (STRETCHES - 1) as f64), 2.2 / scale);
        }
    }
    svg.push_str("</g>\n");
}

/// Some matched pixels of both views, those of view 2 beside view 1, joined.
fn pairs(svg: &mut String, pair: &ViewPair, r: &Reconstruction) {
    titled_frame(svg, 0.0, "correspondences, view 1 left, view 2 right");
    const JOINED: usize = 36;
    let half = PANEL / 2.0;
    let place = |p: Point2, view: usize| {
        let size = cameras(pair)[view].size();
        let scale = half / f64::from(size.width.max(size.height));
        let top = 30.0 + (PANEL - f64::from(size.height) * scale) / 2.0;
        (view as f64 * half + p.x * scale, top + p.y * scale)
    };
    for (k, trace) in traces(r).iter().enumerate() {
        polyline(svg, trace.iter().map(|p| place(*p, k)), "#868e96", 1.4);
    }
    let last = r.points.len() - 1;
    for k in 0..JOINED {
        let point = &r.points[k * last / (JOINED - 1)];
        let ends = [place(point.pixel1.point(), 0), place(point.pixel2.point(), 1)];
        polyline(svg, ends.into_iter(), &colour(k as f64 / (JOINED - 1) as f64), 0.9);
    }
}

/// Frame, mask and the pixel grid of a view; the caller closes the group. Returns px on paper per px.
fn open_view(svg: &mut String, title: &str, pair: &ViewPair, view: usize) -> f64 {
    titled_frame(svg, 0.0, title);
    let size = cameras(pair)[view].size();
    let scale = PANEL / f64::from(size.width.max(size.height));
    let x0 = (PANEL - f64::from(size.width) * scale) / 2.0;
    let _ = writeln!(
        svg,
        "<g transform=\"translate({x0:.3} 30) scale({scale:.6}) translate(0.5 0.5)\">\n\
         <rect x=\"-0.5\" y=\"-0.5\" width=\"{}\" height=\"{}\" fill=\"#f4f4f1\"/>",
        size.width, size.height
    );
    if let Some(masks) = &pair.masks {
        let _ = writeln!(svg, "<path d=\"{}\" fill=\"#d5d5cf\"/>", mask_runs(&masks[view]));
    }
    scale
}

/// Blue to yellow, even to the eye (the ends and the middle of cividis).
fn colour(t: f64) -> String {
    const STOPS: [[f64; 3]; 4] =
        [[0.0, 45.0, 115.0], [86.0, 92.0, 108.0], [165.0, 151.0, 116.0], [240.0, 205.0, 30.0]];
    let x = t.clamp(0.0, 1.0) * 3.0;
    let k = (x as usize).min(2);
    let [r, g, b] = [0, 1, 2]
        .map(|c| (STOPS[k][c] + (STOPS[k + 1][c] - STOPS[k][c]) * (x - k as f64)).round() as u8);
    format!("#{r:02x}{g:02x}{b:02x}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use accurate_synth::{CaseOptions, Family, generate};

    #[test]
    fn every_figure_is_the_same_twice_and_well_formed() {
        let cases: Vec<ViewPair> = (0..2)
            .map(|i| generate(Family::Easy, 1700, i, &CaseOptions::default()).unwrap().into())
            .collect();
        for kind in FigureKind::ALL {
            let svg = figure_svg(kind, &cases).unwrap();
            assert_eq!(svg, figure_svg(kind, &cases).unwrap(), "{kind}");
            assert_eq!(svg.matches("<g ").count(), svg.matches("</g>").count(), "{kind}");
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{kind}");
            assert!(svg.contains("not for clinical use"), "{kind}");
        }
        let both = figure_svg(FigureKind::Simulation, &cases).unwrap();
        assert_eq!(both.matches("Overall").count(), ROWS.len() * cases.len());
    }

    #[test]
    fn no_case_is_an_error() {
        assert!(matches!(figure_svg(FigureKind::Overview, &[]), Err(Error::NoCase)));
    }

    #[test]
    fn the_ramp_ends_where_it_says() {
        assert_eq!(colour(0.0), "#002d73");
        assert_eq!(colour(1.0), "#f0cd1e");
    }
}
