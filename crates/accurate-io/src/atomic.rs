use std::fs;
#[cfg(unix)]
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use tempfile::Builder;

use crate::IoError;

/// What the name of an unfinished file ends with.
const SUFFIX: &str = ".accurate-tmp";

/// Writes `path` so that a reader sees the old file or the new one, never a part.
///
/// `write` fills a temporary file in the same folder, which is synced, renamed onto `path`, and the
/// folder synced. The folder must exist.
///
/// # Errors
/// [`IoError::System`] (or [`IoError::Missing`] for a missing folder). When `write` or anything
/// after it fails, the old file is as it was and no temporary file stays.
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), IoError> {
    let system = |e| IoError::system(path, "write", e);
    let name = path
        .file_name()
        .ok_or_else(|| system(io::Error::new(io::ErrorKind::InvalidInput, "not a file name")))?;
    let folder = folder_of(path);

    let mut prefix = std::ffi::OsString::from(".");
    prefix.push(name);
    prefix.push(".");
    let mut builder = Builder::new();
    builder.prefix(&prefix).suffix(SUFFIX);
    // A temporary file is private by default; an output should follow the user's umask.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let temporary = builder.tempfile_in(folder).map_err(system)?;

    let mut buffer = BufWriter::new(temporary.as_file());
    write(&mut buffer).and_then(|()| buffer.flush()).map_err(system)?;
    drop(buffer);
    temporary.as_file().sync_all().map_err(system)?;
    temporary.persist(path).map_err(|e| system(e.error))?;
    // The rename itself lives in the folder: without this a power cut may undo it.
    #[cfg(unix)]
    File::open(folder).and_then(|f| f.sync_all()).map_err(system)?;
    Ok(())
}

/// Removes what killed runs left unfinished in `folder` and returns how many files that were.
///
/// Call it before a run that has the folder for itself: a file another process is writing at this
/// moment looks the same.
///
/// # Errors
/// [`IoError::System`] or [`IoError::Missing`] naming the folder or the file.
pub fn remove_unfinished(folder: &Path) -> Result<usize, IoError> {
    let system = |e| IoError::system(folder, "list", e);
    let mut removed = 0;
    for entry in fs::read_dir(folder).map_err(system)? {
        let entry = entry.map_err(system)?;
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if name.starts_with('.') && name.ends_with(SUFFIX) {
            fs::remove_file(entry.path())
                .map_err(|e| IoError::system(&entry.path(), "remove", e))?;
            removed += 1;
        }
    }
    Ok(removed)
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(folder)
            .unwrap()
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("curve.csv");
        write_atomically(&path, |w| w.write_all(b"old")).unwrap();
        let error = write_atomically(&path, |w| {
            w.write_all(&[b'n'; 100_000])?;
            Err(io::Error::other("disk full"))
        });
        assert!(error.unwrap_err().to_string().contains("disk full"));
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(names(folder.path()), ["curve.csv"]);
    }

    #[test]
    fn a_target_that_is_a_folder_is_refused_without_leftovers() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("taken");
        fs::create_dir(&path).unwrap();
        assert!(write_atomically(&path, |w| w.write_all(b"x")).is_err());
        assert_eq!(names(folder.path()), ["taken"]);
    }

    #[test]
    fn a_missing_folder_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("no/such/file.csv");
        let error = write_atomically(&path, |w| w.write_all(b"x")).unwrap_err();
        assert!(matches!(&error, IoError::Missing { .. }), "{error:?}");
        assert_eq!(error.path(), path);
    }

    #[test]
    fn what_a_killed_run_left_is_removed_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join(".curve.csv.aB3.accurate-tmp"), "half").unwrap();
        fs::write(folder.path().join("curve.csv"), "whole").unwrap();
        fs::write(folder.path().join(".hidden"), "the user's").unwrap();
        assert_eq!(remove_unfinished(folder.path()).unwrap(), 1);
        assert_eq!(names(folder.path()), [".hidden", "curve.csv"]);
    }

    #[cfg(unix)]
    #[test]
    fn others_can_read_an_output_as_far_as_the_umask_allows() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (ours, plain) = (folder.path().join("ours"), folder.path().join("plain"));
        write_atomically(&ours, |w| w.write_all(b"x")).unwrap();
        fs::write(&plain, "x").unwrap();
        let mode = |p: &Path| fs::metadata(p).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&plain));
    }
}
