use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use accurate3d::io::{require_writable, write_atomically};

use crate::code::Code;
use crate::failure::Failure;

/// Reads a text file whole.
pub fn read_text(path: &Path) -> Result<String, Failure> {
    std::fs::read_to_string(path).map_err(|error| {
        let code = match error.kind() {
            std::io::ErrorKind::NotFound => Failure::NO_INPUT,
            std::io::ErrorKind::InvalidData => Code::Malformed,
            _ => Failure::IO,
        };
        Failure::new(code, format!("{}: {error}", path.display()))
    })
}

/// Whether a name ends in `.extension`, in any case.
pub fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension))
}

/// Writes a text file whole or not at all.
pub fn write_text(path: &Path, text: &str) -> Result<(), Failure> {
    write_atomically(path, |file| file.write_all(text.as_bytes())).map_err(Failure::of_output)
}

/// Refuses an output file that cannot be, before anything is computed for it.
///
/// # Errors
/// [`Failure::IO`] if a folder has its name, or if a file stands where a folder above it has to be.
pub fn check_output(path: &Path) -> Result<(), Failure> {
    if path.is_dir() {
        let message = format!("cannot write {}: it is a folder", path.display());
        return Err(Failure::new(Failure::IO, message).with_hint("name a file"));
    }
    // A device or a pipe takes what is written to it, whatever its folder does.
    if path.exists() && !path.is_file() {
        return Ok(());
    }
    check_folder(path.parent().unwrap_or(path))
}

/// The same for a folder that outputs are to go to.
pub fn check_folder(path: &Path) -> Result<(), Failure> {
    let above = path.ancestors().map(|folder| match folder.as_os_str().is_empty() {
        true => Path::new("."),
        false => folder,
    });
    match above.into_iter().find(|folder| folder.exists()) {
        Some(file) if !file.is_dir() => {
            let message = format!("cannot make folder {}", path.display());
            let message = format!("{message}: {} is a file", file.display());
            Err(Failure::new(Failure::IO, message))
        }
        Some(folder) => {
            require_writable(folder).map_err(|error| Failure::of_output(error).of_file(path))
        }
        None => Ok(()),
    }
}

/// The places of files that are there, by which one is told under any name.
pub fn places<'p>(files: impl IntoIterator<Item = &'p PathBuf>) -> BTreeSet<PathBuf> {
    files.into_iter().filter_map(|path| path.canonicalize().ok()).collect()
}

/// Refuses an output that stands at one of the [`places`] that are `read`, or among the files of a pair
/// folder that is one of them or lies in one.
///
/// # Errors
/// [`Failure::USAGE`].
pub fn refuse_what_is_read(written: &Path, read: &BTreeSet<PathBuf>) -> Result<(), Failure> {
    let is_read = |place: &PathBuf| {
        let in_a_folder = place.ancestors().skip(1).any(|folder| read.contains(folder));
        read.contains(place) || (in_a_folder && is_of_a_pair(place))
    };
    if written.canonicalize().is_ok_and(|place| is_read(&place)) {
        let message = format!("{} is read, and would be replaced", written.display());
        return Err(
            Failure::new(Failure::USAGE, message).with_hint("give another place for the results")
        );
    }
    Ok(())
}

/// Whether a file has the name of one of a pair folder (`docs/conventions.md`).
fn is_of_a_pair(place: &Path) -> bool {
    const FOLDERS: [&str; 5] = ["annotations", "calibration", "images", "masks", "points"];
    let folder = place.parent().and_then(Path::file_name);
    place.file_name().is_some_and(|name| name == "meta.json")
        || folder.is_some_and(|name| FOLDERS.iter().any(|known| name == *known))
}

/// Checks a place for an output file and makes its folder: what fails, fails before the work.
pub fn make_place(path: &Path) -> Result<(), Failure> {
    check_output(path)?;
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => make_folder(folder),
        _ => Ok(()),
    }
}

/// [`make_place`] for a file apart from all that is `read`.
///
/// # Errors
/// Also [`refuse_what_is_read`]'s.
pub fn make_place_apart<'p>(
    path: &Path,
    read: impl IntoIterator<Item = &'p PathBuf>,
) -> Result<(), Failure> {
    refuse_what_is_read(path, &places(read))?;
    make_place(path)
}

/// Removes a file where there is one.
pub fn remove_file(path: &Path) -> Result<(), Failure> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => {
            Err(Failure::new(Failure::IO, format!("cannot remove {}: {error}", path.display())))
        }
        _ => Ok(()),
    }
}

/// Makes the folder that outputs go to.
pub fn make_folder(path: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(path).map_err(|error| {
        Failure::new(Failure::IO, format!("cannot make folder {}: {error}", path.display()))
    })
}
