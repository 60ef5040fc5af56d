//! Consistent: which numbers and choices fit together.

use super::{Configuration, Range, UnitError, Value};
use crate::time::choice::{CacheKind, Replacement};

/// Whether a unit can be built so.
pub(super) fn check(c: &Configuration) -> Result<(), UnitError> {
    in_range(c)?;
    powers_of_two(c)?;
    multiples(c)?;
    large_enough(c)?;
    small_enough(c)
}

fn in_range(c: &Configuration) -> Result<(), UnitError> {
    for (field, value) in c.fields() {
        // A choice is one of its own by its type.
        if let (Range::Number { low, high }, Value::Number(found)) = (field.range, value)
            && !(low..=high).contains(&found)
        {
            return Err(UnitError::Range {
                field: field.name,
                found: i64::from(found),
                low,
                high,
            });
        }
    }
    Ok(())
}

fn powers_of_two(c: &Configuration) -> Result<(), UnitError> {
    let tree = c.replacement == Replacement::TreePlru;
    let by_tree = ", as replacement is tree-plru";
    for (is_asked, field, found, because) in [
        (true, "line_bytes", c.line_bytes, ""),
        (true, "cache_sets", c.cache_sets, ""),
        (true, "cache_banks", c.cache_banks, ""),
        (true, "burst_bytes", c.burst_bytes, ""),
        (true, "decoded_block_side", c.decoded_block_side, ""),
        (c.level2_sets > 0, "level2_sets", c.level2_sets, ""),
        (tree, "cache_ways", c.cache_ways, by_tree),
        (
            tree && c.level2_sets > 0,
            "level2_ways",
            c.level2_ways,
            by_tree,
        ),
    ] {
        if is_asked && !found.is_power_of_two() {
            return Err(UnitError::PowerOfTwo {
                field,
                found,
                because,
            });
        }
    }
    Ok(())
}

fn multiples(c: &Configuration) -> Result<(), UnitError> {
    for (field, found, of, allowed) in [
        (
            "batch_texels",
            c.batch_texels,
            "coalesced_texels",
            c.coalesced_texels,
        ),
        (
            "decoded_cache_blocks",
            c.decoded_cache_blocks,
            "decoded_cache_ways",
            c.decoded_cache_ways,
        ),
    ] {
        if !found.is_multiple_of(allowed) {
            return Err(UnitError::Multiple {
                field,
                found,
                of,
                allowed,
            });
        }
    }
    Ok(())
}

fn large_enough(c: &Configuration) -> Result<(), UnitError> {
    let group = (c.coalesced_texels, "one coalesced group");
    let job = (c.job_texels(), "one job");
    for (field, found, (allowed, holds)) in [
        ("request_queue_texels", c.request_queue_texels, group),
        ("corner_fifo_texels", c.corner_fifo_texels, group),
        ("output_queue_pixels", c.output_queue_pixels, job),
    ] {
        if found < allowed {
            return Err(UnitError::Capacity {
                field,
                found,
                holds,
                allowed,
            });
        }
    }
    Ok(())
}

fn small_enough(c: &Configuration) -> Result<(), UnitError> {
    let level2_latency = if c.level2_sets > 0 {
        c.level2_latency_cycles
    } else {
        0
    };
    for (field, found, allowed, because) in [
        (
            "cache_banks",
            c.cache_banks,
            c.cache_sets,
            "its cache_sets, so that no bank is empty",
        ),
        (
            "level2_latency_cycles",
            c.level2_latency_cycles,
            level2_latency,
            "as level2_sets is 0",
        ),
    ] {
        if found > allowed {
            return Err(UnitError::Excess {
                field,
                found,
                allowed,
                because,
            });
        }
    }
    Ok(())
}

/// Why a field has no effect in this configuration; none if it has one.
pub(super) fn idle(c: &Configuration, field: &str) -> Option<&'static str> {
    let no_level2 = (c.level2_sets == 0).then_some("level2_sets is 0");
    let no_sets = match c.cache {
        CacheKind::Finite => None,
        CacheKind::None => Some("cache is none"),
        CacheKind::Infinite => Some("cache is infinite"),
    };
    match field {
        "level2_ways" | "level2_latency_cycles" | "level2_bytes_per_cycle" => no_level2,
        "decoded_cache_ways" | "decoded_block_side" => {
            (c.decoded_cache_blocks == 0).then_some("decoded_cache_blocks is 0")
        }
        "cache_sets" | "cache_ways" => no_sets,
        "replacement" => no_sets.and(no_level2),
        _ => None,
    }
}
