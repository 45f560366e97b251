use std::fmt::Write;

use accurate_geom::LengthUnit;

use super::ViewPlan;

const CELL: f64 = 16.0;
const LEFT: f64 = 70.0;
const TOP: f64 = 52.0;
const BAR: f64 = 18.0;

/// The expected error over the second view's angles as an SVG picture, logarithmic colours; grey where
/// a view does not see the shape. The same plan gives the same bytes.
pub fn heat_map_svg(plan: &ViewPlan, unit: LengthUnit) -> String {
    let (columns, rows) = (plan.primary_deg.len(), plan.secondary_deg.len());
    let (w, h) = (columns as f64 * CELL, rows as f64 * CELL);
    let width = (LEFT + w + 130.0).max(560.0);
    let height = TOP + h + 92.0;
    let ranked = plan.ranked();
    let error = |v: Option<f64>| v.unwrap_or(f64::NAN);
    let low = error(ranked.first().and_then(|v| v.expected_mean)).max(f64::MIN_POSITIVE);
    // What is thirty times as bad as the best is as bad as can be.
    let high = error(ranked.last().and_then(|v| v.expected_mean)).clamp(1.01 * low, 30.0 * low);
    let level = |e: f64| ((e / low).ln() / (high / low).ln()).clamp(0.0, 1.0);
    let mut svg = String::new();
    let _ = writeln!(
        svg,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" \
         font-family=\"sans-serif\" font-size=\"13\">\n<rect width=\"100%\" height=\"100%\" \
         fill=\"#ffffff\"/>\n<text x=\"{LEFT}\" y=\"26\" font-size=\"15\" fill=\"#111\">Expected \
         error of the curve over the second view, {unit} (mean along the curve)</text>"
    );
    // Secondary angles grow upwards.
    let y_of = |row: usize| TOP + (rows - 1 - row) as f64 * CELL;
    for (index, view) in plan.views.iter().enumerate() {
        let (row, column) = (index / columns, index % columns);
        let fill = match view.expected_mean {
            Some(e) => colour(level(e)),
            None => "#d9d9d4".to_owned(),
        };
        let _ = writeln!(
            svg,
            "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{CELL}\" height=\"{CELL}\" fill=\"{fill}\"/>",
            LEFT + column as f64 * CELL,
            y_of(row)
        );
    }
    axis(&mut svg, plan, w, h, &y_of);
    let place = |a: f64, b: f64| {
        let on = |v: f64, values: &[f64]| {
            let step = values.get(1).map_or(1.0, |second| second - values[0]);
            (v - values[0]) / step
        };
        (
            LEFT + (on(a, &plan.primary_deg) + 0.5) * CELL,
            TOP + h - (on(b, &plan.secondary_deg) + 0.5) * CELL,
        )
    };
    let (x, y) = place(plan.first_deg[0], plan.first_deg[1]);
    if (LEFT..=LEFT + w).contains(&x) && (TOP..=TOP + h).contains(&y) {
        let _ = writeln!(
            svg,
            "<path d=\"M{:.1} {:.1}l12 12m0 -12l-12 12\" stroke=\"#111\" stroke-width=\"2.5\"/>",
            x - 6.0,
            y - 6.0
        );
    }
    let mut caption = "cross: the first view; grey: it is not all seen, or not in depth".to_owned();
    if let Some(best) = ranked.first() {
        let (x, y) = place(best.primary_deg, best.secondary_deg);
        let _ = writeln!(
            svg,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"6\" fill=\"none\" stroke=\"#d4001a\" \
             stroke-width=\"2.5\"/>"
        );
        caption = format!(
            "ring: the best second view ({:.0}, {:.0}), {low:.3} {unit}; {caption}",
            best.primary_deg, best.secondary_deg
        );
        colour_bar(&mut svg, LEFT + w + 26.0, h, low, high);
    }
    let _ = writeln!(
        svg,
        "<text x=\"{LEFT}\" y=\"{:.1}\" fill=\"#333\">{caption}</text>\n<text x=\"{LEFT}\" \
         y=\"{:.1}\" fill=\"#333\">{}</text>\n</svg>",
        TOP + h + 62.0,
        TOP + h + 82.0,
        crate::NOT_FOR_CLINICAL_USE
    );
    svg
}

fn axis(svg: &mut String, plan: &ViewPlan, w: f64, h: f64, y_of: &impl Fn(usize) -> f64) {
    let every = |values: &[f64]| values.len().div_ceil(13).max(1);
    for (column, a) in plan.primary_deg.iter().enumerate().step_by(every(&plan.primary_deg)) {
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\" fill=\"#333\">{a:.0}</text>",
            LEFT + (column as f64 + 0.5) * CELL,
            TOP + h + 17.0
        );
    }
    for (row, b) in plan.secondary_deg.iter().enumerate().step_by(every(&plan.secondary_deg)) {
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\" fill=\"#333\">{b:.0}</text>",
            LEFT - 7.0,
            y_of(row) + 0.5 * CELL + 4.5
        );
    }
    let turn = if plan.is_c_arm {
        ["primary angle, degrees (LAO positive)", "secondary, degrees"]
    } else {
        ["turn about the image's vertical, degrees", "about the horizontal"]
    };
    let _ = writeln!(
        svg,
        "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\" fill=\"#111\">{}</text>\n\
         <text transform=\"translate(18 {:.1}) rotate(-90)\" text-anchor=\"middle\" \
         fill=\"#111\">{}</text>",
        LEFT + 0.5 * w,
        TOP + h + 38.0,
        turn[0],
        TOP + 0.5 * h,
        turn[1]
    );
}

fn colour_bar(svg: &mut String, x: f64, h: f64, low: f64, high: f64) {
    const PIECES: usize = 48;
    for piece in 0..PIECES {
        let level = piece as f64 / (PIECES - 1) as f64;
        let _ = writeln!(
            svg,
            "<rect x=\"{x:.1}\" y=\"{:.2}\" width=\"{BAR}\" height=\"{:.2}\" fill=\"{}\"/>",
            TOP + h * (1.0 - (piece + 1) as f64 / PIECES as f64),
            h / PIECES as f64 + 0.3,
            colour(level)
        );
    }
    for i in 0..5 {
        let level = f64::from(i) / 4.0;
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" fill=\"#333\">{:.3}</text>",
            x + BAR + 6.0,
            TOP + h * (1.0 - level) + 4.5,
            low * (high / low).powf(level)
        );
    }
}

/// From dark blue over green to yellow: even steps look even, also without colour vision.
///
/// # Source
/// Five colours of viridis (matplotlib, CC0), interpolated.
fn colour(level: f64) -> String {
    const KNOTS: [[f64; 3]; 5] = [
        [68.0, 1.0, 84.0],
        [59.0, 82.0, 139.0],
        [33.0, 145.0, 140.0],
        [94.0, 201.0, 98.0],
        [253.0, 231.0, 37.0],
    ];
    let x = level.clamp(0.0, 1.0) * 4.0;
    let low = (x.floor() as usize).min(3);
    let part = x - low as f64;
    // Rounded values are within 0 to 255.
    let mix = |c: usize| (KNOTS[low][c] + part * (KNOTS[low + 1][c] - KNOTS[low][c])).round() as u8;
    format!("#{:02x}{:02x}{:02x}", mix(0), mix(1), mix(2))
}
