use std::path::Path;

use ndarray::Array2;
use nifti::NiftiHeader;
use nifti::writer::WriterOptions;

use crate::IoError;
use crate::atomic::write_atomically;

/// Writes a mask as a NIfTI-1 label map (`.nii` or `.nii.gz`): bytes 0 and 1, one slice, first axis
/// x to the right, second y down, `spacing_mm` `[x, y]` between pixel centres.
///
/// The slice has no place in a patient: the header states spacing and axes only, no anatomical
/// frame (`qform` and `sform` codes 0).
///
/// # Errors
/// [`IoError::Empty`] without pixels, [`IoError::Field`] for a spacing that is not positive and
/// finite, [`IoError::UnknownExtension`], [`IoError::System`].
pub fn write_mask_nifti(
    path: &Path,
    mask: &Array2<bool>,
    spacing_mm: [f64; 2],
) -> Result<(), IoError> {
    let name = path.file_name().map(|n| n.to_string_lossy().to_ascii_lowercase());
    let extension = match name.as_deref() {
        Some(name) if name.ends_with(".nii.gz") => "nii.gz",
        Some(name) if name.ends_with(".nii") => "nii",
        _ => {
            let path = path.to_owned();
            return Err(IoError::UnknownExtension { path, expected: ".nii, .nii.gz" });
        }
    };
    let (height, width) = mask.dim();
    if height == 0 || width == 0 {
        return Err(IoError::Empty { path: path.to_owned(), what: "pixels" });
    }
    if let Some(bad) = spacing_mm.into_iter().find(|s| !(s.is_finite() && *s > 0.0)) {
        let reason = "a pixel spacing must be positive and finite";
        return Err(IoError::field(path, "spacing_mm", bad.to_string(), reason));
    }
    let volume =
        ndarray::Array3::from_shape_fn((width, height, 1), |(x, y, _)| u8::from(mask[[y, x]]));
    let header = NiftiHeader {
        pixdim: [1.0, spacing_mm[0] as f32, spacing_mm[1] as f32, 1.0, 1.0, 1.0, 1.0, 1.0],
        // NIFTI_UNITS_MM
        xyzt_units: 2,
        ..NiftiHeader::default()
    };
    // The library writes to a path of its own; what is whole then goes the usual way.
    let system = |e: std::io::Error| IoError::system(path, "write", e);
    let folder = tempfile::tempdir().map_err(system)?;
    let scratch = folder.path().join(format!("label.{extension}"));
    WriterOptions::new(&scratch)
        .reference_header(&header)
        .write_nifti(&volume)
        .map_err(|e| system(std::io::Error::other(e.to_string())))?;
    let bytes = std::fs::read(&scratch).map_err(system)?;
    write_atomically(path, |w| w.write_all(&bytes))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nifti::{IntoNdArray, NiftiObject, ReaderOptions};

    #[test]
    fn a_label_map_reads_back_pixel_by_pixel_with_its_spacing() {
        let folder = tempfile::tempdir().unwrap();
        let mask = Array2::from_shape_fn((5, 7), |(y, x)| (3 * y + x) % 4 == 0);
        for name in ["a.nii", "a.nii.gz"] {
            let path = folder.path().join(name);
            write_mask_nifti(&path, &mask, [0.25, 0.5]).unwrap();
            let object = ReaderOptions::new().read_file(&path).unwrap();
            assert_eq!(object.header().pixdim[1..3], [0.25, 0.5]);
            let volume = object.into_volume().into_ndarray::<u8>().unwrap();
            assert_eq!(volume.shape(), [7, 5, 1]);
            for ((y, x), &on) in mask.indexed_iter() {
                assert_eq!(volume[[x, y, 0]], u8::from(on), "{name} ({x}, {y})");
            }
        }
    }

    #[test]
    fn what_no_label_map_can_hold_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let mask = Array2::from_elem((2, 2), true);
        let path = folder.path().join("a.nii");
        for spacing in [[0.0, 1.0], [1.0, f64::NAN]] {
            assert!(matches!(write_mask_nifti(&path, &mask, spacing), Err(IoError::Field { .. })));
        }
        let empty = Array2::default((0, 3));
        assert!(matches!(write_mask_nifti(&path, &empty, [1.0; 2]), Err(IoError::Empty { .. })));
        let png = folder.path().join("a.png");
        assert!(write_mask_nifti(&png, &mask, [1.0; 2]).is_err());
        assert!(!path.exists() && !png.exists());
    }
}
