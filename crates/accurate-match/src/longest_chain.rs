/// The longest part of `items`, in their order, in which each may follow the one before it (patience
/// sorting).
///
/// `may_follow(a, b)`, whether `b` may come after `a`, must be transitive and compare them by one key
/// alone, strictly or not.
///
/// # Cost
/// O(n log n) for n items.
pub fn longest_chain<T: Copy>(items: &[T], may_follow: impl Fn(&T, &T) -> bool) -> Vec<T> {
    // The item with the least key that ends a chain of each length, and every item's predecessor.
    let mut ends: Vec<usize> = Vec::new();
    let mut before: Vec<Option<usize>> = Vec::with_capacity(items.len());
    for (k, item) in items.iter().enumerate() {
        let length = ends.partition_point(|&end| may_follow(&items[end], item));
        before.push(length.checked_sub(1).map(|shorter| ends[shorter]));
        if length == ends.len() {
            ends.push(k);
        } else {
            ends[length] = k;
        }
    }
    let mut chain = Vec::with_capacity(ends.len());
    let mut next = ends.last().copied();
    while let Some(k) = next {
        chain.push(items[k]);
        next = before[k];
    }
    chain.reverse();
    chain
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn no_chain_is_longer(values in prop::collection::vec(0usize..8, 0..9), strict: bool) {
            let may_follow = |a: &usize, b: &usize| if strict { a < b } else { a <= b };
            let chain = longest_chain(&values, may_follow);
            prop_assert!(chain.windows(2).all(|w| may_follow(&w[0], &w[1])));
            let chosen = |set: usize| -> Vec<usize> {
                (0..values.len()).filter(|k| set >> k & 1 == 1).map(|k| values[k]).collect()
            };
            let chains = (0..1usize << values.len())
                .map(chosen)
                .filter(|part| part.windows(2).all(|w| may_follow(&w[0], &w[1])));
            let (mut found, mut longest) = (false, 0);
            for part in chains {
                found |= part == chain;
                longest = longest.max(part.len());
            }
            prop_assert!(found);
            prop_assert_eq!(chain.len(), longest);
        }
    }
}
