//! The program as its users run it.
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stderr)]

mod commands;
mod dicom;
mod outputs;
mod privacy;
mod program;
mod refusals;
mod segmentation;
#[path = "../../../accurate3d/tests/support/shared_data.rs"]
mod shared_data;
mod synth;
mod two_views;
mod xa_phantom;
