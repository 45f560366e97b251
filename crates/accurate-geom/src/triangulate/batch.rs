use std::marker::PhantomData;

use pulp::{Arch, Simd, WithSimd};

use super::method::Method;
use super::two_view::TwoView;
use super::{Triangulated, Triangulator};
use crate::number::{Two, Vector};
use crate::{Pixel, Point3, View1, View2};

/// Pairs that go through the kernel at once: a multiple of two of every vector, small enough for the
/// nearest cache.
const CHUNK: usize = 64;

/// x1, y1, x2, y2 of a chunk.
type Pixels = [[f64; CHUNK]; 4];

/// x, y, z of the points of a chunk, and a number above 0 where they are points beyond doubt.
type Points = [[f64; CHUNK]; 4];

/// Triangulates all pairs, [`CHUNK`] at a time.
pub(super) fn run<M: Method, I: Iterator<Item = (Pixel<View1>, Pixel<View2>)>>(
    triangulator: &Triangulator,
    mut pairs: I,
    found: &mut Triangulated,
) {
    let machine = Arch::new();
    let geometry = &triangulator.geometry;
    let mut pixels = [[0.0; CHUNK]; 4];
    let mut points = [[0.0; CHUNK]; 4];
    let mut done = 0;
    loop {
        let mut count = 0;
        for (p1, p2) in pairs.by_ref().take(CHUNK) {
            for (row, value) in pixels.iter_mut().zip([p1.x, p1.y, p2.x, p2.y]) {
                row[count] = value;
            }
            count += 1;
        }
        machine.dispatch(Chunk::<M> {
            geometry,
            pixels: &pixels,
            count,
            points: &mut points,
            method: PhantomData,
        });
        let [x, y, z, fine] = &points;
        let point = |k: usize| Point3::new(x[k], y[k], z[k]);
        // NaN is not fine either.
        if fine[..count].iter().all(|&fine| fine > 0.0) {
            found.points.extend((0..count).map(point));
        } else {
            for k in 0..count {
                let p1 = Pixel::new(pixels[0][k], pixels[1][k]);
                let p2 = Pixel::new(pixels[2][k], pixels[3][k]);
                let fine = fine[k] > 0.0;
                found.push(
                    done + k,
                    if fine { Ok(point(k)) } else { triangulator.triangulate(p1, p2) },
                );
            }
        }
        if count < CHUNK {
            return;
        }
        done += count;
    }
}

struct Chunk<'a, M> {
    geometry: &'a TwoView,
    pixels: &'a Pixels,
    count: usize,
    points: &'a mut Points,
    method: PhantomData<M>,
}

impl<M: Method> WithSimd for Chunk<'_, M> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let g = self.geometry;
        let [x1, y1, x2, y2] = self.pixels;
        let (x1, y1) = (S::as_simd_f64s(x1).0, S::as_simd_f64s(y1).0);
        let (x2, y2) = (S::as_simd_f64s(x2).0, S::as_simd_f64s(y2).0);
        let two = |row: &[S::f64s], k: usize| {
            Two(Vector { simd, lanes: row[k] }, Vector { simd, lanes: row[k + 1] })
        };
        for k in (0..self.count.div_ceil(S::F64_LANES)).step_by(2) {
            let p1 = [two(x1, k), two(y1, k)];
            let p2 = [two(x2, k), two(y2, k)];
            let ([x, y, z], fine) = M::solve(g, &p1, &p2).world(g, &p1, &p2);
            let numbers = [x, y, z, fine];
            for n in 0..numbers.len() {
                let row = S::as_mut_simd_f64s(&mut self.points[n]).0;
                row[k] = numbers[n].0.lanes;
                row[k + 1] = numbers[n].1.lanes;
            }
        }
    }
}
