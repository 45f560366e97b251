//! Hostile input: every truncation and thousands of mutations of good files give a value or a typed
//! error that names the file; never a panic, never a number that is not finite.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stdout)]

mod common;

use std::fs;
use std::path::Path;

use accurate_geom::{LengthUnit, Point3, View1};
use accurate_io::{
    CameraFormat, Column, CurveTable, IoError, PlyEncoding, ViewDefaults, read_cameras,
    read_manifest, read_matrix3, read_points, write_cameras, write_curve, write_matrix3,
    write_pair, write_points, write_rig, write_u8, write_u16,
};
use common::files::{Read, cameras, crc, curve, image, matrix, meta, points, rig, survives};
use common::{Stream, contents};

const MUTATIONS: u64 = 1500;
/// A seed at most this long is cut at every byte, a longer one at this many places.
const CUTS: usize = 1500;

/// What hostile hands like to put in place of a field.
const FIELDS: [&str; 22] = [
    "",
    " ",
    "0",
    "-1",
    "1",
    "3",
    "nan",
    "-inf",
    "1e999",
    "99999999999999999999",
    "1000000000000",
    "2147483648",
    "65536",
    "0x10",
    "\u{0}",
    "\u{feff}",
    "\"",
    "<",
    "[[[[[[[[",
    "\n",
    "ascii",
    "é",
];

fn mutated(seed: &[u8], stream: &mut Stream) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for _ in 0..=stream.below(4) {
        if bytes.is_empty() {
            break;
        }
        let at = stream.below(bytes.len());
        match stream.below(6) {
            // A flipped bit, twice as often as the rest.
            0 | 1 => bytes[at] ^= 1 << stream.below(8),
            2 => bytes[at] = [0, 0xff, 0x7f, 0x80, b'9', b'-'][stream.below(6)],
            // A field replaced by a hostile one.
            3 => {
                let start = field_edge(&bytes[..at], true);
                let end = at + field_edge(&bytes[at..], false);
                bytes.splice(start..end, FIELDS[stream.below(FIELDS.len())].bytes());
            }
            // Two pieces swapped.
            4 => {
                let other = stream.below(bytes.len());
                let length = (1 + stream.below(8)).min(bytes.len() - at.max(other));
                for k in 0..length {
                    bytes.swap(at + k, other + k);
                }
            }
            // A piece repeated or removed.
            _ => {
                let end = (at + 1 + stream.below(40)).min(bytes.len());
                let piece = bytes[at..end].to_vec();
                if stream.below(2) == 0 {
                    bytes.splice(at..at, piece);
                } else {
                    bytes.drain(at..end);
                }
            }
        }
    }
    bytes
}

fn field_edge(bytes: &[u8], last: bool) -> usize {
    let edge = |b: &u8| b.is_ascii_whitespace() || b",=:[]{}()<>'\"".contains(b);
    if last {
        bytes.iter().rposition(edge).map_or(0, |i| i + 1)
    } else {
        bytes.iter().position(edge).unwrap_or(bytes.len())
    }
}

/// Makes the checksums of a PNG right again, so that a mutation gets past them.
fn repair_png(bytes: &mut [u8]) {
    let mut at = 8;
    while bytes.starts_with(b"\x89PNG")
        && let Some(length) = bytes.get(at..at + 4)
        && let length = u32::from_be_bytes(length.try_into().unwrap()) as usize
        && let Some(chunk) = bytes.get(at + 4..at.saturating_add(8).saturating_add(length))
    {
        let checksum = crc(chunk).to_be_bytes();
        at += 8 + length;
        if let Some(place) = bytes.get_mut(at..at + 4) {
            place.copy_from_slice(&checksum);
        }
        at += 4;
    }
}

/// A good pair folder, and a seed file for every format.
fn seeds(dir: &Path) -> Vec<(&'static str, Read)> {
    let pair = contents(5);
    write_pair(dir, &pair).unwrap();
    write_matrix3(&dir.join("K.txt"), pair.rig.camera1().k()).unwrap();
    write_points(&dir.join("points.csv"), &pair.points.unwrap().0).unwrap();
    write_rig(&dir.join("rig.toml"), &pair.rig).unwrap();
    write_rig(&dir.join("rig.json"), &pair.rig).unwrap();
    let views = read_cameras(&[dir.join("rig.toml")], &ViewDefaults::default()).unwrap();
    for (name, format) in [
        ("stereo.yml", CameraFormat::OpencvYaml),
        ("stereo.xml", CameraFormat::OpencvXml),
        ("views.json", CameraFormat::ViewsJson),
        ("p.txt", CameraFormat::MatrixText),
    ] {
        write_cameras(&dir.join(name), &views, format).unwrap();
    }
    fs::write(dir.join("cameras.txt"), "1 OPENCV 640 480 900 910 320 240 0.1 0.2 0 0\n").unwrap();
    let images = "# images\n1 1 0 0 0 0.5 2 3 1 a.png\n1.5 2 -1\n2 0 1 0 0 4 5 6 1 b.png\n";
    fs::write(dir.join("images.txt"), images).unwrap();
    let truth: Vec<Point3> = pair.truth.unwrap();
    let column = |name: &str, unit: &str, scale: f64| Column {
        name: name.into(),
        unit: unit.into(),
        values: (0..truth.len()).map(|i| i as f64 * scale).collect(),
    };
    let curve_table = CurveTable {
        unit: LengthUnit::Millimetre,
        columns: vec![column("arc_length", "mm", 1.25), column("flag", "", 1.0)],
        points: truth.clone(),
    };
    for name in ["curve.csv", "binary.ply", "curve.vtp", "curve.npy", "curve.npz"] {
        write_curve(&dir.join(name), &curve_table).unwrap();
    }
    accurate_io::write_ply_points(&dir.join("ascii.ply"), &truth, PlyEncoding::Ascii).unwrap();
    let image8 = pair.images.unwrap()[0].values.mapv(|v| v as u8);
    write_u8(&dir.join("grey8.png"), &image8).unwrap();
    write_u16(&dir.join("grey16.png"), &image8.mapv(u16::from)).unwrap();
    let encode = |format| {
        let rgb =
            image::RgbImage::from_fn(24, 16, |x, y| image::Rgb([x as u8 * 9, y as u8 * 9, 50]));
        let mut bytes = std::io::Cursor::new(Vec::new());
        image::DynamicImage::ImageRgb8(rgb).write_to(&mut bytes, format).unwrap();
        bytes.into_inner()
    };
    for (name, format) in [
        ("image.tiff", image::ImageFormat::Tiff),
        ("image.jpg", image::ImageFormat::Jpeg),
        ("image.bmp", image::ImageFormat::Bmp),
        ("image.ppm", image::ImageFormat::Pnm),
    ] {
        fs::write(dir.join(name), encode(format)).unwrap();
    }
    vec![
        ("K.txt", matrix),
        ("points.csv", points),
        ("rig.toml", rig),
        ("rig.json", rig),
        ("stereo.yml", cameras),
        ("stereo.xml", cameras),
        ("views.json", cameras),
        ("p.txt", cameras),
        ("cameras.txt", cameras),
        ("images.txt", cameras),
        ("curve.csv", curve),
        ("ascii.ply", curve),
        ("binary.ply", curve),
        ("curve.vtp", curve),
        ("curve.npy", curve),
        ("curve.npz", curve),
        ("grey8.png", image),
        ("grey16.png", image),
        ("image.tiff", image),
        ("image.jpg", image),
        ("image.bmp", image),
        ("image.ppm", image),
        ("meta.json", meta),
    ]
}

#[test]
fn no_truncated_or_mutated_file_is_more_than_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path();
    let mut total = 0;
    for (number, (name, read)) in seeds(dir).into_iter().enumerate() {
        let path = dir.join(name);
        let seed = fs::read(&path).unwrap();
        assert!(survives(&path, &seed, read, name), "the seed {name} itself is good");
        let step = seed.len().div_ceil(CUTS);
        for length in (0..seed.len()).step_by(step) {
            survives(&path, &seed[..length], read, &format!("{name} cut at {length}"));
            total += 1;
        }
        let mut accepted = 0;
        for k in 0..MUTATIONS {
            let mut stream = Stream(1_000_000 * number as u64 + k);
            let mut bytes = mutated(&seed, &mut stream);
            if k % 2 == 0 {
                repair_png(&mut bytes);
            }
            accepted +=
                usize::from(survives(&path, &bytes, read, &format!("{name}, mutation {k}")));
            total += 1;
        }
        println!("{name}: {accepted} of {MUTATIONS} mutations are still valid");
        fs::write(&path, &seed).unwrap();
    }
    println!("{total} hostile files");
}

#[test]
fn a_mutated_manifest_is_refused_or_read() {
    let text = "name = \"m\"\nwhat = \"a\"\nunit = \"mm\"\ntruth = \"none\"\norigin = \"o\"\n\
        licence = \"l\"\nobtain = \"o\"\nshipped = false\nsplit = [{ name = \"test\", cases = 2 }]\n";
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("m.toml");
    let read: Read = |p| read_manifest(p).map(|_| true);
    assert!(survives(&path, text.as_bytes(), read, "the seed"));
    for length in 0..text.len() - 1 {
        survives(&path, &text.as_bytes()[..length], read, "cut");
    }
    for k in 0..MUTATIONS {
        survives(&path, &mutated(text.as_bytes(), &mut Stream(k)), read, &format!("mutation {k}"));
    }
}

#[test]
fn a_line_without_end_is_one_bad_number() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("points.csv");
    let mut bytes = b"x,y\n1,".to_vec();
    bytes.resize(8 << 20, b'7');
    fs::write(&path, &bytes).unwrap();
    // Eight million digits overflow to infinity.
    assert!(matches!(read_points::<View1>(&path), Err(IoError::NotFinite { .. })));
    bytes.truncate(6);
    bytes.resize(8 << 20, b'z');
    fs::write(&path, &bytes).unwrap();
    let error = read_points::<View1>(&path).unwrap_err();
    assert!(matches!(error, IoError::NotANumber { .. }));
    assert!(error.to_string().len() < 300);
}

#[test]
fn many_small_pieces_take_no_quadratic_time() {
    let folder = tempfile::tempdir().unwrap();
    let n = 200_000;
    let array = "<DataArray type=\"Float64\" Name=\"a\" format=\"ascii\">1</DataArray>\n";
    let vtp = format!("<VTKFile type=\"PolyData\"><PointData>{}", array.repeat(n));
    let properties: String = (0..n).map(|i| format!("property uchar p{i}\n")).collect();
    let ply = format!("ply\nformat ascii 1.0\nelement vertex 1\n{properties}end_header\n");
    let elements: String = (0..n).map(|i| format!("element e{i} 0\n")).collect();
    let csv: String = (0..n).map(|i| format!("c{i},")).collect();
    let table: [(&str, String, Read); 5] = [
        ("a.vtp", vtp, curve),
        ("b.ply", ply, curve),
        ("c.ply", format!("ply\nformat ascii 1.0\n{elements}end_header\n"), curve),
        ("d.csv", format!("x,y,z,{csv}\n"), curve),
        ("e.csv", "x,y\n".to_owned() + &"1,2\n".repeat(n), points),
    ];
    for (name, text, read) in table {
        let start = std::time::Instant::now();
        survives(&folder.path().join(name), text.as_bytes(), read, name);
        let seconds = start.elapsed().as_secs_f64();
        println!("{name}: {} KiB in {seconds:.3} s", text.len() >> 10);
        // Linear work takes milliseconds; 200 000 squared would take minutes.
        assert!(seconds < 10.0, "{name}: {seconds} s");
    }
}

#[cfg(target_os = "linux")]
#[test]
fn a_device_that_never_ends_is_refused() {
    let error = read_matrix3(Path::new("/dev/zero")).unwrap_err();
    assert!(matches!(error, IoError::TooLarge { .. }), "{error}");
}
