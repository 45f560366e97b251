//! The manifests of the repository say what they must.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::path::Path;

use accurate_io::read_manifests;

#[test]
fn every_manifest_of_the_repository_is_complete() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../datasets");
    let manifests = read_manifests(&folder).unwrap();
    let names: Vec<&str> = manifests.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(
        names,
        [
            "accurate-paper",
            "carm",
            "guide3d",
            "helix",
            "loops-easy",
            "loops-hard",
            "loops-medium",
            "sim-paper",
            "tangency",
            "xa-phantom"
        ]
    );
    for manifest in &manifests {
        // What others published is not ours to ship, and names the state it was measured on.
        if manifest.generator.is_none() {
            assert!(!manifest.shipped, "{}", manifest.name);
        }
    }
}
