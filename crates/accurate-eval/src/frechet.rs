use accurate_geom::Point3;

use crate::{EvalError, check};

/// The coupling (discrete Fréchet) distance of two point sequences in the given order, world unit:
/// the least over all monotone couplings of the largest distance of a coupled pair.
///
/// # Errors
/// [`EvalError::Empty`], [`EvalError::NotFinite`] or [`EvalError::TooLarge`].
///
/// # Source
/// Eiter and Mannila, Computing discrete Fréchet distance, TU Wien 1994; as one row at a time
/// instead of by recursion, so that long curves cannot overflow the stack.
///
/// # Cost
/// O(n m) time, O(m) memory.
pub fn discrete_frechet(a: &[Point3], b: &[Point3]) -> Result<f64, EvalError> {
    check::points("first curve", a)?;
    check::points("second curve", b)?;
    Ok(coupling_distance(a.iter(), b))
}

/// The same for checked curves, `a` in any order of iteration.
pub(crate) fn coupling_distance<'a>(a: impl Iterator<Item = &'a Point3>, b: &[Point3]) -> f64 {
    // Squared distances: the order is the same and one root at the end is enough.
    let mut row: Vec<f64> = Vec::new();
    for p in a {
        if row.is_empty() {
            let mut largest = 0.0_f64;
            row.extend(b.iter().map(|q| {
                largest = largest.max((p - q).norm_squared());
                largest
            }));
            continue;
        }
        // `diagonal` is the upper left, `left` the cell just written.
        let mut diagonal = f64::INFINITY;
        let mut left = f64::INFINITY;
        for (cell, q) in row.iter_mut().zip(b) {
            let up = *cell;
            left = larger(smaller(smaller(up, diagonal), left), (p - q).norm_squared());
            diagonal = up;
            *cell = left;
        }
    }
    row.last().copied().unwrap_or(f64::INFINITY).sqrt()
}

/// No NaN gets here, so one machine instruction will do where `f64::min` needs several: they are all
/// on the path from each cell to the next.
fn smaller(a: f64, b: f64) -> f64 {
    if a < b { a } else { b }
}

fn larger(a: f64, b: f64) -> f64 {
    if a > b { a } else { b }
}
