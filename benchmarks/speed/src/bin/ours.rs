//! Our side of `benchmarks/peers`: writes the shared inputs, then runs one part at a time when told.
//!
//! `ours data FOLDER` writes the arrays. `ours serve PART FOLDER` reads those of a part, and then
//! runs, for every line `NAME` or `NAME FILE.npy` on stdin, what NAME stands for once and prints its
//! nanoseconds, those of the processor and those on the wall; FILE.npy gets the answer, for the peer to compare with its own.
#![allow(clippy::print_stdout, clippy::print_stderr)]

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::error::Error;
use std::io::{BufRead, Write};
use std::path::Path;
use std::process::ExitCode;
use std::rc::Rc;
use std::time::Instant;

use accurate_eval::{TableScores, polyline_distances, table_scores};
use accurate_geom::{Pixel, Point3, Triangulated, Triangulation, Triangulator, View, View1, View2};
use accurate_match::{Alignment, CostModel, DistanceKind, TieOrder, align_curves};
use accurate_seg::{Mask, guo_hall, zhang_suen};
use accurate_speed::{Wire, wire_mask};
use cpu_time::ProcessTime;
use ndarray::Array2;
use ndarray_npy::{read_npy, write_npy};

type Failure = Box<dyn Error>;

const ECDP_POINTS: [usize; 2] = [1024, 2048];
const MASK_SIDES: [usize; 2] = [512, 1024];
const PAIRS: usize = 100_000;
const METRIC_POINTS: usize = 20_000;

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let done = match words[..] {
        ["data", folder] => data(Path::new(folder)),
        ["serve", part, folder] => jobs(part, Path::new(folder)).and_then(serve),
        _ => Err("usage: ours data FOLDER | ours serve PART FOLDER".into()),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("{failure}");
            ExitCode::FAILURE
        }
    }
}

fn rows<const N: usize>(points: impl ExactSizeIterator<Item = [f64; N]>) -> Array2<f64> {
    let mut array = Array2::zeros((points.len(), N));
    for (mut row, point) in array.rows_mut().into_iter().zip(points) {
        row.iter_mut().zip(point).for_each(|(to, from)| *to = from);
    }
    array
}

fn data(folder: &Path) -> Result<(), Failure> {
    let wire = Wire::new()?;
    let save = |name: &str, array: &Array2<f64>| write_npy(folder.join(name), array);
    let f = wire.rig().fundamental().matrix();
    save("F.npy", &Array2::from_shape_fn((3, 3), |(r, c)| f[(r, c)]))?;
    for (camera, name) in [(wire.rig().camera1(), "P1.npy"), (wire.rig().camera2(), "P2.npy")] {
        let p = camera.projection_matrix();
        save(name, &Array2::from_shape_fn((3, 4), |(r, c)| p[(r, c)]))?;
    }
    for n in ECDP_POINTS {
        let (one, two) = wire.curves(n, true)?;
        save(&format!("ecdp_{n}_1.npy"), &rows(one.iter().map(|p| [p.x, p.y])))?;
        save(&format!("ecdp_{n}_2.npy"), &rows(two.iter().map(|p| [p.x, p.y])))?;
    }
    for side in MASK_SIDES {
        write_npy(folder.join(format!("mask_{side}.npy")), &wire_mask(side)?.to_u8())?;
    }
    // Whole pixels: the rays pass each other at up to half a pixel, as those of a skeleton do.
    let (one, two) = wire.curves(PAIRS, true)?;
    save("pairs_1.npy", &rows(one.iter().map(|p| [p.x, p.y])))?;
    save("pairs_2.npy", &rows(two.iter().map(|p| [p.x, p.y])))?;
    let truth = wire.points(METRIC_POINTS);
    // As far off as a reconstruction: a tenth of a per cent of the size of the wire.
    let size = truth.iter().map(|p| p.coords.amax()).fold(0.0, f64::max);
    let off = |(k, p): (usize, &Point3)| {
        let phase = k as f64 * 0.01;
        [p.x + 1e-3 * size * phase.sin(), p.y + 1e-3 * size * (1.7 * phase).cos(), p.z]
    };
    save("curve.npy", &rows(truth.iter().enumerate().map(off)))?;
    save("truth.npy", &rows(truth.iter().map(|p| [p.x, p.y, p.z])))?;
    Ok(())
}

/// Runs one thing once: its times, and its answer.
type Job = Box<dyn Fn() -> Result<([u128; 2], Array2<f64>), Failure>>;

/// `run` is measured; `answer` is not.
fn job<T: 'static>(
    run: impl Fn() -> Result<T, Failure> + 'static,
    answer: impl Fn(T) -> Result<Array2<f64>, Failure> + 'static,
) -> Job {
    Box::new(move || {
        let (processor, wall) = (ProcessTime::try_now()?, Instant::now());
        let found = run()?;
        let times = [processor.try_elapsed()?.as_nanos(), wall.elapsed().as_nanos()];
        Ok((times, answer(found)?))
    })
}

fn jobs(part: &str, folder: &Path) -> Result<BTreeMap<String, Job>, Failure> {
    match part {
        "ecdp" => ecdp(folder),
        "thinning" => thinning(folder),
        "triangulation" => triangulation(folder),
        "metrics" => metrics(folder),
        _ => Err(format!("no part `{part}`").into()),
    }
}

fn load(folder: &Path, name: &str) -> Result<Array2<f64>, Failure> {
    Ok(read_npy(folder.join(name))?)
}

fn pixels<V: View>(array: &Array2<f64>) -> Vec<Pixel<V>> {
    array.rows().into_iter().map(|row| Pixel::new(row[0], row[1])).collect()
}

fn points(array: &Array2<f64>) -> Vec<Point3> {
    array.rows().into_iter().map(|row| Point3::new(row[0], row[1], row[2])).collect()
}

fn ecdp(folder: &Path) -> Result<BTreeMap<String, Job>, Failure> {
    let wire = Wire::new()?;
    let mut jobs = BTreeMap::new();
    for n in ECDP_POINTS {
        let f = *wire.rig().fundamental();
        let one: Vec<Pixel<View1>> = pixels(&load(folder, &format!("ecdp_{n}_1.npy"))?);
        let two: Vec<Pixel<View2>> = pixels(&load(folder, &format!("ecdp_{n}_2.npy"))?);
        // From pixels to path: the distances are part of it.
        let run = move || {
            let costs = CostModel::new(&f, &one, &two, DistanceKind::View1)?;
            Ok(align_curves(&costs, TieOrder::UpLeftDiagonal)?)
        };
        let cost = |found: Alignment| Ok(Array2::from_elem((1, 1), found.total_cost));
        jobs.insert(format!("path_{n}"), job(run, cost));
    }
    Ok(jobs)
}

fn thinning(folder: &Path) -> Result<BTreeMap<String, Job>, Failure> {
    type Thinning = fn(&Mask) -> Mask;
    let rules: [(&str, Thinning); 2] = [("zhang_suen", zhang_suen), ("guo_hall", guo_hall)];
    let mut jobs = BTreeMap::new();
    for side in MASK_SIDES {
        let image: Array2<u8> = read_npy(folder.join(format!("mask_{side}.npy")))?;
        for (name, thin) in rules {
            let mask = Mask::from_u8(&image)?;
            let pixels = |thin: Mask| Ok(thin.to_u8().mapv(f64::from));
            jobs.insert(format!("{name}_{side}"), job(move || Ok(thin(&mask)), pixels));
        }
    }
    Ok(jobs)
}

fn triangulation(folder: &Path) -> Result<BTreeMap<String, Job>, Failure> {
    let wire = Wire::new()?;
    let mut jobs = BTreeMap::new();
    for method in Triangulation::ALL {
        let triangulator = Triangulator::new(wire.rig(), method);
        let one: Vec<Pixel<View1>> = pixels(&load(folder, "pairs_1.npy")?);
        let two: Vec<Pixel<View2>> = pixels(&load(folder, "pairs_2.npy")?);
        let pairs: Vec<_> = one.into_iter().zip(two).collect();
        let answer = |found: &Triangulated| match found.failures.first() {
            Some((index, failure)) => Err(format!("pair {index}: {failure}").into()),
            None => Ok(rows(found.points.iter().map(|p| [p.x, p.y, p.z]))),
        };
        // Into memory that the call asks for, and into lists that it finds.
        let (fresh, again) = (triangulator.clone(), Rc::new(RefCell::new(Triangulated::default())));
        let (of_fresh, found) = (pairs.clone(), Rc::clone(&again));
        let run = move || Ok(fresh.triangulate_all(of_fresh.iter().copied()));
        jobs.insert(method.to_string(), job(run, move |found| answer(&found)));
        let run = move || {
            triangulator.triangulate_into(pairs.iter().copied(), &mut again.borrow_mut());
            Ok(())
        };
        jobs.insert(format!("{method}_into"), job(run, move |()| answer(&found.borrow())));
    }
    Ok(jobs)
}

fn metrics(folder: &Path) -> Result<BTreeMap<String, Job>, Failure> {
    let (curve, truth) = (load(folder, "curve.npy")?, load(folder, "truth.npy")?);
    let (curve, truth) = (points(&curve), points(&truth));
    let mut jobs = BTreeMap::new();
    let both = (curve.clone(), truth.clone());
    let to_points = move || Ok(table_scores(&both.0, &both.1)?);
    let means = |s: TableScores| Ok(ndarray::array![[s.accuracy, s.completeness, s.max_error]]);
    jobs.insert("points".to_owned(), job(to_points, means));
    let to_segments =
        move || Ok((polyline_distances(&curve, &truth)?, polyline_distances(&truth, &curve)?));
    let columns = |(there, back): (Vec<f64>, Vec<f64>)| {
        Ok(rows(there.into_iter().zip(back).map(|(there, back)| [there, back])))
    };
    jobs.insert("segments".to_owned(), job(to_segments, columns));
    Ok(jobs)
}

fn serve(jobs: BTreeMap<String, Job>) -> Result<(), Failure> {
    let mut out = std::io::stdout();
    for line in std::io::stdin().lock().lines() {
        let line = line?;
        let mut words = line.split_whitespace();
        let name = words.next().unwrap_or_default();
        let job = jobs.get(name).ok_or_else(|| format!("no job `{name}`"))?;
        let ([processor, wall], answer) = job()?;
        if let Some(file) = words.next() {
            write_npy(file, &answer)?;
        }
        writeln!(out, "{processor} {wall}")?;
        out.flush()?;
    }
    Ok(())
}
