//! Laws of the vocabulary: properties over random rigs and curves, with brute force as the oracle.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod generators;
mod triangulation;
