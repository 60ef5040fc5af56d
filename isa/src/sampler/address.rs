//! Address: which texel an index outside the mip means.
//!
//! Direct3D 11.3, section 7.18.9, for indices on both sides of zero and sizes that need not be
//! powers of two.

/// What lies outside 0..1 of a texture, along one axis.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "kebab-case")]
pub enum Address {
    /// The texture repeats.
    Wrap,
    /// The texture repeats, every other copy reversed.
    Mirror,
    /// One reversed copy on the negative side, then the last texel continues on both sides.
    MirrorOnce,
    /// The edge texel continues.
    Clamp,
    /// The sampler's border codes.
    Border,
}

impl Address {
    /// Every mode.
    pub const ALL: [Address; 5] = [
        Address::Wrap,
        Address::Mirror,
        Address::MirrorOnce,
        Address::Clamp,
        Address::Border,
    ];

    /// The name in tables and files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Address::Wrap => "wrap",
            Address::Mirror => "mirror",
            Address::MirrorOnce => "mirror-once",
            Address::Clamp => "clamp",
            Address::Border => "border",
        }
    }

    /// The texel 0..`size` that `index` means; none is the border. `size` is at least 1.
    #[must_use]
    pub const fn resolve(self, index: i64, size: u32) -> Option<u32> {
        let size = size as i64;
        let resolved = match self {
            Address::Wrap => index.rem_euclid(size),
            Address::Mirror => {
                let folded = index.rem_euclid(2 * size);
                if folded < size {
                    folded
                } else {
                    2 * size - 1 - folded
                }
            }
            Address::MirrorOnce => limit(if index < 0 { -1 - index } else { index }, size - 1),
            Address::Clamp => limit(index, size - 1),
            Address::Border => {
                if index < 0 || index >= size {
                    return None;
                }
                index
            }
        };
        Some(resolved as u32)
    }

    /// The place 0..=`size` that a continuous `place` means, both in 1/2^`bits` texels.
    ///
    /// Where texels do not repeat, a place is kept half a texel from the edge: nearer to it a linear
    /// filter joins the edge texel with itself. Only wrapped places reach the edge, as their
    /// neighbours lie on the other side. A border has no places; it is treated as clamped.
    #[must_use]
    pub const fn fold(self, place: i64, size: u32, bits: u32) -> i64 {
        let (size, half) = ((size as i64) << bits, 1_i64 << bits >> 1);
        let folded = match self {
            Address::Wrap => return place.rem_euclid(size),
            Address::Mirror => {
                let folded = place.rem_euclid(2 * size);
                if folded < size {
                    folded
                } else {
                    2 * size - folded
                }
            }
            Address::MirrorOnce => place.abs(),
            Address::Clamp | Address::Border => place,
        };
        if folded < half {
            half
        } else {
            limit(folded, size - half)
        }
    }
}

/// `value` limited to `0..=high`.
const fn limit(value: i64, high: i64) -> i64 {
    if value < 0 {
        0
    } else if value > high {
        high
    } else {
        value
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the section's text says step by step, with its remainder that keeps the sign.
    fn by_the_text(mode: Address, index: i64, size: i64) -> Option<i64> {
        if (0..size).contains(&index) {
            return Some(index);
        }
        let reflected = if index < 0 { -index - 1 } else { index };
        match mode {
            Address::Wrap => {
                let remainder = index % size;
                Some(if remainder < 0 {
                    remainder + size
                } else {
                    remainder
                })
            }
            Address::Mirror => {
                let is_odd_tile = (reflected / size) & 1 == 1;
                let within = reflected % size;
                Some(if is_odd_tile {
                    size - within - 1
                } else {
                    within
                })
            }
            Address::Clamp => Some(index.min(size - 1).max(0)),
            Address::MirrorOnce => Some(reflected.min(size - 1).max(0)),
            Address::Border => None,
        }
    }

    #[test]
    fn every_index_of_every_small_size_is_what_direct3d_says() {
        for mode in Address::ALL {
            for (size, index) in (1..=64).flat_map(|s| (-200..=200).map(move |i| (s, i))) {
                let found = mode.resolve(index, size as u32).map(i64::from);
                let name = mode.name();
                assert_eq!(
                    found,
                    by_the_text(mode, index, size),
                    "{name} {index} of {size}"
                );
            }
        }
    }

    #[test]
    fn powers_of_two_need_no_division() {
        for size in [1_i64, 2, 4, 8, 16, 32, 64] {
            for index in -200..=200 {
                let mask = size - 1;
                let wrapped = index & mask;
                assert_eq!(
                    Address::Wrap.resolve(index, size as u32),
                    Some(wrapped as u32)
                );
                let is_odd = index & size != 0;
                let mirrored = if is_odd { mask - wrapped } else { wrapped };
                assert_eq!(
                    Address::Mirror.resolve(index, size as u32),
                    Some(mirrored as u32)
                );
            }
        }
    }

    #[test]
    fn the_place_of_a_texel_centre_is_the_texel_that_its_index_means() {
        for mode in Address::ALL {
            for (size, index) in (1..=33_u32).flat_map(|s| (-100..100_i64).map(move |i| (s, i))) {
                for bits in 4..=12 {
                    let centre = ((2 * index + 1) << bits) / 2;
                    let folded = mode.fold(centre, size, bits);
                    let resolved = mode.resolve(index, size).map(i64::from);
                    let clamped = index.clamp(0, i64::from(size) - 1);
                    let texel = resolved.unwrap_or(clamped);
                    assert_eq!(folded, ((2 * texel + 1) << bits) / 2);
                }
            }
        }
    }
}
