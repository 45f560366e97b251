use rayon::prelude::*;

/// `work` done on each item, in order; by all threads, unless the caller is one of theirs.
///
/// Who works through many pairs has spread them over the threads already, and a thread that waits for a
/// part of its pair would begin another pair meanwhile, and hold both in memory.
pub fn side_by_side<T: Sync, R: Send>(items: &[T], work: impl Fn(&T) -> R + Sync + Send) -> Vec<R> {
    if items.len() < 2 || is_a_pools_own() {
        items.iter().map(work).collect()
    } else {
        items.par_iter().map(work).collect()
    }
}

/// The same for both views.
pub(crate) fn both_views<R: Send>(work: impl Fn(usize) -> R + Sync) -> [R; 2] {
    let (one, two) =
        if is_a_pools_own() { (work(0), work(1)) } else { rayon::join(|| work(0), || work(1)) };
    [one, two]
}

fn is_a_pools_own() -> bool {
    rayon::current_thread_index().is_some()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn results_are_in_order_and_a_pool_s_own_thread_does_all_by_itself() {
        let items: Vec<usize> = (0..100).collect();
        let work = |item: &usize| (item * item, rayon::current_thread_index());
        let squares: Vec<usize> = items.iter().map(|item| item * item).collect();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        let found = [side_by_side(&items, work), pool.install(|| side_by_side(&items, work))];
        for found in &found {
            assert_eq!(found.iter().map(|(square, _)| *square).collect::<Vec<_>>(), squares);
        }
        let threads =
            |k: usize| found[k].iter().map(|(_, thread)| *thread).collect::<BTreeSet<_>>();
        assert!(!threads(0).contains(&None));
        assert_eq!(threads(1).len(), 1);
    }
}
