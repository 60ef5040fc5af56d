//! What is wrong is named: file, row, column, found, allowed.

use super::parquet_writer::{Form, Numbers, PLAIN, Written, parquet};
use super::*;

fn refused(path: &Path) -> String {
    let error = read(path, &materials()).unwrap_err().to_string();
    let name = path.file_name().unwrap().to_str().unwrap();
    assert!(error.contains(name), "{error} names the file");
    error
}

#[test]
fn csv_errors_say_where_what_and_what_is_allowed() {
    let folder = folder();
    for (text, parts) in [
        (
            "",
            &[
                "found columns ;",
                "x,y,mip or u,v,lod or u,v,dudx,dvdx,dudy,dvdy",
            ][..],
        ),
        ("\n\n", &["found columns ;"]),
        ("x,y\n1,2\n", &["found columns x,y;", "x,y,mip or"]),
        ("u,v\n1,2\n", &["found columns u,v;"]),
        ("u,v,lod,dudx\n", &["found columns u,v,lod,dudx;"]),
        ("x,y,mip,lod\n", &["found columns x,y,mip,lod;"]),
        ("x,y,mip,pixel_x\n", &["pixel_x with pixel_y"]),
        (
            "x,y,mip,colour\n",
            &["column `colour`", "material,pixel_x,pixel_y"],
        ),
        ("x,y,mip,X\n", &["column `X`"]),
        ("x,y,mip,x\n", &["column `x`", "each once"]),
        ("1,2,3\n", &["column `1`"]),
        ("x,y,mip\n", &["no rows", "one or more"]),
        ("x,y,mip\n\n\n", &["no rows"]),
        ("x,y,mip\n1,2\n", &["row 1", "found 2 fields", "allowed: 3"]),
        ("x,y,mip\n1,2,0\n1,2,0,4\n", &["row 2", "found 4 fields"]),
        (
            "x,y,mip\n1,2,0\n1,,0\n",
            &["row 2", "column y", "found ``", "an integer"],
        ),
        (
            "x,y,mip\n1.0,2,0\n",
            &["row 1", "column x", "found `1.0`", "an integer"],
        ),
        ("x,y,mip\n1,2,zero\n", &["column mip", "found `zero`"]),
        (
            "x,y,mip\n64,2,0\n",
            &["row 1", "column x", "found 64", "0..=63"],
        ),
        ("x,y,mip\n-1,2,0\n", &["column x", "found -1", "0..=63"]),
        (
            "x,y,mip\n63,31,0\n0,16,1\n",
            &["row 2", "column y", "found 16", "0..=15"],
        ),
        ("x,y,mip\n0,0,7\n", &["column mip", "found 7", "0..=6"]),
        (
            "x,y,mip\n0,0,18446744073709551617\n",
            &["column mip", "found 18446744073709551617"],
        ),
        (
            "x,y,mip,material\n0,0,0,2\n",
            &["column material", "found 2", "0..=1"],
        ),
        (
            "x,y,mip,material\n0,0,5,1\n",
            &["column mip", "found 5", "0..=4"],
        ),
        (
            "x,y,mip,pixel_x,pixel_y\n0,0,0,4294967296,0\n",
            &["column pixel_x", "0..=4294967295"],
        ),
        (
            "u,v,lod\n0,0,0\n\n0,nan,0\n",
            &["row 2", "column v", "found NaN", "finite"],
        ),
        ("u,v,lod\n-inf,0,0\n", &["column u", "found -inf"]),
        (
            "u,v,lod\n0,0,1e39\n",
            &["column lod", "found inf as f32", "3.4028235e38"],
        ),
        (
            "u,v,lod\n0,0,0x10\n",
            &["column lod", "found `0x10`", "a number"],
        ),
        (
            "u,v,dudx,dvdx,dudy,dvdy\n0,0,0,0,0,nan\n",
            &["column dvdy", "found NaN"],
        ),
    ] {
        let found = refused(&file(&folder, "trace.csv", text));
        assert!(
            parts.iter().all(|part| found.contains(part)),
            "{text:?}: {found}"
        );
    }
}

#[test]
fn csv_that_is_no_text_or_has_no_lines_is_refused() {
    let folder = folder();
    let found = refused(&file(&folder, "a.csv", b"x,y,mip\n1,2,0\n\xff,2,0\n"));
    assert!(
        found.contains("row 2") && found.contains("UTF-8"),
        "{found}"
    );
    let found = refused(&file(&folder, "b.csv", b"x,y,mi\xfe\n1,2,0\n"));
    assert!(
        found.contains("header") && found.contains("UTF-8"),
        "{found}"
    );
    for bytes in [
        vec![b'7'; 1 << 20],
        [b"x,y,mip\n".as_slice(), &[b' '; 1 << 20]].concat(),
    ] {
        let found = refused(&file(&folder, "c.csv", bytes));
        assert!(found.contains("65536 bytes"), "{found}");
    }
}

#[test]
fn the_rows_before_a_wrong_one_are_read() {
    let (folder, materials) = (folder(), materials());
    let path = file(&folder, "a.csv", "x,y,mip\n1,2,0\n3,4,0\n99,0,0\n");
    let mut trace = TraceFile::open(&path, &materials).unwrap();
    let mut demand = Demand::default();
    assert!(trace.advance(&mut demand).unwrap() && trace.advance(&mut demand).unwrap());
    assert_eq!((demand.places[0].x(), trace.rows()), (7, 2));
    assert!(trace.advance(&mut demand).is_err());
}

#[test]
fn files_that_are_missing_or_have_another_name_are_refused() {
    let folder = folder();
    let found = refused(&folder.path().join("missing.csv"));
    assert!(found.contains("No such file"), "{found}");
    let found = refused(&folder.path().join("missing.parquet"));
    assert!(found.contains("No such file"), "{found}");
    for name in ["trace.txt", "trace"] {
        let found = refused(&file(&folder, name, "x,y,mip\n1,2,0\n"));
        assert!(found.contains(".csv or .parquet"), "{found}");
    }
}

fn int(declaration: &str, numbers: &[i32]) -> Written {
    (
        declaration.to_owned(),
        Numbers::Int32(numbers.to_vec()),
        Vec::new(),
    )
}

fn three(x: Written) -> Vec<Written> {
    vec![
        x,
        int("required int32 y", &[0, 0]),
        int("required int32 mip", &[0, 0]),
    ]
}

#[test]
fn parquet_errors_say_where_what_and_what_is_allowed() {
    let folder = folder();
    let of = |name: &str, numbers: Numbers, nulls: &[bool]| {
        three((name.to_owned(), numbers, nulls.to_vec()))
    };
    let int32 = |numbers: &[i32]| Numbers::Int32(numbers.to_vec());
    let text = Numbers::Text(vec!["0".to_owned(), "1".to_owned()]);
    let samples = |lod: f64| {
        let column = |name: &str, n: f64| {
            (
                format!("required double {name}"),
                Numbers::Double(vec![n]),
                Vec::new(),
            )
        };
        vec![column("u", 0.5), column("v", 0.5), column("lod", lod)]
    };
    for (columns, parts) in [
        (
            vec![int("required int32 x", &[1])],
            &["found columns x;", "x,y,mip or"][..],
        ),
        (of("required int32 z", int32(&[0, 1]), &[]), &["column `z`"]),
        (
            of("required float x", Numbers::Float(vec![0.0; 2]), &[]),
            &["column x", "FLOAT", "INT32 or INT64"],
        ),
        (
            of("required binary x (UTF8)", text.clone(), &[]),
            &["column x", "BYTE_ARRAY"],
        ),
        (
            of("required int32 x (DATE)", int32(&[0, 1]), &[]),
            &["column x", "Date", "INT32"],
        ),
        (of("required int32 x", int32(&[]), &[]), &["no rows"]),
        (
            of("required int32 x", int32(&[0, 64]), &[]),
            &["row 2", "column x", "found 64", "0..=63"],
        ),
        (
            of("required int32 x", int32(&[0, -1]), &[]),
            &["row 2", "column x", "found -1"],
        ),
        (
            of("required int32 x (UINT_32)", int32(&[0, -1]), &[]),
            &["row 2", "found 4294967295"],
        ),
        (
            of("optional int32 x", int32(&[0, 0]), &[false, true]),
            &["row 2", "column x", "null"],
        ),
        (samples(f64::NAN), &["row 1", "column lod", "NaN"]),
        (samples(1e300), &["row 1", "column lod", "found inf as f32"]),
    ] {
        let found = refused(&file(&folder, "trace.parquet", parquet(&columns, PLAIN)));
        assert!(
            parts.iter().all(|part| found.contains(part)),
            "{parts:?}: {found}"
        );
    }
    let nested = int(
        "required group g { required int32 y; } required int32 z",
        &[],
    );
    let found = refused(&file(&folder, "trace.parquet", parquet(&[nested], PLAIN)));
    assert!(found.contains("column `g.y`"), "{found}");
}

#[test]
fn integers_of_parquet_are_levels_and_coordinates_too() {
    let (folder, materials) = (folder(), materials());
    let columns = ["u", "v", "lod"].map(|name| int(&format!("optional int32 {name}"), &[1, 2, 3]));
    let form = Form {
        group_rows: 2,
        ..PLAIN
    };
    let parquet = file(&folder, "a.parquet", parquet(&columns, form));
    let csv = file(&folder, "a.csv", "u,v,lod\n1,1,1\n2,2,2\n3,3,3\n");
    assert_eq!(
        read(&parquet, &materials).unwrap(),
        read(&csv, &materials).unwrap()
    );
}

/// One row, u = v = 0.5 and lod = 1 as FLOAT, from pyarrow 26's `write_table`.
const BY_PYARROW: [(&str, &[u8]); 2] = [
    ("snappy", include_bytes!("pyarrow.parquet")),
    ("zstd", include_bytes!("zstd.parquet")),
];

#[test]
fn files_of_another_writer_are_read_and_its_other_compressions_are_named() {
    let (folder, materials) = (folder(), materials());
    let [snappy, zstd] =
        BY_PYARROW.map(|(name, bytes)| file(&folder, &format!("{name}.parquet"), bytes));
    let csv = file(&folder, "a.csv", "u,v,lod\n0.5,0.5,1\n");
    let expected = read(&csv, &materials).unwrap();
    assert_eq!(read(&snappy, &materials).unwrap(), expected);
    let found = refused(&zstd);
    for part in ["column u", "ZSTD", "UNCOMPRESSED, SNAPPY"] {
        assert!(found.contains(part), "{found}");
    }
}
