//! A writer killed at any instant leaves the old file or the new one, whole.
#![cfg(unix)]
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stdout)]

mod common;

use std::fs;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::Duration;

use accurate_geom::{LengthUnit, Point3};
use accurate_io::{CurveTable, read_curve, remove_unfinished, write_curve};

/// Tells the child where to write.
const FOLDER: &str = "ACCURATE_KILLED_WRITER_FOLDER";
const KILLS: usize = 60;

/// Two curves of different length; every point tells which.
fn curve(which: usize) -> CurveTable {
    let n = 3000 + 2000 * which;
    let points = (0..n).map(|i| Point3::new(which as f64, i as f64, n as f64)).collect();
    CurveTable::from_points(points, LengthUnit::Millimetre)
}

/// Not a test of its own: the program the other test starts and kills.
#[test]
fn child_that_writes_until_it_is_killed() {
    let Some(folder) = std::env::var_os(FOLDER) else { return };
    let path = PathBuf::from(folder).join("curve.csv");
    for which in [0, 1].into_iter().cycle() {
        write_curve(&path, &curve(which)).unwrap();
    }
}

#[test]
fn a_kill_at_any_instant_tears_no_file_and_leftovers_can_be_removed() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("curve.csv");
    write_curve(&path, &curve(0)).unwrap();
    let mut stream = common::Stream(11);
    let (mut left, mut seen) = (0, [0, 0]);
    for _ in 0..KILLS {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args(["child_that_writes_until_it_is_killed", "--exact"])
            .env(FOLDER, folder.path())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        sleep(Duration::from_micros(2_000 + stream.next() % 30_000));
        child.kill().unwrap();
        child.wait().unwrap();
        let read = read_curve(&path).unwrap();
        let which = usize::from(read.points.len() != 3000);
        assert_eq!(read.points, curve(which).points);
        seen[which] += 1;
        left += remove_unfinished(folder.path()).unwrap();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
    println!("{KILLS} kills: {left} unfinished files removed, {seen:?} reads of either curve");
}
