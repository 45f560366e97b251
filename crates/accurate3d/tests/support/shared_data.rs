//! Data that is not shipped.

use std::path::{Path, PathBuf};

/// The folder `set` under `ACCURATE_DATA`, or under `../shared/data` beside the checkout; says that a
/// test is skipped where there is none.
pub fn shared_data(set: &str) -> Option<PathBuf> {
    let root = std::env::var_os("ACCURATE_DATA").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data"),
        PathBuf::from,
    );
    let path = root.join(set);
    if path.is_dir() {
        return Some(path);
    }
    eprintln!("skipped: no {set} under ACCURATE_DATA");
    None
}
