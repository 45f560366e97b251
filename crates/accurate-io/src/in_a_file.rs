use std::path::Path;

/// What `read` makes of a file of this name that holds `bytes`, for tests.
pub(crate) fn in_a_file<T>(
    name: &str,
    bytes: impl AsRef<[u8]>,
    read: impl FnOnce(&Path) -> T,
) -> T {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    read(&path)
}
