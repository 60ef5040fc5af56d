//! Specification enums by their names, in JSON.

/// A module for `#[serde(with = …)]` of an enum that has `ALL` and `name`.
macro_rules! by_name {
    ($(#[doc = $doc:literal])* $module:ident, $kind:ty) => {
        $(#[doc = $doc])*
        pub mod $module {
            use serde::{Deserialize, Deserializer, Serializer, de::Error};

            /// The name.
            ///
            /// # Errors
            /// When the serializer fails.
            pub fn serialize<S: Serializer>(value: &$kind, to: S) -> Result<S::Ok, S::Error> {
                to.serialize_str(value.name())
            }

            /// The value with the name.
            ///
            /// # Errors
            /// When there is none; the message lists all.
            pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<$kind, D::Error> {
                let found = String::deserialize(from)?;
                let all = <$kind>::ALL;
                all.into_iter().find(|value| value.name() == found).ok_or_else(|| {
                    let names = all.map(<$kind>::name).join(", ");
                    D::Error::custom(format!("found {found:?}; allowed: {names}"))
                })
            }
        }
    };
}

by_name!(
    /// [`ntmu_isa::rescale::Requantizer`] by name.
    requantizer,
    ntmu_isa::rescale::Requantizer
);
by_name!(
    /// [`ntmu_isa::position::CornerSnap`] by name.
    snap,
    ntmu_isa::position::CornerSnap
);
by_name!(
    /// [`ntmu_isa::position::AddressMode`] by name.
    address_mode,
    ntmu_isa::position::AddressMode
);

/// Bytes as hexadecimal digits, two a byte, lower case.
pub mod hex {
    use serde::{Deserialize, Deserializer, Serializer, de::Error};

    /// The digits.
    ///
    /// # Errors
    /// When the serializer fails.
    pub fn serialize<S: Serializer>(bytes: &[u8], to: S) -> Result<S::Ok, S::Error> {
        let digits: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
        to.serialize_str(&digits)
    }

    /// The bytes.
    ///
    /// # Errors
    /// When something else than lower-case digits is there, or an odd number of them.
    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<u8>, D::Error> {
        let found = String::deserialize(from)?;
        let digit = |c: u8| match c {
            b'0'..=b'9' => Ok(c - b'0'),
            b'a'..=b'f' => Ok(c - b'a' + 10),
            _ => Err(D::Error::custom(format!(
                "found byte {c:#04x}; allowed: 0-9 a-f"
            ))),
        };
        if found.len() % 2 == 1 {
            return Err(D::Error::custom(format!(
                "found {} digits; allowed: even",
                found.len()
            )));
        }
        found
            .as_bytes()
            .chunks_exact(2)
            .map(|d| Ok(digit(d[0])? << 4 | digit(d[1])?))
            .collect()
    }
}
