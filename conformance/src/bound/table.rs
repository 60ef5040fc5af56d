//! How far a table's entry moves when its index does.

use crate::oracle::synthesizer::table_entry;

/// The largest |entry − straight line| over the indices that a device may take: those whose real
/// lies in `low..=high`, moved by at most `error`. With one index, `low` = `high`, it is reached.
pub(super) fn error(table: &[i16], (low, high): (f64, f64), error: f64) -> f64 {
    let limit = |index: f64| index.clamp(-128.0, 127.0);
    let (first, last) = (limit((low - error).ceil()), limit((high + error).floor()));
    let taken = (first as i32..=last as i32).map(|index| table_entry(table, f64::from(index)));
    let (low, high) = (limit(low), limit(high));
    // A straight line between entries: its extremes are at the ends and at the entries inside.
    let inside = (low.ceil() as i32..=high.floor() as i32).map(f64::from);
    let reals = inside.chain([low, high]).map(|at| table_entry(table, at));
    let span = |values: &mut dyn Iterator<Item = f64>| {
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(value), high.max(value))
        })
    };
    let (taken, reals) = (span(&mut taken.into_iter()), span(&mut reals.into_iter()));
    (taken.1 - reals.0).max(reals.1 - taken.0).max(0.0)
}

/// The slope of the table at an index, in entries to an index.
pub(super) fn slope(table: &[i16], index: f64) -> f64 {
    let below = index.floor().clamp(-128.0, 126.0);
    table_entry(table, below + 1.0) - table_entry(table, below)
}
