//! Cache: the tags of a cache, and when each line's data are there.
//!
//! Tags are updated when a fetch is issued, not when its data arrive: the texels wait for their data
//! in order behind the tags (Igehy, Eldridge and Proudfoot 1998), so a line is read before a later
//! one replaces it.

use super::choice::Replacement;
use super::memory::Arrival;

/// A line that a cache holds, or will hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Entry {
    line: u64,
    arrival: Arrival,
}

/// No line: addresses end long before it.
const EMPTY: Entry = Entry {
    line: u64::MAX,
    arrival: Arrival::THERE,
};

/// A set-associative tag store.
#[derive(Clone, Debug)]
pub(super) struct Tags {
    sets: u64,
    ways: usize,
    replacement: Replacement,
    /// `ways` entries for each set. Least recently used and first in: the youngest first. Random and
    /// tree: in their ways.
    entries: Vec<Entry>,
    /// Of a tree, bit n of a set: the older half below node n, node 1 being the root.
    trees: Vec<u64>,
    /// The shift register of random replacement.
    register: u16,
}

impl Tags {
    /// An empty store.
    pub(super) fn new(sets: u32, ways: u32, replacement: Replacement) -> Tags {
        Tags {
            sets: u64::from(sets.max(1)),
            ways: ways as usize,
            replacement,
            entries: vec![EMPTY; sets as usize * ways as usize],
            trees: match replacement {
                Replacement::TreePlru => vec![0; sets as usize * (ways as usize).div_ceil(64)],
                Replacement::Lru | Replacement::Fifo | Replacement::Random => Vec::new(),
            },
            register: 0xace1,
        }
    }

    fn set(&mut self, line: u64) -> (usize, &mut [Entry]) {
        let set = (line % self.sets) as usize;
        let start = set * self.ways;
        (set, &mut self.entries[start..start + self.ways])
    }

    /// When the line's data are there, if the store has it; it becomes its set's most recently used.
    pub(super) fn touch(&mut self, line: u64) -> Option<Arrival> {
        let replacement = self.replacement;
        let (set, entries) = self.set(line);
        let way = entries.iter().position(|entry| entry.line == line)?;
        let arrival = entries[way].arrival;
        match replacement {
            Replacement::Lru => entries[..=way].rotate_right(1),
            Replacement::Fifo | Replacement::Random => {}
            Replacement::TreePlru => self.point_away(set, way),
        }
        Some(arrival)
    }

    /// Puts a line that is not held in the place of another of its set.
    pub(super) fn install(&mut self, line: u64, arrival: Arrival) {
        let entry = Entry { line, arrival };
        match self.replacement {
            Replacement::Lru | Replacement::Fifo => {
                let (_, entries) = self.set(line);
                entries.rotate_right(1);
                entries[0] = entry;
            }
            Replacement::Random => {
                let (_, entries) = self.set(line);
                let empty = entries.iter().position(|held| *held == EMPTY);
                let way = empty.unwrap_or_else(|| self.random_way());
                self.set(line).1[way] = entry;
            }
            Replacement::TreePlru => {
                let (set, _) = self.set(line);
                let way = self.pointed_to(set);
                self.set(line).1[way] = entry;
                self.point_away(set, way);
            }
        }
    }

    /// The next way of a maximal-length shift register, taps 16, 14, 13 and 11.
    fn random_way(&mut self) -> usize {
        let r = self.register;
        let bit = (r ^ (r >> 2) ^ (r >> 3) ^ (r >> 5)) & 1;
        self.register = (r >> 1) | (bit << 15);
        usize::from(self.register) % self.ways
    }

    fn node(&mut self, set: usize, node: usize) -> (&mut u64, u64) {
        let words = self.ways.div_ceil(64);
        (&mut self.trees[set * words + node / 64], 1 << (node % 64))
    }

    /// The way at which a set's tree ends.
    fn pointed_to(&mut self, set: usize) -> usize {
        let mut node = 1;
        while node < self.ways {
            let (word, bit) = self.node(set, node);
            node = 2 * node + usize::from(*word & bit != 0);
        }
        node - self.ways
    }

    /// Turns every node on the way to `way` to its other side.
    fn point_away(&mut self, set: usize, way: usize) {
        let mut node = way + self.ways;
        while node > 1 {
            let came_from_right = node & 1 == 1;
            node /= 2;
            let (word, bit) = self.node(set, node);
            if came_from_right {
                *word &= !bit;
            } else {
                *word |= bit;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Looks up and installs; the hits.
    fn run(tags: &mut Tags, lines: &[u64]) -> Vec<bool> {
        let look = |&line: &u64| {
            let hit = tags.touch(line).is_some();
            if !hit {
                tags.install(line, Arrival::THERE);
            }
            hit
        };
        lines.iter().map(look).collect()
    }

    #[test]
    fn the_least_recently_used_line_of_a_set_is_replaced() {
        // Two sets of two ways. Even lines share set 0.
        let mut tags = Tags::new(2, 2, Replacement::Lru);
        //       0 in,  2 in,  0 hit, 4 replaces 2, 0 hit, 2 replaces 4, 4 replaces 0
        let sequence = [0, 2, 0, 4, 0, 2, 4];
        let hits = [false, false, true, false, true, false, false];
        assert_eq!(run(&mut tags, &sequence), hits);
        // Set 1 was never disturbed: cold, then held.
        assert_eq!(run(&mut tags, &[1, 3, 1, 3]), [false, false, true, true]);
    }

    #[test]
    fn the_first_line_of_a_set_is_replaced_whatever_was_used_since() {
        let mut tags = Tags::new(1, 2, Replacement::Fifo);
        //       0 in,  1 in,  0 hit, 2 replaces 0, 0 replaces 1, 2 hit
        let hits = [false, false, true, false, false, true];
        assert_eq!(run(&mut tags, &[0, 1, 0, 2, 0, 2]), hits);
    }

    #[test]
    fn a_tree_replaces_a_line_that_was_not_the_last_used_of_its_half() {
        let mut tags = Tags::new(1, 4, Replacement::TreePlru);
        assert_eq!(run(&mut tags, &[0, 1, 2, 3]), [false; 4]);
        // Ways are filled 0, 2, 1, 3. After a hit of 0 the tree points to the right half, and there
        // to 1, which came before 3.
        assert_eq!(
            run(&mut tags, &[0, 4, 0, 2, 3]),
            [true, false, true, true, true]
        );
        assert_eq!(run(&mut tags, &[1]), [false]);
    }

    #[test]
    fn random_replacement_fills_a_set_first_and_repeats_itself() {
        let lines: Vec<u64> = (0..50).map(|n| n * n % 13).collect();
        let mut first = Tags::new(1, 4, Replacement::Random);
        assert_eq!(run(&mut first, &[0, 1, 2, 3, 0, 1, 2, 3])[4..], [true; 4]);
        let mut again = Tags::new(1, 4, Replacement::Random);
        run(&mut again, &[0, 1, 2, 3, 0, 1, 2, 3]);
        assert_eq!(run(&mut first, &lines), run(&mut again, &lines));
    }

    #[test]
    fn one_way_holds_one_line_of_a_set_by_every_rule() {
        for &replacement in Replacement::ALL {
            let mut tags = Tags::new(4, 1, replacement);
            let hits = [false, false, false, false, true];
            assert_eq!(run(&mut tags, &[0, 4, 0, 1, 0]), hits, "{replacement:?}");
        }
    }
}
