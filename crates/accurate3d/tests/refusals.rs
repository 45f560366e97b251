//! What a library user may hand over and must be told about.
#![allow(clippy::unwrap_used, clippy::panic)]

use accurate3d::fit::CalibrationPriors;
use accurate3d::synth::{CaseOptions, Family, generate};
use accurate3d::{Error, InputKind, Method, Params, ViewPair, reconstruct};
use ndarray::Array2;

fn pair() -> ViewPair {
    ViewPair::from(generate(Family::Easy, 1908, 0, &CaseOptions::default()).unwrap())
}

fn params() -> Params {
    Params::new(InputKind::Mask, Method::Accurate)
}

#[test]
fn a_mask_of_another_size_than_its_cameras_image_is_refused() {
    for method in [Method::Accurate, Method::Paper] {
        let mut pair = pair();
        let masks = pair.masks.as_mut().unwrap();
        masks[1] = Array2::from_shape_fn((500, 512), |at| masks[1][at]);
        let error = reconstruct(&pair, &Params { method, ..params() }).unwrap_err();
        let Error::OtherSize { view, what, found, expected, .. } = &error else {
            panic!("{error}")
        };
        assert_eq!((*view, *what), (2, "mask"));
        assert_eq!((*found, *expected), ((500, 512), (512, 512)));
        assert!(error.to_string().contains("512 x 500"), "{error}");
    }
}

#[test]
fn weights_and_priors_that_nothing_can_be_compared_by_are_refused() {
    let pair = pair();
    type Spoil = fn(&mut Params);
    let spoils: [(&str, Spoil); 7] = [
        ("clear_lead", |p| p.robust.clear_lead = f64::NAN),
        ("clear_lead", |p| p.robust.clear_lead = -1.0),
        ("contenders", |p| p.robust.contenders = -1.0),
        ("contenders", |p| p.robust.contenders = f64::NAN),
        ("walk_weight", |p| p.robust.walk_weight = f64::NAN),
        ("shift_sigma_px", |p| {
            p.robust.calibration =
                Some(CalibrationPriors { shift_sigma_px: 0.0, ..CalibrationPriors::DEFAULT });
        }),
        ("roll_sigma_rad", |p| {
            p.robust.calibration =
                Some(CalibrationPriors { roll_sigma_rad: f64::NAN, ..CalibrationPriors::DEFAULT });
        }),
    ];
    for (name, spoil) in spoils {
        let mut params = params();
        spoil(&mut params);
        let error = reconstruct(&pair, &params).unwrap_err();
        assert!(error.to_string().contains(name), "{name}: {error}");
    }
}

#[test]
fn an_inverted_mask_is_told_what_it_looks_like() {
    for spoil in [
        |mask: &mut Array2<bool>| mask.mapv_inplace(|b| !b),
        |mask: &mut Array2<bool>| mask.fill(true),
    ] {
        let mut pair = pair();
        spoil(&mut pair.masks.as_mut().unwrap()[1]);
        let error = reconstruct(&pair, &params()).unwrap_err().to_string();
        assert!(error.contains("view 2") && error.contains("inverted"), "{error}");
    }
}

/// Two bodies in one mask: the curve explains one of them, and no harder search is made for the other.
#[test]
fn masks_of_two_bodies_give_one_curve_and_a_doubt() {
    let mut pair = pair();
    let other = generate(Family::Easy, 1908, 1, &CaseOptions::default()).unwrap();
    for (mask, more) in pair.masks.as_mut().unwrap().iter_mut().zip(&other.masks) {
        *mask = Array2::from_shape_fn(mask.dim(), |at| mask[at] || more[at]);
    }
    let found = reconstruct(&pair, &params()).unwrap();
    assert!(!found.diagnostics.suspicions.is_empty());
    assert!(found.points.len() > 50);
}
