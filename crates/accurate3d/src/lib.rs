//! 3D reconstruction of thin flexible bodies (guidewires, catheters, continuum robots) from two
//! calibrated views.
//!
//! [`reconstruct`] takes a [`ViewPair`] (a rig with ordered points, masks or images of both views)
//! and returns a [`Reconstruction`]: the 3D curve with the pixels it came from and diagnostics.
//! The stages meet only here; each is a crate of its own and is re-exported as a module:
//! [`geom`], [`seg`], [`traverse`], [`matching`], [`fit`], [`baselines`], [`eval`], [`synth`], [`io`].
//! [`doctor`] looks for mistakes in cameras, [`plan`] for the second view that sees a shape best,
//! [`table`] measures sets of cases.
//!
//! ```no_run
//! use accurate3d::{InputKind, Method, Params, ViewPair, io, reconstruct};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let rig = io::read_rig("rig.toml".as_ref())?;
//! let masks = [io::read_mask("a_mask.png".as_ref())?, io::read_mask("b_mask.png".as_ref())?];
//! let pair = ViewPair { masks: Some(masks), ..ViewPair::new("case_017", rig) };
//! let curve = reconstruct(&pair, &Params::new(InputKind::Mask, Method::Accurate))?;
//! for doubt in curve.diagnostics.reasons() {
//!     println!("{}: {doubt}", curve.id);
//! }
//! io::write_curve("wire.vtp".as_ref(), &curve.curve_table())?;
//! # Ok(())
//! # }
//! ```
//!
//! Masks and images are [`ndarray`] arrays (version 0.17) of shape (height, width), `[[y, x]]`. Pixel
//! centres lie at integers, x to the right, y down; positions are in the rig's unit.
//!
//! Features, none of them on by default: `rten` and `ort` run segmentation networks
//! ([`segment_images`]), `dicom` reads DICOM XA, `parquet` writes curves as Parquet. No network is built
//! in: that of the command line is the file `models/wire.accmodel` of the repository.
//!
//! Research software: not for clinical use.

pub use accurate_baselines as baselines;
pub use accurate_eval as eval;
pub use accurate_fit as fit;
pub use accurate_geom as geom;
pub use accurate_io as io;
pub use accurate_match as matching;
pub use accurate_seg as seg;
pub use accurate_synth as synth;
pub use accurate_traverse as traverse;

mod c_arm;
mod careful_look;
mod diagnostics;
mod direction;
mod disorder;
pub mod doctor;
mod error;
mod explanation;
mod figure;
mod joint_search;
mod method;
mod ordered_points;
mod pair;
mod picture;
pub mod plan;
mod reasons;
mod reconstruct;
mod reconstruction;
mod report;
mod require;
mod robust;
mod sampled_curve;
mod segment;
pub mod table;
mod trace_mask;
mod unrolled;

pub use careful_look::{CarefulLook, reconstruct_images};
pub use diagnostics::{
    CalibrationDiagnostics, Diagnostics, IntensityDiagnostics, OutlineDiagnostics,
    PointsDiagnostics,
};
pub use error::{Error, Stage};
pub use explanation::{Alternative, ConsideredCurve, Explanation, JunctionDecision};
pub use figure::{FigureKind, figure_svg};
pub use method::{InputKind, Method, UnknownName};
pub use pair::ViewPair;
pub use picture::picture_svg;
pub use reconstruct::{Closure, Params, reconstruct};
pub use reconstruction::{Reconstruction, Traces};
pub use report::{Provenance, report_html};
pub use robust::{DoubtLimits, Evidence, RobustParams, SecondLook, Suspicion};
pub use segment::segment_images;
pub use trace_mask::{MaskTrace, trace_mask};

/// The statement that stands in every report: this is research software.
pub const NOT_FOR_CLINICAL_USE: &str = "Research software: not for clinical use.";
