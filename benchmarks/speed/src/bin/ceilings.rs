//! What one core of this machine can do at most, as JSON: the ceilings of the roofline page.
//!
//! Every figure is the best of many short runs, in processor time: a ceiling is what was reached once.
#![allow(clippy::print_stdout, clippy::print_stderr)]

use std::hint::black_box;
use std::io::Error;
use std::process::ExitCode;
use std::time::Duration;

use cpu_time::ProcessTime;
use pulp::{Arch, Simd, WithSimd};
use serde_json::{Value, json};

/// Bytes that are read or written in all for one figure.
const TRAFFIC: usize = 1 << 30;

fn main() -> ExitCode {
    match measured() {
        Ok(ceilings) => {
            println!("{ceilings}");
            ExitCode::SUCCESS
        }
        Err(failure) => {
            eprintln!("no clock of processor time: {failure}");
            ExitCode::FAILURE
        }
    }
}

fn measured() -> Result<Value, Error> {
    let clock_ghz = clock()?;
    let (lanes, f64_gops) = vector_arithmetic()?;
    let mut read = serde_json::Map::new();
    for (name, bytes) in [("16_kib", 16 << 10), ("1_mib", 1 << 20), ("64_mib", 64 << 20)] {
        read.insert(name.to_owned(), json!(read_gb_per_s(bytes)?));
    }
    Ok(json!({
        "clock_ghz": clock_ghz,
        "f64_lanes": lanes,
        "f64_gops_per_s": f64_gops,
        "read_gb_per_s": read,
        "fresh_memory_gb_per_s": fresh_gb_per_s()?,
    }))
}

/// The least seconds of `runs` runs.
fn best(runs: usize, mut run: impl FnMut()) -> Result<f64, Error> {
    let mut best = Duration::MAX;
    for _ in 0..runs {
        let start = ProcessTime::try_now()?;
        run();
        best = best.min(start.try_elapsed()?);
    }
    Ok(best.as_secs_f64())
}

/// A chain of multiplications and additions, four cycles each on every current x86-64 and Arm core.
fn clock() -> Result<f64, Error> {
    const STEPS: u64 = 200_000;
    let seconds = best(100, || {
        let mut x = black_box(3_u64);
        let factor = black_box(5_u64);
        for k in 0..STEPS {
            x = x.wrapping_mul(factor).wrapping_add(k);
        }
        black_box(x);
    })?;
    Ok(4.0 * STEPS as f64 / seconds * 1e-9)
}

/// Additions and multiplications of `f64`, none fused, in independent vectors: lanes, and 1e9
/// operations per second.
fn vector_arithmetic() -> Result<(usize, f64), Error> {
    struct Work;
    const CHAINS: usize = 12;
    const STEPS: usize = 10_000;
    impl WithSimd for Work {
        type Output = usize;
        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) -> usize {
            let half = simd.splat_f64s(black_box(0.5));
            let mut x = [half; CHAINS];
            for _ in 0..STEPS {
                for k in 0..CHAINS {
                    x[k] = simd.add_f64s(simd.mul_f64s(x[k], half), half);
                }
            }
            let mut sum = half;
            for k in 0..CHAINS {
                sum = simd.add_f64s(sum, x[k]);
            }
            black_box(simd.reduce_sum_f64s(sum));
            S::F64_LANES
        }
    }
    let machine = Arch::new();
    let lanes = machine.dispatch(Work);
    let seconds = best(200, || {
        machine.dispatch(Work);
    })?;
    Ok((lanes, (2 * CHAINS * STEPS * lanes) as f64 / seconds * 1e-9))
}

/// Sums over an array that was just read, 1e9 bytes per second.
fn read_gb_per_s(bytes: usize) -> Result<f64, Error> {
    let words = vec![1_u64; bytes / 8];
    let passes = (1_usize << 22).div_ceil(bytes);
    let seconds = best(TRAFFIC / (passes * bytes), || {
        for _ in 0..passes {
            let words = black_box(&words[..]);
            black_box(words.iter().fold(0_u64, |sum, &word| sum.wrapping_add(word)));
        }
    })?;
    Ok((passes * bytes) as f64 / seconds * 1e-9)
}

/// Memory taken from the system and written once, 1e9 bytes per second: what every large answer
/// costs at least. More at once than allocators keep.
fn fresh_gb_per_s() -> Result<f64, Error> {
    const BYTES: usize = 64 << 20;
    let seconds = best(TRAFFIC / BYTES, || {
        black_box(vec![1_u8; BYTES]);
    })?;
    Ok(BYTES as f64 / seconds * 1e-9)
}
