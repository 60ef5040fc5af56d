//! Sampled: what a sample asks of the unit, without decoding anything.

use super::reads::{Corner, corners, number, place_of};
use crate::demand::Demand;
use crate::place::Place;
use ntmu_isa::profile::Profile;
use ntmu_isa::sampler::{Order, SampleRequest, Sampler, SamplerError};
use ntmu_isa::shape::Shape;

/// A texture set's shape behind a sampler that fits it: enough to turn samples into demands.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sampled {
    shape: Shape,
    sampler: Sampler,
    profile: Profile,
}

impl Sampled {
    /// Texture sets of this shape and profile behind `sampler`.
    ///
    /// # Errors
    /// When the sampler does not fit the shape; see [`Sampler::check`].
    pub fn new(shape: Shape, sampler: Sampler, profile: Profile) -> Result<Sampled, SamplerError> {
        sampler.check(&shape)?;
        Ok(Sampled {
            shape,
            sampler,
            profile,
        })
    }

    /// The shape.
    #[must_use]
    pub fn shape(&self) -> &Shape {
        &self.shape
    }

    /// The sampler.
    #[must_use]
    pub fn sampler(&self) -> &Sampler {
        &self.sampler
    }

    /// Puts what a sample decodes, and how many codes its filter adds up, in the place of those of
    /// `demand`: the places and the count of [`Texture::reads`](super::Texture::reads). A sample of
    /// the border alone has no places.
    pub fn demand(&self, request: &SampleRequest, demand: &mut Demand) {
        demand.places.clear();
        demand.weights = 0;
        let (sampler, shape, profile) = (&self.sampler, &self.shape, &self.profile);
        let mut read = |place: Place| {
            demand.weights += 1;
            number(&mut demand.places, place);
        };
        match sampler.order {
            Order::DecodeThenFilter => {
                for probe in request.each_square(sampler, shape, profile) {
                    for square in std::iter::once(probe.near).chain(probe.far) {
                        for corner in corners(&square) {
                            match corner {
                                Corner::Texel(texel) => read(Place::of(texel)),
                                Corner::Border | Corner::Unread => {}
                            }
                        }
                    }
                }
            }
            Order::FilterThenDecode => {
                for probe in request.each_spot(sampler, shape, profile) {
                    for spot in std::iter::once(probe.near).chain(probe.far) {
                        read(place_of(&spot, profile));
                    }
                }
            }
        }
    }
}
