//! `ntmu simulate`: the cycles of a unit for what a renderer asks.

mod outputs;
mod print;

use super::profile::ProfileChoice;
use super::unit;
use crate::Verdict;
use crate::{console, files};
use anyhow::{Context as _, bail};
use ntmu::access::write_csv;
use ntmu::isa::layout::Layout;
use ntmu::isa::sampler::{Filter, MipFilter, Order, Sampler};
use ntmu::model::stream::{AccessSpec, Interleave};
use ntmu::model::time::energy::EnergyTable;
use ntmu::timing::bracket::{self, Brackets};
use ntmu::timing::counts::Counts;
use ntmu::timing::sampling::{self, Plan, Sample, Sampling};
use ntmu::timing::setup::{Choices, Identities, Setup};
use ntmu::timing::source::Source;
use ntmu::timing::summary::{EnergyRows, LedgerRow, Summary};
use outputs::Outputs;
use serde::Serialize;
use std::path::PathBuf;

#[derive(clap::Args)]
pub(crate) struct Simulate {
    /// The assets, .ntx files, a material each; the built-in one without.
    #[arg(value_name = "ASSET")]
    assets: Vec<PathBuf>,
    /// Take the assets so often, each time as materials of their own.
    #[arg(long, value_name = "COUNT", default_value_t = 1)]
    copies: u32,
    /// The hardware: a preset's name (see `ntmu unit`), or a TOML file.
    #[arg(long, default_value = "desktop")]
    unit: String,
    /// Change a field of the unit first. May be given more than once.
    #[arg(long = "set", value_name = "FIELD=VALUE")]
    changes: Vec<String>,
    #[command(flatten)]
    profile: ProfileChoice,
    /// What is asked for: quad, plane or sphere (scenes); raster, blocks, zorder or random (texel
    /// scans); each with options, as plane:pitch=20,order=raster; or a .csv or .parquet file.
    #[arg(long, default_value = "plane")]
    access: AccessSpec,
    /// Where memory keeps the grids.
    #[arg(long, default_value_t = Layout::TILED)]
    layout: Layout,
    /// Pixels of a scene's screen [default: 1920x1080]
    #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = size)]
    size: Option<[u32; 2]>,
    /// How materials share a scene's screen: quads, tiles:N or random:N:SEED [default: tiles:32]
    #[arg(long)]
    interleave: Option<Interleave>,
    /// A TOML file with a sampler's state; the options below replace its keys.
    #[arg(long, value_name = "FILE")]
    sampler: Option<PathBuf>,
    /// Within a mip and between mips [default: trilinear]
    #[arg(long, value_enum)]
    filter: Option<FilterName>,
    /// The most probes of an anisotropic footprint [default: 1]
    #[arg(long, value_name = "PROBES")]
    anisotropy: Option<u8>,
    /// What comes first [default: decode-then-filter]
    #[arg(long, value_enum)]
    order: Option<OrderName>,
    /// Take one texel of each footprint, chosen at random.
    #[arg(long)]
    stochastic: bool,
    /// How much of the stream is run: auto (all of a short one, else a sample), off, or the share
    /// that a sample measures.
    #[arg(long, value_name = "auto|SHARE|off", default_value = "auto")]
    sample: Sampling,
    /// Same seed, same sample.
    #[arg(long, default_value_t = 0)]
    seed: u32,
    /// Pixels that only warm up: of the whole run [default: 0], or of each segment of a sample
    /// [default: 8192]
    #[arg(long, value_name = "PIXELS")]
    measure_after: Option<u64>,
    /// Do not run the same without a cache and with an infinite one.
    #[arg(long)]
    no_brackets: bool,
    /// Price the operations by a published table of energies: a built-in one (energy, energy-7nm),
    /// or a TOML file.
    #[arg(
        long,
        value_name = "TABLE",
        num_args = 0..=1,
        require_equals = true,
        default_missing_value = "energy"
    )]
    energy: Option<String>,
    /// Write what is asked for as a trace file, to be read with the same assets.
    #[arg(long, value_name = "FILE")]
    write_trace: Option<PathBuf>,
    #[command(flatten)]
    outputs: Outputs,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum FilterName {
    /// One texel of the nearest mip.
    Point,
    /// Four texels of the nearest mip.
    Bilinear,
    /// Four texels of two mips each.
    Trilinear,
    /// Four texels of mip 0, however far away.
    Base,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum OrderName {
    DecodeThenFilter,
    FilterThenDecode,
}

/// `1920x1080`.
fn size(text: &str) -> Result<[u32; 2], String> {
    let parts = text.split_once('x').map(|(w, h)| (w.parse(), h.parse()));
    match parts {
        Some((Ok(width), Ok(height))) => Ok([width, height]),
        Some(_) | None => Err(format!("found `{text}`; allowed: WIDTHxHEIGHT, 1920x1080")),
    }
}

/// What comes out.
#[derive(Serialize)]
struct Results {
    identities: Identities,
    /// What the estimate rests on, if it is one.
    sample: Option<Sample>,
    run: Summary,
    /// The whole run without its first pixels.
    behind_warm_up: Option<Behind>,
    brackets: Option<Brackets>,
    energy: Option<EnergyRows>,
}

#[derive(Serialize)]
struct Behind {
    warm_up_pixels: u64,
    pixels: u64,
    cycles: u64,
    cycles_per_block: f64,
    ledger: Vec<LedgerRow>,
}

impl Simulate {
    pub(crate) fn run(self, json: bool) -> anyhow::Result<Verdict> {
        let table = self.energy.as_deref().map(unit::find_table).transpose()?;
        let setup = self.setup()?;
        let source = Source::new(&setup)?;
        let plan = self.plan(&source)?;
        if let Some(path) = &self.write_trace {
            let Some(stream) = source.stream() else {
                bail!("--write-trace: found an access that is a file; allowed: a scene or a scan");
            };
            let rows = write_csv(stream, path)?;
            console::note(&format!("{}: {rows} rows", path.display()));
        }
        let results = match plan {
            Some(plan) => self.estimated(&setup, &source, &plan, table.as_ref())?,
            None => self.whole(&setup, &source, table.as_ref())?,
        };
        if json {
            console::print_json(&results)?;
        } else {
            print::results(&results);
        }
        Ok(Verdict::Fine)
    }

    fn setup(&self) -> anyhow::Result<Setup> {
        let unit = unit::change(&unit::find(&self.unit)?, &self.changes)?;
        self.refuse_idle()?;
        let mut assets = Vec::new();
        for path in &self.assets {
            assets.push(self.profile.apply(files::read_asset(path)?)?);
        }
        if assets.is_empty() {
            assets.push(self.profile.apply(ntmu::built_in::asset()?)?);
        }
        Ok(Setup::new(Choices {
            unit,
            assets,
            copies: self.copies,
            layout: self.layout,
            access: self.access.clone(),
            sampler: self.sampler()?,
            screen: self.size.unwrap_or([1920, 1080]),
            interleave: self.interleave.unwrap_or(Interleave::Turns { side: 32 }),
        })?)
    }

    /// Options that this access would not look at.
    fn refuse_idle(&self) -> anyhow::Result<()> {
        let of_samples = [
            ("--sampler", self.sampler.is_some()),
            ("--filter", self.filter.is_some()),
            ("--anisotropy", self.anisotropy.is_some()),
            ("--order", self.order.is_some()),
            ("--stochastic", self.stochastic),
        ];
        let of_screens = [
            ("--size", self.size.is_some()),
            ("--interleave", self.interleave.is_some()),
        ];
        let (idle, needed) = match &self.access {
            AccessSpec::Scene(_) => return Ok(()),
            AccessSpec::File(_) => (of_screens.to_vec(), "a scene"),
            AccessSpec::Texels(_) => {
                let idle = of_screens.into_iter().chain(of_samples);
                (
                    idle.collect(),
                    "a scene, or for a sampler's options a file of samples",
                )
            }
        };
        match idle.iter().find(|(_, is_given)| *is_given) {
            Some((option, _)) => bail!(
                "{option}: found access {}, on which it has no effect; allowed: {needed}",
                self.access
            ),
            None => Ok(()),
        }
    }

    fn sampler(&self) -> anyhow::Result<Sampler> {
        let mut sampler = match &self.sampler {
            None => Sampler::default(),
            Some(path) => {
                let context = || path.display().to_string();
                let text = std::fs::read_to_string(path).with_context(context)?;
                toml::from_str(&text).with_context(context)?
            }
        };
        if let Some(filter) = self.filter {
            (sampler.filter, sampler.mip_filter) = match filter {
                FilterName::Point => (Filter::Point, MipFilter::Point),
                FilterName::Bilinear => (Filter::Linear, MipFilter::Point),
                FilterName::Trilinear => (Filter::Linear, MipFilter::Linear),
                FilterName::Base => (Filter::Linear, MipFilter::Base),
            };
        }
        if let Some(order) = self.order {
            sampler.order = match order {
                OrderName::DecodeThenFilter => Order::DecodeThenFilter,
                OrderName::FilterThenDecode => Order::FilterThenDecode,
            };
        }
        if let Some(probes) = self.anisotropy {
            sampler.max_anisotropy = probes;
        }
        sampler.stochastic |= self.stochastic;
        Ok(sampler)
    }

    /// The sample; none where all is run.
    fn plan(&self, source: &Source<'_>) -> anyhow::Result<Option<Plan>> {
        let sampling = match (self.outputs.given(), self.sample) {
            (None, sampling) => sampling,
            (Some(_), Sampling::Auto | Sampling::Off) => Sampling::Off,
            (Some(option), Sampling::Share(share)) if share < 1.0 => bail!(
                "{option}: found --sample {share}; allowed: --sample off, as it shows a whole run"
            ),
            (Some(_), Sampling::Share(_)) => Sampling::Off,
        };
        let warm_up = self.measure_after.unwrap_or(sampling::WARM_UP_PIXELS);
        let plan = Plan::new(source, sampling, warm_up, self.seed);
        let (found, most) = (self.measure_after.unwrap_or(0), source.most_pixels());
        if found >= most {
            bail!("--measure-after: found {found}; allowed: fewer than the stream's {most} pixels");
        }
        Ok(plan)
    }

    fn whole(
        &self,
        setup: &Setup,
        source: &Source<'_>,
        table: Option<&EnergyTable>,
    ) -> anyhow::Result<Results> {
        let (unit, materials) = (setup.unit(), setup.materials());
        let runs = if self.no_brackets { 1 } else { 3 };
        let bar = console::progress(source.most_pixels() * runs, "pixels");
        let tell = |pixels| bar.inc(pixels);
        let mut outputs = self.outputs.open(unit)?;
        let watch = self.outputs.given().map(|_| &mut outputs.watches);
        let after = self.measure_after.unwrap_or(0);
        let brackets = !self.no_brackets;
        let whole = bracket::whole(unit, &materials, source, after, brackets, watch, &tell)?;
        bar.finish_and_clear();
        let timing = &whole.timing;
        if after > 0 && timing.measured.pixels == 0 {
            let asked = timing.pixels;
            bail!(
                "--measure-after: found {after}; allowed: fewer than the {asked} pixels that ask, \
                 so that a job is left to measure"
            );
        }
        for (path, shown) in outputs.keep()? {
            let (path, from, to, cycles) = (path.display(), shown.from, shown.to, shown.cycles);
            console::note(&format!(
                "{path} shows cycles {from}..{to} of {cycles}; --cycles chooses others"
            ));
        }
        let behind = (after > 0).then(|| {
            let counts = Counts::default().behind_warm_up(timing);
            let summary = Summary::of_parts(&counts, unit);
            Behind {
                warm_up_pixels: timing.pixels - counts.timed_pixels,
                pixels: counts.timed_pixels,
                cycles: counts.cycles,
                cycles_per_block: summary.throughput.cycles_per_block,
                ledger: summary.ledger,
            }
        });
        Ok(Results {
            identities: setup.identities(),
            sample: None,
            run: Summary::of(timing, unit),
            behind_warm_up: behind,
            brackets: whole.brackets,
            energy: table.map(|table| EnergyRows::of(&whole.counts, unit, table)),
        })
    }

    fn estimated(
        &self,
        setup: &Setup,
        source: &Source<'_>,
        plan: &Plan,
        table: Option<&EnergyTable>,
    ) -> anyhow::Result<Results> {
        let (unit, materials) = (setup.unit(), setup.materials());
        let bar = console::progress(sampling::steps(plan), "segments");
        let tell = |segments| bar.inc(segments);
        let brackets = !self.no_brackets;
        let found = sampling::estimate(unit, &materials, source, plan, brackets, &tell)?;
        bar.finish_and_clear();
        Ok(Results {
            identities: setup.identities(),
            run: Summary::of_parts(&found.counts, unit),
            sample: Some(found.sample),
            behind_warm_up: None,
            brackets: found.brackets,
            energy: table.map(|table| EnergyRows::of(&found.counts, unit, table)),
        })
    }
}
