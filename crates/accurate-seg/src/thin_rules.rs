//! Which pixels may go in which half-step, 64 at a time.
//!
//! A rule gets the neighbours of a word of pixels and returns the pixels that go if they are
//! foreground. The tests compare every rule with its definition on all 256 neighbourhoods.

use crate::bit_image::Around;

/// The first half-step of Zhang and Suen as scikit-image's `skeletonize` runs it.
pub(crate) fn zhang_suen_first(around: &Around) -> u64 {
    let &Around { n, ne, e, se, s, sw, w, nw } = around;
    // A smallest cover of what the definition keeps among the simple pixels.
    let kept = (!n & !ne & !s & !sw)
        | (!ne & !e & !sw & !w & !nw)
        | (!n & ne & !e)
        | (!ne & se & !sw)
        | (n & s & !(sw & nw))
        | (ne & !se & s & !nw)
        | (!n & !se & sw & !nw)
        | (e & w & !(ne & nw))
        | (e & s & nw)
        | (ne & se & sw & nw);
    simple(around) & !kept
}

/// The second half-step of Zhang and Suen as scikit-image's `skeletonize` runs it.
pub(crate) fn zhang_suen_second(around: &Around) -> u64 {
    let &Around { n, ne, e, se, s, sw, w, nw } = around;
    let kept = (!n & !e & !sw & !w)
        | (!se & !s & !w & !nw)
        | (ne & !se & !sw & !nw)
        | (n & s & !(ne & se))
        | (n & !se & sw & !nw)
        | (!n & !s & !sw & w)
        | (e & w & !(se & sw))
        | (n & se & w)
        | (!ne & !sw & nw)
        | (ne & e & sw & nw);
    simple(around) & !kept
}

/// The first half-step of Guo and Hall: west and south-west borders.
pub(crate) fn guo_hall_west(around: &Around) -> u64 {
    let &Around { s, sw, w, nw, .. } = around;
    guo_hall(around) & !(w & (s | sw | !nw))
}

/// The second half-step of Guo and Hall: east and north-east borders.
pub(crate) fn guo_hall_east(around: &Around) -> u64 {
    let &Around { n, ne, e, se, .. } = around;
    guo_hall(around) & !(e & (n | ne | !se))
}

/// Simple pixels with 2 or 3 neighbours, a 4-neighbour and a diagonal next to it counted as one;
/// of the two ways to pair them the one that counts less.
fn guo_hall(around: &Around) -> u64 {
    let &Around { n, ne, e, se, s, sw, w, nw } = around;
    let (_, two_ahead, four_ahead) = counts([n | ne, e | se, s | sw, w | nw]);
    let (_, two_back, four_back) = counts([nw | n, ne | e, se | s, sw | w]);
    simple(around) & two_ahead & two_back & !(four_ahead & four_back)
}

/// Where there is one 8-connected group of neighbours, a 4-neighbour joining its two sides. Taking
/// such a pixel away changes neither components nor holes.
fn simple(around: &Around) -> u64 {
    let &Around { n, ne, e, se, s, sw, w, nw } = around;
    // A background 4-neighbour followed clockwise by a foreground diagonal or 4-neighbour.
    let starts = [!n & (ne | e), !e & (se | s), !s & (sw | w), !w & (nw | n)];
    let (one_or_more, two_or_more, _) = counts(starts);
    one_or_more & !two_or_more
}

/// Where at least one, at least two, and all four are set.
fn counts([a, b, c, d]: [u64; 4]) -> (u64, u64, u64) {
    let (ab, cd) = (a | b, c | d);
    (ab | cd, (a & b) | (c & d) | (ab & cd), a & b & c & d)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::thin_tables::{GUO_HALL, Rule, ZHANG_SUEN};

    type WordRule = fn(&Around) -> u64;

    /// Neighbourhoods `64 * quarter` to `64 * quarter + 63`, one per pixel of a word.
    fn neighbourhoods(quarter: u64) -> Around {
        let word = |bit: u64| (0..64).map(|k| ((64 * quarter + k) >> bit & 1) << k).sum::<u64>();
        let [n, ne, e, se, s, sw, w, nw] = [0, 1, 2, 3, 4, 5, 6, 7].map(word);
        Around { n, ne, e, se, s, sw, w, nw }
    }

    #[test]
    fn every_rule_decides_as_its_table_on_all_neighbourhoods() {
        let rules: [(WordRule, &Rule); 4] = [
            (zhang_suen_first, &ZHANG_SUEN[0]),
            (zhang_suen_second, &ZHANG_SUEN[1]),
            (guo_hall_west, &GUO_HALL[0]),
            (guo_hall_east, &GUO_HALL[1]),
        ];
        for (number, (rule, table)) in rules.into_iter().enumerate() {
            for quarter in 0..4 {
                let found = rule(&neighbourhoods(quarter));
                for k in 0..64 {
                    let code = (64 * quarter + k) as usize;
                    assert_eq!(found >> k & 1 == 1, table[code], "rule {number}, code {code:#b}");
                }
            }
        }
    }
}
