//! Distinct: a set of lines, one bit each.

/// Lines seen so far. Lines count from 0 and lie close together: the latents of all materials.
#[derive(Clone, Debug, Default)]
pub(super) struct DistinctLines {
    words: Vec<u64>,
    count: u64,
}

impl DistinctLines {
    /// Whether the line is in the set.
    pub(super) fn has(&self, line: u64) -> bool {
        let word = self.words.get((line / 64) as usize).copied().unwrap_or(0);
        word >> (line % 64) & 1 == 1
    }

    /// Adds a line, which may be in the set already.
    pub(super) fn add(&mut self, line: u64) {
        let index = (line / 64) as usize;
        if index >= self.words.len() {
            self.words.resize(index + 1, 0);
        }
        let bit = 1 << (line % 64);
        self.count += u64::from(self.words[index] & bit == 0);
        self.words[index] |= bit;
    }

    /// Lines in the set.
    pub(super) fn count(&self) -> u64 {
        self.count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_counts_once() {
        let mut lines = DistinctLines::default();
        for line in [3, 700, 3, 64, 700] {
            lines.add(line);
        }
        assert_eq!(lines.count(), 3);
        let has = [3, 64, 700, 0, 63, 701, 100_000].map(|line| lines.has(line));
        assert_eq!(has, [true, true, true, false, false, false, false]);
    }
}
