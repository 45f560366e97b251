//! The program as its users run it.
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stderr)]

mod commands;
mod dicom;
mod privacy;
mod program;
mod refusals;
mod segmentation;
mod synth;
mod two_views;
mod xa_phantom;
