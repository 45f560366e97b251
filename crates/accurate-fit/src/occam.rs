use crate::selected_inverse::SelectedInverse;

/// What Laplace's approximation adds to -2 ln of the probability at the best curve: how little of what
/// the prior holds likely the data leave. `inverse` is that of the normal matrix in units of a
/// residual's `variance`, for so many `unknowns` of which the data or a prior speak in these units (others
/// add the same to every fit), `factors` the smoothness of every knot span in units of `lambda3`.
///
/// What the prior leaves open (9 unknowns) is the same in fits with knots as far apart.
pub(crate) fn occam(
    inverse: &SelectedInverse,
    unknowns: usize,
    variance: f64,
    lambda3: f64,
    factors: &[f64],
) -> f64 {
    let prior: f64 = factors.iter().map(|factor| 3.0 * (lambda3 * factor / variance).ln()).sum();
    inverse.log_determinant() - unknowns as f64 * variance.ln() - prior
}
