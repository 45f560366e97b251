//! The pair folder: what is read, and what is said when a part is missing or wrong.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use std::fs;
use std::path::Path;

use accurate_geom::nalgebra::Matrix3x4;
use accurate_geom::{Distortion, ImageSize, LengthUnit, Pixel, View1};
use accurate_io::{
    BitDepth, GreyImage, IoError, Pair, PairContents, PairParts, Truth, find_pairs, read_pair,
    write_mask, write_matrix3, write_matrix3x4, write_pair, write_points, write_u8,
};
use common::{contents, rig};
use ndarray::Array2;

const ALL: PairParts =
    PairParts { points: true, masks: true, images: true, truth: Truth::Required };
const CALIBRATION: PairParts =
    PairParts { points: false, masks: false, images: false, truth: Truth::Ignore };

fn pair() -> (tempfile::TempDir, std::path::PathBuf, PairContents) {
    let set = tempfile::tempdir().unwrap();
    let case = set.path().join("case_017");
    let contents = contents(7);
    write_pair(&case, &contents).unwrap();
    (set, case, contents)
}

#[test]
fn each_missing_file_is_named_when_its_part_is_needed_and_not_otherwise() {
    let points = PairParts { points: true, ..CALIBRATION };
    let masks = PairParts { masks: true, ..CALIBRATION };
    let images = PairParts { images: true, ..CALIBRATION };
    let truth = PairParts { truth: Truth::Required, ..CALIBRATION };
    let table = [
        ("calibration/K_L.txt", CALIBRATION, None),
        ("calibration/K_R.txt", CALIBRATION, None),
        ("calibration/RT_L.txt", CALIBRATION, None),
        ("calibration/RT_R.txt", CALIBRATION, None),
        ("points/points_L.csv", points, Some(masks)),
        ("points/points_R.csv", points, Some(images)),
        ("masks/mask_L.png", masks, Some(points)),
        ("masks/mask_R.png", masks, Some(truth)),
        ("images/view_L.png", images, Some(masks)),
        ("images/view_R.png", images, Some(points)),
        ("annotations/guidewire_3D.ply", truth, Some(images)),
    ];
    for (file, needs, others) in table {
        let (_set, case, _) = pair();
        fs::remove_file(case.join(file)).unwrap();
        let error = read_pair(&case, needs).unwrap_err();
        assert!(matches!(error, IoError::Missing { .. }), "{file}: {error:?}");
        assert_eq!(error.path(), case.join(file));
        assert!(error.to_string().contains(file), "{error}");
        if let Some(others) = others {
            read_pair(&case, others).unwrap_or_else(|e| panic!("{file} is not needed: {e}"));
        }
    }
}

#[test]
fn a_truth_that_is_not_there_is_none_unless_required() {
    let (_set, case, _) = pair();
    fs::remove_file(case.join("annotations/guidewire_3D.ply")).unwrap();
    let parts = PairParts { truth: Truth::IfPresent, ..CALIBRATION };
    assert_eq!(read_pair(&case, parts).unwrap().truth, None);
    // A broken truth is not silently absent.
    fs::write(case.join("annotations/guidewire_3D.ply"), "ply\n").unwrap();
    assert!(read_pair(&case, parts).is_err());
}

#[test]
fn a_folder_that_does_not_exist_is_named_itself() {
    let set = tempfile::tempdir().unwrap();
    let case = set.path().join("case_404");
    let error = read_pair(&case, CALIBRATION).unwrap_err();
    assert!(matches!(error, IoError::Missing { .. }));
    assert_eq!(error.path(), case);
}

#[test]
fn intrinsics_may_be_shared_by_the_set() {
    for (file, shared_as) in [
        ("K_L.txt", "K_L.txt"),
        ("K_L.txt", "calibration/K_L.txt"),
        ("K_R.txt", "calibration/K_R.txt"),
        ("K_R.txt", "K.txt"),
        ("K_R.txt", "calibration/K.txt"),
    ] {
        let (set, case, _) = pair();
        let before = read_pair(&case, ALL).unwrap();
        fs::create_dir_all(set.path().join("calibration")).unwrap();
        fs::rename(case.join("calibration").join(file), set.path().join(shared_as)).unwrap();
        assert_eq!(read_pair(&case, ALL).unwrap(), before, "{shared_as}");
        assert_eq!(find_pairs(set.path()).unwrap(), [case]);
    }
}

#[test]
fn a_case_keeps_its_own_intrinsics_when_the_set_has_others() {
    let (set, case, _) = pair();
    let before = read_pair(&case, ALL).unwrap();
    fs::write(set.path().join("K_L.txt"), "9 0 9\n0 9 9\n0 0 1\n").unwrap();
    assert_eq!(read_pair(&case, ALL).unwrap(), before);
}

#[test]
fn sizes_that_disagree_name_both_files_and_both_values() {
    let wrong = Array2::from_elem((5, 4), true);
    let (_set, case, contents) = pair();
    let ImageSize { width, height } = contents.rig.camera2().size();
    write_mask(&case.join("masks/mask_R.png"), &wrong).unwrap();
    let error = read_pair(&case, ALL).unwrap_err();
    assert!(matches!(error, IoError::SizeMismatch { .. }), "{error:?}");
    let text = error.to_string();
    assert!(text.contains("mask_R.png is 4 x 5 px"), "{text}");
    assert!(text.contains(&format!("meta.json says {width} x {height} px")), "{text}");

    let (_set, case, _) = pair();
    write_u8(&case.join("images/view_L.png"), &Array2::zeros((5, 4))).unwrap();
    let text = read_pair(&case, ALL).unwrap_err().to_string();
    assert!(text.contains("view_L.png is 4 x 5 px"), "{text}");

    // Without meta.json the masks are the reference.
    fs::remove_file(case.join("meta.json")).unwrap();
    let text = read_pair(&case, ALL).unwrap_err().to_string();
    assert!(text.contains("view_L.png is 4 x 5 px") && text.contains("mask_L.png says"), "{text}");
}

#[test]
fn without_meta_the_folder_names_the_case_and_the_masks_give_the_size() {
    let (_set, case, contents) = pair();
    fs::remove_file(case.join("meta.json")).unwrap();
    let read = read_pair(&case, PairParts { points: true, ..CALIBRATION }).unwrap();
    assert_eq!(read.case_id, "case_017");
    assert_eq!(read.size, [contents.rig.camera1().size(), contents.rig.camera2().size()]);
    assert_eq!(read.rig.unit(), LengthUnit::Unit);
    assert_eq!(read.source, None);
    fs::remove_dir_all(case.join("masks")).unwrap();
    fs::remove_dir_all(case.join("images")).unwrap();
    let error = read_pair(&case, PairParts { points: true, ..CALIBRATION }).unwrap_err();
    assert!(matches!(error, IoError::Missing { .. }));
    assert_eq!(error.path(), case.join("meta.json"));
}

#[test]
fn the_meta_file_of_the_public_set_is_read_as_it_is() {
    let (_set, case, _) = pair();
    let meta = r#"{"case_id": "case_3", "num_points": 2000, "image_size": [40, 30], "source": "Blender", "extra": [1]}"#;
    fs::write(case.join("meta.json"), meta).unwrap();
    fs::remove_dir_all(case.join("masks")).unwrap();
    let read = read_pair(&case, CALIBRATION).unwrap();
    assert_eq!((read.case_id.as_str(), read.source.as_deref()), ("case_3", Some("Blender")));
    assert_eq!(read.size, [ImageSize { width: 40, height: 30 }; 2]);
}

#[test]
fn each_bad_meta_field_is_named_with_its_value() {
    let table = [
        (r#"{"image_size": [40]}"#, "image_size = `[40]`"),
        (r#"{"image_size": [40, 0]}"#, "image_size = `[40,0]`"),
        (r#"{"image_size": [40.5, 30]}"#, "image_size = `[40.5,30]`"),
        (r#"{"image_size": "40x30"}"#, "image_size = `\"40x30\"`"),
        (r#"{"image_size": [40, 99999999999]}"#, "image_size in px is 99999999999"),
        (r#"{"image_size": [[40, 30], [40]]}"#, "image_size = `[[40,30],[40]]`"),
        (r#"{"image_size": [40, 30], "unit": "inch"}"#, "unit = `inch`"),
        (r#"{"image_size": [40, 30], "case_id": "../../etc"}"#, "case_id = `../../etc`"),
        (r#"{"image_size": [40, 30], "case_id": ""}"#, "case_id = ``"),
        ("{\n\"image_size\": [40, 30],\n}", "line 3: not valid JSON"),
    ];
    for (meta, expected) in table {
        let (_set, case, _) = pair();
        fs::write(case.join("meta.json"), meta).unwrap();
        let error = read_pair(&case, CALIBRATION).unwrap_err();
        assert!(error.to_string().contains(expected), "{meta}: {error}");
        assert_eq!(error.path(), case.join("meta.json"));
    }
}

#[test]
fn bad_calibration_names_the_file_that_holds_it() {
    let (_set, case, contents) = pair();
    let calibration = case.join("calibration");
    let k = *contents.rig.camera1().k();
    let check = |file: &str, expected: &str| {
        let error = read_pair(&case, CALIBRATION).unwrap_err();
        assert!(matches!(error, IoError::Geometry { .. }), "{error:?}");
        assert_eq!(error.path(), calibration.join(file));
        assert!(error.to_string().contains(expected), "{error}");
    };
    let mut bad_k = k;
    bad_k[(0, 0)] = 0.0;
    write_matrix3(&calibration.join("K_L.txt"), &bad_k).unwrap();
    check("K_L.txt", "view 1: K[0][0] is zero");
    write_matrix3(&calibration.join("K_L.txt"), &k).unwrap();

    let old = fs::read(calibration.join("RT_R.txt")).unwrap();
    write_matrix3x4(&calibration.join("RT_R.txt"), &Matrix3x4::identity().scale(2.0)).unwrap();
    check("RT_R.txt", "view 2: R is not a rotation");
    fs::write(calibration.join("RT_R.txt"), old).unwrap();

    fs::copy(calibration.join("RT_L.txt"), calibration.join("RT_R.txt")).unwrap();
    check("", "rig: zero baseline");
}

#[test]
fn a_mask_without_foreground_is_refused() {
    let (_set, case, contents) = pair();
    let size = contents.rig.camera1().size();
    let empty = Array2::default((size.height as usize, size.width as usize));
    write_mask(&case.join("masks/mask_L.png"), &empty).unwrap();
    let error = read_pair(&case, ALL).unwrap_err();
    assert!(error.to_string().ends_with("mask_L.png: no foreground pixel"), "{error}");
}

#[test]
fn what_cannot_be_read_back_is_not_written() {
    let good = contents(3);
    let shape = good.masks.as_ref().unwrap()[0].dim();
    let mut table: Vec<(PairContents, &str)> = Vec::new();
    table.push((PairContents { case_id: "a/b".into(), ..good.clone() }, "case_id = `a/b`"));
    table.push((
        PairContents { truth: Some(vec![]), ..good.clone() },
        "guidewire_3D.ply: no points",
    ));
    let masks = Some([Array2::from_elem((2, 2), true), Array2::from_elem(shape, true)]);
    table.push((PairContents { masks, ..good.clone() }, "mask_L.png is 2 x 2 px"));
    let mut points = good.points.clone().unwrap();
    points.1[0].y = f64::NAN;
    table.push((PairContents { points: Some(points), ..good.clone() }, "y of point 0"));
    for (bad, expected) in table {
        let dir = tempfile::tempdir().unwrap();
        let error = write_pair(&dir.path().join("case_0"), &bad).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
        assert!(!dir.path().join("case_0").exists(), "{expected}: something was written");
    }
}

#[test]
fn views_of_different_size_keep_their_sizes() {
    let dir = tempfile::tempdir().unwrap();
    let sizes = [ImageSize { width: 40, height: 30 }, ImageSize { width: 20, height: 50 }];
    let contents = PairContents {
        case_id: "uneven".into(),
        rig: rig(sizes, LengthUnit::Centimetre),
        points: None,
        masks: None,
        images: Some(sizes.map(|s| GreyImage {
            values: Array2::from_elem((s.height as usize, s.width as usize), 700.0),
            depth: BitDepth::Sixteen,
        })),
        truth: None,
        source: None,
    };
    write_pair(dir.path(), &contents).unwrap();
    let parts = PairParts::present_in(dir.path());
    assert_eq!(parts, PairParts { images: true, truth: Truth::IfPresent, ..CALIBRATION });
    let read: Pair = read_pair(dir.path(), parts).unwrap();
    assert_eq!(read.size, sizes);
    assert_eq!(read.image_depth, Some([BitDepth::Sixteen; 2]));
    assert_eq!(PairContents::from(read), contents);
}

#[test]
fn a_written_pair_leaves_no_temporary_file() {
    fn walk(dir: &Path, names: &mut Vec<String>) {
        for entry in fs::read_dir(dir).unwrap().map(Result::unwrap) {
            if entry.path().is_dir() {
                walk(&entry.path(), names);
            } else {
                names.push(entry.file_name().into_string().unwrap());
            }
        }
    }
    let (_set, case, _) = pair();
    let mut names = Vec::new();
    walk(&case, &mut names);
    names.sort();
    assert_eq!(
        names,
        [
            "K_L.txt",
            "K_R.txt",
            "RT_L.txt",
            "RT_R.txt",
            "guidewire_3D.ply",
            "mask_L.png",
            "mask_R.png",
            "meta.json",
            "points_L.csv",
            "points_R.csv",
            "view_L.png",
            "view_R.png"
        ]
    );
}

#[test]
fn points_behind_a_lens_are_undistorted_once_and_pictures_refused() {
    let (_set, case, contents) = pair();
    let lens = Distortion { k1: -0.2, k2: 0.05, p1: 1e-3, p2: -2e-3, k3: 0.0 };
    let camera = contents.rig.camera1().clone().with_distortion(lens).unwrap();
    let ideal: Vec<Pixel<View1>> =
        (0..20).map(|i| Pixel::new(f64::from(2 * i), 3.0 + f64::from(i))).collect();
    let seen: Vec<Pixel<View1>> =
        ideal.iter().map(|p| camera.distort(&p.point()).unwrap().into()).collect();
    write_points(&case.join("points/points_L.csv"), &seen).unwrap();
    fs::write(case.join("calibration/D_L.txt"), "-0.2 0.05 1e-3\n-2e-3").unwrap();

    let points = PairParts { points: true, ..CALIBRATION };
    let read = read_pair(&case, points).unwrap();
    assert_eq!(read.rig, contents.rig, "the rig is that of the undistorted view");
    // Newton stops at 64 rounding errors of the normalised coordinate (below 1 here), times f.
    let tol_px = 64.0 * f64::EPSILON * 51.0;
    for (p, q) in read.points.unwrap().0.iter().zip(&ideal) {
        assert!(p.distance(*q) < tol_px, "{p:?} {q:?}");
    }
    for needs in [PairParts { masks: true, ..points }, PairParts { images: true, ..points }] {
        let error = read_pair(&case, needs).unwrap_err();
        assert!(matches!(error, IoError::Unsupported { .. }), "{error}");
        assert_eq!(error.path(), case.join("calibration/D_L.txt"));
    }
    // A lens that bends nothing stands in nobody's way.
    fs::write(case.join("calibration/D_L.txt"), "0 0 0 0 0").unwrap();
    read_pair(&case, ALL).unwrap();
}
