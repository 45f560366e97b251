use std::path::{Path, PathBuf};

use accurate3d::fit::CalibrationPriors;
use accurate3d::io::{PairParts, Truth, find_pairs, read_pair};
use accurate3d::seg::Segmenter;
use accurate3d::synth::Family;
use accurate3d::table::{
    CaseSet, CellCheck, Flags, Measuring, Outcome, PointsProtocol, Row, cases_csv,
    check_case_count, check_cells, grid, measure, need_images, paper_rows, parse_cells, render,
    write_cells,
};
use accurate3d::{InputKind, NOT_FOR_CLINICAL_USE, ViewPair};
use comfy_table::Table as TerminalTable;

use super::synth::case_options;
use crate::args::{PointsKind, TableArgs};
use crate::code::Code;
use crate::console::Console;
use crate::failure::Failure;
use crate::segmentation::segmenter;
use crate::text::{make_place_apart, read_text, write_text};

/// `accurate table`: the paper's table on a set, or the check of its cells.
pub fn run(args: &TableArgs, console: &Console) -> Result<(), Failure> {
    if let Some(cells) = &args.check {
        return check(cells, args, console);
    }
    let mut seeds = args.seeds.clone();
    seeds.sort_unstable();
    seeds.dedup();
    if seeds.len() < args.seeds.len() {
        return Err(Failure::new(Failure::USAGE, "--seeds names a seed twice")
            .with_hint("the same cases, counted twice, say nothing more"));
    }
    let set = case_set(args)?;
    if set.is_empty() {
        return Err(Failure::new(Failure::USAGE, "the table has no case")
            .with_hint("give at least one seed and one case"));
    }
    let rows: Vec<Row> = paper_rows().into_iter().filter(|row| wanted(row, args)).collect();
    if rows.is_empty() {
        return Err(Failure::new(
            Failure::USAGE,
            "no row of the table has these methods and inputs",
        ));
    }
    if args.out.is_some() && args.out == args.per_case {
        return Err(Failure::new(Failure::USAGE, "the table and its cases cannot be one file")
            .with_hint("name another file with --per-case"));
    }
    for path in args.out.iter().chain(&args.per_case) {
        make_place_apart(path, [&PathBuf::from(&args.set)])?;
    }
    let calibration = args.refine_calibration.then_some(CalibrationPriors::DEFAULT);
    let segmenter = match rows.iter().any(|row| row.input == InputKind::Image)
        && args.input.contains(&InputKind::Image)
    {
        true => Some(segmenter(&args.model, console)?),
        false => None,
    };
    let how = Measuring {
        scores: args.scores,
        both_scores: args.per_case.is_some(),
        calibration,
        segmenter: segmenter.as_ref().map(|s| s as &dyn Segmenter),
    };
    let bar = console.progress(set.len(), "measuring");
    let table = measure(&set, &rows, &how, &|| bar.inc(1))?;
    bar.finish_and_clear();
    // A file has the format that is asked for; what is printed is JSON then.
    let format = match console.json && (args.out.is_none() || args.format.is_none()) {
        true => Some(accurate3d::table::Format::Json),
        false => args.format,
    };
    let text = match format {
        Some(format) => render(&table, format),
        None => {
            let (header, rows) = grid(&table);
            let mut terminal = TerminalTable::new();
            terminal.load_style(comfy_table::presets::ASCII_MARKDOWN).set_header(header);
            terminal.add_rows(rows);
            format!("{terminal}\n")
        }
    };
    match &args.out {
        Some(path) => write_text(path, &text)?,
        None => console.data(text.trim_end())?,
    }
    if console.json && args.out.is_some() {
        console.data(render(&table, accurate3d::table::Format::Json).trim_end())?;
    }
    if let Some(path) = &args.per_case {
        let lines = cases_csv(&table).map_err(|problem| {
            Failure::new(Failure::BAD_INPUT, format!("{}: {problem}", path.display()))
        })?;
        write_text(path, &lines)?;
    }
    for row in &table.rows {
        let name = format!("{} ({})", row.row.label, row.row.input);
        let Ok(measured) = &row.result else { continue };
        for (case, reason) in measured.failures() {
            console.detail(&format!("{name}, {case}: {reason}"));
        }
        if args.per_case.is_some() {
            let Flags { wrong, right } = Flags::of(&measured.cases);
            console.remark(&format!(
                "{name}: {} of {} wrong curves are suspect (Hausdorff 5 px or more), {} of {} right ones",
                wrong[0], wrong[1], right[0], right[1]
            ));
        }
    }
    console.remark(&format!("{} cases of {}. {NOT_FOR_CLINICAL_USE}", table.cases, table.set));
    Ok(())
}

fn wanted(row: &Row, args: &TableArgs) -> bool {
    let method = match row.outcome {
        Outcome::Run(method) => args.method.is_empty() || args.method.contains(&method),
        Outcome::NotAvailable(_) => args.method.is_empty(),
    };
    // Image rows take minutes: they run only when they are asked for.
    let unasked =
        args.input.is_empty() && (row.input != InputKind::Image || args.method.is_empty());
    method && (unasked || args.input.contains(&row.input))
}

fn case_set(args: &TableArgs) -> Result<CaseSet, Failure> {
    match args.set.parse::<Family>() {
        Ok(family) => Ok(CaseSet::Generated {
            family,
            options: case_options(&args.disturbances),
            seeds: args.seeds.clone(),
            cases: args.cases,
            points: match args.points {
                PointsKind::Rounded => PointsProtocol::Rounded,
                PointsKind::Exact => PointsProtocol::Exact,
            },
        }),
        Err(unknown) => {
            let path = Path::new(&args.set);
            if !path.exists() {
                return Err(Failure::new(Failure::USAGE, unknown.to_string())
                    .with_hint("or give a folder of pair folders with truth"));
            }
            let of_families = options_of_families(args);
            if !of_families.is_empty() {
                let message = format!("{}: is of generated sets", of_families.join(", "));
                return Err(Failure::new(Failure::USAGE, message)
                    .with_hint("the pairs of a folder are measured as they are: leave it out"));
            }
            // A part that a pair lacks fails that pair's row, which says so; truth it must have.
            let parts = PairParts {
                points: path_has(path, "points"),
                masks: path_has(path, "masks"),
                images: args.input.contains(&InputKind::Image) && path_has(path, "images"),
                truth: Truth::Required,
            };
            let pairs = find_pairs(path)?
                .iter()
                .map(|dir| Ok(ViewPair::from(read_pair(dir, parts)?)))
                .collect::<Result<_, Failure>>()?;
            Ok(CaseSet::Given { name: args.set.clone(), pairs })
        }
    }
}

/// Options that say how cases are generated, where they say anything.
fn options_of_families(args: &TableArgs) -> Vec<&'static str> {
    let made = &args.disturbances;
    [
        (args.seeds != [1, 2, 3, 4, 5], "--seeds"),
        (args.cases != 26, "--cases"),
        (args.points != PointsKind::Rounded, "--points"),
        (made.mask_thickness_px.is_some(), "--mask-thickness-px"),
        (made.occlusions.is_some(), "--occlusions"),
        (made.occlusion_radius_px != 8.0, "--occlusion-radius-px"),
        (made.calibration_rotation_deg != 0.0, "--calibration-rotation-deg"),
        (made.calibration_shift_px != 0.0, "--calibration-shift-px"),
    ]
    .into_iter()
    .filter_map(|(given, name)| given.then_some(name))
    .collect()
}

fn path_has(set: &Path, part: &str) -> bool {
    find_pairs(set).is_ok_and(|pairs| pairs.iter().all(|pair| pair.join(part).is_dir()))
}

/// `accurate table --check`: every cell that can run, against its accepted interval.
fn check(path: &Path, args: &TableArgs, console: &Console) -> Result<(), Failure> {
    let mut cells = parse_cells(&read_text(path)?).map_err(|problem| {
        Failure::new(Failure::BAD_INPUT, format!("{}: {problem}", path.display()))
    })?;
    if let Some(row) = &args.accept {
        cells.retain(|cell| cell.row == *row && !cell.method.is_empty());
        if cells.is_empty() {
            return Err(Failure::new(
                Failure::USAGE,
                format!("{}: no cell of the row `{row}` can run", path.display()),
            ));
        }
    }
    let segmenter = match need_images(&cells) {
        true => Some(segmenter(&args.model, console)?),
        false => None,
    };
    let bar = console.progress(check_case_count(&cells), "measuring");
    let segmenter = segmenter.as_ref().map(|s| s as &dyn Segmenter);
    let checks = check_cells(&cells, segmenter, &|| bar.inc(1))?;
    bar.finish_and_clear();
    if console.json {
        console.json(&checks)?;
    } else {
        for c in &checks {
            console.data(&line_of(c))?;
        }
    }
    let ran = checks.iter().filter(|c| c.measured.is_some()).count();
    if ran == 0 {
        return Err(Failure::new(Failure::BAD_INPUT, "no cell could be measured"));
    }
    if args.accept.is_some() {
        return accept(path, &checks, console);
    }
    let failed = checks.iter().filter(|c| !c.accepted).count();
    console.remark(&format!("{} cells: {ran} measured, {failed} outside", checks.len()));
    if failed > 0 {
        return Err(Failure::new(
            Code::CellsOutside,
            format!("{failed} cells lie outside their accepted intervals"),
        ));
    }
    Ok(())
}

fn line_of(c: &CellCheck) -> String {
    let name = format!("{} {} {} {}", c.cell.row, c.cell.dataset, c.cell.metric, c.cell.method);
    match (c.measured, c.cell.low, c.cell.high) {
        (Some(value), Some(low), Some(high)) => format!(
            "{} {name}: {value:.4} in [{low}, {high}] (paper {}){}",
            if c.accepted { "ok  " } else { "FAIL" },
            c.cell.paper,
            match c.failures {
                0 => String::new(),
                failures => format!(", {failures} cases failed"),
            }
        ),
        (None, Some(_), _) => format!("FAIL {name}: nothing was measured"),
        _ => format!("n/a  {name}: {} (paper {})", c.cell.command, c.cell.paper),
    }
}

/// `--accept`: the measured values become the accepted ones; everything else stays as it is.
fn accept(path: &Path, checks: &[CellCheck], console: &Console) -> Result<(), Failure> {
    let bad = |problem: String| {
        Failure::new(Failure::BAD_INPUT, format!("{}: {problem}", path.display()))
    };
    let mut cells = parse_cells(&read_text(path)?).map_err(bad)?;
    for cell in &mut cells {
        let Some(check) = checks.iter().find(|check| check.cell == *cell) else { continue };
        let value = check
            .measured
            .ok_or_else(|| bad(format!("nothing was measured for {} {}", cell.row, cell.metric)))?;
        cell.accept(value);
    }
    write_text(path, &write_cells(&cells).map_err(bad)?)?;
    console.remark(&format!("{} intervals set in {}", checks.len(), path.display()));
    Ok(())
}
