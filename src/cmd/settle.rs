//! `ntmu settle`: an asset's latents, one code up or down where it then decodes better.

use std::path::PathBuf;

/// The synthesizer stays as it is. `encode` ends with this; it is for assets that came another way:
/// converted to fewer bits, or trained by somebody else.
#[derive(clap::Args)]
pub(crate) struct Settle {
    /// The asset, an .ntx file.
    asset: PathBuf,
    /// The texture set that it was made from: a folder of images, or a TOML manifest.
    source: PathBuf,
    /// The asset to write.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Rounds; one in which nothing moves is the last.
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=100))]
    rounds: u32,
    /// How much a map's error counts, `normal=2`; 1 without it. Can be repeated.
    #[arg(long, value_name = "MAP=WEIGHT", value_parser = super::encode::weight)]
    weight: Vec<(String, f64)>,
}

#[cfg(not(feature = "train"))]
impl Settle {
    pub(crate) fn run(self, _json: bool) -> anyhow::Result<crate::Verdict> {
        let Settle {
            asset,
            source,
            output,
            rounds,
            ..
        } = self;
        anyhow::bail!(
            "this build has no trainer. It comes with\n  cargo run --release --features train -- \
             settle {} {} -o {} --rounds {rounds}",
            asset.display(),
            source.display(),
            output.display()
        )
    }
}

#[cfg(feature = "train")]
mod training {
    use super::Settle;
    use crate::Verdict;
    use crate::cmd::compare::source_of;
    use crate::{console, files};
    use anyhow::Context as _;
    use ntmu::decoded::Decoded;
    use ntmu::isa::Asset;
    use ntmu::quality::{self, Quality};
    use ntmu::texture_set::TextureSet;
    use ntmu::trainer;
    use ntmu::training_source::training_source;
    use serde_json::json;
    use std::sync::atomic::AtomicBool;

    impl Settle {
        pub(crate) fn run(self, json: bool) -> anyhow::Result<Verdict> {
            let asset = files::read_asset(&self.asset)?;
            let set = TextureSet::read(&self.source)?;
            let reference = source_of(&asset, &set)?;
            let mut source = training_source(&set);
            drop(set);
            source.mips.truncate(reference.len());
            let measure = |asset: &Asset| {
                let reals = Decoded::of(asset, |_| ()).reals(&asset.shape);
                Quality::measure(&reference, &reals, &quality::maps_of(asset))
            };
            let before = measure(&asset)?;
            let weights = self.weight.iter().cloned().collect();
            let bar = console::progress(u64::from(self.rounds), "settling");
            let settled = trainer::settle(
                &asset,
                &source,
                &weights,
                self.rounds,
                &AtomicBool::new(false),
                &mut |_| bar.inc(1),
            );
            bar.finish_and_clear();
            let (settled, rounds) = settled.with_context(|| self.asset.display().to_string())?;
            let settled = recorded(settled, rounds.len())?;
            let after = measure(&settled)?;
            files::write(&self.output, &settled.to_bytes())?;
            let output = self.output.display().to_string();
            if json {
                console::print_json(&json!({
                    "output": output, "before": before, "quality": after, "rounds": rounds,
                    "bppc": quality::bppc(&settled), "profile": settled.profile.identity(),
                }))?;
            } else {
                let moved: u64 = rounds.iter().map(|round| round.moved).sum();
                console::print(&format!(
                    "{output}: {:.2} dB instead of {:.2}, {moved} moves of latents in {} rounds",
                    after.overall.psnr,
                    before.overall.psnr,
                    rounds.len()
                ));
            }
            Ok(Verdict::Fine)
        }
    }

    /// The asset with the rounds added to its record. What the record says of its quality no longer
    /// holds and goes.
    fn recorded(asset: Asset, rounds: usize) -> anyhow::Result<Asset> {
        let mut parts = asset.into_parts();
        let record = &mut parts.metadata.record;
        record.retain(|(key, _)| !key.starts_with("psnr"));
        match record.iter_mut().find(|(key, _)| key == "settle") {
            Some((_, value)) => value.push_str(&format!("+{rounds}")),
            None => record.push(("settle".to_owned(), rounds.to_string())),
        }
        Ok(Asset::new(parts)?)
    }
}
