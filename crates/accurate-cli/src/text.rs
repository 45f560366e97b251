use std::path::Path;

use accurate3d::io::write_atomically;

use crate::failure::Failure;

/// Reads a text file whole.
pub fn read_text(path: &Path) -> Result<String, Failure> {
    std::fs::read_to_string(path).map_err(|error| {
        let code = match error.kind() {
            std::io::ErrorKind::NotFound => Failure::NO_INPUT,
            _ => Failure::IO,
        };
        Failure::new(code, format!("{}: {error}", path.display()))
    })
}

/// Writes a text file whole or not at all.
pub fn write_text(path: &Path, text: &str) -> Result<(), Failure> {
    Ok(write_atomically(path, |file| file.write_all(text.as_bytes()))?)
}

/// Makes the folder that outputs go to.
pub fn make_folder(path: &Path) -> Result<(), Failure> {
    std::fs::create_dir_all(path).map_err(|error| {
        Failure::new(Failure::IO, format!("cannot make folder {}: {error}", path.display()))
    })
}
