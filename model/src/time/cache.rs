//! Cache: the tags of the latent cache.
//!
//! Only tags are kept. They are updated when a fetch is issued, not when its data arrive: the
//! texels wait for their data in order behind the tags (Igehy, Eldridge and Proudfoot 1998), so a
//! line is read before a later one replaces it.

/// A set-associative tag store, least recently used replaced first.
#[derive(Clone, Debug)]
pub(super) struct Tags {
    sets: u64,
    ways: usize,
    /// `ways` lines for each set, most recently used first.
    lines: Vec<u64>,
}

/// No line: addresses end long before it.
const EMPTY: u64 = u64::MAX;

impl Tags {
    /// An empty store.
    pub(super) fn new(sets: u32, ways: u32) -> Tags {
        let lines = vec![EMPTY; sets as usize * ways as usize];
        Tags {
            sets: u64::from(sets),
            ways: ways as usize,
            lines,
        }
    }

    fn set(&mut self, line: u64) -> &mut [u64] {
        let start = (line % self.sets) as usize * self.ways;
        &mut self.lines[start..start + self.ways]
    }

    /// Whether the line is held; it becomes its set's most recently used.
    pub(super) fn touch(&mut self, line: u64) -> bool {
        let set = self.set(line);
        match set.iter().position(|&held| held == line) {
            Some(way) => {
                set[..=way].rotate_right(1);
                true
            }
            None => false,
        }
    }

    /// Puts a line that is not held in the place of its set's least recently used.
    pub(super) fn install(&mut self, line: u64) {
        let set = self.set(line);
        set.rotate_right(1);
        set[0] = line;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Looks up and installs; the hits.
    fn run(tags: &mut Tags, lines: &[u64]) -> Vec<bool> {
        let mut look = |&line: &u64| {
            let hit = tags.touch(line);
            if !hit {
                tags.install(line);
            }
            hit
        };
        lines.iter().map(&mut look).collect()
    }

    #[test]
    fn the_least_recently_used_line_of_a_set_is_replaced() {
        // Two sets of two ways. Even lines share set 0.
        let mut tags = Tags::new(2, 2);
        //       0 in,  2 in,  0 hit, 4 replaces 2, 0 hit, 2 replaces 4, 4 replaces 0
        let sequence = [0, 2, 0, 4, 0, 2, 4];
        let hits = [false, false, true, false, true, false, false];
        assert_eq!(run(&mut tags, &sequence), hits);
        // Set 1 was never disturbed: cold, then held.
        assert_eq!(run(&mut tags, &[1, 3, 1, 3]), [false, false, true, true]);
    }

    #[test]
    fn one_way_holds_one_line_of_a_set() {
        let mut tags = Tags::new(4, 1);
        assert_eq!(
            run(&mut tags, &[0, 4, 0, 1, 0]),
            [false, false, false, false, true]
        );
    }
}
