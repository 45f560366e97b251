//! What lies above the kernels: other matchings, traversal, scores of whole curves, whole pairs.
#![allow(missing_docs, clippy::unwrap_used)]

use std::hint::black_box;

use accurate_speed::{Wire, wire_mask};
use accurate3d::baselines::cheapest_grid_path;
use accurate3d::eval::curve_scores;
use accurate3d::geom::{Point3, View1};
use accurate3d::matching::{CostModel, DistanceKind, TieOrder, align_rows};
use accurate3d::seg::{Skeleton, zhang_suen};
use accurate3d::synth::{CaseOptions, Family, generate};
use accurate3d::traverse::{TraverseParams, trace_single};
use accurate3d::{InputKind, Method, Params, ViewPair, reconstruct};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};

const POINTS: [usize; 4] = [256, 512, 1024, 2048];
const SIDES: [usize; 4] = [256, 512, 1024, 2048];

fn matching(c: &mut Criterion) {
    let wire = Wire::new().unwrap();
    // The paper's claim: the same optimum as Baur's graph search, found more efficiently.
    let mut group = c.benchmark_group("monotone_matching");
    group.sample_size(10);
    for n in [256, 512, 1024] {
        let (p1, p2) = wire.curves(n, false).unwrap();
        let f = wire.rig().fundamental();
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

fn masks(c: &mut Criterion) {
    let mut group = c.benchmark_group("traversal");
    group.sample_size(20);
    for side in SIDES {
        let skeleton = Skeleton::of(&zhang_suen(&wire_mask(side).unwrap())).unwrap();
        let pixels = skeleton.pixels_as::<View1>();
        group.throughput(Throughput::Elements(pixels.len() as u64));
        group.bench_with_input(BenchmarkId::from_parameter(side), &pixels, |b, pixels| {
            b.iter(|| trace_single(black_box(pixels), &TraverseParams::PAPER).unwrap());
        });
    }
    group.finish();
}

fn metrics(c: &mut Criterion) {
    let wire = Wire::new().unwrap();
    let mut group = c.benchmark_group("curve_scores");
    group.sample_size(10);
    for n in POINTS {
        let truth = wire.points(n);
        let curve: Vec<Point3> = truth.iter().map(|p| p + (p.coords.yzx() * 1e-3)).collect();
        let spacing = (truth[1] - truth[0]).norm();
        group.throughput(Throughput::Elements(n as u64));
        group.bench_with_input(BenchmarkId::from_parameter(n), &n, |b, _| {
            b.iter(|| curve_scores(black_box(&curve), black_box(&truth), spacing).unwrap());
        });
    }
    group.finish();
}

fn pipeline(c: &mut Criterion) {
    let case = generate(Family::Medium, 1000, 0, &CaseOptions::default()).unwrap();
    let pair = ViewPair::from(case);
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

criterion_group!(benches, matching, masks, metrics, pipeline);
criterion_main!(benches);
