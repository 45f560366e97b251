use std::cmp::Reverse;

/// The longest chain of candidate pairs `(i, j)` that strictly increases in both indices.
///
/// Ties: every member's predecessor, and the last member, is the first of the best in
/// lexicographic order of `(i, j)`: exactly what the plain loop over all earlier candidates keeps
/// when only a longer chain replaces an earlier one. The order and repetitions of `candidates` do
/// not matter.
///
/// # Cost
/// O(M log M) for M candidates, by a Fenwick tree of prefix maxima over `j`.
///
/// # Source
/// Hoffmann et al., MICCAI 2012: the correspondence function is a shortest path whose edges keep
/// both orders and cost the points they skip. The fewest skipped points are the longest chain.
pub fn longest_chain(candidates: &[(usize, usize)]) -> Vec<(usize, usize)> {
    let mut sorted = candidates.to_vec();
    sorted.sort_unstable();
    sorted.dedup();
    let mut columns: Vec<usize> = sorted.iter().map(|c| c.1).collect();
    columns.sort_unstable();
    columns.dedup();

    let rank = |k: usize| columns.partition_point(|&j| j < sorted[k].1);
    let rows: Vec<usize> = sorted.iter().map(|c| c.0).collect();
    let links = link(&rows, rank, columns.len());
    let mut best: Option<usize> = None;
    for (k, node) in links.iter().enumerate() {
        if best.is_none_or(|b| node.length > links[b].length) {
            best = Some(k);
        }
    }
    let mut chain = Vec::new();
    while let Some(k) = best {
        chain.push(sorted[k]);
        best = links[k].previous;
    }
    chain.reverse();
    chain
}

/// The longest chain of nodes `(i, t)` that strictly increases in `i` and in `t`, and among the
/// longest the one with the least sum of `link_cost(previous, next)`. Returns indices into `nodes`,
/// which must be sorted by `i`.
///
/// Ties of the sum: the earlier node in the order given.
///
/// # Cost
/// O(M log M) plus the pairs of neighbouring chain lengths: with a few candidates per sample, a few
/// M; at worst O(M²).
pub(crate) fn longest_cheapest_chain(
    nodes: &[(usize, f64)],
    link_cost: impl Fn((usize, f64), (usize, f64)) -> f64,
) -> Vec<usize> {
    let mut values: Vec<f64> = nodes.iter().map(|n| n.1).collect();
    values.sort_unstable_by(f64::total_cmp);
    values.dedup();
    let rows: Vec<usize> = nodes.iter().map(|n| n.0).collect();
    let rank = |k: usize| values.partition_point(|v| *v < nodes[k].1);
    let links = link(&rows, rank, values.len());

    // A node whose longest chain has length L can only be preceded by one of length L - 1: the
    // second key is decided level by level.
    let levels = links.iter().map(|l| l.length).max().unwrap_or(0);
    let mut by_length = vec![Vec::new(); levels];
    for (k, node) in links.iter().enumerate() {
        by_length[node.length - 1].push(k);
    }
    let mut best: Vec<(f64, Option<usize>)> = vec![(0.0, None); nodes.len()];
    for pair in 1..levels {
        for &k in &by_length[pair] {
            let mut least = (f64::INFINITY, links[k].previous);
            for &p in &by_length[pair - 1] {
                if nodes[p].0 < nodes[k].0 && nodes[p].1 < nodes[k].1 {
                    let cost = best[p].0 + link_cost(nodes[p], nodes[k]);
                    if cost < least.0 {
                        least = (cost, Some(p));
                    }
                }
            }
            best[k] = least;
        }
    }
    let mut end: Option<usize> = None;
    for &k in by_length.last().map_or(&[][..], |top| top) {
        if end.is_none_or(|e| best[k].0 < best[e].0) {
            end = Some(k);
        }
    }
    let mut chain = Vec::new();
    while let Some(k) = end {
        chain.push(k);
        end = best[k].1;
    }
    chain.reverse();
    chain
}

/// The longest chain that ends at a node, and the node before it.
struct Link {
    length: usize,
    previous: Option<usize>,
}

/// Links every node to the first best predecessor of smaller row and smaller rank. `rows` is sorted.
fn link(rows: &[usize], rank: impl Fn(usize) -> usize, ranks: usize) -> Vec<Link> {
    let mut tree = PrefixMax { best: vec![None; ranks + 1] };
    let mut links: Vec<Link> = Vec::with_capacity(rows.len());
    let mut start = 0;
    while start < rows.len() {
        let end = start + rows[start..].partition_point(|&row| row == rows[start]);
        // Ask for the whole row before any of it is entered: one node per row.
        for k in start..end {
            let before = tree.below(rank(k));
            let (length, previous) = before.map_or((1, None), |(n, Reverse(p))| (n + 1, Some(p)));
            links.push(Link { length, previous });
        }
        for (k, entered) in links.iter().enumerate().skip(start) {
            tree.enter(rank(k), (entered.length, Reverse(k)));
        }
        start = end;
    }
    links
}

/// Greatest (length, earliest node) over all ranks below a bound, as a Fenwick tree.
struct PrefixMax {
    best: Vec<Option<(usize, Reverse<usize>)>>,
}

impl PrefixMax {
    fn below(&self, rank: usize) -> Option<(usize, Reverse<usize>)> {
        let mut position = rank;
        let mut greatest = None;
        while position > 0 {
            greatest = greatest.max(self.best[position]);
            position &= position - 1;
        }
        greatest
    }

    fn enter(&mut self, rank: usize, value: (usize, Reverse<usize>)) {
        let mut position = rank + 1;
        while position < self.best.len() {
            self.best[position] = self.best[position].max(Some(value));
            position += position & position.wrapping_neg();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The plain loop over all earlier candidates.
    fn plain_loop(candidates: &[(usize, usize)]) -> Vec<(usize, usize)> {
        let mut sorted = candidates.to_vec();
        sorted.sort_unstable();
        sorted.dedup();
        let mut length = vec![1; sorted.len()];
        let mut previous = vec![None; sorted.len()];
        for k in 0..sorted.len() {
            for p in 0..k {
                let before = sorted[p].0 < sorted[k].0 && sorted[p].1 < sorted[k].1;
                if before && length[p] + 1 > length[k] {
                    length[k] = length[p] + 1;
                    previous[k] = Some(p);
                }
            }
        }
        let longest = length.iter().copied().max().unwrap_or(0);
        let mut at = length.iter().position(|&l| l == longest);
        let mut chain = Vec::new();
        while let Some(k) = at {
            chain.push(sorted[k]);
            at = previous[k];
        }
        chain.reverse();
        chain
    }

    fn increasing(chain: &[(usize, usize)]) -> bool {
        chain.windows(2).all(|w| w[0].0 < w[1].0 && w[0].1 < w[1].1)
    }

    /// Every subset is tried.
    fn longest_subset(candidates: &[(usize, usize)]) -> usize {
        let mut sorted = candidates.to_vec();
        sorted.sort_unstable();
        (0u32..1 << sorted.len())
            .filter(|mask| {
                let subset: Vec<_> =
                    (0..sorted.len()).filter(|k| mask >> k & 1 == 1).map(|k| sorted[k]).collect();
                increasing(&subset)
            })
            .map(u32::count_ones)
            .max()
            .unwrap_or(0) as usize
    }

    proptest! {
        #[test]
        fn the_chain_is_as_long_as_the_longest_of_all_subsets(
            candidates in prop::collection::vec((0usize..6, 0usize..6), 0..12),
        ) {
            let chain = longest_chain(&candidates);
            prop_assert_eq!(chain.len(), longest_subset(&candidates));
            prop_assert!(increasing(&chain));
        }

        #[test]
        fn the_chain_is_the_one_the_plain_loop_finds(
            candidates in prop::collection::vec((0usize..30, 0usize..30), 0..150),
        ) {
            prop_assert_eq!(longest_chain(&candidates), plain_loop(&candidates));
        }

        #[test]
        fn the_cheapest_longest_chain_equals_a_quadratic_search(
            mut nodes in prop::collection::vec((0usize..12, 0u8..12), 0..40),
        ) {
            nodes.sort_unstable();
            nodes.dedup();
            let nodes: Vec<(usize, f64)> =
                nodes.into_iter().map(|(i, t)| (i, f64::from(t))).collect();
            // Small integers: sums are exact, so equality is too.
            let cost = |a: (usize, f64), b: (usize, f64)| {
                let d = (b.1 - a.1) - (b.0 - a.0) as f64;
                d * d
            };
            let chain = longest_cheapest_chain(&nodes, cost);
            // Lexicographic (length, -cost) over all predecessors, not only those one level down.
            let mut best: Vec<(usize, f64)> = Vec::new();
            for k in 0..nodes.len() {
                let mut own = (1, 0.0);
                for p in 0..k {
                    if nodes[p].0 < nodes[k].0 && nodes[p].1 < nodes[k].1 {
                        let via = (best[p].0 + 1, best[p].1 + cost(nodes[p], nodes[k]));
                        if via.0 > own.0 || (via.0 == own.0 && via.1 < own.1) {
                            own = via;
                        }
                    }
                }
                best.push(own);
            }
            let length = best.iter().map(|b| b.0).max().unwrap_or(0);
            let least = best.iter().filter(|b| b.0 == length).map(|b| b.1).fold(f64::INFINITY, f64::min);
            prop_assert_eq!(chain.len(), length);
            if length > 0 {
                let sum: f64 = chain.windows(2).map(|w| cost(nodes[w[0]], nodes[w[1]])).sum();
                prop_assert_eq!(sum, least);
            }
        }
    }

    #[test]
    fn no_candidates_make_no_chain() {
        assert!(longest_chain(&[]).is_empty());
        assert!(longest_cheapest_chain(&[], |_, _| 0.0).is_empty());
    }
}
