//! A mask image as a NIfTI label map: `mask_to_nifti MASK.png LABEL.nii.gz [SPACING_MM]`.
#![allow(clippy::print_stdout)]

use std::error::Error;
use std::path::PathBuf;

use accurate_io::{read_mask, write_mask_nifti};

fn main() -> Result<(), Box<dyn Error>> {
    let mut words = std::env::args().skip(1);
    let (Some(mask), Some(label)) = (words.next(), words.next()) else {
        return Err("usage: mask_to_nifti MASK.png LABEL.nii.gz [SPACING_MM]".into());
    };
    let spacing = words.next().map_or(Ok(1.0), |text| text.parse())?;
    let mask = read_mask(&PathBuf::from(mask))?;
    write_mask_nifti(&PathBuf::from(&label), &mask, [spacing; 2])?;
    println!("{label}: {} x {} px", mask.ncols(), mask.nrows());
    Ok(())
}
