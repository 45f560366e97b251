//! How often the doctor names the mistake: each one made in many random rigs, and none in as many.
//!
//! `cargo run --release -p accurate3d --example doctor_study -- [RIGS] [SEED]`
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::print_stdout)]

#[path = "../tests/support/mistaken_rigs.rs"]
#[allow(dead_code)] // The wires are for another study.
mod mistaken_rigs;

use accurate_geom::LengthUnit;
use accurate3d::doctor::{Seen, Verdict, Which, diagnose};
use mistaken_rigs::{means, mistakes, sound, spoiled};
use rayon::prelude::*;

#[derive(Default, Clone)]
struct Row {
    name: &'static str,
    made: usize,
    unseen: usize,
    first: usize,
    among: usize,
    others: usize,
    wrong: Vec<String>,
}

fn main() {
    let number = |at: usize, default: u64| {
        std::env::args().nth(at).map_or(default, |word| word.parse().expect("a number"))
    };
    let (rigs, seed) = (number(1, 100), number(2, 1000));
    let tables: Vec<(Vec<Row>, usize)> = (0..rigs).into_par_iter().map(|i| rig(seed, i)).collect();
    let mut rows = tables[0].0.clone();
    let mut alarms = 0;
    for (index, (table, alarm)) in tables.into_iter().enumerate() {
        alarms += alarm;
        if index == 0 {
            continue;
        }
        for (sum, row) in rows.iter_mut().zip(table) {
            sum.made += row.made;
            sum.unseen += row.unseen;
            sum.first += row.first;
            sum.among += row.among;
            sum.others += row.others;
            sum.wrong.extend(row.wrong);
        }
    }
    println!("{rigs} rigs, seed {seed}: {alarms} alarms on sound ones");
    println!("mistake                  made  unseen  named  alone   missed  equals/rig");
    let (mut named, mut seen) = (0, 0);
    for row in &rows {
        let of = row.made - row.unseen;
        named += row.among;
        seen += of;
        println!(
            "{:<23} {:>5}  {:>6}  {:>5}  {:>5}   {:>6}  {:.2}",
            row.name,
            row.made,
            row.unseen,
            row.among,
            row.first,
            of - row.among,
            row.others as f64 / of.max(1) as f64
        );
        for wrong in row.wrong.iter().take(4) {
            println!("    {wrong}");
        }
    }
    println!("named {named} of {seen}: {:.2} %", 100.0 * named as f64 / seen as f64);
}

fn rig(seed: u64, index: u64) -> (Vec<Row>, usize) {
    let scene = sound(seed, index);
    let examine = |scene: &mistaken_rigs::Scene| {
        diagnose(&scene.cameras, LengthUnit::Millimetre, &Seen::Matched(scene.beads.clone()))
    };
    let healthy = examine(&scene).unwrap();
    let sound_px = healthy.residual_px.unwrap();
    let alarm = usize::from(healthy.verdict != Verdict::Sound || !healthy.remarks.is_empty());
    let rows = mistakes(seed, index)
        .into_iter()
        .map(|mistake| {
            let mut row = Row { name: mistake.name(), ..Row::default() };
            let which = Which::ALL[(index / 3 % 3) as usize];
            let which = match mistake {
                accurate3d::doctor::Mistake::ViewsSwapped => Which::Both,
                accurate3d::doctor::Mistake::WorldAxes
                | accurate3d::doctor::Mistake::UnitOfView(_)
                    if which == Which::Both =>
                {
                    Which::View1
                }
                _ => which,
            };
            let Some((bad, mistake)) = spoiled(&scene, mistake, which) else { return row };
            row.made = 1;
            let told = examine(&bad).ok();
            let bad_px = told.as_ref().and_then(|t| t.residual_px).unwrap_or(f64::INFINITY);
            // 12 nats of 80 points.
            let in_front = told.as_ref().map_or(0.0, |t| t.in_front);
            if bad_px < sound_px * (12.0f64 / 80.0).exp() && in_front > 0.9 {
                row.unseen = 1;
                return row;
            }
            let found = told.as_ref().and_then(|t| t.findings.first());
            if let Some(finding) = found.filter(|_| told.as_ref().unwrap().findings.len() == 1) {
                let same = |(m, w): &(accurate3d::doctor::Mistake, Which)| {
                    means(m, &mistake) && (*w == which || m.name() == "views-swapped")
                };
                row.others = finding.or.len();
                if same(&(finding.mistake, finding.which)) || finding.or.iter().any(same) {
                    row.among = 1;
                    row.first = usize::from(finding.or.is_empty());
                    return row;
                }
            }
            let found: Vec<String> = told
                .iter()
                .flat_map(|t| &t.findings)
                .map(|f| {
                    format!("{:?} {} ({:.2} -> {:.2})", f.mistake, f.which, f.before_px, f.after_px)
                })
                .collect();
            row.wrong.push(format!(
                "rig {index}, {mistake:?} in {which}: {sound_px:.2} -> {bad_px:.2} px; {}",
                found.join(" + ")
            ));
            row
        })
        .collect();
    (rows, alarm)
}
