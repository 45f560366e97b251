//! Cameras of other tools: what is written reads back; what their tools wrote is read.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod kinds;

use std::path::{Path, PathBuf};

use accurate_geom::nalgebra::{Matrix3, Rotation3, Vector3};
use accurate_geom::{Camera, Distortion, ImageSize, LengthUnit};
use accurate_io::{CameraFormat, IoError, NamedView, ViewDefaults, read_cameras, write_cameras};
use proptest::prelude::*;

fn views() -> impl Strategy<Value = Vec<NamedView>> {
    let view = (
        prop::array::uniform3(-3.0..3.0f64),
        prop::array::uniform3(-900.0..900.0f64),
        prop::array::uniform4(200.0..3000.0f64),
        prop::array::uniform4(-0.1..0.1f64),
        any::<bool>(),
        prop::sample::select(vec![(512, 400), (1024, 768)]),
    )
        .prop_map(|(turn, t, k, d, lens, (width, height))| {
            let r = *Rotation3::new(Vector3::from(turn)).matrix();
            let k = Matrix3::new(k[0], 0.0, k[2], 0.0, k[1], k[3], 0.0, 0.0, 1.0);
            let size = ImageSize { width, height };
            let camera = Camera::new(k, r, Vector3::from(t), size).unwrap();
            let [k1, k2, p1, p2] = d;
            let lens = lens.then_some(Distortion { k1, k2, p1, p2, k3: 0.0 });
            let camera = match lens {
                Some(lens) => camera.with_distortion(lens).unwrap(),
                None => camera,
            };
            let (unit, frame) = (LengthUnit::Millimetre, "as in the file".to_owned());
            NamedView { name: "v".into(), camera, unit, frame, notes: vec![] }
        });
    prop::collection::vec(view, 2)
}

const MM: ViewDefaults = ViewDefaults { image_size: None, unit: Some(LengthUnit::Millimetre) };

fn there_and_back(views: &[NamedView], name: &str, format: CameraFormat) -> Vec<NamedView> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    write_cameras(&path, views, format).unwrap();
    read_cameras(&[path], &MM).unwrap()
}

proptest! {
    // Each case writes and syncs files.
    #![proptest_config(ProptestConfig::with_cases(24))]
    #[test]
    fn formats_that_hold_every_number_give_back_the_same_bits(views in views()) {
        for (name, format) in [
            ("c.yml", CameraFormat::OpencvYaml),
            ("c.xml", CameraFormat::OpencvXml),
            ("c.toml", CameraFormat::Rig),
            ("c.json", CameraFormat::ViewsJson),
        ] {
            let read = there_and_back(&views, name, format);
            prop_assert_eq!(read.len(), 2);
            for (a, b) in views.iter().zip(&read) {
                prop_assert_eq!(&a.camera, &b.camera, "{}", name);
                prop_assert_eq!(b.unit, LengthUnit::Millimetre);
            }
        }
    }

    #[test]
    fn colmap_gives_back_the_camera_within_rounding(views in views()) {
        let read = there_and_back(&views, "colmap", CameraFormat::Colmap);
        for (a, b) in views.iter().zip(&read) {
            // A quaternion and half a pixel there and back: a few roundings of numbers up to 3000.
            let tolerance = 64.0 * f64::EPSILON * 3000.0;
            prop_assert!((a.camera.k() - b.camera.k()).amax() < tolerance);
            prop_assert!((a.camera.r() - b.camera.r()).amax() < 64.0 * f64::EPSILON);
            prop_assert_eq!(a.camera.t(), b.camera.t());
            prop_assert_eq!(a.camera.size(), b.camera.size());
            prop_assert_eq!(a.camera.distortion(), b.camera.distortion());
        }
    }

    #[test]
    fn matrices_project_as_before(views in views()) {
        let plain: Vec<NamedView> = views
            .into_iter()
            .map(|v| {
                let c = &v.camera;
                let camera = Camera::new(*c.k(), *c.r(), *c.t(), c.size()).unwrap();
                NamedView { camera, ..v }
            })
            .collect();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("p.txt");
        write_cameras(&path, &plain, CameraFormat::MatrixText).unwrap();
        let defaults =
            ViewDefaults { image_size: Some(ImageSize { width: 512, height: 400 }), unit: None };
        let read = read_cameras(&[path], &defaults).unwrap();
        for (a, b) in plain.iter().zip(&read) {
            let (p, q) = (a.camera.projection_matrix(), b.camera.projection_matrix());
            // RQ and the product again; entries reach 3000 * 900 * 2.
            prop_assert!((p - q).amax() < 1e3 * f64::EPSILON * p.amax(), "{} {}", p, q);
        }
    }
}

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/opencv").join(name)
}

#[test]
fn files_that_cv2_wrote_are_read() {
    let defaults =
        ViewDefaults { image_size: Some(ImageSize { width: 640, height: 480 }), unit: MM.unit };
    for ext in ["yml", "xml"] {
        let files = ["intrinsics", "extrinsics"].map(|n| fixture(&format!("{n}.{ext}")));
        let views = read_cameras(&files, &defaults).unwrap();
        assert_eq!(views.len(), 2);
        let (c1, c2) = (&views[0].camera, &views[1].camera);
        assert_eq!(c1.k()[(0, 0)], 1200.5);
        assert_eq!(c2.k()[(1, 2)], 239.25);
        assert_eq!(c1.r(), &Matrix3::identity());
        assert_eq!(c2.t(), &Vector3::new(-250.0, 1.0 / 3.0, 1e-7));
        assert_eq!(c1.distortion().unwrap().k2, -0.2);
        // cv2.Rodrigues([0.1, -0.7, 0.3]).
        let r = Rotation3::new(Vector3::new(0.1, -0.7, 0.3));
        assert!((c2.r() - r.matrix()).amax() < 1e-15);
    }
}

#[test]
fn what_is_missing_or_not_understood_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let read = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        read_cameras(&[path], &ViewDefaults::default())
    };
    let k = "K: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 1., 0., 2., 0., 1., 2., 0., 0., 1. ]\n";
    let cases = [
        ("a.yml", format!("%YAML:1.0\n---\n{k}"), "states no image size"),
        ("a.yml", format!("%YAML:1.0\n---\n{}", k.replace("1. ]", "1., 7. ]")), "10 given"),
        (
            "a.yml",
            format!("%YAML:1.0\n---\n{}", k.replace("2.,", ".Nan,")),
            "must be a list of numbers",
        ),
        ("a.yml", format!("%YAML:1.0\n---\n{}", "[".repeat(100_000)), "nested deeper"),
        ("a.yml", "%YAML:1.0\n---\nD: 3\n".into(), "not in the file; looked for K, M"),
        ("a.xml", "<a><b/></a>".into(), "expected <opencv_storage>"),
        ("a.xml", format!("<opencv_storage>{}", "<a>".repeat(100_000)), "nested deeper"),
        ("a.xml", "<!DOCTYPE a [<!ENTITY x \"y\">]><opencv_storage/>".into(), "document types"),
        ("p.txt", "1 0 0 0\n0 1 0 0\n0 0 1 0\n".into(), "states no image size"),
        ("m.json", "{\"CameraParameters1\": {}}".into(), "RotationOfCamera2"),
        ("m.json", "{\"a\": 1}".into(), "without the fields of a known camera"),
        ("images.txt", "# no image\n".into(), "missing file"),
        ("m.bin", "hello".into(), "no known camera file (it begins with `hello`)"),
    ];
    for (name, text, expected) in cases {
        let error = read(name, &text).unwrap_err().to_string();
        assert!(error.contains(expected), "{name}: {error}");
    }
    std::fs::write(folder.path().join("cameras.txt"), "1 PINHOLE 9 9 1 1 4 4\n").unwrap();
    let error = read("images.txt", "1 10 20 30 1 0 0 0 1 a.png\n\n").unwrap_err().to_string();
    assert!(error.contains("the translation seems to stand before the quaternion"), "{error}");
}

#[test]
fn matlab_counts_pixels_from_one_and_transposes() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("stereo.json");
    let camera = r#"{"IntrinsicMatrix": [[800,0,0],[0,810,0],[321,241,1]], "RadialDistortion": [0.1,0.2],
        "TangentialDistortion": [0,0], "ImageSize": [480,640], "WorldUnits": "mm"}"#;
    let text = format!(
        r#"{{"CameraParameters1": {camera}, "CameraParameters2": {camera},
            "RotationOfCamera2": [[0,1,0],[-1,0,0],[0,0,1]], "TranslationOfCamera2": [5,6,7]}}"#
    );
    std::fs::write(&path, text).unwrap();
    let views = read_cameras(&[path], &ViewDefaults::default()).unwrap();
    let c = &views[1].camera;
    assert_eq!(c.k(), &Matrix3::new(800.0, 0.0, 320.0, 0.0, 810.0, 240.0, 0.0, 0.0, 1.0));
    assert_eq!(c.size(), ImageSize { width: 640, height: 480 });
    // Row vector (1, 0, 0) R = (0, 1, 0): as a column, R takes x to y.
    assert_eq!(c.r() * Vector3::x(), Vector3::y());
    assert_eq!(c.t(), &Vector3::new(5.0, 6.0, 7.0));
    assert_eq!(c.distortion().unwrap().k2, 0.2);
}

#[test]
fn simulators_of_radiographs_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("drr.json");
    let pose = "[[1,0,0,1],[0,1,0,2],[0,0,1,700],[0,0,0,1]]";
    let text = format!(
        r#"[{{"sdd": 1000, "height": 200, "width": 300, "delx": 0.5, "dely": 0.5, "x0": 5, "y0": 0, "extrinsic": {pose}}},
            {{"intrinsic": [[2000,0,150],[0,2000,100],[0,0,1]], "extrinsic": {pose}, "sensor_width": 300, "sensor_height": 200}}]"#
    );
    std::fs::write(&path, text).unwrap();
    let views = read_cameras(std::slice::from_ref(&path), &ViewDefaults::default()).unwrap();
    let k = views[0].camera.k();
    // The middle of 300 px is between pixels 149 and 150; x0 = 5 mm is 10 px.
    assert_eq!((k[(0, 0)], k[(0, 2)], k[(1, 2)]), (2000.0, 159.5, 99.5));
    assert_eq!(views[1].camera.t(), &Vector3::new(1.0, 2.0, 700.0));
    std::fs::write(&path, r#"{"sdd": 0, "height": 2, "width": 3, "delx": 1, "dely": 1}"#).unwrap();
    let error = read_cameras(&[path], &ViewDefaults::default()).unwrap_err();
    assert!(matches!(error, IoError::Field { .. }), "{error}");
}

/// An NPY file, version 1.0, of little-endian `f8`.
fn npy(shape: &str, fortran: bool, values: &[f64]) -> Vec<u8> {
    let order = if fortran { "True" } else { "False" };
    let mut head = format!("{{'descr': '<f8', 'fortran_order': {order}, 'shape': {shape}, }}");
    while (10 + head.len() + 1) % 64 != 0 {
        head.push(' ');
    }
    head.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((head.len() as u16).to_le_bytes());
    bytes.extend(head.as_bytes());
    bytes.extend(values.iter().flat_map(|v| v.to_le_bytes()));
    bytes
}

/// P of two cameras, f = 1000 px and 1200 px, the second turned by a right angle about y.
const MATRICES: [f64; 24] = [
    1000.0, 0.0, 250.0, 5000.0, 0.0, 1000.0, 250.0, 6000.0, 0.0, 0.0, 1.0, 700.0, //
    -240.0, 0.0, 1200.0, 7000.0, -240.0, 1200.0, 0.0, 8000.0, -1.0, 0.0, 0.0, 900.0,
];

#[test]
fn matrices_in_npy_and_csv_are_the_same_cameras() {
    let folder = tempfile::tempdir().unwrap();
    let defaults =
        ViewDefaults { image_size: Some(ImageSize { width: 500, height: 500 }), unit: MM.unit };
    let read = |name: &str, bytes: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        read_cameras(&[path], &defaults)
    };
    let rows = |gap: &str| -> Vec<u8> {
        let row = |r: &[f64]| r.iter().map(f64::to_string).collect::<Vec<_>>().join(gap);
        MATRICES.chunks_exact(4).map(row).collect::<Vec<_>>().join("\n").into_bytes()
    };
    let array = read("p.npy", &npy("(2, 3, 4)", false, &MATRICES)).unwrap();
    assert_eq!(array.len(), 2);
    for (index, view) in array.iter().enumerate() {
        let p = view.camera.projection_matrix();
        for (at, expected) in MATRICES[12 * index..][..12].iter().enumerate() {
            // RQ and the product again, of entries up to 8000.
            assert!((p[(at / 4, at % 4)] - expected).abs() < 1e-9, "{index} {at}");
        }
    }
    assert_eq!(array[0].camera.k()[(0, 0)], 1000.0);
    assert_eq!(array[0].unit, LengthUnit::Millimetre);
    for (name, gap) in [("p.csv", ","), ("q.csv", "; "), ("p.txt", "  ")] {
        let text = read(name, &rows(gap)).unwrap();
        let cameras =
            |views: &[NamedView]| views.iter().map(|v| v.camera.clone()).collect::<Vec<_>>();
        assert_eq!(cameras(&text), cameras(&array), "{name}");
    }
    let one = read("one.npy", &npy("(3, 4)", false, &MATRICES[..12])).unwrap();
    assert_eq!(one[0].camera, array[0].camera);
}

#[test]
fn arrays_that_are_no_matrices_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let defaults =
        ViewDefaults { image_size: Some(ImageSize { width: 500, height: 500 }), unit: MM.unit };
    let mut nan = MATRICES;
    nan[5] = f64::NAN;
    let mut flat = MATRICES;
    flat[8..12].fill(0.0);
    let whole = npy("(2, 3, 4)", false, &MATRICES);
    let cases: [(&str, Vec<u8>, &str); 7] = [
        ("a.npy", npy("(4, 3, 2)", false, &MATRICES), "expected (3, 4) or (n, 3, 4)"),
        ("a.npy", npy("(2, 3, 4)", true, &MATRICES), "C order"),
        ("a.npy", npy("(2, 3, 4)", false, &nan), "not finite"),
        ("a.npy", npy("(2, 3, 4)", false, &flat), "camera"),
        ("a.npy", whole[..whole.len() - 8].to_vec(), "NPY"),
        ("a.csv", b"1,0,0,0\n0,1,0,0\n0,0,1,0\n1,2\n".to_vec(), "a row of 2 numbers"),
        ("a.csv", b"1,0,0,0\n0,1,0,0\n0,0,1,0\n1,0,0,0\n".to_vec(), "multiple of 3"),
    ];
    for (name, bytes, expected) in cases {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let error = read_cameras(&[path], &defaults).unwrap_err().to_string();
        assert!(error.contains(expected), "{name}: {error}");
    }
}

/// Two cameras 90 degrees apart.
fn two_views(sizes: [(u32, u32); 2]) -> Vec<NamedView> {
    let view = |angle: f64, (width, height): (u32, u32)| {
        let k = Matrix3::new(900.0, 0.0, 255.5, 0.0, 910.0, 254.25, 0.0, 0.0, 1.0);
        let r = *Rotation3::from_axis_angle(&Vector3::y_axis(), angle).matrix();
        let size = ImageSize { width, height };
        NamedView {
            name: "v".into(),
            camera: Camera::new(k, r, Vector3::new(1.0, 2.0, 700.0), size).unwrap(),
            unit: LengthUnit::Millimetre,
            frame: "as in the file".into(),
            notes: vec![],
        }
    };
    vec![view(0.0, sizes[0]), view(1.5, sizes[1])]
}

fn cameras(views: &[NamedView]) -> Vec<&Camera> {
    views.iter().map(|view| &view.camera).collect()
}

#[test]
fn opencv_files_keep_two_sizes_and_write_one_size_plainly() {
    let folder = tempfile::tempdir().unwrap();
    for (name, format) in [("c.yml", CameraFormat::OpencvYaml), ("c.xml", CameraFormat::OpencvXml)]
    {
        let path = folder.path().join(name);
        let differing = two_views([(512, 512), (1024, 768)]);
        write_cameras(&path, &differing, format).unwrap();
        let read = read_cameras(std::slice::from_ref(&path), &MM).unwrap();
        assert_eq!(cameras(&read), cameras(&differing), "{name}");
        let same = two_views([(512, 400); 2]);
        write_cameras(&path, &same, format).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        assert!(text.contains("image_width") && !text.contains("image_width1"), "{text}");
        assert_eq!(cameras(&read_cameras(&[path], &MM).unwrap()), cameras(&same), "{name}");
    }
}

/// `numpy` arrays of one dimension, which OpenCV 5 writes under another tag and OpenCV 4 as columns.
#[test]
fn opencv_arrays_of_one_dimension_are_columns() {
    let folder = tempfile::tempdir().unwrap();
    let read = |name: &str, text: String| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        read_cameras(&[path], &MM).map(|views| views[0].camera.clone())
    };
    let (k, d, t) = ("900. 0. 320. 0. 900. 240. 0. 0. 1.", "0.1 -0.2 0. 0. 0.05", "3. -4. 500.");
    let yaml = |shape: fn(usize) -> String| {
        let matrix = |name: &str, shape: &str, data: &str| {
            let data = data.replace(' ', ", ");
            format!("{name}: {shape}\n   dt: d\n   data: [ {data} ]\n")
        };
        let [k, r] = [("K", k), ("R", "1. 0. 0. 0. 1. 0. 0. 0. 1.")]
            .map(|(name, data)| matrix(name, "!!opencv-matrix\n   rows: 3\n   cols: 3", data));
        let (d, t) = (matrix("D", &shape(5), d), matrix("T", &shape(3), t));
        read("c.yml", format!("%YAML:1.0\n---\n{k}{d}{r}{t}image_size: [ 640, 480 ]\n"))
    };
    let column = |n| format!("!!opencv-matrix\n   rows: {n}\n   cols: 1");
    let expected = yaml(column).unwrap();
    assert!(expected.distortion().is_some() && expected.t().z == 500.0);
    let one = |n| format!("!!opencv-nd-matrix\n   sizes: [ {n} ]");
    assert_eq!(yaml(one).unwrap(), expected);
    let two = |n| format!("!!opencv-nd-matrix\n   sizes: [ 1, {n} ]");
    assert_eq!(yaml(two).unwrap(), expected);

    let xml = |sizes: fn(usize) -> String| {
        let nd = |name: &str, n, data: &str| {
            let sizes = sizes(n);
            format!(
                "<{name} type_id=\"opencv-nd-matrix\"><sizes>{sizes}</sizes><dt>d</dt>\
                 <data>{data}</data></{name}>"
            )
        };
        let square = |name: &str, data: &str| {
            format!(
                "<{name} type_id=\"opencv-matrix\"><rows>3</rows><cols>3</cols><dt>d</dt>\
                 <data>{data}</data></{name}>"
            )
        };
        let [k, r] = [square("K", k), square("R", "1. 0. 0. 0. 1. 0. 0. 0. 1.")];
        let (d, t) = (nd("D", 5, d), nd("T", 3, t));
        let size = "<image_size>640 480</image_size>";
        read("c.xml", format!("<opencv_storage>{k}{d}{r}{t}{size}</opencv_storage>"))
    };
    assert_eq!(xml(|n| n.to_string()).unwrap(), expected);

    let refused = |shape| yaml(shape).unwrap_err().to_string();
    let three = |n| format!("!!opencv-nd-matrix\n   sizes: [ 1, {n}, 1 ]");
    assert!(refused(three).contains("has 3 dimensions"), "{}", refused(three));
    let short = |n| format!("!!opencv-nd-matrix\n   sizes: [ {} ]", n - 1);
    assert!(refused(short).contains("2 x 1 entries stated, 3 given"), "{}", refused(short));
    let none = |_| "!!opencv-nd-matrix\n   sizes: [ 0 ]".to_owned();
    assert!(refused(none).contains("sizes must be whole"), "{}", refused(none));
    assert!(xml(|n| format!("1 {n} 1")).unwrap_err().to_string().contains("3 dimensions"));
}

#[test]
fn an_image_size_must_be_whole_positive_and_fit() {
    let folder = tempfile::tempdir().unwrap();
    let opencv = |size: &str| {
        let path = folder.path().join("c.yml");
        let k = "[ 900., 0., 320., 0., 900., 240., 0., 0., 1. ]";
        let k = format!("K: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: {k}\n");
        std::fs::write(&path, format!("%YAML:1.0\n---\n{k}{size}\n")).unwrap();
        read_cameras(&[path], &MM).map(|views| views[0].camera.size())
    };
    let matlab = |size: &str| {
        let path = folder.path().join("stereo.json");
        let camera = format!(r#"{{"K": [[800,0,321],[0,810,241],[0,0,1]], "ImageSize": {size}}}"#);
        let text = format!(
            r#"{{"CameraParameters1": {camera}, "CameraParameters2": {camera},
                "RotationOfCamera2": [[0,1,0],[-1,0,0],[0,0,1]], "TranslationOfCamera2": [5,6,7]}}"#
        );
        std::fs::write(&path, text).unwrap();
        read_cameras(&[path], &MM).map(|views| views[0].camera.size())
    };
    let vga = ImageSize { width: 640, height: 480 };
    assert_eq!(opencv("image_size: [ 640, 480 ]").unwrap(), vga);
    let matrix =
        "image_size: !!opencv-matrix\n   rows: 2\n   cols: 1\n   dt: i\n   data: [ 640, 480 ]";
    assert_eq!(opencv(matrix).unwrap(), vga);
    assert_eq!(matlab("[480, 640]").unwrap(), vga);
    let whole = "expected a whole number of px from 1 to 1000000";
    for (found, value, expected) in [
        (opencv("image_size: [ 640.7, 480.2 ]"), "image_size = `640.7`", whole),
        (opencv("image_size: [ 1e30, 480 ]"), "image_size = `1000000", whole),
        (opencv("image_size: [ 640, 0 ]"), "image_size = `0`", whole),
        (opencv("imageSize: [ 640, -480 ]"), "imageSize = `-480`", whole),
        (opencv("image_size: [ 640, .Nan ]"), "image_size", "expected"),
        (opencv("image_size: \"640x480\""), "image_size", "expected [width, height]"),
        (opencv("image_width: 640.5\nimage_height: 480"), "image_width = `640.5`", whole),
        (matlab("[480.5, 640]"), "ImageSize = `480.5`", whole),
        (matlab("[480, 1e12]"), "ImageSize = `1000000000000`", whole),
        (matlab("[480, 640, 3]"), "ImageSize", "expected [rows, columns], found 3 numbers"),
    ] {
        let error = found.unwrap_err();
        assert!(matches!(error, IoError::Field { .. }), "{error}");
        let error = error.to_string();
        assert!(error.contains(value) && error.contains(expected), "{error}");
    }
    assert!(matlab("[]").unwrap_err().to_string().contains("states no image size"));
}

const COLMAP_CAMERAS: &str = "# CAMERA_ID MODEL WIDTH HEIGHT PARAMS\n\
    1 PINHOLE 640 480 900 900 320 240\n2 SIMPLE_RADIAL 800 600 950 400 300 0.1\n";

#[test]
fn colmap_images_are_read_with_and_without_their_lines_of_points() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("cameras.txt"), COLMAP_CAMERAS).unwrap();
    let names_of = |images: &str| {
        std::fs::write(folder.path().join("images.txt"), images).unwrap();
        let views = read_cameras(&[folder.path().to_owned()], &MM)?;
        Ok(views.into_iter().map(|view| view.name).collect::<Vec<_>>())
    };
    // A name that is a number, one with blanks, and one that a parser may take for a number.
    let images = ["1 1 0 0 0 1 2 3 1 0001", "2 0 1 0 0 4 5 6 2 b c.png", "3 0 0 1 0 7 8 9 1 nan"];
    let points = ["", "1.5 2 -1 3 4 17", "1.5 2 -1"];
    let expected = ["0001", "b c.png", "nan"];
    // Every choice of: no line, an empty one, points.
    for choice in 0..27_usize {
        let mut text = String::from("# IMAGE_ID ...\n");
        for (i, image) in images.iter().enumerate() {
            text += &format!("{image}\n");
            text += &match choice / 3_usize.pow(i as u32) % 3 {
                0 => String::new(),
                1 => "\n".to_owned(),
                _ => format!("{}\n", points[i]),
            };
        }
        let names: Result<Vec<String>, IoError> = names_of(&text);
        assert_eq!(names.unwrap(), expected, "{text}");
    }
    let cut = format!("{}\n1.5 2 -1 3\n{}\n", images[0], images[1]);
    let error = names_of(&cut).unwrap_err().to_string();
    assert!(error.contains("line 2: not valid COLMAP text: expected IMAGE_ID"), "{error}");
}
