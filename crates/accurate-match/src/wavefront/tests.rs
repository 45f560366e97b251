use accurate_geom::nalgebra::Matrix3;
use accurate_geom::{Fundamental, Pixel, View1, View2};
use proptest::prelude::*;

use super::*;

const KINDS: [DistanceKind; 4] =
    [DistanceKind::View1, DistanceKind::View2, DistanceKind::Symmetric, DistanceKind::Sampson];
const ORDERS: [TieOrder; 2] = [TieOrder::UpLeftDiagonal, TieOrder::DiagonalFirst];

fn machines() -> Vec<Machine> {
    let mut machines = vec![Machine::Portable];
    #[cfg(target_arch = "x86_64")]
    {
        machines.extend(pulp::x86::V3::try_new().map(Machine::Avx2));
        machines.extend(pulp::x86::V4::try_new().map(Machine::Avx512));
    }
    machines
}

fn plain(costs: &CostModel, ties: TieOrder) -> Alignment {
    align_rows(costs.n1(), costs.n2(), |i, row| costs.fill_row(i, row), ties).unwrap()
}

/// A rectified pair seen through a projective change of both images: neither epipole is in sight.
fn fundamental() -> Fundamental<View1, View2> {
    let rectified = Matrix3::new(0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 1.0, 0.0);
    let h1 = Matrix3::new(1.0, 0.1, 3.0, -0.2, 0.9, 5.0, 1e-5, 2e-5, 1.0);
    let h2 = Matrix3::new(0.8, -0.3, 1.0, 0.1, 1.1, -4.0, -2e-5, 1e-5, 1.0);
    Fundamental::from_matrix(h1.transpose() * rectified * h2).unwrap()
}

/// Two samplings of one wavy body; `grid` rounds to whole pixels, which makes ties common.
fn curves(
    n1: usize,
    n2: usize,
    waves: f64,
    grid: bool,
    apart: f64,
) -> (Vec<Pixel<View1>>, Vec<Pixel<View2>>) {
    let round = |v: f64| if grid { v.round() } else { v };
    let at =
        |s: f64| (250.0 + 200.0 * (waves * s).cos(), 250.0 + 200.0 * (1.0 + waves * 0.7 * s).sin());
    let one = (0..n1).map(|k| {
        let (x, y) = at(k as f64 / n1 as f64);
        Pixel::new(round(x), round(y))
    });
    let two = (0..n2).map(|k| {
        let s = k as f64 / n2 as f64;
        let (x, y) = at(s + 0.02 * (9.0 * s).sin());
        Pixel::new(round(x * 0.9 + 20.0), round(y + apart))
    });
    (one.collect(), two.collect())
}

proptest! {
    #[test]
    fn every_machine_gives_the_bits_of_the_plain_kernel(
        n1 in 1..150_usize, n2 in 1..150_usize, waves in 0.5..9.0_f64, grid in any::<bool>(),
        apart in -40.0..40.0_f64, kind in prop::sample::select(KINDS.to_vec()),
    ) {
        let (one, two) = curves(n1, n2, waves, grid, apart);
        let costs = CostModel::new(&fundamental(), &one, &two, kind).unwrap();
        for ties in ORDERS {
            let expected = plain(&costs, ties);
            for machine in machines() {
                // One block, and blocks of one band.
                for bytes in [RECORD_BYTES, 0] {
                    let found = align_within(&costs, ties, machine, bytes, Prune::No).unwrap();
                    prop_assert_eq!(&found, &expected);
                }
            }
        }
    }

    #[test]
    fn any_bound_at_or_above_the_optimum_gives_the_same_path(
        n1 in 1..200_usize, n2 in 1..200_usize, waves in 0.5..9.0_f64, grid in any::<bool>(),
        apart in -40.0..40.0_f64, factor in 1.0..3.0_f64,
    ) {
        let (one, two) = curves(n1, n2, waves, grid, apart);
        let costs = CostModel::new(&fundamental(), &one, &two, DistanceKind::View1).unwrap();
        let columns = Columns::of(&costs, 1).unwrap();
        for ties in ORDERS {
            let expected = plain(&costs, ties);
            for machine in machines() {
                for factor in [1.0, factor] {
                    let bound = expected.total_cost * factor;
                    for bytes in [RECORD_BYTES, 0] {
                        let plan = Plan::new(n1, n2, bytes).unwrap();
                        let job = Job { columns: &columns, ties, bound, plan, path: true };
                        prop_assert_eq!(machine.run(job), Some(expected.clone()));
                    }
                }
                // Too low a bound may leave out too much, but never claims to be below it.
                let bound = expected.total_cost * 0.99 - 1e-9;
                let plan = Plan::new(n1, n2, RECORD_BYTES).unwrap();
                let low = machine.run(Job { columns: &columns, ties, bound, plan, path: true });
                prop_assert!(low.is_none_or(|found| found.total_cost > bound));
            }
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    #[test]
    fn long_curves_are_pruned_to_the_same_answer(
        n1 in 300..1500_usize, n2 in 300..1500_usize, waves in 0.5..9.0_f64, grid in any::<bool>(),
        apart in -40.0..40.0_f64, kind in prop::sample::select(KINDS.to_vec()),
    ) {
        let (one, two) = curves(n1, n2, waves, grid, apart);
        let costs = CostModel::new(&fundamental(), &one, &two, kind).unwrap();
        for ties in ORDERS {
            prop_assert_eq!(align_curves(&costs, ties).unwrap(), plain(&costs, ties));
        }
    }
}

#[test]
fn numbers_out_of_range_go_to_the_plain_kernel() {
    let two = [Pixel::<View2>::new(1.0, 2.0), Pixel::new(5.0, 1.0)];
    for size in [1e119, 1e121, 1e160] {
        let one = [Pixel::<View1>::new(size, -size), Pixel::new(-size, size)];
        let Ok(costs) = CostModel::new(&fundamental(), &one, &two, DistanceKind::View1) else {
            continue;
        };
        assert_eq!(Columns::of(&costs, 1).is_some(), size < 1e120);
        for ties in ORDERS {
            let plain = align_rows(2, 2, |i, row| costs.fill_row(i, row), ties);
            assert_eq!(align_curves(&costs, ties), plain);
        }
    }
}

#[test]
fn sixteen_thousand_points_stay_below_100_mb_and_the_limit_is_far() {
    let bytes = |n: usize, record: usize| {
        let plan = Plan::new(n, n, record).unwrap();
        let kept = n.div_ceil(plan.block_rows) - 1;
        plan.block_rows * (n + BAND).div_ceil(4) + kept * n * 8
    };
    assert!(bytes(16_384, RECORD_BYTES) < 100 << 20);
    assert_eq!(Plan::new(16_384, 16_384, RECORD_BYTES).unwrap().block_rows, 16_384);
    assert!(bytes(131_072, RECORD_BYTES) < 200 << 20);
    assert!(matches!(Plan::new(1 << 32, 1 << 32, RECORD_BYTES), Err(MatchError::TooLarge { .. })));
}
