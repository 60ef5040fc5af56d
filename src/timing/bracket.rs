//! Bracket: a run beside the same run without a cache, and with an infinite one.
//!
//! What lies between the two is what a latent cache can do; where the run lies between them is how
//! much of it this one does.

use super::counts::Counts;
use super::source::{Source, Told};
use super::summary::Summary;
use crate::access::AccessError;
use crate::model::Material;
use crate::model::time::{self, Timing, Unit, Watch};
use serde::Serialize;

/// The same demands on the same unit with other caches.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Brackets {
    /// Every line comes from memory, once for each fetch of a group.
    pub no_cache: Summary,
    /// Every line comes from memory once.
    pub infinite_cache: Summary,
}

/// The units of the brackets: without a cache, and with an infinite one.
#[must_use]
pub fn units(unit: &Unit) -> [Unit; 2] {
    [unit.without_cache(), unit.with_infinite_cache()]
}

/// A whole run, and its brackets if they are wanted.
#[derive(Debug)]
pub struct Whole {
    /// The run.
    pub timing: Timing,
    /// What it did.
    pub counts: Counts,
    /// Its brackets.
    pub brackets: Option<Brackets>,
}

/// Runs all demands of a source, behind a warm-up if `measure_after` is not 0; see
/// [`time::simulate_behind`]. `watch` sees the run, not its brackets. `tell` is called with the pixels
/// that went in since it was called last, those of the brackets too; it is the only thing that
/// depends on the threads.
///
/// # Errors
/// When the trace file cannot be read any more.
pub fn whole(
    unit: &Unit,
    materials: &[Material<'_>],
    source: &Source<'_>,
    measure_after: u64,
    with_brackets: bool,
    watch: Option<&mut (impl Watch + Send)>,
    tell: &(dyn Fn(u64) + Sync),
) -> Result<Whole, AccessError> {
    let run = |unit: &Unit| {
        let mut demands = Told::new(source.demands()?, tell);
        time::simulate(unit, materials, &mut demands, &mut ())
    };
    let watched = || {
        let mut demands = Told::new(source.demands()?, tell);
        match watch {
            None => time::simulate_behind(unit, materials, &mut demands, measure_after),
            Some(watch) => {
                let mut timing = time::simulate(unit, materials, &mut demands, watch)?;
                if measure_after > 0 {
                    let mut again = source.demands()?;
                    let behind = time::simulate_behind(unit, materials, &mut again, measure_after)?;
                    timing.measured = behind.measured;
                }
                Ok(timing)
            }
        }
    };
    let brackets = || {
        if !with_brackets {
            return Ok(None);
        }
        let [none, infinite] = units(unit);
        let (first, second) = rayon::join(|| run(&none), || run(&infinite));
        Ok(Some(Brackets {
            no_cache: Summary::of(&first?, &none),
            infinite_cache: Summary::of(&second?, &infinite),
        }))
    };
    let (timing, brackets) = rayon::join(watched, brackets);
    let timing = timing?;
    Ok(Whole {
        counts: Counts::of(&timing, unit),
        timing,
        brackets: brackets?,
    })
}
