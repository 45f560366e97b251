//! How every stage grows with its input: points from 256 to 8192, masks from 256² to 2048².
#![allow(missing_docs, clippy::unwrap_used)]

use std::hint::black_box;

use accurate3d::baselines::cheapest_grid_path;
use accurate3d::eval::{curve_scores, table_scores};
use accurate3d::geom::{Pixel, Point3, Triangulation, Triangulator, View1, View2};
use accurate3d::matching::{
    CostModel, CurveMatcher, DistanceKind, Ecdp, EcdpParams, TieOrder, align_rows,
};
use accurate3d::seg::{Mask, Skeleton, zhang_suen};
use accurate3d::synth::{CaseOptions, Family, SynthCase, generate};
use accurate3d::traverse::{TraverseParams, trace_single};
use accurate3d::{InputKind, Method, Params, ViewPair, reconstruct};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use ndarray::Array2;

const POINTS: [usize; 6] = [256, 512, 1024, 2048, 4096, 8192];
const SIDES: [usize; 4] = [256, 512, 1024, 2048];

fn case() -> SynthCase {
    generate(Family::Medium, 1000, 0, &CaseOptions::default()).unwrap()
}

/// `n` points uniform along the truth of a self-crossing wire, and their exact projections.
fn curves(case: &SynthCase, n: usize) -> (Vec<Point3>, Vec<Pixel<View1>>, Vec<Pixel<View2>>) {
    let length = case.length();
    let points: Vec<Point3> = (0..n)
        .map(|k| case.truth_at(length * k as f64 / (n - 1) as f64).unwrap_or(case.truth[0]))
        .collect();
    let (p1, p2) = points.iter().map(|p| case.true_rig.project(p).unwrap()).unzip();
    (points, p1, p2)
}

fn matching(c: &mut Criterion) {
    let case = case();
    let mut group = c.benchmark_group("ecdp_with_path");
    group.sample_size(10);
    for n in POINTS {
        let (_, p1, p2) = curves(&case, n);
        let ecdp = Ecdp { params: EcdpParams::PAPER };
        group.throughput(Throughput::Elements((n * n) as u64));
        group.bench_with_input(BenchmarkId::from_parameter(n), &n, |b, _| {
            b.iter(|| ecdp.reconstruct(black_box(&p1), black_box(&p2), &case.rig).unwrap());
        });
    }
    group.finish();
    // The paper's claim: the same optimum as Baur's graph search, found more efficiently.
    let mut group = c.benchmark_group("monotone_matching");
    group.sample_size(10);
    for n in [256, 512, 1024] {
        let (_, p1, p2) = curves(&case, n);
        let f = case.rig.fundamental();
        let model = CostModel::new(f, &p1, &p2, DistanceKind::View1).unwrap();
        group.throughput(Throughput::Elements((n * n) as u64));
        group.bench_with_input(BenchmarkId::new("ecdp", n), &n, |b, &n| {
            b.iter(|| {
                let fill = |i: usize, row: &mut [f64]| model.fill_row(i, row);
                align_rows(n, n, fill, TieOrder::UpLeftDiagonal).unwrap()
            });
        });
        group.bench_with_input(BenchmarkId::new("dijkstra", n), &n, |b, &n| {
            b.iter(|| cheapest_grid_path(n, n, |i, j| model.cost(i, j)).unwrap());
        });
    }
    group.finish();
}

fn triangulation(c: &mut Criterion) {
    let case = case();
    let (_, p1, p2) = curves(&case, 4096);
    let mut group = c.benchmark_group("triangulate_4096");
    group.throughput(Throughput::Elements(4096));
    for method in [
        Triangulation::Dlt,
        Triangulation::Midpoint,
        Triangulation::LindstromNiter2,
        Triangulation::GaussNewton,
    ] {
        let triangulator = Triangulator::new(&case.rig, method);
        group.bench_function(method.to_string(), |b| {
            b.iter(|| {
                p1.iter()
                    .zip(&p2)
                    .filter_map(|(&a, &b)| triangulator.triangulate(a, b).ok())
                    .map(|p| p.x)
                    .sum::<f64>()
            });
        });
    }
    group.finish();
}

/// A sine of `side` px, 6 px thick.
fn wire_mask(side: usize) -> Mask {
    let s = side as f64;
    let image = Array2::from_shape_fn((side, side), |(row, col)| {
        let phase = col as f64 * 12.0 / s;
        let centre = s / 2.0 + 0.35 * s * phase.sin();
        let slope = 0.35 * 12.0 * phase.cos();
        (row as f64 - centre).abs() / slope.hypot(1.0) < 3.0
    });
    Mask::from_array(image).unwrap()
}

fn masks(c: &mut Criterion) {
    let mut group = c.benchmark_group("thinning");
    group.sample_size(20);
    for side in SIDES {
        let mask = wire_mask(side);
        group.throughput(Throughput::Elements((side * side) as u64));
        group.bench_with_input(BenchmarkId::from_parameter(side), &mask, |b, mask| {
            b.iter(|| zhang_suen(black_box(mask)));
        });
    }
    group.finish();
    let mut group = c.benchmark_group("traversal");
    group.sample_size(20);
    for side in SIDES {
        let skeleton = Skeleton::of(&zhang_suen(&wire_mask(side))).unwrap();
        let pixels = skeleton.pixels_as::<View1>();
        group.throughput(Throughput::Elements(pixels.len() as u64));
        group.bench_with_input(BenchmarkId::from_parameter(side), &pixels, |b, pixels| {
            b.iter(|| trace_single(black_box(pixels), &TraverseParams::PAPER).unwrap());
        });
    }
    group.finish();
}

fn metrics(c: &mut Criterion) {
    let case = case();
    let mut group = c.benchmark_group("scores");
    group.sample_size(10);
    for n in POINTS {
        let (truth, _, _) = curves(&case, n);
        let curve: Vec<Point3> = truth.iter().map(|p| p + (p.coords.yzx() * 1e-3)).collect();
        group.throughput(Throughput::Elements(n as u64));
        group.bench_with_input(BenchmarkId::new("table", n), &n, |b, _| {
            b.iter(|| table_scores(black_box(&curve), black_box(&truth)).unwrap());
        });
        if n <= 2048 {
            let spacing = case.length() / n as f64;
            group.bench_with_input(BenchmarkId::new("polyline", n), &n, |b, _| {
                b.iter(|| curve_scores(black_box(&curve), black_box(&truth), spacing).unwrap());
            });
        }
    }
    group.finish();
}

fn pipeline(c: &mut Criterion) {
    let pair = ViewPair::from(case());
    let mut group = c.benchmark_group("pair_512");
    group.sample_size(10);
    for (input, method) in [
        (InputKind::Points, Method::Paper),
        (InputKind::Mask, Method::Paper),
        (InputKind::Mask, Method::Accurate),
    ] {
        let params = Params::new(input, method);
        group.bench_function(format!("{input}_{method}"), |b| {
            b.iter(|| reconstruct(black_box(&pair), &params).unwrap());
        });
    }
    group.finish();
}

criterion_group!(benches, matching, triangulation, masks, metrics, pipeline);
criterion_main!(benches);
