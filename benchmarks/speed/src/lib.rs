//! What the speed measurements share: their inputs.

mod workloads;

pub use workloads::{Images, Wire, wire_mask};
