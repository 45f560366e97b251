use std::fmt::Write;

use accurate3d::geom::View1;
use accurate3d::io::read_mask;
use accurate3d::seg::{Mask, Skeleton, zhang_suen};
use accurate3d::traverse::{TraverseParams, trace_single};

use crate::args::TraceArgs;
use crate::console::Console;
use crate::failure::Failure;
use crate::text::{make_place, places, refuse_what_is_read, write_text};

/// `accurate trace`: a mask's skeleton in order, as `x,y` lines.
pub fn run(args: &TraceArgs, console: &Console) -> Result<(), Failure> {
    if let Some(path) = &args.out {
        make_place(path)?;
        refuse_what_is_read(path, &places([&args.mask]))?;
    }
    let of_mask = |failure: Failure| failure.of_file(&args.mask);
    let mask = Mask::from_array(read_mask(&args.mask)?).map_err(|e| of_mask(e.into()))?;
    let skeleton = Skeleton::of(&zhang_suen(&mask)).map_err(|e| of_mask(e.into()))?;
    let trace = trace_single(&skeleton.pixels_as::<View1>(), &TraverseParams::PAPER)
        .map_err(|e| of_mask(e.into()))?;
    let mut csv = String::from("x,y\n");
    for p in &trace.points {
        let _ = writeln!(csv, "{},{}", p.x, p.y);
    }
    match &args.out {
        Some(path) => write_text(path, &csv)?,
        None => console.data(csv.trim_end())?,
    }
    console.remark(&format!(
        "{} points, coverage {:.1} %, {} jumps over 3 px",
        trace.points.len(),
        100.0 * trace.coverage,
        trace.jumps.len()
    ));
    Ok(())
}
