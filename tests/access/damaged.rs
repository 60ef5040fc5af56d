//! Damaged Parquet files give errors, or other demands; never a panic.

use super::parquet_writer::{Form, Numbers, Written, parquet};
use super::*;

/// A file of 40 rows in three groups, and how it is written.
fn small(has_dictionary: bool) -> Vec<u8> {
    let column = |declaration: &str, modulus: i32| -> Written {
        let numbers = (0..40).map(|n| n % modulus).collect();
        (declaration.to_owned(), Numbers::Int32(numbers), Vec::new())
    };
    let columns = [
        column("required int32 x", 16),
        column("optional int32 y", 13),
        column("required int32 mip", 1),
    ];
    let form = Form {
        is_snappy: true,
        has_dictionary,
        group_rows: 15,
    };
    parquet(&columns, form)
}

#[test]
fn a_file_cut_off_anywhere_is_refused() {
    let folder = folder();
    for bytes in [small(false), small(true)] {
        for length in 0..bytes.len() {
            let path = file(&folder, "cut.parquet", &bytes[..length]);
            let error = read(&path, &materials()).unwrap_err();
            assert!(
                matches!(error, AccessError::Parquet { .. }),
                "{length}: {error}"
            );
        }
        assert_eq!(
            read(&file(&folder, "whole.parquet", bytes), &materials())
                .unwrap()
                .len(),
            40
        );
    }
}

#[test]
fn a_file_with_any_byte_changed_is_read_or_refused() {
    let folder = folder();
    let materials = materials();
    for mut bytes in [small(false), small(true)] {
        let mut refused = 0;
        for index in 0..bytes.len() {
            for change in [0x01, 0x80, 0xff] {
                bytes[index] ^= change;
                let path = file(&folder, "changed.parquet", &bytes);
                refused += u32::from(read(&path, &materials).is_err());
                bytes[index] ^= change;
            }
        }
        assert!(refused > 0, "some changes are noticed");
    }
}
