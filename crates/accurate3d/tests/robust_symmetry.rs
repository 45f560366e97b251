//! What is made of masks does not depend on how they lie or which is called the first.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "support/turned_cameras.rs"]
mod turned_cameras;

use accurate3d::eval::curve_scores;
use accurate3d::fit::CalibrationPriors;
use accurate3d::geom::{Camera, Point2, Rig, View1};
use accurate3d::synth::{CaseOptions, Family, SynthCase, generate};
use accurate3d::{InputKind, Method, Params, Reconstruction, ViewPair, reconstruct, trace_mask};
use ndarray::{Array2, Axis};
use turned_cameras::{mirrored, transposed};

/// How an image is turned.
#[derive(Debug, Clone, Copy)]
enum Turn {
    MirrorX,
    Transpose,
    Rotate90,
}

impl Turn {
    fn mask(self, mask: &Array2<bool>) -> Array2<bool> {
        let mirrored = |mask: &Array2<bool>| {
            let mut mask = mask.clone();
            mask.invert_axis(Axis(1));
            mask
        };
        match self {
            Self::MirrorX => mirrored(mask),
            Self::Transpose => mask.t().to_owned(),
            Self::Rotate90 => mirrored(&mask.t().to_owned()),
        }
    }

    /// The camera whose image is the turned one.
    fn camera(self, camera: &Camera) -> Camera {
        match self {
            Self::MirrorX => mirrored(camera),
            Self::Transpose => transposed(camera),
            Self::Rotate90 => mirrored(&transposed(camera)),
        }
    }

    /// Where a point of an image is shown in the turned one, which is `turned_width` wide.
    fn point(self, [x, y]: [f64; 2], turned_width: f64) -> [f64; 2] {
        match self {
            Self::MirrorX => [turned_width - 1.0 - x, y],
            Self::Transpose => [y, x],
            Self::Rotate90 => [turned_width - 1.0 - y, x],
        }
    }

    fn pair(self, case: &SynthCase) -> (Rig, [Array2<bool>; 2]) {
        let [one, two] = [case.rig.camera1(), case.rig.camera2()].map(|c| self.camera(c));
        let rig = Rig::new(one, two, case.rig.unit()).unwrap();
        (rig, [self.mask(&case.masks[0]), self.mask(&case.masks[1])])
    }
}

const TURNS: [Turn; 3] = [Turn::MirrorX, Turn::Transpose, Turn::Rotate90];

/// The same numbers are summed in the same order; what differs is how cameras are rounded.
const ROUNDING_PX: f64 = 1e-6;

/// Among them those that differed most, up to 9 px, while only skeletons were the same however masks lie.
const CASES: [(Family, u64); 7] = [
    (Family::Easy, 13),
    (Family::Medium, 4),
    (Family::Medium, 7),
    (Family::Medium, 13),
    (Family::Hard, 2),
    (Family::Hard, 6),
    (Family::Hard, 7),
];

fn cases() -> impl Iterator<Item = SynthCase> {
    CASES
        .into_iter()
        .map(|(family, index)| generate(family, 1000, index, &CaseOptions::default()).unwrap())
}

fn params() -> Params {
    Params::new(InputKind::Mask, Method::Accurate)
}

fn curve(rig: &Rig, masks: [Array2<bool>; 2], params: &Params) -> Reconstruction {
    let pair = ViewPair { masks: Some(masks), ..ViewPair::new("symmetry", rig.clone()) };
    reconstruct(&pair, params).unwrap()
}

fn assert_same_curve(case: &SynthCase, here: &Reconstruction, there: &Reconstruction) {
    let depth: f64 = case.truth.iter().map(|p| case.rig.camera1().depth(p)).sum::<f64>()
        / case.truth.len() as f64;
    let unit_per_px = depth / case.rig.camera1().k()[(0, 0)].abs();
    let (a, b) = (here.positions(), there.positions());
    let apart_px = curve_scores(&a, &b, 0.5 * unit_per_px).unwrap().hausdorff / unit_per_px;
    assert!(apart_px < ROUNDING_PX, "{}: {apart_px} px", case.id);
    assert_eq!(here.diagnostics.suspicions, there.diagnostics.suspicions, "{}", case.id);
}

fn assert_same_points(here: &[Point2], there: &[Point2], name: &str) {
    assert_eq!(here.len(), there.len(), "{name}");
    for (a, b) in here.iter().zip(there) {
        assert!((a - b).norm() < ROUNDING_PX, "{name}: {a} {b}");
    }
}

#[test]
fn images_that_lie_otherwise_give_the_same_curve() {
    for case in cases() {
        let here = curve(&case.rig, case.masks.clone(), &params());
        for turn in TURNS {
            let (rig, masks) = turn.pair(&case);
            let width = masks[0].ncols() as f64;
            let there = curve(&rig, masks, &params());
            assert_same_curve(&case, &here, &there);
            // And what is told in pixels is told in those of the images that were given.
            let turned = |p: Point2| Point2::from(turn.point([p.x, p.y], width));
            let expected: Vec<_> = here.traces.points1.iter().map(|p| turned(p.point())).collect();
            let found: Vec<_> = there.traces.points1.iter().map(|p| p.point()).collect();
            assert_same_points(&expected, &found, &case.id);
            let places = |r: &Reconstruction| -> Vec<Point2> {
                r.explanation.junctions[0].iter().map(|j| Point2::from(j.at)).collect()
            };
            let expected: Vec<_> = places(&here).into_iter().map(turned).collect();
            assert_same_points(&expected, &places(&there), &case.id);
        }
    }
}

#[test]
fn swapped_views_give_the_same_curve() {
    for case in cases() {
        let here = curve(&case.rig, case.masks.clone(), &params());
        let [one, two] = case.masks.clone();
        let there = curve(&case.rig.swapped(), [two, one], &params());
        assert_same_curve(&case, &here, &there);
        let of_one: Vec<_> = here.traces.points1.iter().map(|p| p.point()).collect();
        let also: Vec<_> = there.traces.points2.iter().map(|p| p.point()).collect();
        assert_same_points(&of_one, &also, &case.id);
        let [a, b] = here.explanation.junctions;
        assert_eq!([b, a], there.explanation.junctions);
        let [a, b] = here.diagnostics.trace_coverage;
        assert_eq!([b, a], there.diagnostics.trace_coverage);
    }
}

#[test]
fn an_estimated_calibration_is_that_of_the_camera_as_it_lies() {
    let mut params = params();
    params.robust.calibration = Some(CalibrationPriors::DEFAULT);
    let (family, index) = CASES[1];
    let case = generate(family, 1000, index, &CaseOptions::default()).unwrap();
    let here = curve(&case.rig, case.masks.clone(), &params);
    let found = here.diagnostics.calibration.unwrap();
    assert!(found.shift_px[0].hypot(found.shift_px[1]) > 1e-4, "{found:?}");
    for turn in TURNS {
        let (rig, masks) = turn.pair(&case);
        let there = curve(&rig, masks, &params);
        assert_same_curve(&case, &here, &there);
        let there = there.diagnostics.calibration.unwrap();
        let none = turn.point([0.0; 2], 1.0);
        let turned = Point2::from(turn.point(found.shift_px, 1.0)) - Point2::from(none);
        let off = (turned - (Point2::from(there.shift_px) - Point2::origin())).norm();
        assert!(off < ROUNDING_PX, "{turn:?} {off}");
        assert!((found.roll_rad - there.roll_rad).abs() < 1e-9, "{turn:?}");
        assert!((found.observed_sigma_px - there.observed_sigma_px).abs() < 1e-9, "{turn:?}");
    }
}

#[test]
fn a_mask_that_lies_otherwise_is_traced_the_same() {
    for case in cases() {
        let here = trace_mask::<View1>(&case.masks[0], "here").unwrap();
        for turn in TURNS {
            let mask = turn.mask(&case.masks[0]);
            let there = trace_mask::<View1>(&mask, "there").unwrap();
            let width = mask.ncols() as f64;
            let turned = |p: &Point2| Point2::from(turn.point([p.x, p.y], width));
            let expected: Vec<_> = here.points.iter().map(turned).collect();
            assert_same_points(&expected, &there.points, &case.id);
        }
    }
}
