//! Sizes a file declares are refused before memory is taken for them. Alone in its file, because the
//! peak memory is that of the process.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stdout)]

mod common;

use std::fs;

use common::files::{Read, crc, curve, image, matrix, rig, survives};

/// Peak resident memory of this process, KiB; `None` where the system does not tell.
fn peak_kib() -> Option<u64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|l| l.starts_with("VmHWM"))?;
    line.split_whitespace().nth(1)?.parse().ok()
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
        let grown = after - before;
        println!("peak memory grew by {grown} KiB");
        // The files themselves have up to 2 MiB and the text parsers list their tokens; any of the
        // sizes declared above would show as more than 190 MiB.
        assert!(grown < 16 << 10, "peak memory grew by {grown} KiB");
    } else {
        println!("skipped: this system does not tell the peak memory");
    }
}
