//! 3D Slicer's Markups (`.mrk.json`): a curve with measurements per control point.

use std::path::Path;

use accurate_geom::{LengthUnit, Point3};
use serde::{Deserialize, Serialize};

use crate::IoError;
use crate::atomic::write_atomically;
use crate::bounded::{MAX_POINTS_BYTES, read_text};
use crate::curve::{Column, CurveTable, check_column_count};
use crate::matrix::finite;
use crate::unit::length_unit;

/// The identifier Slicer looks for; no file is fetched from there.
const SCHEMA: &str = "https://raw.githubusercontent.com/slicer/slicer/master/Modules/Loadable/Markups/Resources/Schema/markups-schema-v1.0.3.json#";

#[derive(Serialize, Deserialize)]
struct Document {
    #[serde(rename = "@schema")]
    schema: String,
    markups: Vec<Markup>,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Markup {
    #[serde(rename = "type")]
    kind: String,
    #[serde(default)]
    name: String,
    coordinate_system: String,
    #[serde(default = "millimetres")]
    coordinate_units: String,
    /// The unit of the points before they became Slicer's millimetres; Slicer ignores it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    world_unit: Option<String>,
    control_points: Vec<ControlPoint>,
    #[serde(default)]
    measurements: Vec<Measurement>,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
struct ControlPoint {
    #[serde(default)]
    id: String,
    #[serde(default)]
    label: String,
    #[serde(default)]
    position: Position,
    #[serde(default)]
    position_status: PositionStatus,
}

#[derive(Serialize, Deserialize)]
#[serde(untagged)]
enum Position {
    At([f64; 3]),
    /// Slicer writes an empty text where a point is not placed.
    Nowhere(String),
}

impl Default for Position {
    fn default() -> Self {
        Self::Nowhere(String::new())
    }
}

/// Whether a point has a place. Only [`Self::Defined`] ones belong to the curve: the others are
/// waiting to be placed, follow the mouse, or were skipped because there is nothing to see.
#[derive(Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum PositionStatus {
    /// Also of files that say nothing, as Slicer takes them.
    #[default]
    Defined,
    Undefined,
    Preview,
    Missing,
}

#[derive(Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
struct Measurement {
    name: String,
    #[serde(default)]
    enabled: bool,
    #[serde(default)]
    units: String,
    #[serde(default)]
    description: String,
    #[serde(default)]
    print_format: String,
    #[serde(default)]
    control_point_values: Vec<f64>,
}

fn millimetres() -> String {
    "mm".to_owned()
}

/// How many of Slicer's millimetres one unit is. A world without physical size is shown as if its
/// unit were a millimetre: Slicer has no other.
const fn millimetres_per(unit: LengthUnit) -> f64 {
    match unit {
        LengthUnit::Centimetre => 10.0,
        LengthUnit::Metre => 1000.0,
        _ => 1.0,
    }
}

pub(crate) fn write(path: &Path, curve: &CurveTable) -> Result<(), IoError> {
    let scale = millimetres_per(curve.unit);
    let mut control_points = Vec::with_capacity(curve.points.len());
    for (i, p) in curve.points.iter().enumerate() {
        let position = [p.x * scale, p.y * scale, p.z * scale];
        for value in position {
            finite(path, value, || format!("point {i} in mm"))?;
        }
        control_points.push(ControlPoint {
            id: (i + 1).to_string(),
            label: (i + 1).to_string(),
            position: Position::At(position),
            position_status: PositionStatus::Defined,
        });
    }
    let measurements = curve
        .columns
        .iter()
        .map(|column| Measurement {
            name: column.name.clone(),
            enabled: true,
            units: column.unit.clone(),
            description: format!("{} per control point", column.name),
            print_format: "%.4g".to_owned(),
            control_point_values: column.values.clone(),
        })
        .collect();
    let name = match curve.unit {
        LengthUnit::Unit => "curve (world units shown as mm)",
        _ => "curve",
    };
    let document = Document {
        schema: SCHEMA.to_owned(),
        markups: vec![Markup {
            kind: "Curve".to_owned(),
            name: name.to_owned(),
            coordinate_system: "LPS".to_owned(),
            coordinate_units: millimetres(),
            world_unit: Some(curve.unit.label().to_owned()),
            control_points,
            measurements,
        }],
    };
    let mut text = serde_json::to_vec_pretty(&document)
        .map_err(|e| IoError::system(path, "encode", std::io::Error::other(e)))?;
    text.push(b'\n');
    write_atomically(path, |w| w.write_all(&text))
}

pub(crate) fn read(path: &Path) -> Result<CurveTable, IoError> {
    let text = read_text(path, MAX_POINTS_BYTES)?;
    let document: Document = serde_json::from_str(&text)
        .map_err(|e| IoError::malformed(path, "Slicer Markups", Some(e.line()), e))?;
    let count = document.markups.len();
    let Ok([markup]) = <[Markup; 1]>::try_from(document.markups) else {
        let reason = "expected one markup, a curve, line or point list";
        return Err(IoError::field(path, "markups", count.to_string(), reason));
    };
    // LPS and RAS differ in the signs of the first two axes.
    let sign = match markup.coordinate_system.as_str() {
        "LPS" | "0" => 1.0,
        "RAS" | "1" => -1.0,
        other => {
            return Err(IoError::field(path, "coordinateSystem", other, "expected LPS or RAS"));
        }
    };
    if markup.coordinate_units != "mm" {
        let reason = "Slicer's points are in mm";
        return Err(IoError::field(path, "coordinateUnits", &markup.coordinate_units, reason));
    }
    let unit = match &markup.world_unit {
        None => LengthUnit::Millimetre,
        Some(label) => length_unit(path, "worldUnit", label)?,
    };
    let scale = millimetres_per(unit);
    let placed: Vec<bool> = markup
        .control_points
        .iter()
        .map(|c| c.position_status == PositionStatus::Defined)
        .collect();
    let mut points = Vec::new();
    for (i, control) in markup.control_points.iter().enumerate().filter(|(i, _)| placed[*i]) {
        let Position::At([x, y, z]) = control.position else {
            let reason = "expected three numbers for a point whose positionStatus is defined";
            return Err(IoError::field(path, format!("controlPoints[{i}].position"), "", reason));
        };
        points.push(Point3::new(sign * x / scale, sign * y / scale, z / scale));
    }
    // Slicer's own summaries (length, curvature) have no value per point.
    let per_point: Vec<Measurement> =
        markup.measurements.into_iter().filter(|m| !m.control_point_values.is_empty()).collect();
    check_column_count(path, per_point.len())?;
    let columns = per_point
        .into_iter()
        .map(|mut m| {
            // One value per control point, placed or not.
            if m.control_point_values.len() == placed.len() {
                let mut placed = placed.iter();
                m.control_point_values.retain(|_| placed.next().is_some_and(|placed| *placed));
            }
            Column { name: m.name, unit: m.units, values: m.control_point_values }
        })
        .collect();
    Ok(CurveTable { unit, points, columns })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::in_a_file::in_a_file;

    fn read_text_of(text: &str) -> Result<CurveTable, IoError> {
        in_a_file("a.mrk.json", text, read)
    }

    #[test]
    fn a_ras_file_of_slicer_is_turned_to_lps() {
        let text = r#"{"@schema": "x", "markups": [{"type": "Fiducial", "coordinateSystem": "RAS",
            "controlPoints": [{"id": "1", "label": "F-1", "position": [1.0, 2.0, 3.0]}]}]}"#;
        let curve = read_text_of(text).unwrap();
        assert_eq!(curve.points, [Point3::new(-1.0, -2.0, 3.0)]);
        assert_eq!(curve.unit, LengthUnit::Millimetre);
    }

    #[test]
    fn points_that_slicer_has_not_placed_are_left_out_with_their_values() {
        let of = |points: &str| {
            format!(
                r#"{{"@schema": "x", "markups": [{{"type": "Curve", "coordinateSystem": "LPS",
                "controlPoints": [{points}], "measurements": [{{"name": "radius", "units": "mm",
                "controlPointValues": [1, 2, 3, 4, 5, 6]}}]}}]}}"#
            )
        };
        // As Slicer writes them, but for the preview with a place.
        let text =
            of(r#"{"id": "1", "label": "a", "position": [1, 2, 3], "positionStatus": "defined"},
            {"id": "2", "label": "b", "position": "", "positionStatus": "undefined"},
            {"id": "3", "label": "c", "position": [7, 8, 9], "positionStatus": "preview"},
            {"id": "4", "label": "d", "position": "", "positionStatus": "missing"},
            {"id": "5", "label": "e", "position": [0, 0, 0], "positionStatus": "undefined"},
            {"position": [4, 5, 6]}"#);
        let curve = read_text_of(&text).unwrap();
        assert_eq!(curve.points, [Point3::new(1.0, 2.0, 3.0), Point3::new(4.0, 5.0, 6.0)]);
        assert_eq!(curve.columns[0].values, [1.0, 6.0]);
        for (point, expected) in [
            (
                r#"{"position": [1, 2, 3], "positionStatus": "guessed"}"#,
                "unknown variant `guessed`",
            ),
            (r#"{"position": "", "positionStatus": "defined"}"#, "controlPoints[0].position"),
            (r#"{"position": [1, 2], "positionStatus": "defined"}"#, "Slicer Markups"),
        ] {
            let error = read_text_of(&of(point)).unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
    }

    #[test]
    fn what_is_not_one_curve_in_mm_is_refused_by_name() {
        let markup = |system: &str, units: &str| {
            format!(
                r#"{{"type": "Curve", "coordinateSystem": "{system}", "coordinateUnits": "{units}",
                "controlPoints": [{{"id": "1", "label": "1", "position": [0, 0, 0]}}]}}"#
            )
        };
        let of = |markups: &str| format!(r#"{{"@schema": "x", "markups": [{markups}]}}"#);
        let good = markup("LPS", "mm");
        for (text, word) in [
            (of(&markup("XYZ", "mm")), "coordinateSystem"),
            (of(&markup("LPS", "um")), "coordinateUnits"),
            (of(&format!("{good}, {good}")), "markups"),
            (of(""), "markups"),
            ("{".to_owned(), "Slicer Markups"),
        ] {
            let error = read_text_of(&text).unwrap_err().to_string();
            assert!(error.contains(word), "{word}: {error}");
        }
    }
}
