/// `work` for both views: side by side, unless the caller is a thread of a pool, which has other work for the
/// other threads.
pub(crate) fn both_views<R: Send>(work: impl Fn(usize) -> R + Sync) -> [R; 2] {
    let (one, two) = if rayon::current_thread_index().is_some() {
        (work(0), work(1))
    } else {
        rayon::join(|| work(0), || work(1))
    };
    [one, two]
}
