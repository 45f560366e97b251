//! Beam search for the cheapest walks.

use std::cmp::Ordering;
use std::collections::BTreeMap;

use nalgebra::Vector2;

use super::WalkParams;
use super::prices::EdgePrices;
use super::turns::{Turns, reverse};

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

/// A walk that was found.
#[derive(Debug)]
pub(super) struct Found {
    pub halves: Vec<u32>,
    /// Whether it is cheaper closed than with two ends at the node where it starts and ends.
    pub closed: bool,
}

/// The cheapest walks, cheapest first; a walk and its reverse are one, and so are the starts of a closed
/// one.
pub(super) fn search(turns: &Turns, prices: &[EdgePrices], params: &WalkParams) -> Vec<Found> {
    let nothing: f64 = prices.iter().map(|p| p.total[0]).sum();
    let nothing_least: f64 = prices.iter().map(|p| p.least[0]).sum();
    let words = prices.len().div_ceil(32);
    let mut arena: Vec<(u32, u32)> = Vec::new();
    let mut cheapest = Cheapest::new(params.walks);
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
            if let Some((total, closed)) = total(turns, state) {
                let finished = Finished { total, entry: state.entry };
                cheapest.take_in(finished, closed, || halves_to(&arena, state.entry));
            }
        }
        let limit = cheapest.limit();
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
                // A walk that closes gets back what its start has cost; bends cost nothing at least.
                let start = turns.from[state.first as usize];
                if key - turns.ending[start as usize] >= limit {
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
    cheapest.found.into_values().collect()
}

/// The half-edges of a walk up to an entry of the arena.
fn halves_to(arena: &[(u32, u32)], mut entry: u32) -> Vec<u32> {
    let mut halves = Vec::new();
    while entry != u32::MAX {
        let (parent, half) = arena[entry as usize];
        halves.push(half);
        entry = parent;
    }
    halves.reverse();
    halves
}

/// What the walk costs if it ends here, if it may, and whether it is closed then.
fn total(turns: &Turns, state: &State) -> Option<(f64, bool)> {
    if turns.link[state.half as usize] {
        return None;
    }
    let (start, end) = (turns.from[state.first as usize], turns.to[state.half as usize]);
    let open = turns.ending[end as usize];
    let closing = turns
        .closing(state.first, state.half, &state.ahead)
        .map(|price| price - turns.ending[start as usize])
        .filter(|price| *price < open);
    Some((state.paid + state.edges + closing.unwrap_or(open), closing.is_some()))
}

/// The cheapest of the walks that were finished so far, each once.
struct Cheapest {
    most: usize,
    found: BTreeMap<Finished, Found>,
    /// By [`canonical`] half-edges.
    known: BTreeMap<Vec<u32>, Finished>,
}

impl Cheapest {
    fn new(most: usize) -> Self {
        Self { most, found: BTreeMap::new(), known: BTreeMap::new() }
    }

    /// What a walk has to be cheaper than.
    fn limit(&self) -> f64 {
        match self.found.last_key_value() {
            Some((dearest, _)) if self.found.len() == self.most => dearest.total,
            _ => f64::INFINITY,
        }
    }

    fn take_in(&mut self, finished: Finished, closed: bool, halves: impl FnOnce() -> Vec<u32>) {
        if finished.total >= self.limit() {
            return;
        }
        let halves = halves();
        let canonical = canonical(&halves, closed);
        if let Some(same) = self.known.get(&canonical) {
            if same.total <= finished.total {
                return;
            }
            self.found.remove(same);
        } else if self.found.len() == self.most
            && let Some((_, dearest)) = self.found.pop_last()
        {
            self.known.remove(&self::canonical(&dearest.halves, dearest.closed));
        }
        self.known.insert(canonical, finished);
        self.found.insert(finished, Found { halves, closed });
    }
}

/// The same for a walk and its reverse, and for every start of a closed walk.
fn canonical(halves: &[u32], closed: bool) -> Vec<u32> {
    let backward: Vec<u32> = halves.iter().rev().map(|&half| reverse(half)).collect();
    let starts = if closed { halves.len() } else { 1 };
    let rotations = (0..starts).flat_map(|start| {
        [halves, &backward[..]].map(|walk| [&walk[start..], &walk[..start]].concat())
    });
    rotations.min().unwrap_or_default()
}
