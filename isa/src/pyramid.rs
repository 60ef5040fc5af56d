//! Pyramid: which level of the grids serves a mip.
//!
//! CNTC has one pair of grids for every mip, and strides through it (paper, section 4.3). NTC has a
//! feature pyramid: pairs of falling resolution, each for a few mips. A pyramid here is two numbers.
//! Level l has 1/2^(each · l) of level 0's resolution, so a mip that is r = each · l halvings below
//! mip 0 lies in its level as mip − r lies in level 0, and every rule of a position holds unchanged.

/// Which level of the grids serves a mip.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Pyramid {
    /// Mips that level 0 serves, 1..=15; 0 where level 0 serves them all.
    first: u8,
    /// Mips that every further level serves, 1..=`first`; 0 where there is none. Also log2 of a
    /// level's resolution over the next level's.
    each: u8,
}

impl Pyramid {
    /// One level for every mip: CNTC.
    pub const SINGLE: Pyramid = Pyramid { first: 0, each: 0 };

    /// Level 0 for mips 0 to 3, every further level for two mips: NTC (Vaidyanathan et al. 2023).
    pub const NTC: Pyramid = Pyramid { first: 4, each: 2 };

    /// Level 0 for mips 0 to 3, then a level for every mip: the grid pairs of CNTC's ablation of
    /// strides (paper, "Effect of sampling with stride").
    pub const EVERY_MIP: Pyramid = Pyramid { first: 4, each: 1 };

    /// The pyramid whose level 0 serves `first` mips and every further one `each`, or `None` where
    /// the two numbers are no pyramid: allowed are 1 ≤ each ≤ first ≤ 15, and 0 and 0.
    #[must_use]
    pub const fn new(first: u8, each: u8) -> Option<Pyramid> {
        let single = first == 0 && each == 0;
        let several = each >= 1 && each <= first && first <= 15;
        if single || several {
            Some(Pyramid { first, each })
        } else {
            None
        }
    }

    /// Mips that level 0 serves; 0 where it serves them all.
    #[must_use]
    pub const fn first(self) -> u8 {
        self.first
    }

    /// Mips that every further level serves; 0 where there is none.
    #[must_use]
    pub const fn each(self) -> u8 {
        self.each
    }

    /// The code in a file: 16 · first + each.
    #[must_use]
    pub const fn code(self) -> u8 {
        self.first << 4 | self.each
    }

    /// The pyramid with this code, if there is one.
    #[must_use]
    pub const fn from_code(code: u8) -> Option<Pyramid> {
        Pyramid::new(code >> 4, code & 15)
    }

    /// The level that serves a mip.
    #[must_use]
    pub const fn level_of(self, mip: u8) -> u8 {
        if self.each == 0 || mip < self.first {
            0
        } else {
            1 + (mip - self.first) / self.each
        }
    }

    /// log2 of level 0's resolution over that of `level`.
    #[must_use]
    pub const fn reduction_log2(self, level: u8) -> u8 {
        self.each.saturating_mul(level)
    }

    /// The mip that lies in level 0 as `mip` lies in its own level: `mip` less the halvings between
    /// the two levels.
    #[must_use]
    pub const fn mip_in_level(self, mip: u8) -> u8 {
        mip.saturating_sub(self.reduction_log2(self.level_of(mip)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all() -> impl Iterator<Item = Pyramid> {
        (0..=255).filter_map(Pyramid::from_code)
    }

    #[test]
    fn codes_lead_back_and_what_is_no_pyramid_has_none() {
        assert_eq!(all().count(), 1 + 15 * 16 / 2);
        for pyramid in all() {
            assert_eq!(Pyramid::from_code(pyramid.code()), Some(pyramid));
        }
        assert_eq!(Pyramid::new(1, 2), None);
        assert_eq!(Pyramid::new(3, 0), None);
    }

    #[test]
    fn every_level_serves_as_many_mips_as_it_says_and_none_is_finer_than_needed() {
        for pyramid in all().filter(|&p| p != Pyramid::SINGLE) {
            for mip in 0..32 {
                let level = pyramid.level_of(mip);
                let served = (0..64).filter(|&m| pyramid.level_of(m) == level).count();
                let expected = if level == 0 {
                    pyramid.first
                } else {
                    pyramid.each
                };
                assert_eq!(served, usize::from(expected), "{pyramid:?} mip {mip}");
                // Each halving of the level undoes one of the mip.
                assert!(pyramid.mip_in_level(mip) < pyramid.first);
                if level > 0 {
                    assert!(pyramid.mip_in_level(mip) >= pyramid.first - pyramid.each);
                }
            }
        }
        assert!((0..32).all(|mip| Pyramid::SINGLE.mip_in_level(mip) == mip));
    }

    #[test]
    fn ntc_and_the_ablation_have_the_levels_of_their_papers() {
        let levels = |p: Pyramid| (0..10).map(|m| p.level_of(m)).collect::<Vec<_>>();
        assert_eq!(levels(Pyramid::NTC), [0, 0, 0, 0, 1, 1, 2, 2, 3, 3]);
        assert_eq!(levels(Pyramid::EVERY_MIP), [0, 0, 0, 0, 1, 2, 3, 4, 5, 6]);
        assert_eq!(Pyramid::NTC.mip_in_level(5), 3);
        assert_eq!(Pyramid::EVERY_MIP.mip_in_level(9), 3);
    }
}
