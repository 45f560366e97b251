//! Writes one generated case to stdout as CSV: `cargo run -p accurate-synth --example synth_case --
//! carm 1 0`. Rows are `truth,x,y,z`, `exact1,x,y,arc`, `exact2,x,y,arc`.
#![allow(clippy::print_stdout)]

use std::error::Error;

use accurate_synth::{CaseOptions, Family, generate};

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let family: Family = args.next().as_deref().unwrap_or("carm").parse()?;
    let seed = args.next().as_deref().unwrap_or("1").parse()?;
    let index = args.next().as_deref().unwrap_or("0").parse()?;
    let case = generate(family, seed, index, &CaseOptions::default())?;

    println!("# {}: {:.1} {} long", case.id, case.length(), case.rig.unit());
    println!("kind,a,b,c");
    for p in &case.truth {
        println!("truth,{},{},{}", p.x, p.y, p.z);
    }
    for (p, arc) in case.exact_points.0.iter().zip(&case.exact_arc_lengths.0) {
        println!("exact1,{},{},{arc}", p.x, p.y);
    }
    for (p, arc) in case.exact_points.1.iter().zip(&case.exact_arc_lengths.1) {
        println!("exact2,{},{},{arc}", p.x, p.y);
    }
    Ok(())
}
