use std::path::Path;

use accurate_geom::nalgebra::{Matrix3, Vector3};
use accurate_geom::{Camera, Distortion, ImageSize, Rig};
use serde::{Deserialize, Serialize};

use crate::IoError;
use crate::atomic::write_atomically;
use crate::bounded::{MAX_SMALL_BYTES, read_text};
use crate::json::write_json;
use crate::unit::length_unit;

/// The schema of `rig.toml` and `rig.json`; see [`read_rig`].
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RigFile {
    unit: String,
    view1: ViewFile,
    view2: ViewFile,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ViewFile {
    image_size: [u32; 2],
    #[serde(rename = "K")]
    k: [[f64; 3]; 3],
    #[serde(rename = "R")]
    r: [[f64; 3]; 3],
    t: [f64; 3],
    #[serde(default, skip_serializing_if = "Option::is_none")]
    distortion: Option<[f64; 5]>,
}

/// Reads two cameras from a TOML or JSON file: JSON begins with a brace, which TOML cannot. Both have
/// the fields
///
/// ```toml
/// unit = "mm"                     # mm, cm, m or unit
///
/// [view1]                         # and the same for [view2]
/// image_size = [512, 512]         # width, height, px
/// K = [[1200.0, 0.0, 256.0], [0.0, 1200.0, 256.0], [0.0, 0.0, 1.0]]   # px
/// R = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]             # world to camera
/// t = [0.0, 0.0, 1200.0]          # world to camera, in the unit
/// distortion = [0.0, 0.0, 0.0, 0.0, 0.0]   # k1 k2 p1 p2 k3 of OpenCV; may be left out
/// ```
///
/// Unknown fields are refused: a misspelt `distortion` must not be lost. It is given to the cameras;
/// [`undistort_points`](crate::undistort_points) removes it from points.
///
/// # Errors
/// [`IoError::Malformed`] with the line; [`IoError::Field`] for an unknown unit;
/// [`IoError::Geometry`] naming the view; [`IoError::Missing`], [`IoError::TooLarge`] above 1 MiB.
pub fn read_rig(path: &Path) -> Result<Rig, IoError> {
    parse_rig(path, &read_text(path, MAX_SMALL_BYTES)?)
}

/// [`read_rig`] of the text of `path`.
pub(crate) fn parse_rig(path: &Path, text: &str) -> Result<Rig, IoError> {
    let file: RigFile = if text.trim_start().starts_with('{') {
        serde_json::from_str(text)
            .map_err(|e| IoError::malformed(path, "JSON rig", Some(e.line()), e.to_string()))?
    } else {
        toml::from_str(text).map_err(|e| {
            let line = e.span().map(|span| line_at(text, span.start));
            IoError::malformed(path, "TOML rig", line, e.message())
        })?
    };
    let unit = length_unit(path, "unit", &file.unit)?;
    let geometry = |part| move |source| IoError::Geometry { path: path.to_owned(), part, source };
    let camera1 = file.view1.camera(path, "view 1")?;
    let camera2 = file.view2.camera(path, "view 2")?;
    Rig::new(camera1, camera2, unit).map_err(geometry("rig"))
}

/// Whether a text is a rig file rather than another file of cameras: it has a key `view1` or `view2`.
///
/// Nothing is parsed, so that a rig with a mistake in it is told from no rig at all.
pub(crate) fn looks_like_rig(text: &str) -> bool {
    let names = ["view1", "view2"];
    let head = text.trim_start();
    if head.starts_with('{') {
        // A key, not a value: a view may be called so.
        let is_key = |rest: &str| rest.trim_start().starts_with(':');
        return names.iter().any(|n| text.split(&format!("\"{n}\"")).skip(1).any(is_key));
    }
    if head.strip_prefix('[').is_some_and(|rest| rest.trim_start().starts_with('{')) {
        // An array of JSON objects.
        return false;
    }
    // `[view1]`, `[ "view1" ]`, `view1 = {`, `view1.K =`: a key of TOML stands first on its line.
    let mark = |c: char| c.is_whitespace() || matches!(c, '"' | '\'');
    let ends = |rest: &str| rest.trim_start_matches(mark).starts_with([']', '=', '.']);
    let is_head = |line: &str| {
        let key = line.trim_start_matches(|c| c == '[' || mark(c));
        names.iter().any(|name| key.strip_prefix(name).is_some_and(ends))
    };
    text.lines().any(is_head)
}

/// Writes two cameras as TOML or JSON (by extension, in any case); reading them gives the same bits.
///
/// # Errors
/// [`IoError::UnknownExtension`], [`IoError::System`].
pub fn write_rig(path: &Path, rig: &Rig) -> Result<(), IoError> {
    let file = RigFile {
        unit: rig.unit().label().to_owned(),
        view1: ViewFile::of(rig.camera1()),
        view2: ViewFile::of(rig.camera2()),
    };
    match Format::of(path)? {
        Format::Toml => {
            let text = toml::to_string(&file)
                .map_err(|e| IoError::malformed(path, "TOML rig", None, e.to_string()))?;
            write_atomically(path, |w| w.write_all(text.as_bytes()))
        }
        Format::Json => write_json(path, &file),
    }
}

impl ViewFile {
    fn of(camera: &Camera) -> Self {
        let rows = |m: &Matrix3<f64>| [0, 1, 2].map(|r| [0, 1, 2].map(|c| m[(r, c)]));
        Self {
            image_size: [camera.size().width, camera.size().height],
            k: rows(camera.k()),
            r: rows(camera.r()),
            t: (*camera.t()).into(),
            distortion: camera.distortion().map(|d| [d.k1, d.k2, d.p1, d.p2, d.k3]),
        }
    }

    fn camera(&self, path: &Path, part: &'static str) -> Result<Camera, IoError> {
        let matrix = |rows: &[[f64; 3]; 3]| Matrix3::from_fn(|r, c| rows[r][c]);
        let [width, height] = self.image_size;
        Camera::new(
            matrix(&self.k),
            matrix(&self.r),
            Vector3::from(self.t),
            ImageSize { width, height },
        )
        .and_then(|camera| match self.distortion {
            Some([k1, k2, p1, p2, k3]) => camera.with_distortion(Distortion { k1, k2, p1, p2, k3 }),
            None => Ok(camera),
        })
        .map_err(|source| IoError::Geometry { path: path.to_owned(), part, source })
    }
}

enum Format {
    Toml,
    Json,
}

impl Format {
    fn of(path: &Path) -> Result<Self, IoError> {
        let extension = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase());
        match extension.as_deref() {
            Some("toml") => Ok(Self::Toml),
            Some("json") => Ok(Self::Json),
            _ => Err(IoError::UnknownExtension { path: path.to_owned(), expected: ".toml, .json" }),
        }
    }
}

/// Line, from 1, of a byte offset.
pub(crate) fn line_at(text: &str, offset: usize) -> usize {
    1 + text.bytes().take(offset).filter(|b| *b == b'\n').count()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::in_a_file::in_a_file;
    use std::fs;

    const GOOD: &str = r#"unit = "mm"
[view1]
image_size = [512, 512]
K = [[1200, 0, 256], [0, 1200.0, 256], [0, 0, 1]]
R = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
t = [0, 0, 1200]
[view2]
image_size = [500, 400]
K = [[1493.75, 0, 250], [0, -1493.75, 250], [0, 0, 1]]
R = [[0, 0, -1], [0, 1, 0], [1, 0, 0]]
t = [0, 0, 720.5]
distortion = [0, 0, 0, 0, 0]
"#;

    fn read(text: &str, name: &str) -> Result<Rig, IoError> {
        in_a_file(name, text, read_rig)
    }

    #[test]
    fn a_rig_written_by_hand_is_read() {
        let rig = read(GOOD, "rig.toml").unwrap();
        assert_eq!(rig.camera2().k()[(1, 1)], -1493.75);
        assert_eq!(rig.camera2().size(), ImageSize { width: 500, height: 400 });
        assert_eq!(rig.unit().label(), "mm");
    }

    #[test]
    fn each_defect_is_named_with_its_place() {
        let cases = [
            ("unit = \"mm\"", "unit = \"inch\"", "unit = `inch`"),
            ("unit = \"mm\"", "", "missing field `unit`"),
            ("[view2]", "[view3]", "unknown field `view3`"),
            ("distortion", "distorsion", "line 12: not valid TOML rig: unknown field `distorsion`"),
            ("t = [0, 0, 1200]", "t = [0, 0]", "line 6: not valid TOML rig: invalid length 2"),
            ("t = [0, 0, 1200]", "t = [0, nan, 1200]", "view 1: t[1] is not finite: NaN"),
            ("0, 0, 1]]\nR = [[0", "0, 0, 2]]\nR = [[0", "view 2: K is not upper triangular"),
            ("R = [[0, 0, -1]", "R = [[0, 0, -2]", "view 2: R is not a rotation"),
            ("[500, 400]", "[500, 0]", "view 2: image size 500 x 0"),
            ("[500, 400]", "[500, -4]", "line 8: not valid TOML rig: invalid value: integer `-4`"),
            ("1493.75, 0, 250", "0, 0, 250", "view 2: K[0][0] is zero"),
        ];
        for (from, to, expected) in cases {
            assert!(GOOD.contains(from), "{from}");
            let error = read(&GOOD.replacen(from, to, 1), "rig.toml").unwrap_err().to_string();
            assert!(error.contains(expected), "{from} -> {to}: {error}");
        }
        let same_centre = GOOD.replace("t = [0, 0, 720.5]", "t = [-1200, 0, 0]");
        let error = read(&same_centre, "rig.toml").unwrap_err().to_string();
        assert!(error.contains("rig: zero baseline"), "{error}");
    }

    #[test]
    fn the_name_says_how_a_rig_is_written_but_not_how_it_is_read() {
        let rig = read(GOOD, "rig.toml").unwrap();
        let folder = tempfile::tempdir().unwrap();
        let written = |name: &str| {
            let path = folder.path().join(name);
            write_rig(&path, &rig).map(|()| fs::read_to_string(path).unwrap())
        };
        let (toml, json) = (written("A.TOML").unwrap(), written("a.json").unwrap());
        assert!(toml.starts_with("unit") && json.starts_with('{'));
        for name in ["rig.txt", "cams.cfg", "X.TOML", "rig", "rig.json", "rig.toml"] {
            assert_eq!(read(&toml, name).unwrap(), rig, "{name}");
            assert_eq!(read(&json, name).unwrap(), rig, "{name}");
        }
        assert!(matches!(written("rig.yaml"), Err(IoError::UnknownExtension { .. })));
    }

    #[test]
    fn deep_nesting_is_refused() {
        let toml = format!("unit = {}", "[".repeat(200_000));
        assert!(matches!(read(&toml, "rig.toml"), Err(IoError::Malformed { .. })));
        let json = format!("{{\"unit\": {}", "[".repeat(200_000));
        assert!(matches!(read(&json, "rig.json"), Err(IoError::Malformed { .. })));
    }
}
