use accurate_match::{MAX_ALIGNMENT_BYTES, MatchError};

/// Refuses `items` of `bytes_each` that together need more memory than any alignment may; `n1` and `n2`
/// are the points of the curves.
pub(crate) fn check_room(
    items: u64,
    bytes_each: u64,
    n1: usize,
    n2: usize,
) -> Result<(), MatchError> {
    let bytes = items.saturating_mul(bytes_each);
    if bytes <= MAX_ALIGNMENT_BYTES {
        return Ok(());
    }
    Err(MatchError::TooLarge { n1, n2, bytes, limit_bytes: MAX_ALIGNMENT_BYTES })
}

/// The product, or the largest number there is.
pub(crate) fn all_pairs(n1: usize, n2: usize) -> u64 {
    (n1 as u64).saturating_mul(n2 as u64)
}
