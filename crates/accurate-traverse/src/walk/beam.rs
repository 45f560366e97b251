//! Beam search for the cheapest walks.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use nalgebra::Vector2;

use super::WalkParams;
use super::prices::EdgePrices;
use super::turns::Turns;

/// A partial walk. Its edges are in the arena; how often it used each edge is in a slab beside it.
#[derive(Debug, Clone, Copy)]
struct State {
    /// Entry of the arena.
    entry: u32,
    /// Last and first half-edge.
    half: u32,
    first: u32,
    /// Remembered direction.
    ahead: Vector2<f64>,
    /// Bends, turns and start so far.
    paid: f64,
    /// Prices of all edges if the walk ended here, and the least that they can become.
    edges: f64,
    edges_least: f64,
}

/// A continuation of state `parent` of the beam.
#[derive(Debug, Clone, Copy)]
struct Step {
    parent: u32,
    state: State,
    /// What the beam is ordered by.
    key: f64,
}

/// A finished walk: total cost and last entry of the arena.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Finished {
    total: f64,
    entry: u32,
}

impl Eq for Finished {}

impl Ord for Finished {
    fn cmp(&self, other: &Self) -> Ordering {
        self.total.total_cmp(&other.total).then(self.entry.cmp(&other.entry))
    }
}

impl PartialOrd for Finished {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// How often each edge was used, two bits each.
#[derive(Debug, Default)]
struct Uses {
    words: usize,
    bits: Vec<u64>,
}

impl Uses {
    fn get(&self, state: usize, edge: usize) -> usize {
        (self.bits[state * self.words + edge / 32] >> (2 * (edge % 32)) & 3) as usize
    }

    /// Appends a copy of `state` of `other` with one use of `edge` more.
    fn push(&mut self, other: &Self, state: usize, edge: usize) {
        let start = self.bits.len();
        self.bits.extend_from_slice(&other.bits[state * self.words..(state + 1) * self.words]);
        self.bits[start + edge / 32] += 1 << (2 * (edge % 32));
    }
}

/// The half-edge sequences of the cheapest walks, cheapest first, with repetitions (backwards, or
/// closed walks from another start).
pub(super) fn search(turns: &Turns, prices: &[EdgePrices], params: &WalkParams) -> Vec<Vec<u32>> {
    // A walk and its reverse are both found; a closed one from several starts.
    let wanted = 3 * params.walks;
    let nothing: f64 = prices.iter().map(|p| p.total[0]).sum();
    let nothing_least: f64 = prices.iter().map(|p| p.least[0]).sum();
    let words = prices.len().div_ceil(32);
    let mut arena: Vec<(u32, u32)> = Vec::new();
    let mut finished: BinaryHeap<Finished> = BinaryHeap::new();
    let mut beam: Vec<State> = Vec::new();
    let mut uses = Uses { words, bits: Vec::new() };
    let unused = Uses { words, bits: vec![0; words] };
    for half in 0..turns.to.len() as u32 {
        let h = half as usize;
        if turns.link[h] {
            continue;
        }
        let price = &prices[h / 2];
        arena.push((u32::MAX, half));
        uses.push(&unused, 0, h / 2);
        beam.push(State {
            entry: arena.len() as u32 - 1,
            half,
            first: half,
            ahead: turns.exit[h],
            paid: turns.ending[turns.from[h] as usize],
            edges: nothing + price.total[1] - price.total[0],
            edges_least: nothing_least + price.least[1] - price.least[0],
        });
    }
    let mut steps: Vec<Step> = Vec::new();
    for _ in 1..=params.max_steps {
        for state in &beam {
            let Some(total) = total(turns, state) else { continue };
            if finished.len() < wanted {
                finished.push(Finished { total, entry: state.entry });
            } else if let Some(mut worst) = finished.peek_mut()
                && total < worst.total
            {
                *worst = Finished { total, entry: state.entry };
            }
        }
        let limit = match finished.peek() {
            Some(worst) if finished.len() == wanted => worst.total,
            _ => f64::INFINITY,
        };
        steps.clear();
        for (parent, state) in beam.iter().enumerate() {
            for &half in turns.leaving(turns.to[state.half as usize]) {
                let edge = half as usize / 2;
                let used = uses.get(parent, edge);
                let price = &prices[edge];
                if used >= price.max_uses || !turns.allows(state.half, half) {
                    continue;
                }
                let paid = state.paid + turns.price(state.half, &state.ahead, half);
                let edges_least = state.edges_least + price.least[used + 1] - price.least[used];
                let key = paid + edges_least;
                if key >= limit {
                    continue;
                }
                let edges = state.edges + price.total[used + 1] - price.total[used];
                let state = State { half, paid, edges, edges_least, ..*state };
                steps.push(Step { parent: parent as u32, state, key });
            }
        }
        if steps.is_empty() {
            break;
        }
        if steps.len() > params.beam {
            steps.select_nth_unstable_by(params.beam - 1, |a, b| {
                let order = a.key.total_cmp(&b.key);
                order.then(a.parent.cmp(&b.parent)).then(a.state.half.cmp(&b.state.half))
            });
            steps.truncate(params.beam);
        }
        let mut next_uses = Uses { words, bits: Vec::with_capacity(steps.len() * words) };
        let mut next = Vec::with_capacity(steps.len());
        for &Step { parent, mut state, .. } in &steps {
            let from = beam[parent as usize].half;
            next_uses.push(&uses, parent as usize, state.half as usize / 2);
            arena.push((state.entry, state.half));
            state.entry = arena.len() as u32 - 1;
            state.ahead = turns.carry(from, &state.ahead, state.half);
            next.push(state);
        }
        beam = next;
        uses = next_uses;
    }
    finished
        .into_sorted_vec()
        .into_iter()
        .map(|walk| {
            let mut halves = Vec::new();
            let mut entry = walk.entry;
            while entry != u32::MAX {
                let (parent, half) = arena[entry as usize];
                halves.push(half);
                entry = parent;
            }
            halves.reverse();
            halves
        })
        .collect()
}

/// What the walk costs if it ends here, if it may.
fn total(turns: &Turns, state: &State) -> Option<f64> {
    if turns.link[state.half as usize] {
        return None;
    }
    let (start, end) = (turns.from[state.first as usize], turns.to[state.half as usize]);
    let open = turns.ending[end as usize];
    let closing = if start == end && !turns.tip[end as usize] {
        turns.bend(&state.ahead, state.first) - turns.ending[start as usize]
    } else {
        f64::INFINITY
    };
    Some(state.paid + state.edges + open.min(closing))
}
