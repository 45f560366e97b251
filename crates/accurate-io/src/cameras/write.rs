use std::fmt::Write as _;
use std::path::Path;

use accurate_geom::Rig;
use accurate_geom::nalgebra::DMatrix;

use super::{NamedView, colmap, projection_list};
use crate::IoError;
use crate::atomic::write_atomically;
use crate::json::write_json;
use crate::rig_file::write_rig;

/// What cameras can be written as.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum CameraFormat {
    /// OpenCV FileStorage YAML; one or two views. Where two views differ in size it holds
    /// `image_width1`, `image_height1` and so on, which our reader knows and OpenCV leaves alone.
    OpencvYaml,
    /// OpenCV FileStorage XML; one or two views, as [`Self::OpencvYaml`].
    OpencvXml,
    /// A folder of COLMAP text files. Rotations become quaternions and the principal point moves by
    /// half a pixel, so both come back off in their last digits.
    Colmap,
    /// Our rig file (TOML or JSON by the extension); two views.
    Rig,
    /// 3 x 4 matrices one below the other. Reading takes `K`, `R` and `t` out of their product, off in
    /// the last digits; sizes and units are comments.
    MatrixText,
    /// An array of views as `camera show --json` prints them.
    ViewsJson,
}

/// Writes cameras whole or not at all.
///
/// # Errors
/// [`IoError::Unsupported`] if the format cannot hold them: too many views, views in different units,
/// a lens that the format has no place for. [`IoError::System`].
pub fn write_cameras(
    path: &Path,
    views: &[NamedView],
    format: CameraFormat,
) -> Result<(), IoError> {
    let unsupported = |what: String| IoError::Unsupported { path: path.to_owned(), what };
    if views.is_empty() {
        return Err(IoError::Empty { path: path.to_owned(), what: "cameras" });
    }
    if views.iter().any(|view| view.unit != views[0].unit) {
        return Err(unsupported("the views have different units of length".into()));
    }
    match format {
        CameraFormat::OpencvYaml | CameraFormat::OpencvXml => {
            if views.len() > 2 {
                return Err(unsupported(format!("{} views; the format holds 1 or 2", views.len())));
            }
            let values = opencv_values(views);
            let text = if format == CameraFormat::OpencvXml { xml(&values) } else { yaml(&values) };
            write_atomically(path, |w| w.write_all(text.as_bytes()))
        }
        CameraFormat::Colmap => colmap::write(path, views),
        CameraFormat::MatrixText => {
            let text = projection_list::to_text(path, views)?;
            write_atomically(path, |w| w.write_all(text.as_bytes()))
        }
        CameraFormat::ViewsJson => {
            write_json(path, &views.iter().map(NamedView::described).collect::<Vec<_>>())
        }
        CameraFormat::Rig => {
            let [view1, view2] = views else {
                return Err(unsupported(format!("{} views; a rig has 2", views.len())));
            };
            let rig = Rig::new(view1.camera.clone(), view2.camera.clone(), view1.unit);
            let rig = rig.map_err(|source| IoError::Geometry {
                path: path.to_owned(),
                part: "rig",
                source,
            })?;
            write_rig(path, &rig)
        }
    }
}

enum Entry {
    Matrix(DMatrix<f64>),
    Whole(u32),
    Word(&'static str),
}

/// What goes into the file, in order. Two views: OpenCV's own stereo names (`x_cam2 = R x_cam1 + T`),
/// and `RT1`, `RT2`, which keep our world.
fn opencv_values(views: &[NamedView]) -> Vec<(String, Entry)> {
    let mut values = Vec::new();
    let sizes: Vec<_> = views.iter().map(|view| view.camera.size()).collect();
    // OpenCV knows one size for both views; numbered ones are ours, for views that differ.
    let agree = sizes.iter().all(|size| *size == sizes[0]);
    for (index, size) in sizes.iter().enumerate().take(if agree { 1 } else { sizes.len() }) {
        let number = if agree { String::new() } else { (index + 1).to_string() };
        values.push((format!("image_width{number}"), Entry::Whole(size.width)));
        values.push((format!("image_height{number}"), Entry::Whole(size.height)));
    }
    values.push(("unit".to_owned(), Entry::Word(views[0].unit.label())));
    let dense = |rows, cols, of: &dyn Fn(usize, usize) -> f64| {
        Entry::Matrix(DMatrix::from_fn(rows, cols, of))
    };
    for (index, view) in views.iter().enumerate() {
        let camera = &view.camera;
        let d = camera.distortion().copied().unwrap_or_default();
        let lens = [d.k1, d.k2, d.p1, d.p2, d.k3];
        let number = if views.len() == 1 { String::new() } else { (index + 1).to_string() };
        values.push((format!("K{number}"), dense(3, 3, &|r, c| camera.k()[(r, c)])));
        values.push((format!("D{number}"), dense(1, 5, &|_, c| lens[c])));
        if views.len() == 2 {
            let rt = |r: usize, c: usize| if c < 3 { camera.r()[(r, c)] } else { camera.t()[r] };
            values.push((format!("RT{number}"), dense(3, 4, &rt)));
        }
    }
    let (r, t) = match views {
        [view1, view2] => {
            let r = view2.camera.r() * view1.camera.r_inverse();
            (r, view2.camera.t() - r * view1.camera.t())
        }
        _ => (*views[0].camera.r(), *views[0].camera.t()),
    };
    values.push(("R".to_owned(), dense(3, 3, &|i, j| r[(i, j)])));
    values.push(("T".to_owned(), dense(3, 1, &|i, _| t[i])));
    values
}

/// Entries in row order, shortest text that reads back to the same bits.
fn entries(m: &DMatrix<f64>) -> Vec<String> {
    m.row_iter().flat_map(|row| row.iter().map(|v| format!("{v:?}")).collect::<Vec<_>>()).collect()
}

/// `%YAML 1.2` as OpenCV 5 writes it: OpenCV 3 and later and every YAML parser read it.
fn yaml(values: &[(String, Entry)]) -> String {
    let mut text = String::from("%YAML 1.2\n---\n");
    for (name, value) in values {
        let _ = match value {
            Entry::Whole(v) => writeln!(text, "{name}: {v}"),
            Entry::Word(v) => writeln!(text, "{name}: {v}"),
            Entry::Matrix(m) => writeln!(
                text,
                "{name}: !!opencv-matrix\n   rows: {}\n   cols: {}\n   dt: d\n   data: [ {} ]",
                m.nrows(),
                m.ncols(),
                entries(m).join(", ")
            ),
        };
    }
    text
}

fn xml(values: &[(String, Entry)]) -> String {
    let mut text = String::from("<?xml version=\"1.0\"?>\n<opencv_storage>\n");
    for (name, value) in values {
        let _ = match value {
            Entry::Whole(v) => writeln!(text, "<{name}>{v}</{name}>"),
            Entry::Word(v) => writeln!(text, "<{name}>{v}</{name}>"),
            Entry::Matrix(m) => writeln!(
                text,
                "<{name} type_id=\"opencv-matrix\">\n  <rows>{}</rows>\n  <cols>{}</cols>\n  \
                 <dt>d</dt>\n  <data>\n    {}</data></{name}>",
                m.nrows(),
                m.ncols(),
                entries(m).join(" ")
            ),
        };
    }
    text.push_str("</opencv_storage>\n");
    text
}
