//! Hostile input: every truncation and thousands of mutations of good files give a value or a typed
//! error that names the file; never a panic, never a number that is not finite.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stdout)]

mod common;

use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use accurate_geom::{LengthUnit, Point3, View1};
use accurate_io::{
    Column, CurveTable, IoError, PairParts, PlyEncoding, read_curve, read_grey, read_manifest,
    read_mask, read_matrix3, read_pair, read_points, read_rig, write_curve, write_matrix3,
    write_pair, write_points, write_rig, write_u8, write_u16,
};
use common::{Stream, contents};

/// Reads a file; `Ok(false)` if a number in the result is not finite.
type Read = fn(&Path) -> Result<bool, IoError>;

const MUTATIONS: u64 = 1500;
/// A seed at most this long is cut at every byte, a longer one at this many places.
const CUTS: usize = 1500;

fn curve(path: &Path) -> Result<bool, IoError> {
    let curve = read_curve(path)?;
    let finite = |v: &f64| v.is_finite();
    Ok(curve.points.iter().all(|p| p.coords.iter().all(finite))
        && curve.columns.iter().all(|c| c.values.iter().all(finite)))
}

fn points(path: &Path) -> Result<bool, IoError> {
    Ok(read_points::<View1>(path)?.iter().all(|p| p.is_finite()))
}

fn rig(path: &Path) -> Result<bool, IoError> {
    let rig = read_rig(path)?;
    Ok([rig.camera1(), rig.camera2()]
        .iter()
        .all(|c| c.projection_matrix().iter().all(|v| v.is_finite())))
}

fn image(path: &Path) -> Result<bool, IoError> {
    let grey = read_grey(path)?;
    let mask = match read_mask(path) {
        Ok(mask) => mask.dim(),
        Err(IoError::Unsupported { .. }) => grey.values.dim(),
        Err(e) => return Err(e),
    };
    let range = 0.0..=grey.depth.max_value();
    Ok(mask == grey.values.dim() && grey.values.iter().all(|v| range.contains(v)))
}

/// The file is `meta.json` of a good pair folder.
fn meta(path: &Path) -> Result<bool, IoError> {
    let dir = path.parent().unwrap();
    let pair = read_pair(dir, PairParts::default())?;
    Ok(pair.size.iter().all(|s| s.width > 0 && s.height > 0))
}

fn matrix(path: &Path) -> Result<bool, IoError> {
    Ok(read_matrix3(path)?.iter().all(|v| v.is_finite()))
}

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

/// Writes `bytes`, reads them, and checks what came of it. `true` if they were accepted.
fn survives(path: &Path, bytes: &[u8], read: Read, what: &str) -> bool {
    fs::write(path, bytes).unwrap();
    let outcome = catch_unwind(AssertUnwindSafe(|| read(path)));
    match outcome.unwrap_or_else(|_| panic!("{what} panicked")) {
        Ok(finite) => {
            assert!(finite, "{what} gave a number that is not finite");
            true
        }
        Err(error) => {
            let text = error.to_string();
            assert!(text.len() < 2000, "{what}: {} characters of error", text.len());
            assert!(!error.path().as_os_str().is_empty(), "{what}: {text}");
            false
        }
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
    let points: Vec<Point3> = pair.truth.unwrap();
    let column = |name: &str, unit: &str, scale: f64| Column {
        name: name.into(),
        unit: unit.into(),
        values: (0..points.len()).map(|i| i as f64 * scale).collect(),
    };
    let curve_table = CurveTable {
        unit: LengthUnit::Millimetre,
        columns: vec![column("arc_length", "mm", 1.25), column("flag", "", 1.0)],
        points: points.clone(),
    };
    for name in ["curve.csv", "binary.ply", "curve.vtp", "curve.npy"] {
        write_curve(&dir.join(name), &curve_table).unwrap();
    }
    accurate_io::write_ply_points(&dir.join("ascii.ply"), &points, PlyEncoding::Ascii).unwrap();
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
        ("points.csv", points_reader()),
        ("rig.toml", rig),
        ("rig.json", rig),
        ("curve.csv", curve),
        ("ascii.ply", curve),
        ("binary.ply", curve),
        ("curve.vtp", curve),
        ("curve.npy", curve),
        ("grey8.png", image),
        ("grey16.png", image),
        ("image.tiff", image),
        ("image.jpg", image),
        ("image.bmp", image),
        ("image.ppm", image),
        ("meta.json", meta),
    ]
}

fn points_reader() -> Read {
    points
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
            let bytes = mutated(&seed, &mut stream);
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

/// Peak resident memory of this process, KiB; `None` where the system does not tell.
fn peak_kib() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM"))?;
    line.split_whitespace().nth(1)?.parse().ok()
}

fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |mut crc, b| {
        crc ^= u32::from(*b);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { (crc >> 1) ^ 0xEDB8_8320 } else { crc >> 1 };
        }
        crc
    })
}

/// A PNG of a few bytes whose header declares `width` x `height`.
fn png_bomb(width: u32, height: u32) -> Vec<u8> {
    let mut header = b"IHDR".to_vec();
    header.extend(width.to_be_bytes());
    header.extend(height.to_be_bytes());
    header.extend([8, 0, 0, 0, 0]);
    let mut bytes = b"\x89PNG\r\n\x1a\n".to_vec();
    for chunk in [header, b"IDAT\x78\x9c\x63".to_vec(), b"IEND".to_vec()] {
        bytes.extend((chunk.len() as u32 - 4).to_be_bytes());
        bytes.extend(&chunk);
        bytes.extend(crc(&chunk).to_be_bytes());
    }
    bytes
}

#[test]
fn declared_sizes_are_refused_before_memory_is_taken() {
    let folder = tempfile::tempdir().unwrap();
    let npy = |shape: &str| {
        let header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}\n");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.bytes());
        bytes
    };
    let ply = |format: &str, count: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement vertex {count}\nproperty double x\n\
             property double y\nproperty double z\nend_header\n1 2 3\n"
        )
        .into_bytes()
    };
    let vtp = "<VTKFile type=\"PolyData\">".to_owned() + &"<a>".repeat(100_000);
    let bmp = {
        let mut bytes = b"BM\0\0\0\0\0\0\0\0\x36\0\0\0\x28\0\0\0".to_vec();
        bytes.extend(16_000_i32.to_le_bytes());
        bytes.extend(16_000_i32.to_le_bytes());
        bytes.extend([1, 0, 24, 0]);
        bytes.extend([0; 24]);
        bytes
    };
    let table: Vec<(&str, Vec<u8>, Read)> = vec![
        ("a.ply", ply("ascii", "1000000000000"), curve),
        ("b.ply", ply("binary_little_endian", "1000000000000"), curve),
        ("c.ply", ply("ascii", "99999999999999999999999"), curve),
        ("d.npy", npy("(1000000000000, 3)"), curve),
        ("e.npy", npy("(18446744073709551615, 3)"), curve),
        ("f.npy", b"\x93NUMPY\x02\x00\xff\xff\xff\xff{".to_vec(), curve),
        ("g.png", png_bomb(0x7fff_ffff, 0x7fff_ffff), image),
        ("h.png", png_bomb(16_384, 16_384), image),
        ("i.png", png_bomb(65_535, 1), image),
        ("j.bmp", bmp, image),
        ("k.ppm", b"P6 16000 16000 255\n".to_vec(), image),
        ("l.ppm", b"P6 4000000000 4000000000 255\n".to_vec(), image),
        ("m.vtp", vtp.into_bytes(), curve),
        ("n.toml", b"a = {b = ".repeat(20_000), rig),
        ("o.toml", b"[".repeat(100_000), rig),
        ("p.json", b"{\"a\":".repeat(20_000), rig),
        ("q.toml", vec![b'#'; 2 << 20], rig),
        ("r.txt", vec![b'1'; 2 << 20], matrix),
    ];
    let before = peak_kib();
    for (name, bytes, read) in table {
        let path = folder.path().join(name);
        assert!(!survives(&path, &bytes, read, name), "{name} was accepted");
    }
    if let (Some(before), Some(after)) = (before, peak_kib()) {
        // The tests of this file run side by side, with megabytes of their own; any of the sizes
        // declared above would show as more than 190 MiB.
        assert!(after - before < 128 << 10, "peak memory grew by {} KiB", after - before);
        println!("peak memory grew by {} KiB", after - before);
    } else {
        println!("skipped: this system does not tell the peak memory");
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

#[cfg(target_os = "linux")]
#[test]
fn a_device_that_never_ends_is_refused() {
    let error = read_matrix3(Path::new("/dev/zero")).unwrap_err();
    assert!(matches!(error, IoError::TooLarge { .. }), "{error}");
}
