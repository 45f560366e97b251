#[cfg(unix)]
use std::fs::File;
use std::fs::{self, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::Path;

use tempfile::Builder;

use crate::IoError;

/// What the name of an unfinished file ends with.
const SUFFIX: &str = ".accurate-tmp";

/// Writes `path` so that a reader sees the old file or the new one, never a part.
///
/// `write` fills a temporary file in the same folder, which is synced, renamed onto `path`, and the
/// folder synced. The folder must exist. What a link leads to is replaced, not the link; a device or a
/// pipe is written to as it is.
///
/// # Errors
/// [`IoError::System`] (or [`IoError::Missing`] for a missing folder). When `write` or anything
/// after it fails, the old file is as it was and no temporary file stays.
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), IoError> {
    let system = |e| IoError::system(path, "write", e);
    // A name that leads nowhere yet stays as it is.
    let place = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    if fs::metadata(&place).is_ok_and(|there| !there.is_file() && !there.is_dir()) {
        let mut stream =
            BufWriter::new(OpenOptions::new().write(true).open(&place).map_err(system)?);
        return write(&mut stream).and_then(|()| stream.flush()).map_err(system);
    }
    let path = place.as_path();
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

/// Refuses a folder in which no file can be made, before the work whose results are to go there.
///
/// # Errors
/// [`IoError::System`] or [`IoError::Missing`] naming the folder.
pub fn require_writable(folder: &Path) -> Result<(), IoError> {
    let probe = Builder::new().prefix(".").suffix(SUFFIX).tempfile_in(folder);
    probe.map(drop).map_err(|e| IoError::system(folder, "write to", e))
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

    #[cfg(unix)]
    #[test]
    fn a_link_stays_and_what_it_leads_to_is_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let (real, link) = (folder.path().join("real.csv"), folder.path().join("link.csv"));
        fs::write(&real, b"old").unwrap();
        std::os::unix::fs::symlink(&real, &link).unwrap();
        write_atomically(&link, |w| w.write_all(b"new")).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&real).unwrap(), b"new");
        assert_eq!(names(folder.path()), ["link.csv", "real.csv"]);
    }

    #[cfg(unix)]
    #[test]
    fn a_device_and_a_pipe_are_written_to_and_stay_what_they_are() {
        use std::os::unix::fs::FileTypeExt;

        let null = Path::new("/dev/null");
        // Not a name of the device itself: what goes wrong here must not go wrong there.
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("null");
        std::os::unix::fs::symlink(null, &link).unwrap();
        write_atomically(&link, |w| w.write_all(b"gone")).unwrap();
        assert!(fs::metadata(null).unwrap().file_type().is_char_device());

        let pipe = folder.path().join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let reader = std::thread::spawn({
            let pipe = pipe.clone();
            move || fs::read(pipe).unwrap()
        });
        write_atomically(&pipe, |w| w.write_all(b"through")).unwrap();
        assert_eq!(reader.join().unwrap(), b"through");
        assert!(fs::metadata(&pipe).unwrap().file_type().is_fifo());
    }

    #[test]
    fn a_folder_that_takes_no_file_is_refused_and_one_that_does_stays_empty() {
        let folder = tempfile::tempdir().unwrap();
        require_writable(folder.path()).unwrap();
        assert!(names(folder.path()).is_empty());
        assert!(require_writable(&folder.path().join("nowhere")).is_err());
        // Where nobody may write, whoever runs this.
        #[cfg(target_os = "linux")]
        assert!(require_writable(Path::new("/sys")).is_err());
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
