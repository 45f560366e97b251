use std::f64::consts::TAU;

use accurate_geom::{ImageSize, Point2};
use ndarray::Array2;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;

use super::stroke::{Profile, Stroke, add_stroke};
use super::wander::{Tip, Wander, entry, log_uniform};
use crate::background::{Background, bilinear};
use crate::xray::blur;

/// Optical depth of what lies behind the devices; shape (side, side).
pub(crate) fn draw(rng: &mut ChaCha8Rng, side: usize, strength: f64) -> Array2<f64> {
    let mut depth = match rng.random_range(0..10_u32) {
        0..6 => patient(rng, side),
        6..8 => soft_tissue(rng, side),
        _ => bench_phantom(rng, side),
    };
    depth.mapv_inplace(|value| value * strength);
    if rng.random_bool(0.35) {
        add_gas(rng, &mut depth);
    }
    if rng.random_bool(0.35) {
        add_vessel_tree(rng, &mut depth);
    }
    depth
}

/// The chest of the pair generator, magnified, mirrored and turned.
fn patient(rng: &mut ChaCha8Rng, side: usize) -> Array2<f64> {
    let field = ImageSize { width: side as u32, height: side as u32 };
    let grid = Background::draw(rng, field).into_grid();
    let nodes = (grid.nrows().min(grid.ncols()) - 2) as f64;
    let zoom = log_uniform(rng, 1.0, 2.6);
    let window = nodes / zoom;
    let x0 = rng.random_range(0.0..=1.0) * (nodes - window);
    let y0 = rng.random_range(0.0..=1.0) * (nodes - window);
    let (flip, turn) = (rng.random_bool(0.5), rng.random_bool(0.25));
    let step = window / side as f64;
    Array2::from_shape_fn((side, side), |(row, column)| {
        let (r, c) = if turn { (column, row) } else { (row, column) };
        let c = if flip { side - 1 - c } else { c };
        bilinear(&grid, x0 + c as f64 * step, y0 + r as f64 * step)
    })
}

/// Value noise alone: an abdomen, a thigh, a water tank.
fn soft_tissue(rng: &mut ChaCha8Rng, side: usize) -> Array2<f64> {
    let level = rng.random_range(0.3..1.2);
    let tilt = (rng.random_range(-0.5..0.5), rng.random_range(-0.5..0.5));
    let roughness = rng.random_range(0.0..1.0);
    let mut depth = Array2::from_shape_fn((side, side), |(row, column)| {
        let (x, y) = (column as f64 / side as f64 - 0.5, row as f64 / side as f64 - 0.5);
        level + tilt.0 * x + tilt.1 * y
    });
    for (cells, amplitude) in [(2_usize, 0.35), (5, 0.2), (11, 0.1), (27, 0.05), (70, 0.025)] {
        let grid = Array2::from_shape_simple_fn((cells + 3, cells + 3), || {
            roughness * rng.random_range(-amplitude..amplitude)
        });
        let step = cells as f64 / side as f64;
        let eased = |value: f64| {
            let part = value.fract();
            value.floor() + part * part * (3.0 - 2.0 * part)
        };
        for ((row, column), value) in depth.indexed_iter_mut() {
            *value += bilinear(&grid, eased(column as f64 * step), eased(row as f64 * step));
        }
    }
    depth.mapv_inplace(|value| value.max(0.0));
    depth
}

/// A flat plate with block edges and hollow tubes: a silicone vessel model on a table.
fn bench_phantom(rng: &mut ChaCha8Rng, side: usize) -> Array2<f64> {
    let level = rng.random_range(0.1..0.8);
    let mut depth = Array2::from_elem((side, side), level);
    for _ in 0..rng.random_range(0..4_u32) {
        let heading = rng.random_range(0.0..TAU);
        let (cos, sin) = (heading.cos(), heading.sin());
        let at = rng.random_range(-0.45..0.45) * side as f64;
        let (jump, soft) = (rng.random_range(-0.3..0.3_f64), rng.random_range(0.5..2.0));
        let middle = side as f64 / 2.0;
        for ((row, column), value) in depth.indexed_iter_mut() {
            let d = (column as f64 - middle) * cos + (row as f64 - middle) * sin - at;
            *value = (*value + jump / (1.0 + (-d / soft).exp())).max(0.0);
        }
    }
    let mut tubes = Array2::zeros((side, side));
    for _ in 0..rng.random_range(1..5_u32) {
        let points = free_path(rng, side, 0.002);
        let radius = rng.random_range(8.0..30.0);
        let wall = rng.random_range(0.04..0.25);
        let bore = rng.random_range(0.7..0.92);
        add_stroke(
            &mut tubes,
            &Stroke {
                points: &points,
                radius_px: &|_| radius,
                depth: &|_| wall,
                profile: Profile::Hollow(bore),
            },
        );
    }
    depth += &tubes;
    depth
}

/// Bubbles of gas: bright, round, in groups.
fn add_gas(rng: &mut ChaCha8Rng, depth: &mut Array2<f64>) {
    let side = depth.ncols() as f64;
    for _ in 0..rng.random_range(1..4_u32) {
        let (cx, cy) = (rng.random_range(0.0..side), rng.random_range(0.0..side));
        for _ in 0..rng.random_range(1..5_u32) {
            let (x, y) = (
                cx + rng.random_range(-0.12..0.12) * side,
                cy + rng.random_range(-0.12..0.12) * side,
            );
            let (a, b) = (rng.random_range(0.02..0.12) * side, rng.random_range(0.02..0.12) * side);
            let strength = rng.random_range(0.05..0.35);
            let soft = rng.random_range(0.05..0.3);
            let (sin, cos) = f64::sin_cos(rng.random_range(0.0..TAU));
            for ((row, column), value) in depth.indexed_iter_mut() {
                let (dx, dy) = (column as f64 - x, row as f64 - y);
                let (u, v) = ((cos * dx + sin * dy) / a, (cos * dy - sin * dx) / b);
                let r2 = u * u + v * v;
                if r2 < 4.0 {
                    let cover = 1.0 / (1.0 + ((r2.sqrt() - 1.0) / soft).exp());
                    *value = (*value - strength * cover).max(0.0);
                }
            }
        }
    }
}

/// Contrast-filled vessels: tapering, branching, soft, and much fainter where thinner, so that a
/// small branch is not a wire.
fn add_vessel_tree(rng: &mut ChaCha8Rng, depth: &mut Array2<f64>) {
    let side = depth.ncols();
    let per_px = rng.random_range(0.008..0.03);
    let mut layer = Array2::<f64>::zeros(depth.dim());
    let trunk = free_path(rng, side, 0.004);
    let root = rng.random_range(5.0..18.0_f64);
    let mut open = vec![(trunk, root, 0_u32)];
    while let Some((points, radius, generation)) = open.pop() {
        let length = points.len() as f64 * super::wander::STEP_PX;
        let radius_at = |s: f64| (radius * (1.0 - 0.55 * s / length)).max(1.0);
        let mut branch = Array2::zeros(depth.dim());
        add_stroke(
            &mut branch,
            &Stroke {
                points: &points,
                radius_px: &radius_at,
                depth: &|s| per_px * 2.0 * radius_at(s).powi(2) / root,
                profile: Profile::Solid,
            },
        );
        layer.zip_mut_with(&branch, |all, one| *all = all.max(*one));
        if generation == 2 || points.len() < 60 {
            continue;
        }
        for _ in 0..rng.random_range(1..4_u32) {
            let from = rng.random_range(points.len() / 5..points.len() - 10);
            let along = points[from + 5] - points[from];
            let side_turn =
                if rng.random_bool(0.5) { 1.0 } else { -1.0 } * rng.random_range(0.4..1.1);
            let wander = Wander {
                length_px: length * rng.random_range(0.25..0.7),
                bending: 0.012,
                memory_px: 40.0,
                loops: vec![],
                tip: Tip::Plain,
                home: None,
            };
            let child = wander.draw(rng, points[from], along.y.atan2(along.x) + side_turn);
            let at = radius_at(from as f64 * super::wander::STEP_PX);
            open.push((child, at * rng.random_range(0.45..0.8), generation + 1));
        }
    }
    blur(&mut layer, rng.random_range(0.8..2.5));
    *depth += &layer;
}

/// A path from the border through the image.
fn free_path(rng: &mut ChaCha8Rng, side: usize, bending: f64) -> Vec<Point2> {
    let (start, heading) = entry(rng, side as f64);
    let wander = Wander {
        length_px: rng.random_range(0.4..1.3) * side as f64,
        bending,
        memory_px: 80.0,
        loops: vec![],
        tip: Tip::Plain,
        home: None,
    };
    wander.draw(rng, start, heading)
}
