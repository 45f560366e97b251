use std::fmt::Write as _;
use std::path::Path;

use accurate_geom::{LengthUnit, Point3};
use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use crate::IoError;
use crate::atomic::write_atomically;
use crate::bounded::{MAX_POINTS_BYTES, read_text};
use crate::curve::{Column, CurveTable, check_column_count};
use crate::matrix::parse_number;
use crate::unit::length_unit;

/// Field array with the unit of the points.
const UNIT: &str = "unit";
/// Prefix of the field arrays with the units of the point arrays.
const UNIT_OF: &str = "unit:";

pub(crate) fn write(path: &Path, curve: &CurveTable) -> Result<(), IoError> {
    let n = curve.points.len();
    let mut x = String::new();
    // Writing to a String cannot fail.
    let _ = write!(
        x,
        "<?xml version=\"1.0\"?>\n\
         <VTKFile type=\"PolyData\" version=\"0.1\" byte_order=\"LittleEndian\">\n<PolyData>\n\
         <FieldData>\n{}",
        text_array(UNIT, curve.unit.label())
    );
    for column in curve.columns.iter().filter(|c| !c.unit.is_empty()) {
        x.push_str(&text_array(&format!("{UNIT_OF}{}", column.name), &column.unit));
    }
    let _ = write!(
        x,
        "</FieldData>\n\
         <Piece NumberOfPoints=\"{n}\" NumberOfVerts=\"0\" NumberOfLines=\"1\" \
         NumberOfStrips=\"0\" NumberOfPolys=\"0\">\n<PointData>\n"
    );
    for column in &curve.columns {
        let _ =
            writeln!(x, "<DataArray type=\"Float64\" Name=\"{}\" format=\"ascii\">", column.name);
        for value in &column.values {
            // `{:?}` is the shortest text that reads back to the same bits.
            let _ = writeln!(x, "{value:?}");
        }
        x.push_str("</DataArray>\n");
    }
    x.push_str(
        "</PointData>\n<Points>\n\
         <DataArray type=\"Float64\" NumberOfComponents=\"3\" format=\"ascii\">\n",
    );
    for p in &curve.points {
        let _ = writeln!(x, "{:?} {:?} {:?}", p.x, p.y, p.z);
    }
    x.push_str(
        "</DataArray>\n</Points>\n<Lines>\n\
         <DataArray type=\"Int64\" Name=\"connectivity\" format=\"ascii\">\n",
    );
    for i in 0..n {
        let _ = writeln!(x, "{i}");
    }
    let _ = write!(
        x,
        "</DataArray>\n<DataArray type=\"Int64\" Name=\"offsets\" format=\"ascii\">\n{n}\n\
         </DataArray>\n</Lines>\n</Piece>\n</PolyData>\n</VTKFile>\n"
    );
    write_atomically(path, |w| w.write_all(x.as_bytes()))
}

/// VTK's ASCII form of a text: its UTF-8 bytes as numbers, ended by 0.
fn text_array(name: &str, text: &str) -> String {
    let mut codes = String::new();
    for byte in text.bytes() {
        let _ = write!(codes, "{byte} ");
    }
    format!(
        "<Array type=\"String\" Name=\"{name}\" NumberOfTuples=\"1\" format=\"ascii\">\n\
         {codes}0\n</Array>\n"
    )
}

pub(crate) fn read(path: &Path) -> Result<CurveTable, IoError> {
    let text = read_text(path, MAX_POINTS_BYTES)?;
    let mut document = Document::new(path, &text);
    document.parse()?;
    document.into_curve()
}

/// What has been read of a VTP file so far.
struct Document<'a> {
    path: &'a Path,
    text: &'a str,
    points: Option<Vec<f64>>,
    columns: Vec<Column>,
    connectivity: Option<Vec<f64>>,
    offsets: Option<Vec<f64>>,
    texts: Vec<(String, String)>,
    /// A byte offset and the line, from 1, it is in.
    counted: (usize, usize),
}

/// An array whose content comes next.
struct Pending {
    section: String,
    name: String,
    is_text: bool,
    content: String,
    line: usize,
}

impl<'a> Document<'a> {
    fn new(path: &'a Path, text: &'a str) -> Self {
        Self {
            path,
            text,
            points: None,
            columns: Vec::new(),
            connectivity: None,
            offsets: None,
            texts: Vec::new(),
            counted: (0, 1),
        }
    }

    fn malformed(&self, line: usize, reason: impl ToString) -> IoError {
        IoError::malformed(self.path, "VTP", Some(line), reason)
    }

    /// Line, from 1, of a byte offset. Offsets must not decrease: counting goes on from the last
    /// one, or a file of many small arrays would take quadratic time.
    fn line(&mut self, offset: u64) -> usize {
        let (from, line) = self.counted;
        let to = usize::try_from(offset).unwrap_or(usize::MAX).min(self.text.len()).max(from);
        let passed = self.text.as_bytes().get(from..to).unwrap_or_default();
        self.counted = (to, line + passed.iter().filter(|b| **b == b'\n').count());
        self.counted.1
    }

    fn parse(&mut self) -> Result<(), IoError> {
        let mut reader = Reader::from_str(self.text);
        let mut open: Vec<String> = Vec::new();
        let mut pending: Option<Pending> = None;
        let mut pieces = 0;
        loop {
            let event = reader.read_event();
            let line = self.line(reader.buffer_position());
            match event.map_err(|e| self.malformed(line, e))? {
                Event::Start(tag) => {
                    let name = tag.name().as_ref().to_owned();
                    if open.is_empty() {
                        self.check_root(&tag, &name, line)?;
                    }
                    if name == "Piece" {
                        pieces += 1;
                        if pieces > 1 {
                            return Err(self.unsupported("more than one piece"));
                        }
                    }
                    if is_array(&name) {
                        let section = open.last().cloned().unwrap_or_default();
                        pending = Some(self.array(&tag, section, line)?);
                    }
                    open.push(name);
                    if open.len() > 16 {
                        return Err(self.unsupported("elements nested deeper than 16"));
                    }
                }
                Event::End(_) => {
                    if let Some(name) = open.pop()
                        && is_array(&name)
                        && let Some(array) = pending.take()
                    {
                        self.store(array)?;
                    }
                }
                Event::Text(content) => {
                    // VTK nests information keys, which hold numbers too, within its arrays.
                    let direct = open.last().is_some_and(|name| is_array(name));
                    if let Some(array) = pending.as_mut().filter(|_| direct) {
                        array.content.push_str(&content.into_inner());
                    }
                }
                Event::DocType(_) | Event::GeneralRef(_) | Event::CData(_) => {
                    return Err(self.unsupported("document types, entities and CDATA"));
                }
                Event::Eof if open.is_empty() => return Ok(()),
                Event::Eof => {
                    return Err(self.malformed(line, "the file ends within an element"));
                }
                Event::Empty(_) | Event::Comment(_) | Event::Decl(_) | Event::PI(_) => {}
            }
        }
    }

    fn unsupported(&self, what: &str) -> IoError {
        IoError::Unsupported {
            path: self.path.to_owned(),
            what: format!("{what} are not read; expected ASCII PolyData with one polyline"),
        }
    }

    fn check_root(&self, tag: &BytesStart<'_>, name: &str, line: usize) -> Result<(), IoError> {
        let kind = self.attribute(tag, "type", line)?;
        if name != "VTKFile" || kind.as_deref() != Some("PolyData") {
            return Err(self.malformed(line, "expected <VTKFile type=\"PolyData\">"));
        }
        Ok(())
    }

    fn attribute(
        &self,
        tag: &BytesStart<'_>,
        name: &str,
        line: usize,
    ) -> Result<Option<String>, IoError> {
        let found = tag.try_get_attribute(name).map_err(|e| self.malformed(line, e))?;
        Ok(found.map(|a| a.value.into_owned()))
    }

    fn array(
        &self,
        tag: &BytesStart<'_>,
        section: String,
        line: usize,
    ) -> Result<Pending, IoError> {
        let attribute = |name| self.attribute(tag, name, line);
        if attribute("format")?.as_deref() != Some("ascii") {
            return Err(self.unsupported("arrays that are not ASCII"));
        }
        let components = attribute("NumberOfComponents")?.unwrap_or_else(|| "1".to_owned());
        let expected = if section == "Points" { "3" } else { "1" };
        if components != expected {
            return Err(self.malformed(line, format!("{components} components in {section}")));
        }
        Ok(Pending {
            section,
            name: attribute("Name")?.unwrap_or_default(),
            is_text: attribute("type")?.as_deref() == Some("String"),
            content: String::new(),
            line,
        })
    }

    fn store(&mut self, array: Pending) -> Result<(), IoError> {
        let mut values = Vec::new();
        for (i, text) in array.content.lines().enumerate() {
            for (column, field) in text.split_whitespace().enumerate() {
                values.push(parse_number(self.path, array.line + i, column + 1, field)?);
            }
        }
        match (array.section.as_str(), array.name.as_str()) {
            ("Points", _) => self.points = Some(values),
            ("Lines", "connectivity") => self.connectivity = Some(values),
            ("Lines", "offsets") => self.offsets = Some(values),
            ("PointData", _) if !array.is_text => {
                self.columns.push(Column { name: array.name, unit: String::new(), values });
            }
            ("FieldData", _) if array.is_text => {
                // VTK takes bytes for signed when it saves a text.
                let byte = |v: &f64| if *v < 0.0 { (*v + 256.0) as u8 } else { *v as u8 };
                let bytes = values.iter().take_while(|v| **v != 0.0).map(byte).collect();
                let text = String::from_utf8(bytes)
                    .map_err(|_| self.malformed(array.line, "a text that is not UTF-8"))?;
                self.texts.push((array.name, text));
            }
            _ => {}
        }
        Ok(())
    }

    fn into_curve(mut self) -> Result<CurveTable, IoError> {
        check_column_count(self.path, self.columns.len().max(self.texts.len()))?;
        let values = self.points.take().unwrap_or_default();
        let n = values.len() / 3;
        if !values.len().is_multiple_of(3) {
            return Err(self.malformed(1, format!("{} coordinates: not in threes", values.len())));
        }
        let in_order =
            |c: &[f64]| c.len() == n && c.iter().enumerate().all(|(i, v)| *v == i as f64);
        let one_line = self.connectivity.as_deref().is_none_or(in_order)
            && self.offsets.as_deref().is_none_or(|o| *o == [n as f64]);
        if !one_line {
            return Err(self.unsupported("lines other than one through all points in order"));
        }
        let points = values.chunks_exact(3).map(Point3::from_slice).collect();
        let mut unit = LengthUnit::Unit;
        for (name, text) in &self.texts {
            if name == UNIT {
                unit = length_unit(self.path, UNIT, text)?;
            } else if let Some(of) = name.strip_prefix(UNIT_OF)
                && let Some(column) = self.columns.iter_mut().find(|c| c.name == of)
            {
                column.unit.clone_from(text);
            }
        }
        Ok(CurveTable { unit, points, columns: self.columns })
    }
}

fn is_array(element: &str) -> bool {
    matches!(element, "DataArray" | "Array")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::in_a_file::in_a_file;

    /// As VTK saves a file of ours again: indented, with empty sections, information keys and signed
    /// bytes.
    const BY_VTK: &str = r#"<?xml version="1.0"?>
<VTKFile type="PolyData" version="0.1" byte_order="LittleEndian" header_type="UInt32" compressor="vtkZLibDataCompressor">
  <PolyData>
    <FieldData>
      <Array type="String" Name="unit" NumberOfTuples="1" format="ascii">
        99 109 0
      </Array>
      <Array type="String" Name="unit:sigma" NumberOfTuples="1" format="ascii">
        -62 -75 109 0
      </Array>
    </FieldData>
    <Piece NumberOfPoints="2" NumberOfVerts="0" NumberOfLines="1" NumberOfStrips="0" NumberOfPolys="0">
      <PointData>
        <DataArray type="Float64" Name="sigma" format="ascii" RangeMin="0.5" RangeMax="1">
          0.5 1
        </DataArray>
      </PointData>
      <CellData>
      </CellData>
      <Points>
        <DataArray type="Float64" Name="Points" NumberOfComponents="3" format="ascii" RangeMin="0" RangeMax="9">
          0 1 2 -3
          4 5e-1
          <InformationKey name="L2_NORM_RANGE" location="vtkDataArray" length="2">
            <InformationKeyValue index="0">
              2.23
            </InformationKeyValue>
          </InformationKey>
        </DataArray>
      </Points>
      <Verts>
        <DataArray type="Int64" Name="connectivity" format="ascii"/>
        <DataArray type="Int64" Name="offsets" format="ascii"/>
      </Verts>
      <Lines>
        <DataArray type="Int64" Name="connectivity" format="ascii">
          0 1
        </DataArray>
        <DataArray type="Int64" Name="offsets" format="ascii">
          2
        </DataArray>
      </Lines>
    </Piece>
  </PolyData>
</VTKFile>
"#;

    fn read_text(text: &str) -> Result<CurveTable, IoError> {
        in_a_file("curve.vtp", text, read)
    }

    #[test]
    fn a_file_saved_again_by_vtk_is_read() {
        let curve = read_text(BY_VTK).unwrap();
        assert_eq!(curve.points, [Point3::new(0.0, 1.0, 2.0), Point3::new(-3.0, 4.0, 0.5)]);
        assert_eq!(curve.unit, LengthUnit::Centimetre);
        let sigma = Column { name: "sigma".into(), unit: "\u{b5}m".into(), values: vec![0.5, 1.0] };
        assert_eq!(curve.columns, [sigma]);
    }

    #[test]
    fn what_is_not_one_ascii_polyline_is_refused() {
        for (from, to, expected) in [
            ("0 1\n        </", "1 0\n        </", "lines other than one"),
            ("          2\n", "          1 2\n", "lines other than one"),
            (
                "format=\"ascii\" RangeMin=\"0.5\"",
                "format=\"appended\"",
                "arrays that are not ASCII",
            ),
            ("\"PolyData\"", "\"ImageData\"", "line 2: not valid VTP: expected <VTKFile"),
            ("NumberOfComponents=\"3\"", "NumberOfComponents=\"2\"", "2 components in Points"),
            ("4 5e-1", "4 5e-1 6", "7 coordinates"),
            ("99 109 0", "105 110 99 104 0", "unit = `inch`: expected mm, cm, m or unit"),
            ("4 5e-1", "4 NaN", "line 23, column 2 is not finite"),
            ("</Points>", "</Point>", "not valid VTP"),
            ("<PolyData>", "<!DOCTYPE a [<!ENTITY b \"c\">]><PolyData>", "entities"),
        ] {
            assert!(BY_VTK.contains(from), "{from}");
            let error = read_text(&BY_VTK.replacen(from, to, 1)).unwrap_err().to_string();
            assert!(error.contains(expected), "{from}: {error}");
        }
    }
}
