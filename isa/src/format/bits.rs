//! Codes of 1 to 8 bits, packed from the least significant bit of the first byte.

use crate::error::AssetError;

/// Codes as bytes. Each is below 2^`width`; the last byte is filled with zeros.
pub(super) fn pack(codes: impl ExactSizeIterator<Item = u8>, width: u8) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(packed_bytes(codes.len() as u64, width) as usize);
    let (mut held, mut held_bits) = (0_u16, 0_u8);
    for code in codes {
        held |= u16::from(code) << held_bits;
        held_bits += width;
        while held_bits >= 8 {
            bytes.push(held as u8);
            held >>= 8;
            held_bits -= 8;
        }
    }
    if held_bits > 0 {
        bytes.push(held as u8);
    }
    bytes
}

/// Bytes that `count` codes take.
pub(super) fn packed_bytes(count: u64, width: u8) -> u64 {
    (count * u64::from(width)).div_ceil(8)
}

/// `count` codes from exactly the bytes that they take.
pub(super) fn unpack(
    section: &'static str,
    bytes: &[u8],
    count: u64,
    width: u8,
) -> Result<Vec<u8>, AssetError> {
    let needed = packed_bytes(count, width);
    if (bytes.len() as u64) < needed {
        return Err(AssetError::Truncated {
            section,
            needed,
            found: bytes.len() as u64,
        });
    }
    if bytes.len() as u64 != needed {
        return Err(AssetError::field(
            format!("{section}.bytes"),
            bytes.len(),
            needed,
        ));
    }
    let mask = (1_u16 << width) - 1;
    let mut codes = Vec::with_capacity(count as usize);
    let (mut held, mut held_bits) = (0_u16, 0_u8);
    let mut rest = bytes.iter();
    for _ in 0..count {
        if held_bits < width {
            held |= u16::from(*rest.next().unwrap_or(&0)) << held_bits;
            held_bits += 8;
        }
        codes.push((held & mask) as u8);
        held >>= width;
        held_bits -= width;
    }
    if held != 0 {
        return Err(AssetError::field(
            format!("{section}.fill"),
            "a set bit",
            "zeros",
        ));
    }
    Ok(codes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_first_code_is_in_the_lowest_bits() {
        assert_eq!(pack([1, 2, 3].into_iter(), 4), [0x21, 0x03]);
        assert_eq!(
            pack([1, 0, 1, 1, 0, 0, 0, 0, 1].into_iter(), 1),
            [0b0000_1101, 1]
        );
        assert_eq!(pack([5, 6].into_iter(), 3), [0b0011_0101]);
    }

    #[test]
    fn a_set_bit_in_the_fill_is_refused() {
        assert!(unpack("grid0", &[0x21, 0x13], 3, 4).is_err());
        assert!(unpack("grid0", &[0x21], 3, 4).is_err());
        assert!(unpack("grid0", &[0x21, 0x03, 0], 3, 4).is_err());
    }

    proptest! {
        #[test]
        fn codes_of_every_width_return(width in 1_u8..=8, codes in proptest::collection::vec(any::<u8>(), 0..70)) {
            let codes: Vec<u8> = codes.into_iter().map(|c| c & ((1_u16 << width) - 1) as u8).collect();
            let bytes = pack(codes.iter().copied(), width);
            prop_assert_eq!(unpack("grid0", &bytes, codes.len() as u64, width), Ok(codes));
        }
    }
}
