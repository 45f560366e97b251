//! How the kernels grow with their input: points from 256 to 16384, masks from 256² to 4096².
#![allow(missing_docs, clippy::unwrap_used)]

use std::hint::black_box;

use accurate_eval::{polyline_distances, table_scores};
use accurate_geom::{Pixel, Point3, Triangulation, Triangulator, View2};
use accurate_match::{CostModel, DistanceKind, TieOrder, align_curves};
use accurate_seg::zhang_suen;
use accurate_speed::{Wire, wire_mask};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};

const POINTS: [usize; 7] = [256, 512, 1024, 2048, 4096, 8192, 16_384];
const SIDES: [usize; 5] = [256, 512, 1024, 2048, 4096];

fn alignment(c: &mut Criterion) {
    let wire = Wire::new().unwrap();
    let f = wire.rig().fundamental();
    let mut group = c.benchmark_group("ecdp");
    group.sample_size(10);
    for n in POINTS {
        let (one, together) = wire.curves(n, true).unwrap();
        // Far from every epipolar line that it could belong to: nothing can be left out.
        let apart: Vec<Pixel<View2>> =
            together.iter().map(|p| Pixel::new(p.x + 300.0, p.y + 300.0)).collect();
        group.throughput(Throughput::Elements((n * n) as u64));
        for (name, two) in [("together", &together), ("apart", &apart)] {
            group.bench_with_input(BenchmarkId::new(name, n), &n, |b, _| {
                b.iter(|| {
                    let costs = CostModel::new(f, black_box(&one), two, DistanceKind::View1);
                    align_curves(&costs.unwrap(), TieOrder::UpLeftDiagonal).unwrap()
                });
            });
        }
    }
    group.finish();
}

fn triangulation(c: &mut Criterion) {
    let wire = Wire::new().unwrap();
    let mut group = c.benchmark_group("triangulation");
    group.sample_size(20);
    for n in POINTS {
        let (one, two) = wire.curves(n, true).unwrap();
        group.throughput(Throughput::Elements(n as u64));
        for method in Triangulation::ALL {
            let triangulator = Triangulator::new(wire.rig(), method);
            group.bench_with_input(BenchmarkId::new(method.name(), n), &n, |b, _| {
                let pairs = || black_box(&one).iter().copied().zip(two.iter().copied());
                b.iter(|| triangulator.triangulate_all(pairs()));
            });
        }
    }
    group.finish();
}

fn thinning(c: &mut Criterion) {
    let mut group = c.benchmark_group("thinning");
    group.sample_size(20);
    for side in SIDES {
        let mask = wire_mask(side).unwrap();
        group.throughput(Throughput::Elements((side * side) as u64));
        group.bench_with_input(BenchmarkId::new("zhang_suen", side), &mask, |b, mask| {
            b.iter(|| zhang_suen(black_box(mask)));
        });
    }
    group.finish();
}

fn metrics(c: &mut Criterion) {
    let wire = Wire::new().unwrap();
    let mut group = c.benchmark_group("metrics");
    group.sample_size(20);
    for n in POINTS {
        let truth = wire.points(n);
        let curve: Vec<Point3> = truth.iter().map(|p| p + (p.coords.yzx() * 1e-3)).collect();
        group.throughput(Throughput::Elements(n as u64));
        group.bench_with_input(BenchmarkId::new("points", n), &n, |b, _| {
            b.iter(|| table_scores(black_box(&curve), black_box(&truth)).unwrap());
        });
        group.bench_with_input(BenchmarkId::new("segments", n), &n, |b, _| {
            b.iter(|| {
                let there = polyline_distances(black_box(&curve), black_box(&truth)).unwrap();
                (there, polyline_distances(black_box(&truth), black_box(&curve)).unwrap())
            });
        });
    }
    group.finish();
}

criterion_group!(benches, alignment, triangulation, thinning, metrics);
criterion_main!(benches);
