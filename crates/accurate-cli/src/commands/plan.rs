use std::path::Path;

use accurate3d::NOT_FOR_CLINICAL_USE;
use accurate3d::geom::LengthUnit;
use accurate3d::io::{NamedView, read_curve};
use accurate3d::plan::{PlanError, PlanParams, PlannedView, ViewPlan, heat_map_svg, plan_views};
use serde_json::{Value, json};

use crate::args::PlanArgs;
use crate::console::Console;
use crate::failure::Failure;
use crate::raster::{is_picture, write_picture};
use crate::text::{has_extension, make_place_apart, write_text};
use crate::two_views::one_view;
use crate::units::common_unit;

/// Views that are printed.
const SHOWN: usize = 5;
/// Pixels of a PNG per unit of the heat map.
const PNG_SCALE: f32 = 2.0;

/// `accurate plan-views`: the error to expect over the angles of the second view.
pub fn run(args: &PlanArgs, console: &Console) -> Result<(), Failure> {
    for path in &args.out {
        if !is_picture(path) && !is_csv(path) {
            let message =
                format!("a plan is written as .svg, .png or .csv, not {}", path.display());
            return Err(Failure::new(Failure::USAGE, message));
        }
        make_place_apart(path, [&args.shape, &args.first])?;
    }
    let view = one_view(&args.first, args.view.as_deref(), &args.stated.defaults())?;
    let shape = read_curve(&args.shape)?;
    let unit = common_unit(("the shape", shape.unit), ("the first view", view.unit))?;
    let params = PlanParams {
        sigma_px: args.sigma_px,
        primary_deg: args.primary.0,
        secondary_deg: args.secondary.0,
        step_deg: args.step,
        ..PlanParams::DEFAULT
    };
    let plan = plan_views(&shape.points, &view.camera, &params)?;
    let ranked = plan.ranked();
    if ranked.is_empty() {
        return Err(Failure::new(
            Failure::BAD_INPUT,
            "no second view in these ranges sees all of the shape in depth",
        )
        .with_hint("widen --primary and --secondary, or give the part of the body that matters"));
    }
    for path in &args.out {
        if is_csv(path) {
            write_text(path, &csv(&plan, unit))?;
        } else {
            write_picture(path, &heat_map_svg(&plan, unit), PNG_SCALE)?;
        }
    }
    if console.json {
        return console.json(&as_json(&plan, &ranked, unit, &view));
    }
    let [a, b] = plan.first_deg;
    console.data(&format!("first view `{}` at ({a:.1}, {b:.1}) degrees", view.name))?;
    for view in ranked.iter().take(SHOWN) {
        console.data(&line(view, unit))?;
    }
    if let Some(worst) = ranked.last() {
        console.data(&format!("worst of {}: {}", ranked.len(), line(worst, unit)))?;
    }
    console.remark(NOT_FOR_CLINICAL_USE);
    Ok(())
}

fn is_csv(path: &Path) -> bool {
    has_extension(path, "csv")
}

fn line(view: &PlannedView, unit: LengthUnit) -> String {
    format!(
        "second view ({:.0}, {:.0}), {:.0} degrees apart: expected error {:.3} {unit}, worst place \
         {:.3} {unit}",
        view.primary_deg,
        view.secondary_deg,
        view.apart_deg,
        view.expected_mean.unwrap_or(f64::NAN),
        view.expected_max.unwrap_or(f64::NAN),
    )
}

fn csv(plan: &ViewPlan, unit: LengthUnit) -> String {
    let mut csv = format!(
        "primary_deg,secondary_deg,apart_deg,seen,expected_mean[{unit}],expected_max[{unit}]\n"
    );
    for view in &plan.views {
        let number = |value: Option<f64>| value.map(|v| format!("{v:?}")).unwrap_or_default();
        csv.push_str(&format!(
            "{},{},{:?},{:?},{},{}\n",
            view.primary_deg,
            view.secondary_deg,
            view.apart_deg,
            view.seen,
            number(view.expected_mean),
            number(view.expected_max)
        ));
    }
    csv
}

fn as_json(plan: &ViewPlan, ranked: &[PlannedView], unit: LengthUnit, view: &NamedView) -> Value {
    let described = |view: &PlannedView| {
        json!({
            "primary_deg": view.primary_deg,
            "secondary_deg": view.secondary_deg,
            "apart_deg": view.apart_deg,
            "expected_mean": view.expected_mean,
            "expected_max": view.expected_max,
        })
    };
    json!({
        "first": {"name": view.name, "angles_deg": plan.first_deg},
        "c_arm": plan.is_c_arm,
        "unit": unit.label(),
        "best": ranked.iter().take(SHOWN).map(described).collect::<Vec<_>>(),
        "worst": ranked.last().map(described),
        "views": plan.views.len(),
        "note": NOT_FOR_CLINICAL_USE,
    })
}

impl From<PlanError> for Failure {
    fn from(error: PlanError) -> Self {
        let code = match error {
            PlanError::BadParameter { .. } => Self::USAGE,
            _ => Self::BAD_INPUT,
        };
        Self::new(code, error.to_string())
    }
}
