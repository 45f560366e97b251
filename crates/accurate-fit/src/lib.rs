//! One 3D B-spline fitted to both views.
