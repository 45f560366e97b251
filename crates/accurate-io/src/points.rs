use std::path::Path;

use accurate_geom::{ImageSize, Pixel, View};

use crate::IoError;
use crate::atomic::write_atomically;
use crate::bounded::{MAX_POINTS_BYTES, read_bytes};
use crate::matrix::{finite, parse_number};

/// Reads ordered centreline points (`points_L.csv`) of view `V`: a header with the columns `x` and
/// `y` in px, then one point per line, in order. Other columns are ignored, but with a column `z` it is a
/// curve in space, and refused, as is the ridge that `accurate segment` writes, which is in no order.
/// Points may lie outside the image.
///
/// # Errors
/// [`IoError::NotANumber`] or [`IoError::NotFinite`] with line and column; [`IoError::Malformed`]
/// for a missing header or a ragged line; [`IoError::Empty`] without points;
/// [`IoError::Missing`], [`IoError::TooLarge`] above 256 MiB.
pub fn read_points<V: View>(path: &Path) -> Result<Vec<Pixel<V>>, IoError> {
    let table = CsvTable::read(path)?;
    let (x, y) = (table.column("x")?, table.column("y")?);
    let has = |column: &str| table.header.iter().any(|name| name == column);
    if has("z") {
        let reason = "a column `z`: this is a curve in space, not points of an image";
        return Err(IoError::malformed(path, "points", Some(1), reason));
    }
    if has("direction_x") && has("probability") {
        let reason = "the ridge that `accurate segment` found, row by row and not in order along a body: \
                      reconstruct from the mask, or order it with `accurate trace`";
        return Err(IoError::malformed(path, "points", Some(1), reason));
    }
    let mut points = Vec::new();
    table.for_each_row(|line, row| {
        let number = |c: usize| parse_number(path, line, c + 1, row.get(c).unwrap_or_default());
        points.push(Pixel::new(number(x)?, number(y)?));
        Ok(())
    })?;
    if points.is_empty() {
        return Err(IoError::Empty { path: path.to_owned(), what: "points" });
    }
    Ok(points)
}

/// By how much of its picture's longer side a recorded point may lie beyond the edge: bodies that leave the
/// picture are clicked on to (those of Guide3D up to 0.7 %).
const BEYOND_THE_EDGE: f64 = 0.05;

/// [`read_points`] as the camera recorded them, in a picture of this size.
///
/// # Errors
/// Those of [`read_points`]; [`IoError::PointOutside`] for the first one that lies outside of the picture
/// by more than 5 % of its longer side: it may have been seen in a picture of another size.
pub(crate) fn read_recorded_points<V: View>(
    path: &Path,
    size: ImageSize,
) -> Result<Vec<Pixel<V>>, IoError> {
    let points = read_points(path)?;
    let [width, height] = [size.width, size.height].map(f64::from);
    let beyond = BEYOND_THE_EDGE * width.max(height);
    let inside = |value: f64, side: f64| (-beyond..=side - 1.0 + beyond).contains(&value);
    match points.iter().position(|p| !(inside(p.x, width) && inside(p.y, height))) {
        None => Ok(points),
        Some(index) => {
            let point = [points[index].x, points[index].y];
            Err(IoError::PointOutside { path: path.to_owned(), index, point, size })
        }
    }
}

/// Writes ordered centreline points; reading them gives the same bits.
///
/// # Errors
/// [`IoError::Empty`], [`IoError::NotFinite`], [`IoError::System`].
pub fn write_points<V: View>(path: &Path, points: &[Pixel<V>]) -> Result<(), IoError> {
    check_points(path, points)?;
    write_atomically(path, |w| {
        writeln!(w, "x,y")?;
        points.iter().try_for_each(|p| writeln!(w, "{:?},{:?}", p.x, p.y))
    })
}

pub(crate) fn check_points<V: View>(path: &Path, points: &[Pixel<V>]) -> Result<(), IoError> {
    if points.is_empty() {
        return Err(IoError::Empty { path: path.to_owned(), what: "points" });
    }
    for (i, p) in points.iter().enumerate() {
        finite(path, p.x, || format!("x of point {i}"))?;
        finite(path, p.y, || format!("y of point {i}"))?;
    }
    Ok(())
}

/// A CSV file with a header, in memory.
pub(crate) struct CsvTable<'p> {
    path: &'p Path,
    bytes: Vec<u8>,
    pub(crate) header: Vec<String>,
}

impl<'p> CsvTable<'p> {
    pub(crate) fn read(path: &'p Path) -> Result<Self, IoError> {
        let bytes = read_bytes(path, MAX_POINTS_BYTES)?;
        let header = reader(&bytes)
            .headers()
            .map_err(|e| malformed(path, &e))?
            .iter()
            .map(str::to_owned)
            .collect();
        Ok(Self { path, bytes, header })
    }

    /// Index of the column `name`.
    pub(crate) fn column(&self, name: &str) -> Result<usize, IoError> {
        self.header.iter().position(|h| h == name).ok_or_else(|| {
            IoError::malformed(
                self.path,
                "CSV",
                Some(1),
                format!("no column `{name}` in the header `{}`", self.shown_header()),
            )
        })
    }

    /// The header as it was read, for a message: no more of it than fits a line.
    fn shown_header(&self) -> String {
        const MOST: usize = 60;
        let whole = self.header.join(",");
        match whole.char_indices().nth(MOST) {
            Some((end, _)) => format!("{}...", &whole[..end]),
            None => whole,
        }
    }

    /// Calls `visit` with the line (from 1) and the fields of every row below the header.
    pub(crate) fn for_each_row(
        &self,
        mut visit: impl FnMut(usize, &csv::StringRecord) -> Result<(), IoError>,
    ) -> Result<(), IoError> {
        let mut reader = reader(&self.bytes);
        let mut row = csv::StringRecord::new();
        while reader.read_record(&mut row).map_err(|e| malformed(self.path, &e))? {
            let line = row.position().map_or(0, |p| p.line() as usize);
            visit(line, &row)?;
        }
        Ok(())
    }
}

fn reader(bytes: &[u8]) -> csv::Reader<&[u8]> {
    csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(bytes)
}

fn malformed(path: &Path, error: &csv::Error) -> IoError {
    let line = error.position().map(|p| p.line() as usize);
    let reason = match error.kind() {
        csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
            format!("{len} fields where the header has {expected_len}")
        }
        csv::ErrorKind::Utf8 { .. } => "not UTF-8 text".to_owned(),
        _ => error.to_string(),
    };
    IoError::malformed(path, "CSV", line, reason)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::in_a_file::in_a_file;
    use accurate_geom::View1;
    use std::fs;

    #[test]
    fn recorded_points_lie_in_their_picture_but_for_a_twentieth_of_its_longer_side() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("points_L.csv");
        let size = ImageSize { width: 200, height: 100 };
        let read = |x: f64, y: f64| {
            fs::write(&path, format!("x,y\n50,50\n{x},{y}\n")).unwrap();
            read_recorded_points::<View1>(&path, size)
        };
        for (x, y) in [(-10.0, 50.0), (209.0, 50.0), (50.0, -10.0), (50.0, 109.0)] {
            assert_eq!(read(x, y).unwrap().len(), 2, "{x}, {y}");
        }
        for (x, y) in [(-10.1, 50.0), (209.1, 50.0), (50.0, -10.1), (50.0, 109.1)] {
            let error = read(x, y).unwrap_err();
            let IoError::PointOutside { index: 1, point, .. } = &error else { panic!("{error}") };
            assert_eq!(*point, [x, y]);
            assert!(error.to_string().contains("200 x 100"), "{error}");
        }
    }

    fn read(text: &[u8]) -> Result<Vec<Pixel<View1>>, IoError> {
        in_a_file("points_L.csv", text, read_points)
    }

    #[test]
    fn columns_are_found_by_name_and_negative_pixels_are_kept() {
        let points = read(b"y, x ,radius\r\n774.1,-7.03,0.4\r\n5,6,7\r\n").unwrap();
        assert_eq!(points, [Pixel::new(-7.03, 774.1), Pixel::new(6.0, 5.0)]);
    }

    #[test]
    fn what_is_no_ordered_curve_of_an_image_says_so() {
        let space = read(b"x,y,z\n1,2,3\n").unwrap_err().to_string();
        assert!(space.contains("curve in space"), "{space}");
        let ridge = read(b"x,y,direction_x,direction_y,width_px,probability\n1,2,1,0,3,0.9\n");
        let ridge = ridge.unwrap_err().to_string();
        assert!(ridge.contains("accurate trace"), "{ridge}");
        assert_eq!(read(b"x,y,probability\n1,2,0.9\n").unwrap().len(), 1);
    }

    #[test]
    fn each_defect_names_its_line() {
        let cases: [(&[u8], &str); 8] = [
            (b"", "no column `x` in the header ``"),
            (b"x,y\n", "no points"),
            (b"1,2\n3,4\n", "no column `x` in the header `1,2`"),
            (b"x;y\n3;4\n", "no column `x` in the header `x;y`"),
            (b"x,y\n1,2\n3\n", "line 3: not valid CSV: 1 fields where the header has 2"),
            (b"x,y\n1,2\n3,a\n", "line 3, column 2: `a` is not a number"),
            (b"x,y\n1,inf\n", "line 2, column 2 is not finite: inf"),
            (b"x,y\n1,\xff\n", "not UTF-8 text"),
        ];
        for (text, expected) in cases {
            let error = read(text).unwrap_err().to_string();
            assert!(error.ends_with(expected), "{text:?}: {error}");
        }
    }
}
