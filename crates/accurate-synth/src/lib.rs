//! Seeded wires with exact truth: curves, rigs, ordered points, masks and X-ray-like pictures.
//!
//! [`generate`] is a pure function of a [`Family`], a seed, an index and [`CaseOptions`]: case 17 of
//! a set is the same whether or not the other cases were made, and on any number of threads. Every
//! draw comes from a named stream ([`case_rng`]), so that an option (a gap, a calibration error)
//! never changes the curve or the cameras. The streams are the same on every machine; the curves
//! made from them agree up to the last bits of the platform's `sin`, `cos`, `ln` and `pow`.
//!
//! The truth *is* the polyline [`SynthCase::truth`]: points, masks and pictures are all made from
//! its exact projection by [`SynthCase::true_rig`].
//!
//! ```
//! use accurate_synth::{CaseOptions, Family, generate};
//! let case = generate(Family::Carm, 1, 0, &CaseOptions::default())?;
//! assert_eq!(case.truth.len(), 2000);
//! assert_eq!(case.masks[0].dim(), (500, 500));
//! # Ok::<(), accurate_synth::SynthError>(())
//! ```

mod background;
mod case;
mod damage;
mod domain;
mod error;
mod family;
mod mask;
mod options;
mod points;
mod polyline;
mod probability;
mod projection;
mod rigs;
mod rng;
mod spline;
mod tangency;
mod wires;
mod xray;

pub use case::{SynthCase, TRUTH_POINTS, generate};
pub use damage::Disc;
pub use domain::{
    TUBE_RADIUS_PX, VisiblePiece, XRAY_VERSION, XrayDomain, XraySample, draw_xray,
    draw_xray_held_out, draw_xray_onto, draw_xray_phantom,
};
pub use error::SynthError;
pub use family::{Family, UnknownFamily};
pub use options::{CalibrationError, CaseOptions};
pub use probability::{ProbabilityDamage, damaged_probabilities};
pub use rng::case_rng;
pub use tangency::TangentStretch;
pub use xray::{XrayOptions, XrayResponse, render_xray};
