//! Plan: all texels of a request with their weights, or all places where latents are filtered.

use super::coordinate::{Scaled, Step};
use super::footprint::Footprint;
use super::lod::{self, Level};
use super::number::Fixed;
use super::{Filter, MipBlend, Sampler};
use crate::profile::Profile;
use crate::shape::Shape;

/// How a request says which mips it wants.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Detail {
    /// The level of detail, as f32 bits; one probe.
    Lod(u32),
    /// (du/dx, dv/dx) and (du/dy, dv/dy), as f32 bits of normalised coordinates.
    Gradients {
        /// Along x of the screen.
        x: [u32; 2],
        /// Along y of the screen.
        y: [u32; 2],
    },
    /// Its probes, already known.
    Footprint(Footprint),
}

/// One sample: where, how coarse, and the random bits of a stochastic choice.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SampleRequest {
    /// u and v, normalised, as f32 bits.
    pub place: [u32; 2],
    /// See [`Detail`].
    pub detail: Detail,
    /// Read by a stochastic sampler only; see [`SampleRequest::squares`] for which bit does what.
    pub random: u64,
}

/// The texels around a place of one mip.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Square {
    /// The mip.
    pub mip: u8,
    /// The two columns; none is the border.
    pub columns: [Option<u32>; 2],
    /// The two rows; none is the border.
    pub rows: [Option<u32>; 2],
    /// The weights of the second column and row, in 1/2^`subtexel_bits`.
    pub fractions: [u32; 2],
}

/// A place where latents are interpolated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Spot {
    /// The mip whose texels the coordinates count.
    pub mip: u8,
    /// x and y from the edge of texel 0, in 1/2^`subtexel_bits` texels; within the mip.
    pub coordinates: [i64; 2],
    /// What the synthesizer is told, in 1/2^`lod_bits` mips.
    pub lod: u32,
}

/// One probe: a place in a mip and, where two mips are joined, the same in the next.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Probe<T> {
    /// In the mip.
    pub near: T,
    /// In the next mip; none where `fraction` is 0.
    pub far: Option<T>,
    /// The weight of `far`, in 1/2^`lod_bits`.
    pub fraction: u32,
}

impl Square {
    /// The texel at corner (0,0), (1,0), (0,1) or (1,1), numbered 0..=3; none is the border.
    #[must_use]
    pub const fn corner(&self, corner: usize) -> Option<(u32, u32)> {
        match (self.columns[corner & 1], self.rows[corner >> 1 & 1]) {
            (Some(column), Some(row)) => Some((column, row)),
            (None, _) | (_, None) => None,
        }
    }

    /// Whether the corner's column and row have any weight: what has none need not be decoded, by
    /// any filter rule. The factored rule can round the weight of one that counts to 0.
    #[must_use]
    pub const fn counts(&self, corner: usize) -> bool {
        (corner & 1 == 0 || self.fractions[0] > 0) && (corner >> 1 == 0 || self.fractions[1] > 0)
    }

    /// The one texel that random bits below `fractions` on each axis choose, as a square.
    const fn chosen(self, random: [u32; 2]) -> Square {
        let column = self.columns[(random[0] < self.fractions[0]) as usize];
        let row = self.rows[(random[1] < self.fractions[1]) as usize];
        Square {
            mip: self.mip,
            columns: [column; 2],
            rows: [row; 2],
            fractions: [0; 2],
        }
    }
}

/// The random bits of a request, in the order in which they are used.
struct Random {
    texel: [u32; 2],
    mip: u32,
    probe: u32,
}

impl Random {
    const fn of(bits: u64, profile: &Profile) -> Random {
        let (b, l) = (profile.subtexel_bits as u32, profile.lod_bits as u32);
        let (texel, mip) = ((1 << b) - 1, (1 << l) - 1);
        Random {
            texel: [bits as u32 & texel, (bits >> b) as u32 & texel],
            mip: (bits >> (2 * b)) as u32 & mip,
            probe: (bits >> (2 * b + l)) as u32,
        }
    }
}

impl SampleRequest {
    /// The texels of every probe.
    ///
    /// A stochastic sampler gives one texel. Of its random bits, from the lowest, with b subtexel
    /// bits and l level bits:
    ///
    /// | bits | choose | if |
    /// |---|---|---|
    /// | b | the second column | less than the fraction along u |
    /// | b | the second row | less than the fraction along v |
    /// | l | the next mip | less than the level's fraction |
    /// | 32 | probe ⌊n · bits / 2^32⌋ of n | |
    ///
    /// So every texel is chosen with exactly its weight where n is a power of two; elsewhere the
    /// probability of a probe is less than 2^−32 from 1/n.
    #[must_use]
    pub fn squares(
        &self,
        sampler: &Sampler,
        shape: &Shape,
        profile: &Profile,
    ) -> Vec<Probe<Square>> {
        self.each_square(sampler, shape, profile).collect()
    }

    /// [`SampleRequest::squares`] one after the other, without memory for all of them.
    pub fn each_square<'a>(
        &'a self,
        sampler: &'a Sampler,
        shape: &'a Shape,
        profile: &'a Profile,
    ) -> impl Iterator<Item = Probe<Square>> + use<'a> {
        let (footprint, level) = self.footprint(sampler, shape, profile);
        let square = move |step: [Step; 2], mip: u8| {
            let (width, height) = shape.mip_size(mip);
            let axis = |axis: usize, size: u32| {
                let scaled = Scaled::of(self.place[axis], sampler.address[axis], step[axis], size);
                match sampler.filter {
                    Filter::Linear => {
                        let pair = scaled.pair(profile);
                        let texels = [pair.first, pair.first + 1];
                        (
                            texels.map(|t| resolve(t, sampler, axis, size)),
                            pair.fraction,
                        )
                    }
                    Filter::Point => {
                        let texel = resolve(scaled.texel(profile), sampler, axis, size);
                        ([texel; 2], 0)
                    }
                }
            };
            let (columns, x) = axis(0, width);
            let (rows, y) = axis(1, height);
            Square {
                mip,
                columns,
                rows,
                fractions: [x, y],
            }
        };
        let random = Random::of(self.random, profile);
        self.probes(sampler, footprint, &random).map(move |step| {
            let probe = Probe::between(level, |mip| square(step, mip));
            if sampler.stochastic {
                probe.chosen(random.mip).map(|s| s.chosen(random.texel))
            } else {
                probe
            }
        })
    }

    /// The places of every probe, for an order that filters latents. A stochastic sampler chooses
    /// the mip and the probe, with the bits that [`SampleRequest::squares`] says; a place needs no
    /// choice.
    #[must_use]
    pub fn spots(&self, sampler: &Sampler, shape: &Shape, profile: &Profile) -> Vec<Probe<Spot>> {
        self.each_spot(sampler, shape, profile).collect()
    }

    /// [`SampleRequest::spots`] one after the other, without memory for all of them.
    pub fn each_spot<'a>(
        &'a self,
        sampler: &'a Sampler,
        shape: &'a Shape,
        profile: &'a Profile,
    ) -> impl Iterator<Item = Probe<Spot>> + use<'a> {
        let (footprint, level) = self.footprint(sampler, shape, profile);
        let bits = u32::from(profile.subtexel_bits);
        let spot = move |step: [Step; 2], mip: u8, lod: u32| {
            let (width, height) = shape.mip_size(mip);
            let axis = |axis: usize, size: u32| {
                let address = sampler.address[axis];
                let pair = Scaled::of(self.place[axis], address, step[axis], size).pair(profile);
                let first = pair.first + i64::from(sampler.offset[axis]);
                let place = (first << bits) + i64::from(pair.fraction) + (1 << bits >> 1);
                address.fold(place, size, bits)
            };
            Spot {
                mip,
                coordinates: [axis(0, width), axis(1, height)],
                lod,
            }
        };
        let random = Random::of(self.random, profile);
        self.probes(sampler, footprint, &random)
            .map(move |step| match sampler.mip_blend {
                MipBlend::Codes => {
                    let of_mip = |mip| u32::from(mip) << profile.lod_bits;
                    let probe = Probe::between(level, |mip| spot(step, mip, of_mip(mip)));
                    if sampler.stochastic {
                        probe.chosen(random.mip)
                    } else {
                        probe
                    }
                }
                MipBlend::Level => {
                    let lod = (u32::from(level.mip) << profile.lod_bits) + level.fraction;
                    Probe::one(spot(step, level.mip, lod))
                }
            })
    }

    /// The four texels of a gather in Direct3D's order: lower left, lower right, upper right, upper
    /// left. They are those of a linear filter at the place in the nearest mip, before any weight.
    #[must_use]
    pub fn gathered(
        &self,
        sampler: &Sampler,
        shape: &Shape,
        profile: &Profile,
    ) -> (u8, [Option<(u32, u32)>; 4]) {
        let (_, lod) = self.lowered(sampler, shape, profile);
        let mip = Level::gathered(lod, sampler, shape.mip_count, profile);
        let (width, height) = shape.mip_size(mip);
        let axis = |axis: usize, size: u32| {
            let address = sampler.address[axis];
            let scaled = Scaled::of(self.place[axis], address, Step::CENTRE, size);
            let first = scaled.pair(profile).first;
            [first, first + 1].map(|texel| resolve(texel, sampler, axis, size))
        };
        let square = Square {
            mip,
            columns: axis(0, width),
            rows: axis(1, height),
            fractions: [0; 2],
        };
        (mip, [2, 3, 1, 0].map(|corner| square.corner(corner)))
    }

    /// The probes' number and line, and the level before the bias.
    fn lowered(&self, sampler: &Sampler, shape: &Shape, profile: &Profile) -> (Footprint, Fixed) {
        let most = sampler.max_anisotropy;
        let footprint = match self.detail {
            Detail::Lod(bits) => {
                let single = Footprint {
                    probes: 1,
                    line: [0; 2],
                    lod: 0,
                };
                return (single, lod::from_bits(bits));
            }
            Detail::Gradients { x, y } => {
                Footprint::of(x, y, [shape.width, shape.height], most, profile)
            }
            Detail::Footprint(footprint) => Footprint {
                probes: footprint.probes.clamp(1, most.max(1)),
                ..footprint
            },
        };
        (footprint, lod::from_footprint(footprint.lod))
    }

    fn footprint(&self, sampler: &Sampler, shape: &Shape, profile: &Profile) -> (Footprint, Level) {
        let (footprint, lod) = self.lowered(sampler, shape, profile);
        let level = Level::of(lod, sampler, shape.mip_count, profile);
        (footprint, level)
    }

    /// The steps of all probes along u and v, or of the one that is chosen.
    fn probes(
        &self,
        sampler: &Sampler,
        footprint: Footprint,
        random: &Random,
    ) -> impl Iterator<Item = [Step; 2]> + use<> {
        let count = footprint.probes;
        let indices = if sampler.stochastic {
            let index = ((u64::from(random.probe) * u64::from(count)) >> 32) as u8;
            index..index + 1
        } else {
            0..count
        };
        indices.map(move |index| footprint.line.map(|line| Step { line, index, count }))
    }
}

impl<T: Copy> Probe<T> {
    /// In one mip.
    #[must_use]
    pub const fn one(near: T) -> Probe<T> {
        Probe {
            near,
            far: None,
            fraction: 0,
        }
    }

    fn between(level: Level, place: impl Fn(u8) -> T) -> Probe<T> {
        // A fraction above 0 lies below the last mip, so the next exists.
        let far = (level.fraction > 0).then(|| place(level.mip + 1));
        Probe {
            near: place(level.mip),
            far,
            fraction: level.fraction,
        }
    }

    /// The mip that random bits below the fraction choose.
    fn chosen(self, random: u32) -> Probe<T> {
        match self.far {
            Some(far) if random < self.fraction => Probe::one(far),
            Some(_) | None => Probe::one(self.near),
        }
    }

    /// The same of something made of each place.
    #[must_use]
    pub fn map<U>(self, mut make: impl FnMut(T) -> U) -> Probe<U> {
        Probe {
            near: make(self.near),
            far: self.far.map(make),
            fraction: self.fraction,
        }
    }
}

/// The texel that an index means after offset and address mode.
fn resolve(texel: i64, sampler: &Sampler, axis: usize, size: u32) -> Option<u32> {
    sampler.address[axis].resolve(texel + i64::from(sampler.offset[axis]), size)
}
