//! Laws: what is written reads back to the same bits.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use std::fs;

use accurate_geom::nalgebra::{Matrix3, Matrix3x4, Rotation3, Vector3};
use accurate_geom::{Camera, Distortion, ImageSize, LengthUnit, Pixel, Point3, Rig, View1};
use accurate_io::{
    BitDepth, Column, CurveTable, GreyImage, PairContents, PairParts, PlyEncoding, Truth,
    read_curve, read_grey, read_mask, read_matrix3, read_matrix3x4, read_pair, read_ply_points,
    read_points, read_rig, write_atomically, write_curve, write_grey, write_json, write_mask,
    write_matrix3, write_matrix3x4, write_pair, write_ply_points, write_points, write_rig,
    write_u8, write_u16,
};
use ndarray::Array2;
use proptest::collection::vec;
use proptest::prelude::*;

/// Any finite number: subnormal, -0.0 and the largest included.
fn numbers() -> impl Strategy<Value = f64> {
    use proptest::num::f64::{NEGATIVE, NORMAL, POSITIVE, SUBNORMAL, ZERO};
    POSITIVE | NEGATIVE | NORMAL | SUBNORMAL | ZERO
}

fn points3() -> impl Strategy<Value = Vec<Point3>> {
    vec([numbers(), numbers(), numbers()].prop_map(Point3::from), 1..40)
}

fn units() -> impl Strategy<Value = LengthUnit> {
    prop::sample::select(vec![
        LengthUnit::Millimetre,
        LengthUnit::Centimetre,
        LengthUnit::Metre,
        LengthUnit::Unit,
    ])
}

/// A curve with up to three columns; the first is the arc length in the curve's unit, from which a
/// CSV file tells the unit.
fn curves() -> impl Strategy<Value = CurveTable> {
    let column = ("[a-wA-W_][a-zA-Z0-9_-]{0,12}", "[ -~°µ]{0,6}");
    (points3(), units(), vec(column, 0..3)).prop_flat_map(|(points, unit, names)| {
        let n = points.len();
        vec(vec(numbers(), n), 1 + names.len()).prop_map(move |values| {
            let mut columns = Vec::new();
            let head = ("arc_length".to_owned(), unit.label().to_owned());
            for ((i, (name, unit)), values) in
                std::iter::once(&head).chain(&names).enumerate().zip(values)
            {
                let name = if i == 0 { name.clone() } else { format!("{name}{i}") };
                columns.push(Column { name, unit: unit.trim().to_owned(), values });
            }
            CurveTable { unit, points: points.clone(), columns }
        })
    })
}

/// Bits, because `-0.0 == 0.0` hides a lost sign.
fn bits(points: &[Point3]) -> Vec<[u64; 3]> {
    points.iter().map(|p| [p.x.to_bits(), p.y.to_bits(), p.z.to_bits()]).collect()
}

fn column_bits(curve: &CurveTable) -> Vec<(&str, &str, Vec<u64>)> {
    let of = |c: &Column| c.values.iter().map(|v| v.to_bits()).collect();
    curve.columns.iter().map(|c| (c.name.as_str(), c.unit.as_str(), of(c))).collect()
}

fn rigs(lenses: bool) -> impl Strategy<Value = Rig> {
    let view = (
        [-4e3..4e3_f64, -4e3..4e3, -9.0..9.0, -900.0..900.0, -900.0..900.0],
        [-3.0..3.0_f64, -3.0..3.0, -3.0..3.0],
        [-1e3..1e3_f64, -1e3..1e3, -1e3..1e3],
        (1..5000_u32, 1..5000_u32),
        prop::option::of([-0.3..0.3_f64, -0.1..0.1, -1e-2..1e-2, -1e-2..1e-2, -0.1..0.1]),
    );
    ([view.clone(), view], units()).prop_filter_map("degenerate rig", move |(views, unit)| {
        let mut cameras =
            views.into_iter().map(|([fx, fy, s, cx, cy], r, t, (width, height), lens)| {
                let k = Matrix3::new(fx, s, cx, 0.0, fy, cy, 0.0, 0.0, 1.0);
                let r = Rotation3::from_euler_angles(r[0], r[1], r[2]).into_inner();
                let camera = Camera::new(k, r, Vector3::from(t), ImageSize { width, height })?;
                let Some([k1, k2, p1, p2, k3]) = lens.filter(|_| lenses) else { return Ok(camera) };
                camera.with_distortion(Distortion { k1, k2, p1, p2, k3 })
            });
        Rig::new(cameras.next()?.ok()?, cameras.next()?.ok()?, unit).ok()
    })
}

proptest! {
    // Each case writes and syncs files; 48 keep the file below a few seconds.
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn a_curve_keeps_every_bit_name_and_unit_in_csv_ply_vtp_and_npz(curve in curves()) {
        let folder = tempfile::tempdir().unwrap();
        for extension in ["csv", "ply", "vtp", "npz"] {
            let path = folder.path().join(format!("curve.{extension}"));
            let taken = |c: &Column| ["points", "units_json"].contains(&c.name.as_str());
            if extension == "npz" && curve.columns.iter().any(taken) {
                prop_assert!(write_curve(&path, &curve).is_err());
                continue;
            }
            write_curve(&path, &curve).unwrap();
            let read = read_curve(&path).unwrap();
            prop_assert_eq!(bits(&read.points), bits(&curve.points), "{}", extension);
            prop_assert_eq!(column_bits(&read), column_bits(&curve), "{}", extension);
            prop_assert_eq!(read.unit, curve.unit, "{}", extension);
        }
    }

    #[test]
    fn a_markups_curve_keeps_what_needs_no_scaling_to_the_bit(curve in curves()) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("curve.mrk.json");
        match write_curve(&path, &curve) {
            Ok(()) => {}
            // The largest metres are no finite millimetres.
            Err(error) => {
                prop_assert!(matches!(error, accurate_io::IoError::NotFinite { .. }), "{}", error);
                return Ok(());
            }
        }
        let read = read_curve(&path).unwrap();
        prop_assert_eq!(column_bits(&read), column_bits(&curve));
        prop_assert_eq!(read.unit, curve.unit);
        if matches!(curve.unit, LengthUnit::Millimetre | LengthUnit::Unit) {
            prop_assert_eq!(bits(&read.points), bits(&curve.points));
        } else {
            for (a, b) in read.points.iter().zip(&curve.points) {
                // One product, one quotient: each rounds by half an ulp of a normal number, or by
                // half the smallest subnormal.
                let tolerance = |v: f64| 2.0 * f64::EPSILON * v.abs() + 2.0 * f64::from_bits(1);
                for (x, y) in a.coords.iter().zip(b.coords.iter()) {
                    prop_assert!((x - y).abs() <= tolerance(*y), "{} {}", x, y);
                }
            }
        }
    }

    #[test]
    fn an_npy_curve_keeps_every_bit_of_its_points(curve in curves()) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("curve.npy");
        write_curve(&path, &curve).unwrap();
        let read = read_curve(&path).unwrap();
        prop_assert_eq!(bits(&read.points), bits(&curve.points));
        prop_assert_eq!((read.columns.len(), read.unit), (0, LengthUnit::Unit));
    }

    #[test]
    fn ply_points_keep_every_bit_in_every_encoding(points in points3()) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("truth.ply");
        for encoding in
            [PlyEncoding::Ascii, PlyEncoding::BinaryLittleEndian, PlyEncoding::BinaryBigEndian]
        {
            write_ply_points(&path, &points, encoding).unwrap();
            prop_assert_eq!(bits(&read_ply_points(&path).unwrap()), bits(&points));
        }
    }

    #[test]
    fn a_rig_keeps_every_bit_in_toml_and_json(rig in rigs(true)) {
        let folder = tempfile::tempdir().unwrap();
        for name in ["rig.toml", "rig.json"] {
            let path = folder.path().join(name);
            write_rig(&path, &rig).unwrap();
            prop_assert_eq!(&read_rig(&path).unwrap(), &rig, "{}", name);
        }
    }

    #[test]
    fn matrices_keep_every_bit(entries in vec(numbers(), 12)) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("m.txt");
        let bits = |m: &[f64]| m.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        let rt = Matrix3x4::from_column_slice(&entries);
        write_matrix3x4(&path, &rt).unwrap();
        prop_assert_eq!(bits(read_matrix3x4(&path).unwrap().as_slice()), bits(rt.as_slice()));
        let k = Matrix3::from_column_slice(&entries[..9]);
        write_matrix3(&path, &k).unwrap();
        prop_assert_eq!(bits(read_matrix3(&path).unwrap().as_slice()), bits(k.as_slice()));
    }

    #[test]
    fn ordered_points_keep_every_bit(points in vec((numbers(), numbers()), 1..60)) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("points_L.csv");
        let points: Vec<Pixel<View1>> = points.into_iter().map(|(x, y)| Pixel::new(x, y)).collect();
        write_points(&path, &points).unwrap();
        let bits = |p: &[Pixel<View1>]| p.iter().map(|p| (p.x.to_bits(), p.y.to_bits())).collect::<Vec<_>>();
        prop_assert_eq!(bits(&read_points(&path).unwrap()), bits(&points));
    }

    #[test]
    fn masks_and_images_keep_every_pixel(
        (height, width) in (1..20_usize, 1..20_usize),
        seed in any::<u64>(),
    ) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("image.png");
        let mut stream = common::Stream(seed);
        let eight = Array2::from_shape_fn((height, width), |_| stream.next() as u8);
        let sixteen = Array2::from_shape_fn((height, width), |_| stream.next() as u16);
        let mask = eight.mapv(|v| v > 128);
        write_mask(&path, &mask).unwrap();
        prop_assert_eq!(read_mask(&path).unwrap(), mask);
        write_u8(&path, &eight).unwrap();
        let grey = read_grey(&path).unwrap();
        prop_assert_eq!(&grey, &GreyImage { values: eight.mapv(f32::from), depth: BitDepth::Eight });
        prop_assert_eq!(read_mask(&path).unwrap(), eight.mapv(|v| v != 0));
        write_u16(&path, &sixteen).unwrap();
        let grey = read_grey(&path).unwrap();
        prop_assert_eq!(&grey.values, &sixteen.mapv(f32::from));
        write_grey(&path, &grey).unwrap();
        prop_assert_eq!(read_grey(&path).unwrap(), grey);
        prop_assert_eq!(read_mask(&path).unwrap(), sixteen.mapv(|v| v != 0));
    }

    #[test]
    fn a_whole_pair_folder_comes_back(seed in any::<u64>(), parts in any::<[bool; 4]>(), rig in rigs(false)) {
        let folder = tempfile::tempdir().unwrap();
        let mut contents = common::contents(seed);
        let images = parts[1] || parts[2];
        if !images {
            // Any rig will do where no image fixes the size.
            contents.rig = rig;
        }
        if !parts[0] { contents.points = None; }
        if !parts[1] { contents.masks = None; }
        if !parts[2] { contents.images = None; }
        if !parts[3] { contents.truth = None; }
        write_pair(folder.path(), &contents).unwrap();
        let needs = PairParts::present_in(folder.path());
        prop_assert_eq!([needs.points, needs.masks, needs.images], [parts[0], parts[1], parts[2]]);
        let read = read_pair(folder.path(), PairParts { truth: Truth::IfPresent, ..needs }).unwrap();
        prop_assert_eq!(PairContents::from(read), contents);
    }

    #[test]
    fn a_write_that_fails_after_any_number_of_bytes_leaves_the_old_file(
        old in vec(any::<u8>(), 0..100),
        written in 0..100_000_usize,
    ) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("result.json");
        write_atomically(&path, |w| w.write_all(&old)).unwrap();
        let result = write_atomically(&path, |w| {
            w.write_all(&vec![b'x'; written])?;
            Err(std::io::Error::other("no space left"))
        });
        prop_assert!(result.is_err());
        prop_assert_eq!(fs::read(&path).unwrap(), old);
        prop_assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn json_keeps_every_bit_and_never_holds_a_non_finite_number(
        mut values in vec(numbers(), 1..30),
        bad in prop::option::of((prop::sample::select(vec![f64::NAN, f64::INFINITY, f64::NEG_INFINITY]), any::<prop::sample::Index>())),
    ) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("result.json");
        if let Some((value, index)) = &bad {
            let i = index.index(values.len());
            values[i] = *value;
            let error = write_json(&path, &values).unwrap_err().to_string();
            prop_assert!(error.contains(&format!("[{i}] is not finite")), "{}", error);
            prop_assert!(!path.exists());
        } else {
            write_json(&path, &values).unwrap();
            let text = fs::read_to_string(&path).unwrap();
            for (line, value) in text.lines().skip(1).zip(&values) {
                let read: f64 = line.trim().trim_end_matches(',').parse().unwrap();
                prop_assert_eq!(read.to_bits(), value.to_bits());
            }
        }
    }
}
