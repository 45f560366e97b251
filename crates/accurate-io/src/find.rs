use std::cmp::Ordering;
use std::fs;
use std::path::{Path, PathBuf};

use crate::IoError;

/// The pair folders `path` stands for: `path` itself if it is a pair folder, else the folders in it
/// that are (or are called `case_*`), in natural order (`case_2` before `case_10`).
///
/// # Errors
/// [`IoError::Missing`] or [`IoError::System`] if the folder cannot be listed;
/// [`IoError::NoPair`] if it is neither.
pub fn find_pairs(path: &Path) -> Result<Vec<PathBuf>, IoError> {
    let system = |e| IoError::system(path, "list", e);
    let entries = fs::read_dir(path).map_err(system)?;
    if is_pair(path) {
        return Ok(vec![path.to_owned()]);
    }
    let mut cases = Vec::new();
    for entry in entries {
        let entry = entry.map_err(system)?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let folder = entry.path();
        if folder.is_dir() && (name.starts_with("case_") || is_pair(&folder)) {
            cases.push((name, folder));
        }
    }
    if cases.is_empty() {
        return Err(IoError::NoPair { path: path.to_owned() });
    }
    cases.sort_by(|a, b| natural_order(&a.0, &b.0));
    Ok(cases.into_iter().map(|c| c.1).collect())
}

/// Whether the folder has what only a pair folder has. A set's folder may have a `calibration`
/// folder of its own, with the K that its cases share.
fn is_pair(folder: &Path) -> bool {
    let marks = ["meta.json", "points", "masks", "images", "calibration/RT_L.txt"];
    marks.iter().any(|mark| folder.join(mark).exists())
}

/// Compares names with runs of digits taken as numbers of any length.
fn natural_order(a: &str, b: &str) -> Ordering {
    let (mut rest_a, mut rest_b) = (a, b);
    loop {
        let (text_a, number_a, next_a) = split(rest_a);
        let (text_b, number_b, next_b) = split(rest_b);
        let by_value = |n: &str| n.trim_start_matches('0').len();
        let order = text_a
            .cmp(text_b)
            .then_with(|| by_value(number_a).cmp(&by_value(number_b)))
            .then_with(|| number_a.trim_start_matches('0').cmp(number_b.trim_start_matches('0')));
        if order != Ordering::Equal {
            return order;
        }
        if next_a.is_empty() || next_b.is_empty() {
            // Equal as numbers: `case_01` and `case_1` still need one order.
            return next_a.len().cmp(&next_b.len()).then_with(|| a.cmp(b));
        }
        (rest_a, rest_b) = (next_a, next_b);
    }
}

/// Leading text, the digits behind it, and the rest.
fn split(text: &str) -> (&str, &str, &str) {
    let digits = text.find(|c: char| c.is_ascii_digit()).unwrap_or(text.len());
    let (head, tail) = text.split_at(digits);
    let end = tail.find(|c: char| !c.is_ascii_digit()).unwrap_or(tail.len());
    let (number, rest) = tail.split_at(end);
    (head, number, rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cases_come_in_natural_order_and_files_are_no_cases() {
        let set = tempfile::tempdir().unwrap();
        for name in ["case_10", "case_2", "case_002b", "case_1", "other"] {
            fs::create_dir(set.path().join(name)).unwrap();
        }
        fs::write(set.path().join("case_0"), "a file").unwrap();
        let found = find_pairs(set.path()).unwrap();
        let names: Vec<_> =
            found.iter().map(|p| p.file_name().unwrap().to_str().unwrap()).collect();
        assert_eq!(names, ["case_1", "case_2", "case_002b", "case_10"]);
    }

    #[test]
    fn a_pair_stands_for_itself_and_anything_else_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        assert!(matches!(find_pairs(dir.path()), Err(IoError::NoPair { .. })));
        fs::create_dir_all(dir.path().join("calibration")).unwrap();
        fs::write(dir.path().join("calibration/RT_L.txt"), "").unwrap();
        assert_eq!(find_pairs(dir.path()).unwrap(), [dir.path()]);
        let missing = dir.path().join("nowhere");
        assert!(matches!(find_pairs(&missing), Err(IoError::Missing { .. })));
    }

    #[test]
    fn the_order_is_total() {
        let names = [
            "",
            "1",
            "01",
            "a",
            "a1",
            "a01",
            "a1b",
            "a2",
            "a10",
            "a10b2",
            "b",
            "99999999999999999999999",
        ];
        for a in names {
            assert_eq!(natural_order(a, a), Ordering::Equal);
            for b in names {
                assert_eq!(natural_order(a, b), natural_order(b, a).reverse(), "{a} {b}");
                assert_eq!(natural_order(a, b) == Ordering::Equal, a == b);
                for c in names {
                    if natural_order(a, b).is_lt() && natural_order(b, c).is_lt() {
                        assert!(natural_order(a, c).is_lt(), "{a} {b} {c}");
                    }
                }
            }
        }
    }
}
