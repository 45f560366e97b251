//! The definitions of the thinning rules, as tables over the 256 neighbourhoods.

/// `rule[code]` tells whether a foreground pixel with this neighbourhood is deleted. Bit `k` of
/// the code is the neighbour number `k`, clockwise from north: see the constants below.
pub(crate) type Rule = [bool; 256];

pub(crate) const N: u8 = 1;
pub(crate) const NE: u8 = 1 << 1;
pub(crate) const E: u8 = 1 << 2;
pub(crate) const SE: u8 = 1 << 3;
pub(crate) const S: u8 = 1 << 4;
pub(crate) const SW: u8 = 1 << 5;
pub(crate) const W: u8 = 1 << 6;
pub(crate) const NW: u8 = 1 << 7;

/// Zhang and Suen, CACM 1984, conditions (a)-(d) and (a), (b), (c'), (d') as printed.
pub(crate) static ZHANG_SUEN_1984: [Rule; 2] = [zhang_suen(0), zhang_suen(1)];

/// Zhang-Suen as scikit-image's `skeletonize` runs it: the printed conditions but for the 30
/// neighbourhoods listed here, found from its output on small images (every other entry is fixed
/// by that output too, except `N|E` in the second half-step, which no image has been seen to
/// depend on).
///
/// What they mean: the first list takes corners of staircases, where the printed crossing number
/// counts two runs although a diagonal joins them; the second keeps ends two pixels wide and one
/// side of a 2 x 2 block, which the printed conditions erase as a whole.
pub(crate) static ZHANG_SUEN: [Rule; 2] = [
    amended(
        zhang_suen(0),
        &[
            N | E,
            E | S,
            S | W,
            N | W,
            N | NE | W,
            N | SW | W,
            N | NE | SW | W,
            N | E | NW,
            S | W | NW,
        ],
        &[E | SE, SE | S, S | SW, SW | W, W | NW, E | SE | S, S | SW | W],
    ),
    amended(
        zhang_suen(1),
        &[E | S, S | W, N | W, N | E | SE, SE | S | W, E | S | SW, NE | E | S | SW],
        &[N | NE, NE | E, SE | S, W | NW, N | NW, N | NE | E, N | W | NW],
    ),
];

/// Guo and Hall, CACM 1989, algorithm A1: one 8-run, 2 or 3 neighbours when paired both ways, and
/// a direction. The first half-step takes west and south-west borders, the second east and
/// north-east: the order of OpenCV's `THINNING_GUOHALL`.
pub(crate) static GUO_HALL: [Rule; 2] = [guo_hall(0), guo_hall(1)];

const fn zhang_suen(half: usize) -> Rule {
    let mut rule = [false; 256];
    let mut code = 0;
    while code < 256 {
        let c = code as u8;
        let neighbours = c.count_ones();
        // A background neighbour followed clockwise by a foreground one starts a run.
        let runs = (!c & c.rotate_right(1)).count_ones();
        let open_sides = if half == 0 {
            !has(c, N | E | S) && !has(c, E | S | W)
        } else {
            !has(c, N | E | W) && !has(c, N | S | W)
        };
        rule[code] = 2 <= neighbours && neighbours <= 6 && runs == 1 && open_sides;
        code += 1;
    }
    rule
}

const fn guo_hall(half: usize) -> Rule {
    let mut rule = [false; 256];
    let mut code = 0;
    while code < 256 {
        let c = code as u8;
        // Two neighbours count as one when a pairing puts them together; both pairings are tried.
        let ahead = pairs(c);
        let back = pairs(c.rotate_left(1));
        let neighbours = if ahead < back { ahead } else { back };
        let bound = if half == 0 {
            has(c, W) && (c & (S | SW) != 0 || c & NW == 0)
        } else {
            has(c, E) && (c & (N | NE) != 0 || c & SE == 0)
        };
        rule[code] = eight_runs(c) == 1 && 2 <= neighbours && neighbours <= 3 && !bound;
        code += 1;
    }
    rule
}

/// Number of 8-connected groups among the neighbours, where a 4-neighbour joins its two sides;
/// 1 for a simple pixel, whose removal changes neither components nor holes.
pub(crate) const fn eight_runs(c: u8) -> u32 {
    // A background 4-neighbour followed by a foreground diagonal or 4-neighbour starts a group.
    (!c & (c.rotate_right(1) | c.rotate_right(2)) & (N | E | S | W)).count_ones()
}

/// How many of the pairs (N, NE), (E, SE), (S, SW), (W, NW) have foreground.
const fn pairs(c: u8) -> u32 {
    ((c | (c >> 1)) & (N | E | S | W)).count_ones()
}

const fn has(code: u8, all: u8) -> bool {
    code & all == all
}

const fn amended(mut rule: Rule, also: &[u8], never: &[u8]) -> Rule {
    let mut k = 0;
    while k < also.len() {
        rule[also[k] as usize] = true;
        k += 1;
    }
    k = 0;
    while k < never.len() {
        rule[never[k] as usize] = false;
        k += 1;
    }
    rule
}

mod tests {
    use super::*;

    const ROUND: [(i32, i32); 8] =
        [(-1, 0), (-1, 1), (0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1)];

    fn code_at(foreground: &[(i32, i32)], (row, col): (i32, i32)) -> u8 {
        let bit = |&(k, &(r, c)): &(usize, &(i32, i32))| {
            foreground.contains(&(row + r, col + c)).then_some(1u8 << k)
        };
        ROUND.iter().enumerate().filter_map(|pair| bit(&pair)).sum()
    }

    fn subset(cells: &[(i32, i32)], bits: u32) -> Vec<(i32, i32)> {
        let chosen = |(k, &cell): (usize, &(i32, i32))| (bits >> k & 1 == 1).then_some(cell);
        cells.iter().enumerate().filter_map(chosen).collect()
    }

    /// Ronse, "Minimal test patterns for connectivity preservation in parallel thinning algorithms
    /// for binary digital images", Discrete Appl. Math. 1988: a parallel step keeps the components
    /// and the holes of *every* image when (1) it deletes only simple pixels, (2) of two
    /// 4-neighbours that go together the second is still simple when the first has gone, and
    /// (3) no component inside a 2 x 2 block goes as a whole.
    fn ronse(rule: &Rule) -> [bool; 3] {
        let goes = |shape: &[(i32, i32)], at| rule[usize::from(code_at(shape, at))];
        let only_simple = (0..=255u8).all(|c| !rule[usize::from(c)] || eight_runs(c) == 1);

        let pairs_stay_simple = [(0, 1), (1, 0)].into_iter().all(|second| {
            let first = (0, 0);
            let around: Vec<(i32, i32)> = (-1..=1 + second.0)
                .flat_map(|row| (-1..=1 + second.1).map(move |col| (row, col)))
                .filter(|&cell| cell != first && cell != second)
                .collect();
            assert_eq!(around.len(), 10);
            (0..1 << 10).map(|bits| subset(&around, bits)).all(|mut shape| {
                shape.push(second);
                let simple_alone = eight_runs(code_at(&shape, second)) == 1;
                shape.push(first);
                simple_alone || !(goes(&shape, first) && goes(&shape, second))
            })
        });

        let block = [(0, 0), (0, 1), (1, 0), (1, 1)];
        let blocks_survive = (1..16)
            .map(|bits| subset(&block, bits))
            .all(|shape| !shape.iter().all(|&cell| goes(&shape, cell)));
        [only_simple, pairs_stay_simple, blocks_survive]
    }

    #[test]
    fn each_half_step_keeps_the_topology_of_every_image() {
        for rule in ZHANG_SUEN.iter().chain(&GUO_HALL) {
            assert_eq!(ronse(rule), [true; 3]);
        }
    }

    #[test]
    fn the_rule_as_printed_in_1984_erases_a_2_by_2_block() {
        for rule in &ZHANG_SUEN_1984 {
            assert_eq!(ronse(rule), [true, true, false]);
        }
    }

    #[test]
    fn the_amended_rule_departs_from_the_printed_one_in_thirty_entries() {
        let changed = |half: usize| {
            (0..256).filter(|&c| ZHANG_SUEN[half][c] != ZHANG_SUEN_1984[half][c]).count()
        };
        assert_eq!([changed(0), changed(1)], [16, 14]);
    }
}
