//! Choices: what a configuration picks from a list, as its files name it.

use ntmu_isa::embed::Wave;
use ntmu_isa::position::{AddressMode, CornerSnap};
use ntmu_isa::shape::Sampling;
use serde::{Deserialize, Serialize};

pub use ntmu_isa::preset::ActivationKind;
pub use ntmu_isa::pyramid::Pyramid;

/// Where the first corner lies when the stride is more than one cell; see
/// [`ntmu_isa::position::CornerSnap`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Snap {
    /// The cell just below the texel centre.
    Cell,
    /// The multiple of the stride just below the texel centre.
    Stride,
}

impl From<Snap> for CornerSnap {
    fn from(snap: Snap) -> CornerSnap {
        match snap {
            Snap::Cell => CornerSnap::Cell,
            Snap::Stride => CornerSnap::Stride,
        }
    }
}

impl From<CornerSnap> for Snap {
    fn from(snap: CornerSnap) -> Snap {
        match snap {
            CornerSnap::Cell => Snap::Cell,
            CornerSnap::Stride => Snap::Stride,
        }
    }
}

/// What a corner outside the grid means; see [`ntmu_isa::position::AddressMode`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Address {
    /// The grid repeats.
    Wrap,
    /// The grid repeats, every other copy reversed.
    Mirror,
    /// The edge cell continues.
    Clamp,
}

impl From<Address> for AddressMode {
    fn from(address: Address) -> AddressMode {
        match address {
            Address::Wrap => AddressMode::Wrap,
            Address::Mirror => AddressMode::Mirror,
            Address::Clamp => AddressMode::Clamp,
        }
    }
}

impl From<AddressMode> for Address {
    fn from(address: AddressMode) -> Address {
        match address {
            AddressMode::Wrap => Address::Wrap,
            AddressMode::Mirror => Address::Mirror,
            AddressMode::Clamp => Address::Clamp,
        }
    }
}

/// The form of the waves; see [`ntmu_isa::embed::Wave`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WaveForm {
    /// Continuous, as in the NTC paper.
    Triangle,
    /// With a fall at the period's end, as in NVIDIA's RTX SDK.
    Saw,
}

impl From<WaveForm> for Wave {
    fn from(form: WaveForm) -> Wave {
        match form {
            WaveForm::Triangle => Wave::Triangle,
            WaveForm::Saw => Wave::Saw,
        }
    }
}

impl From<Wave> for WaveForm {
    fn from(form: Wave) -> WaveForm {
        match form {
            Wave::Triangle => WaveForm::Triangle,
            Wave::Saw => WaveForm::Saw,
        }
    }
}

/// Where latents start that no encoder makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FirstLatents {
    /// At the principal components of the texels under their cells.
    Components,
    /// At random around zero.
    Random,
}

/// What moves the synthesizer's parameters; latents and encoders always take Adam.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Optimiser {
    /// Adam (Kingma and Ba 2015).
    Adam,
    /// Muon (Jordan et al. 2024) for the weights of the hidden layers, Adam for the rest.
    Muon,
}

/// What a grid gives the synthesizer; see [`ntmu_isa::shape::Sampling`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum GridSampling {
    /// The four corners one after the other.
    Corners,
    /// One latent a channel, interpolated among the four corners.
    Interpolated,
}

impl From<GridSampling> for Sampling {
    fn from(sampling: GridSampling) -> Sampling {
        match sampling {
            GridSampling::Corners => Sampling::Corners,
            GridSampling::Interpolated => Sampling::Interpolated,
        }
    }
}

impl From<Sampling> for GridSampling {
    fn from(sampling: Sampling) -> GridSampling {
        match sampling {
            Sampling::Corners => GridSampling::Corners,
            Sampling::Interpolated => GridSampling::Interpolated,
        }
    }
}

/// The arithmetic of a layer; see [`ntmu_isa::layer::Parameters`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Precision {
    /// Integers: weights of [`crate::TrainConfig::weight_bits`], activations of
    /// [`crate::TrainConfig::activation_bits`].
    Int8,
    /// Halves, summed in f32.
    Fp16,
}

impl Precision {
    /// The name in configurations and errors.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Precision::Int8 => "int8",
            Precision::Fp16 => "fp16",
        }
    }
}

/// The pyramids that have a name in configurations.
pub const PYRAMIDS: [(&str, Pyramid); 3] = [
    ("single", Pyramid::SINGLE),
    ("ntc", Pyramid::NTC),
    ("every-mip", Pyramid::EVERY_MIP),
];

/// A pyramid in a configuration's file: by its name, or by its two numbers.
pub(crate) mod pyramid {
    use super::{PYRAMIDS, Pyramid};
    use serde::de::Error as _;
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    #[derive(Serialize, Deserialize)]
    #[serde(untagged)]
    enum Written<N> {
        Name(N),
        Numbers { first: u8, each: u8 },
    }

    pub(crate) fn serialize<S: Serializer>(
        pyramid: &Pyramid,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        let (first, each) = (pyramid.first(), pyramid.each());
        let named = PYRAMIDS.iter().find(|(_, known)| known == pyramid);
        named
            .map_or(Written::Numbers { first, each }, |(name, _)| {
                Written::Name(name)
            })
            .serialize(serializer)
    }

    pub(crate) fn deserialize<'d, D: Deserializer<'d>>(
        deserializer: D,
    ) -> Result<Pyramid, D::Error> {
        let (found, pyramid) = match Written::<String>::deserialize(deserializer)? {
            Written::Name(name) => {
                let named = PYRAMIDS.iter().find(|(known, _)| *known == name);
                (name, named.map(|(_, pyramid)| *pyramid))
            }
            Written::Numbers { first, each } => (
                format!("first {first}, each {each}"),
                Pyramid::new(first, each),
            ),
        };
        pyramid.ok_or_else(|| {
            let names = PYRAMIDS.map(|(name, _)| name).join(", ");
            D::Error::custom(format!(
                "pyramid: found {found}; allowed: {names}, 1 ≤ each ≤ first ≤ 15, or 0 and 0"
            ))
        })
    }

    #[cfg(test)]
    mod tests {
        use super::*;

        #[derive(Serialize, Deserialize)]
        struct Field {
            #[serde(with = "super")]
            pyramid: Pyramid,
        }

        fn read(text: &str) -> Result<Pyramid, serde_json::Error> {
            serde_json::from_str::<Field>(&format!("{{\"pyramid\":{text}}}")).map(|f| f.pyramid)
        }

        #[test]
        fn every_pyramid_is_written_and_read_back_and_what_is_none_is_refused() {
            for (first, each) in (0..=255).flat_map(|f| [0, 1, 2, 3, 15, 16].map(|e| (f, e))) {
                let numbers = format!("{{\"first\":{first},\"each\":{each}}}");
                let Some(pyramid) = Pyramid::new(first, each) else {
                    assert!(read(&numbers).unwrap_err().to_string().contains("allowed"));
                    continue;
                };
                assert_eq!(read(&numbers).unwrap(), pyramid);
                let text = serde_json::to_value(Field { pyramid }).unwrap();
                assert_eq!(read(&text["pyramid"].to_string()).unwrap(), pyramid);
            }
            for (name, pyramid) in PYRAMIDS {
                assert_eq!(read(&format!("\"{name}\"")).unwrap(), pyramid);
            }
            assert!(read("\"none\"").is_err());
            assert!(read("{\"first\":4}").is_err());
        }
    }
}
