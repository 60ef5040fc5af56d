//! CSV and Parquet of the same rows give the same demands.

use super::parquet_writer::{Form, Numbers, Written, parquet};
use super::*;
use proptest::prelude::*;

/// Columns of one kind, by name, in some order, and which of them a generated file leaves out.
#[derive(Clone, Debug)]
struct Table {
    columns: Vec<(&'static str, Column)>,
}

#[derive(Clone, Debug)]
enum Column {
    Whole(Vec<i64>),
    Real(Vec<f32>),
}

const ROWS: std::ops::Range<usize> = 1..40;

fn whole(below: i64, rows: usize) -> impl Strategy<Value = Column> {
    prop::collection::vec(0..below, rows).prop_map(Column::Whole)
}

/// Any finite f32, small ones as often as all others.
fn real(rows: usize) -> impl Strategy<Value = Column> {
    let finite = any::<u32>()
        .prop_map(f32::from_bits)
        .prop_filter("finite", |f| f.is_finite());
    prop::collection::vec(prop_oneof![finite, -2.0..2.0_f32], rows).prop_map(Column::Real)
}

fn table() -> impl Strategy<Value = Table> {
    let kinds = prop::sample::select(vec![
        // Texels that both materials have.
        vec![("x", 4), ("y", 4), ("mip", 3)],
        vec![("u", 0), ("v", 0), ("lod", 0)],
        vec![
            ("u", 0),
            ("v", 0),
            ("dudx", 0),
            ("dvdx", 0),
            ("dudy", 0),
            ("dvdy", 0),
        ],
    ]);
    (kinds, any::<[bool; 2]>(), ROWS)
        .prop_flat_map(|(mut names, [has_material, has_pixels], rows)| {
            if has_material {
                names.push(("material", 2));
            }
            if has_pixels {
                names.extend([("pixel_x", 1 << 32), ("pixel_y", 1 << 32)]);
            }
            let columns: Vec<BoxedStrategy<(&str, Column)>> = names
                .into_iter()
                .map(|(name, below)| match below {
                    0 => real(rows).prop_map(move |c| (name, c)).boxed(),
                    _ => whole(below, rows).prop_map(move |c| (name, c)).boxed(),
                })
                .collect();
            columns.prop_shuffle()
        })
        .prop_map(|columns| Table { columns })
}

impl Table {
    fn rows(&self) -> usize {
        match &self.columns[0].1 {
            Column::Whole(numbers) => numbers.len(),
            Column::Real(numbers) => numbers.len(),
        }
    }

    fn csv(&self) -> String {
        let names: Vec<&str> = self.columns.iter().map(|c| c.0).collect();
        let mut text = format!("{}\n", names.join(","));
        for row in 0..self.rows() {
            let fields = self.columns.iter().map(|(_, column)| match column {
                Column::Whole(numbers) => numbers[row].to_string(),
                Column::Real(numbers) => numbers[row].to_string(),
            });
            text.push_str(&format!("{}\n", fields.collect::<Vec<_>>().join(",")));
        }
        text
    }

    /// `wide` for each column in turn: 64 bits instead of 32.
    fn written(&self, wide: &[bool], is_optional: bool) -> Vec<Written> {
        let repetition = if is_optional { "optional" } else { "required" };
        let columns = self.columns.iter().zip(wide.iter().cycle());
        columns
            .map(|((name, column), wide)| {
                let (declared, numbers) = match (column, wide) {
                    (Column::Whole(n), true) => ("int64", Numbers::Int64(n.clone())),
                    (Column::Whole(n), false) => {
                        let n = n.iter().map(|&n| n as u32 as i32).collect();
                        ("int32", Numbers::Int32(n))
                    }
                    (Column::Real(n), true) => (
                        "double",
                        Numbers::Double(n.iter().map(|&n| n.into()).collect()),
                    ),
                    (Column::Real(n), false) => ("float", Numbers::Float(n.clone())),
                };
                let unsigned = match (column, wide) {
                    (Column::Whole(_), false) => " (UINT_32)",
                    (Column::Whole(_) | Column::Real(_), _) => "",
                };
                (
                    format!("{repetition} {declared} {name}{unsigned}"),
                    numbers,
                    Vec::new(),
                )
            })
            .collect()
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn csv_and_parquet_of_the_same_rows_give_the_same_demands(
        table in table(),
        wide in prop::collection::vec(any::<bool>(), 1..9),
        is_optional in any::<bool>(),
        is_snappy in any::<bool>(),
        has_dictionary in any::<bool>(),
        group_rows in prop_oneof![1..9_usize, Just(usize::MAX)],
    ) {
        let (folder, materials) = (folder(), materials());
        let csv = file(&folder, "a.csv", table.csv());
        let form = Form { is_snappy, has_dictionary, group_rows };
        let bytes = parquet(&table.written(&wide, is_optional), form);
        let parquet = file(&folder, "a.parquet", bytes);
        let expected = read(&csv, &materials).unwrap();
        prop_assert_eq!(expected.len(), table.rows());
        prop_assert_eq!(read(&parquet, &materials).unwrap(), expected);
    }
}

#[test]
fn a_file_of_many_chunks_and_groups_is_read_to_its_end() {
    let numbers: Vec<i64> = (0..10_001).collect();
    let column = |name: &'static str, modulus: i64| {
        let numbers = numbers.iter().map(|n| n % modulus).collect();
        (name, Column::Whole(numbers))
    };
    let columns = vec![
        column("x", 16),
        column("y", 13),
        column("mip", 1),
        column("material", 2),
    ];
    let table = Table { columns };
    let (folder, materials) = (folder(), materials());
    let expected = read(&file(&folder, "a.csv", table.csv()), &materials).unwrap();
    assert_eq!(expected.len(), 10_001);
    for group_rows in [4096, 5000, 10_001] {
        let form = Form {
            is_snappy: true,
            has_dictionary: true,
            group_rows,
        };
        let bytes = parquet(&table.written(&[true], false), form);
        assert_eq!(
            read(&file(&folder, "a.parquet", bytes), &materials).unwrap(),
            expected
        );
    }
}

#[test]
fn without_pixels_four_rows_are_a_quad_and_without_a_material_it_is_the_first() {
    let (folder, materials) = (folder(), materials());
    let path = file(
        &folder,
        "a.csv",
        format!("y,mip,x\n{}", "3,0,5\n".repeat(9)),
    );
    let demands = read(&path, &materials).unwrap();
    let pixels: Vec<[u32; 2]> = demands.iter().map(|d| d.pixel).collect();
    let quad = |x| [[x, 0], [x + 1, 0], [x, 1], [x + 1, 1]];
    assert_eq!(pixels[..8], [quad(0), quad(2)].concat());
    assert_eq!(pixels[8], [4, 0]);
    assert!(demands.iter().all(|d| d.material == 0 && d.weights == 1));
    assert!(
        demands
            .iter()
            .all(|d| d.places.len() == 1 && (d.places[0].x(), d.places[0].y()) == (11, 7))
    );
}

#[test]
fn spaces_quotes_line_ends_a_byte_order_mark_and_empty_lines_change_nothing() {
    let (folder, materials) = (folder(), materials());
    let plain = read(
        &file(&folder, "a.csv", "u,v,lod\n0.5,0.25,1\n0.125,1e-3,0.5\n"),
        &materials,
    );
    let plain = plain.unwrap();
    for text in [
        "u, v, lod\r\n0.5, 0.25, 1\r\n0.125, 1e-3, 0.5\r\n",
        "\u{feff}u,v,lod\n0.5,0.25,1.0\n\n0.125,0.001,5e-1",
        "\"u\",\"v\",\"lod\"\n\"0.5\",+0.25,1\n.125,1E-3,.5\n",
    ] {
        assert_eq!(
            read(&file(&folder, "b.CSV", text), &materials).unwrap(),
            plain,
            "{text:?}"
        );
    }
}
