use std::fs::File;
use std::path::{Path, PathBuf};

use crate::calibration::{VIEWS, k_path, lens_path, rt_path};
use crate::pair::{TRUTH_NAME, image_name, mask_name, points_name};
use crate::{IoError, PairParts, Truth};

/// The BLAKE3 hash of a file's bytes, 64 hexadecimal digits.
///
/// # Errors
/// [`IoError::Missing`] or [`IoError::System`].
pub fn hash_file(path: &Path) -> Result<String, IoError> {
    let system = |e| IoError::system(path, "read", e);
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(File::open(path).map_err(system)?).map_err(system)?;
    Ok(hasher.finalize().to_hex().to_string())
}

/// The BLAKE3 hash of bytes in memory, 64 hexadecimal digits.
pub fn hash_bytes(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

/// The [`pair_files`], each with its hash, so that a result can say what it was made from.
///
/// # Errors
/// As [`hash_file`].
pub fn hash_pair(dir: &Path, needs: PairParts) -> Result<Vec<(PathBuf, String)>, IoError> {
    let files = pair_files(dir, needs).into_iter();
    files.map(|file| hash_file(&file).map(|hash| (file, hash))).collect()
}

/// The files that [`read_pair`](crate::read_pair) reads with the same `needs`, as far as they are there,
/// in the order of their paths, which are as found from `dir`.
pub fn pair_files(dir: &Path, needs: PairParts) -> Vec<PathBuf> {
    let mut files = vec![dir.join("meta.json")];
    for (letter, _) in VIEWS {
        files.extend(k_path(dir, letter));
        files.push(rt_path(dir, letter));
        files.push(lens_path(dir, letter));
        for (wanted, name) in [
            (needs.points, points_name(letter)),
            (needs.masks, mask_name(letter)),
            (needs.images, image_name(letter)),
        ] {
            if wanted {
                files.push(dir.join(name));
            }
        }
    }
    if needs.truth != Truth::Ignore {
        files.push(dir.join(TRUTH_NAME));
    }
    files.sort();
    files.dedup();
    files.retain(|file| file.is_file());
    files
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_of_an_empty_file_is_the_published_one() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("empty");
        std::fs::write(&path, b"").unwrap();
        // Test vector of the BLAKE3 specification for no input.
        assert_eq!(
            hash_file(&path).unwrap(),
            "af1349b9f5f9a1a6a0404dea36dcc9499bcb25c9adc112b7cc9a93cae41f3262"
        );
    }

    #[test]
    fn a_pair_is_told_by_the_files_that_were_asked_for() {
        let dir = tempfile::tempdir().unwrap();
        let write = |name: &str| {
            let path = dir.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, name).unwrap();
        };
        for name in [
            "meta.json",
            "calibration/K.txt",
            "calibration/RT_L.txt",
            "calibration/RT_R.txt",
            "points/points_L.csv",
            "points/points_R.csv",
            "masks/mask_L.png",
        ] {
            write(name);
        }
        let needs = PairParts { points: true, ..PairParts::default() };
        let files: Vec<_> = hash_pair(dir.path(), needs)
            .unwrap()
            .into_iter()
            .map(|(path, _)| path.strip_prefix(dir.path()).unwrap().to_owned())
            .collect();
        // K.txt once, though both views read it; no mask, though one is there.
        assert_eq!(files.len(), 6, "{files:?}");
        assert!(!files.contains(&PathBuf::from("masks/mask_L.png")));
    }
}
