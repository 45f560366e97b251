use std::path::{Path, PathBuf};

use accurate3d::NOT_FOR_CLINICAL_USE;
use accurate3d::doctor::{
    CANNOT_BE_TOLD, Diagnosis, DoctorError, Finding, LEAST_PLACES, Mistake, Seen, Verdict, diagnose,
};
use accurate3d::geom::{Camera, LengthUnit, Point2, Rig, View, View1, View2};
use accurate3d::io::{
    NamedView, PairParts, Truth, find_pairs, read_mask, read_pair, read_points, write_rig,
};
use ndarray::Array2;
use serde_json::{Value, json};

use super::trace::cheapest_walk;
use crate::args::DoctorArgs;
use crate::console::Console;
use crate::failure::Failure;
use crate::text::{has_extension, make_place_apart};
use crate::two_views::{NEVER_THE_SAME, two_cameras};

/// `accurate camera doctor`: what is wrong with two cameras, by what was seen with them.
pub fn run(args: &DoctorArgs, console: &Console) -> Result<(), Failure> {
    if let Some(path) = &args.out {
        if !["toml", "json"].iter().any(|extension| has_extension(path, extension)) {
            let message = format!("a rig is written as .toml or .json, not as {}", path.display());
            return Err(Failure::new(Failure::USAGE, message));
        }
        let seen = [&args.matched, &args.points, &args.masks].into_iter().flatten();
        make_place_apart(path, args.files.iter().chain(seen))?;
    }
    let (views, seen) = examined(args)?;
    let unit = common_unit(&views)?;
    let cameras = [views[0].camera.clone(), views[1].camera.clone()];
    let Some(seen) = seen else {
        console.data(&described(&views))?;
        console.remark(
            "nothing was seen with them: give --matched, --points or --masks to have the mistakes tried",
        );
        return Ok(());
    };
    let diagnosis = diagnose(&cameras, unit, &seen)?;
    if let Some(path) = &args.out {
        let [one, two] = &diagnosis.mended;
        let rig = Rig::new(one.clone(), two.clone(), unit)
            .map_err(|e| Failure::new(Failure::BAD_INPUT, format!("the mended rig: {e}")))?;
        write_rig(path, &rig).map_err(Failure::of_output)?;
    }
    if console.json {
        console.json(&as_json(&views, &diagnosis))?;
    } else {
        console.data(&described(&views))?;
        console.data(&as_text(&diagnosis, &seen))?;
        if let Some(path) = &args.out {
            console.remark(&format!("the mended cameras: {}", path.display()));
        }
    }
    if args.strict && (diagnosis.verdict != Verdict::Sound || !diagnosis.remarks.is_empty()) {
        return Err(Failure::new(Failure::SUSPECT, "the cameras are not sound"));
    }
    Ok(())
}

/// The two cameras, and what was seen with them.
fn examined(args: &DoctorArgs) -> Result<([NamedView; 2], Option<Seen>), Failure> {
    let usage = |what: &str| Failure::new(Failure::USAGE, what);
    let kinds = [&args.matched, &args.points, &args.masks];
    if kinds.iter().filter(|files| !files.is_empty()).count() > 1 {
        return Err(usage("--matched, --points and --masks are three kinds of the same: give one"));
    }
    let named = !kinds.iter().all(|files| files.is_empty());
    let folders = args.files.iter().all(|f| f.is_dir() && !f.join("cameras.txt").is_file());
    if folders {
        let views = (!args.views.is_empty()).then_some("--views");
        if let Some(option) = views.or(args.stated.given()) {
            return Err(usage(&format!(
                "{option} is for camera files; a pair folder says it itself"
            ))
            .with_hint("leave it out, or name the camera files and what was seen with them"));
        }
        let (views, seen) = of_pair_folders(&args.files)?;
        let seen = if named { of_files(args, &views)? } else { seen };
        return Ok((views, seen));
    }
    let views = two_cameras(&args.files, &args.views, &args.stated.defaults())?;
    if views[0].camera == views[1].camera {
        let message = format!("`{}` and `{}` are the same camera", views[0].name, views[1].name);
        return Err(Failure::new(Failure::USAGE, message)
            .with_hint("two views of two places are examined: is one file named twice?"));
    }
    let seen = of_files(args, &views)?;
    Ok((views, seen))
}

/// What the options name, as the cameras see it.
fn of_files(args: &DoctorArgs, views: &[NamedView; 2]) -> Result<Option<Seen>, Failure> {
    if !args.matched.is_empty() {
        let mut pairs = Vec::new();
        for files in args.matched.chunks_exact(2) {
            let [one, two] = [points_of(&files[0])?, points_of(&files[1])?];
            if one.len() != two.len() {
                let message = format!(
                    "{} has {} points, {} has {}",
                    files[0].display(),
                    one.len(),
                    files[1].display(),
                    two.len()
                );
                return Err(Failure::new(Failure::BAD_INPUT, message).with_hint(
                    "matched points have as many rows; ordered points that are not matched go in with --points",
                ));
            }
            if one == two {
                return Err(both_alike());
            }
            pairs.extend(one.into_iter().zip(two).map(|(a, b)| [a, b]));
        }
        return Ok(Some(Seen::Matched(pairs)));
    }
    let mut curves = Vec::new();
    for files in args.points.chunks_exact(2) {
        curves.push([points_of(&files[0])?, points_of(&files[1])?]);
    }
    for files in args.masks.chunks_exact(2) {
        let [one, two] = [&files[0], &files[1]];
        curves.push([traced::<View1>(one, &views[0])?, traced::<View2>(two, &views[1])?]);
    }
    if curves.iter().any(|[one, two]| one == two) {
        return Err(both_alike());
    }
    Ok((!curves.is_empty()).then_some(Seen::Curves(curves)))
}

fn both_alike() -> Failure {
    Failure::new(Failure::USAGE, "what was seen is the same in both views")
        .with_hint(NEVER_THE_SAME)
}

/// Pair folders that share their cameras, and their points, or their masks where there are none.
fn of_pair_folders(folders: &[PathBuf]) -> Result<([NamedView; 2], Option<Seen>), Failure> {
    let mut shared: Option<(PathBuf, String, Rig)> = None;
    let mut curves = Vec::new();
    for folder in folders {
        for dir in find_pairs(folder)? {
            let present = PairParts::present_in(&dir);
            let parts = PairParts {
                points: present.points,
                masks: present.masks && !present.points,
                images: false,
                truth: Truth::Ignore,
            };
            let pair = read_pair(&dir, parts)?;
            match &shared {
                Some((other, _, rig)) if *rig != pair.rig => {
                    let message =
                        format!("{} and {} have other cameras", other.display(), dir.display());
                    return Err(Failure::new(Failure::USAGE, message)
                        .with_hint("examine pairs with different cameras one by one"));
                }
                Some(_) => {}
                None => shared = Some((dir.clone(), pair.case_id.clone(), pair.rig.clone())),
            }
            if let Some((one, two)) = &pair.points {
                let plain1 = one.iter().map(|p| p.point()).collect();
                curves.push([plain1, two.iter().map(|p| p.point()).collect()]);
            } else if let Some(masks) = pair.masks {
                let one =
                    traced_mask::<View1>(&masks[0]).map_err(|failure| failure.of_file(&dir))?;
                let two =
                    traced_mask::<View2>(&masks[1]).map_err(|failure| failure.of_file(&dir))?;
                curves.push([one, two]);
            }
        }
    }
    let Some((_, id, rig)) = shared else {
        return Err(Failure::new(Failure::USAGE, "no pair folder is named"));
    };
    let view = |camera: &Camera, number: u8| NamedView {
        name: format!("{id}_{number}"),
        camera: camera.clone(),
        unit: rig.unit(),
        frame: "as in the folder".into(),
        notes: Vec::new(),
    };
    let views = [view(rig.camera1(), 1), view(rig.camera2(), 2)];
    Ok((views, (!curves.is_empty()).then_some(Seen::Curves(curves))))
}

fn points_of(path: &Path) -> Result<Vec<Point2>, Failure> {
    // The view is of no account here: the doctor may exchange them.
    Ok(read_points::<View1>(path)?.iter().map(|p| p.point()).collect())
}

fn traced<V: View>(path: &Path, view: &NamedView) -> Result<Vec<Point2>, Failure> {
    let mask = read_mask(path)?;
    view.check_size(path, mask.dim())?;
    traced_mask::<V>(&mask).map_err(|failure| failure.of_file(path))
}

fn traced_mask<V: View>(mask: &Array2<bool>) -> Result<Vec<Point2>, Failure> {
    let traced = cheapest_walk::<V>(mask)?;
    if traced.closed {
        let message = format!("view {}: the body is closed", V::NUMBER);
        return Err(Failure::new(Failure::BAD_INPUT, message).with_hint(
            "where a ring begins in either view is not known: give points that belong together, with --matched",
        ));
    }
    Ok(traced.points)
}

fn common_unit(views: &[NamedView; 2]) -> Result<LengthUnit, Failure> {
    let [one, two] = [views[0].unit, views[1].unit];
    if one == two {
        return Ok(one);
    }
    let message = format!("camera 1 is in {one}, camera 2 in {two}");
    Err(Failure::new(Failure::BAD_INPUT, message).with_hint("convert one, or state --unit"))
}

/// How the two cameras stand to each other.
fn described(views: &[NamedView; 2]) -> String {
    let [one, two] = [&views[0].camera, &views[1].camera];
    let axis = |camera: &Camera| camera.r().row(2).transpose();
    let (d1, d2) = (axis(one), axis(two));
    let apart = d1.dot(&d2).clamp(-1.0, 1.0).acos().to_degrees();
    let baseline = two.centre() - one.centre();
    let normal = d1.cross(&d2);
    // Parallel axes are everywhere as far apart as the baseline is across them.
    let between = if normal.norm() > 1e-6 {
        baseline.dot(&normal.normalize()).abs()
    } else {
        baseline.cross(&d1).norm()
    };
    format!(
        "view 1 `{0}`, view 2 `{1}`: {apart:.1} degrees apart, centres {2:.2} {3} from each other, \
         central rays pass at {between:.3} {3}",
        views[0].name,
        views[1].name,
        baseline.norm(),
        views[0].unit,
    )
}

fn as_text(diagnosis: &Diagnosis, seen: &Seen) -> String {
    let what = match seen {
        Seen::Matched(pairs) => format!("{} matched points", pairs.len()),
        Seen::Curves(curves) => format!("{} pairs of curves", curves.len()),
    };
    let residual = match (diagnosis.residual_px, seen) {
        (None, _) => "no rig as given".to_owned(),
        (Some(px), Seen::Matched(_)) => format!("epipolar residual {px:.2} px"),
        (Some(px), Seen::Curves(_)) => format!("cost of the match {px:.2} px a point"),
    };
    let mut text =
        format!("{what}: {residual}, {:.0} % in front of both", 100.0 * diagnosis.in_front);
    if let Some(places) = diagnosis.turning_places {
        text.push_str(&format!(
            "\n{places} places where both curves turn round at an epipolar line{}",
            if places < LEAST_PLACES {
                format!(": too few to tell whether pixels are displaced by a few px, which takes {LEAST_PLACES} (give more pairs of the same rig)")
            } else {
                String::new()
            }
        ));
    }
    for finding in &diagnosis.findings {
        text.push_str(&format!(
            "\n!! {} in {}: {:.2} -> {:.2} px if undone\n   fix: {}",
            finding.mistake.name(),
            views_of(finding),
            finding.before_px,
            finding.after_px,
            finding.mistake.remedy(finding.which)
        ));
        for (mistake, which) in &finding.or {
            text.push_str(&format!(
                "\n   or {} in {which} (these views cannot tell): {}",
                mistake.name(),
                mistake.remedy(*which)
            ));
        }
    }
    for remark in &diagnosis.remarks {
        text.push_str(&format!("\n?? {remark}"));
    }
    text.push_str(match diagnosis.verdict {
        Verdict::Sound => "\nok: none of the usual mistakes makes it fit better",
        Verdict::Mistaken => "\nok: nothing is left once that is undone",
        Verdict::Unexplained => {
            "\n!! it does not fit, and none of the usual mistakes explains it: other views, a table \
             or patient that moved, wrong points, or a calibration that is plainly off"
        }
    });
    text.push_str("\ncannot be told by any two views:");
    for what in CANNOT_BE_TOLD {
        text.push_str(&format!("\n   {what}"));
    }
    text
}

fn views_of(finding: &Finding) -> String {
    match finding.mistake {
        Mistake::ViewsSwapped | Mistake::PixelsDisplaced(_) => "the pair".to_owned(),
        _ => finding.which.to_string(),
    }
}

fn as_json(views: &[NamedView; 2], diagnosis: &Diagnosis) -> Value {
    let finding = |f: &Finding| {
        json!({
            "mistake": f.mistake.name(),
            "where": views_of(f),
            "before_px": finite(f.before_px),
            "after_px": f.after_px,
            "fix": f.mistake.remedy(f.which),
            "or": f.or.iter().map(|(m, w)| json!({
                "mistake": m.name(), "where": w.to_string(), "fix": m.remedy(*w),
            })).collect::<Vec<_>>(),
        })
    };
    json!({
        "views": [views[0].name, views[1].name],
        "verdict": match diagnosis.verdict {
            Verdict::Sound => "sound",
            Verdict::Mistaken => "mistaken",
            Verdict::Unexplained => "unexplained",
        },
        "residual_px": diagnosis.residual_px,
        "in_front": diagnosis.in_front,
        "points": diagnosis.points,
        "turning_places": diagnosis.turning_places,
        "findings": diagnosis.findings.iter().map(finding).collect::<Vec<_>>(),
        "remarks": diagnosis.remarks.iter().map(|r| r.to_string()).collect::<Vec<_>>(),
        "cannot_be_told": CANNOT_BE_TOLD,
        "note": NOT_FOR_CLINICAL_USE,
    })
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

impl From<DoctorError> for Failure {
    fn from(error: DoctorError) -> Self {
        Self::new(Self::BAD_INPUT, error.to_string())
    }
}
