use std::path::Path;

use serde::Serialize;

use crate::IoError;
use crate::atomic::write_atomically;
use crate::finite_check::first_non_finite;

/// Writes `value` as indented JSON, atomically.
///
/// # Errors
/// [`IoError::NotFinite`] naming the field, because JSON has no NaN and would silently get `null`;
/// [`IoError::Malformed`] if `value` cannot be JSON (e.g. a map whose keys are no text);
/// [`IoError::System`].
pub fn write_json(path: &Path, value: &(impl Serialize + ?Sized)) -> Result<(), IoError> {
    let malformed = |e: &dyn std::fmt::Display| IoError::malformed(path, "JSON", None, e);
    if let Some((at, value)) = first_non_finite(value).map_err(|e| malformed(&e))? {
        return Err(IoError::NotFinite { path: path.to_owned(), at, value });
    }
    let mut text = serde_json::to_vec_pretty(value).map_err(|e| malformed(&e))?;
    text.push(b'\n');
    write_atomically(path, |w| w.write_all(&text))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    #[derive(Serialize)]
    struct Scores {
        method: &'static str,
        lengths: Vec<f64>,
        best: Option<f32>,
        nested: BTreeMap<String, (u8, f64)>,
    }

    fn scores(bad: f64) -> Scores {
        let nested = BTreeMap::from([("helix".to_owned(), (1, bad))]);
        Scores { method: "paper", lengths: vec![1.0, 0.1], best: None, nested }
    }

    #[test]
    fn a_nan_anywhere_is_refused_with_its_place() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("result.json");
        let error = write_json(&path, &scores(f64::INFINITY)).unwrap_err();
        assert!(error.to_string().ends_with("nested.helix[1] is not finite: inf"), "{error}");
        assert!(!path.exists());
    }

    #[test]
    fn finite_values_come_back_and_none_is_null() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("result.json");
        write_json(&path, &scores(0.1 + 0.2)).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let value: serde_json::Value = serde_json::from_str(&text).unwrap();
        assert_eq!(value["nested"]["helix"][1].as_f64(), Some(0.1 + 0.2));
        assert!(value["best"].is_null());
        assert_eq!(value["method"], "paper");
        assert!(text.ends_with("}\n"));
    }
}
