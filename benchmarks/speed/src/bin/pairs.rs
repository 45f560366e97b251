//! What a whole pair of masks costs, masks in memory to curve, and what a second thread is worth.
//!
//! `pairs [--cases N] [--seed S] [--rounds R] [FILE.json]` prints a table and writes the file. Takes
//! some minutes; the machine should be quiet, for the second part is measured on the wall.
#![allow(clippy::print_stdout, clippy::print_stderr)]

use std::error::Error;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use accurate3d::eval::quantile;
use accurate3d::synth::{CaseOptions, Family, generate};
use accurate3d::{InputKind, Method, Params, Reconstruction, ViewPair, reconstruct};
use cpu_time::ProcessTime;
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use serde_json::{Value, json};

type Failure = Box<dyn Error>;

const FAMILIES: [Family; 3] = [Family::Easy, Family::Medium, Family::Hard];
const METHODS: [Method; 2] = [Method::Paper, Method::Accurate];
const THREADS: [usize; 2] = [1, 2];

struct Options {
    cases: u64,
    /// A tuning seed: the figures are not to be those of the evaluation.
    seed: u64,
    rounds: usize,
    file: Option<PathBuf>,
}

fn main() -> ExitCode {
    match options().and_then(|options| run(&options)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("{failure}");
            ExitCode::FAILURE
        }
    }
}

fn options() -> Result<Options, Failure> {
    let mut options = Options { cases: 24, seed: 1000, rounds: 5, file: None };
    let mut args = std::env::args().skip(1);
    while let Some(arg) = args.next() {
        let mut number = || args.next().ok_or_else(|| format!("{arg} N"));
        match arg.as_str() {
            "--cases" => options.cases = number()?.parse()?,
            "--seed" => options.seed = number()?.parse()?,
            "--rounds" => options.rounds = number()?.parse()?,
            _ => options.file = Some(arg.into()),
        }
    }
    if options.cases == 0 || options.rounds == 0 {
        return Err("--cases and --rounds: at least 1".into());
    }
    Ok(options)
}

fn run(options: &Options) -> Result<(), Failure> {
    let mut costs = Vec::new();
    let mut gains = Vec::new();
    println!(
        "| method | pairs | processor: median, 95 %, ms | wall: median, 95 %, ms | no result |"
    );
    println!("|---|---|--:|--:|--:|");
    for method in METHODS {
        let params = Params::new(InputKind::Mask, method);
        let mut all = Vec::new();
        for family in FAMILIES {
            let pairs = (0..options.cases)
                .map(|case| {
                    Ok(generate(family, options.seed, case, &CaseOptions::default())?.into())
                })
                .collect::<Result<Vec<ViewPair>, Failure>>()?;
            let cost = Cost::of(&pairs, &params, options.rounds)?;
            println!("| {method} | {family} | {} | {} |", cost.text()?, cost.failed);
            costs.push(cost.json(method, family)?);
            all.extend(pairs);
        }
        gains.push((method, Gain::of(&all, &params, options.rounds)?));
    }
    println!();
    println!("| method | pairs | 1 thread, pairs/s | 2 threads, pairs/s | ratio |");
    println!("|---|--:|--:|--:|--:|");
    for (method, gain) in &gains {
        println!("| {method} | {} |", gain.text());
    }
    if let Some(file) = &options.file {
        let gains: Vec<Value> = gains.iter().map(|(method, gain)| gain.json(*method)).collect();
        let all = json!({
            "seed": options.seed,
            "cases_per_family": options.cases,
            "rounds": options.rounds,
            "pairs": costs,
            "threads": gains,
        });
        std::fs::write(file, format!("{all:#}\n"))?;
    }
    Ok(())
}

/// The least times of each pair over all rounds, ms.
struct Cost {
    processor: Vec<f64>,
    wall: Vec<f64>,
    /// Pairs that end in an error. Their time counts.
    failed: usize,
}

impl Cost {
    fn of(pairs: &[ViewPair], params: &Params, rounds: usize) -> Result<Self, Failure> {
        let mut cost = Self {
            processor: vec![f64::INFINITY; pairs.len()],
            wall: vec![f64::INFINITY; pairs.len()],
            failed: 0,
        };
        for _ in 0..rounds {
            cost.failed = 0;
            for (k, pair) in pairs.iter().enumerate() {
                let (processor, wall) = (ProcessTime::try_now()?, Instant::now());
                let found = reconstruct(pair, params);
                let processor = processor.try_elapsed()?.as_secs_f64();
                let wall = wall.elapsed().as_secs_f64();
                cost.failed += usize::from(found.is_err());
                cost.processor[k] = cost.processor[k].min(1e3 * processor);
                cost.wall[k] = cost.wall[k].min(1e3 * wall);
            }
        }
        Ok(cost)
    }

    fn text(&self) -> Result<String, Failure> {
        let [processor, wall] = [&self.processor, &self.wall].map(|times| -> Result<_, Failure> {
            Ok(format!("{:.1}, {:.1}", quantile(times, 0.5)?, quantile(times, 0.95)?))
        });
        Ok(format!("{} | {}", processor?, wall?))
    }

    fn json(&self, method: Method, family: Family) -> Result<Value, Failure> {
        Ok(json!({
            "method": method.to_string(),
            "family": family.to_string(),
            "processor_median_ms": quantile(&self.processor, 0.5)?,
            "processor_95_ms": quantile(&self.processor, 0.95)?,
            "wall_median_ms": quantile(&self.wall, 0.5)?,
            "wall_95_ms": quantile(&self.wall, 0.95)?,
            "failed": self.failed,
        }))
    }
}

/// A batch of pairs with each number of [`THREADS`].
struct Gain {
    pairs: usize,
    /// The least time of the batch on the wall, s.
    wall: [f64; THREADS.len()],
}

impl Gain {
    fn of(pairs: &[ViewPair], params: &Params, rounds: usize) -> Result<Self, Failure> {
        let batch = |pool: &ThreadPool| -> Vec<Option<Reconstruction>> {
            pool.install(|| pairs.par_iter().map(|pair| reconstruct(pair, params).ok()).collect())
        };
        let mut pools = Vec::new();
        for threads in THREADS {
            pools.push(ThreadPoolBuilder::new().num_threads(threads).build()?);
        }
        let mut wall = [f64::INFINITY; THREADS.len()];
        let mut first = None;
        for _ in 0..rounds {
            for (pool, least) in pools.iter().zip(&mut wall) {
                let start = Instant::now();
                let found = batch(pool);
                *least = least.min(start.elapsed().as_secs_f64());
                // Their text tells every f64 from its neighbours.
                let text = format!("{found:?}");
                if *first.get_or_insert_with(|| text.clone()) != text {
                    return Err("the results depend on the number of threads".into());
                }
            }
        }
        Ok(Self { pairs: pairs.len(), wall })
    }

    fn text(&self) -> String {
        let [one, two] = self.wall.map(|wall| self.pairs as f64 / wall);
        format!("{} | {one:.1} | {two:.1} | {:.2}", self.pairs, two / one)
    }

    fn json(&self, method: Method) -> Value {
        let [one, two] = self.wall;
        json!({
            "method": method.to_string(),
            "pairs": self.pairs,
            "wall_1_thread_s": one,
            "wall_2_threads_s": two,
            "ratio": one / two,
        })
    }
}
