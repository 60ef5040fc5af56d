//! Settings: the training configuration that the flags ask for.

use super::{Encode, smaller};
use anyhow::Context as _;
use ntmu::isa::position::{AddressMode, CornerSnap};
use ntmu::trainer::{
    EFFORTS, PYRAMIDS, Plan, Precision, Preset, Source, TrainConfig, TrainingDevice,
};
use std::path::Path;

impl Encode {
    /// What the flags say before the set is known.
    pub(super) fn config(&self) -> anyhow::Result<TrainConfig> {
        let mut config = Preset::by_name(&self.preset)?.config();
        let named = EFFORTS
            .iter()
            .find(|(name, _)| *name == self.effort)
            .map(|(_, effort)| *effort);
        let effort = named.or_else(|| self.effort.parse().ok().filter(|&effort| effort <= 100));
        let effort = effort.with_context(|| {
            let names = EFFORTS.map(|(name, _)| name).join(", ");
            format!(
                "effort: found {:?}; allowed: 0 to 100, {names}",
                self.effort
            )
        })?;
        config = config.with_effort(effort);
        config.seed = self.seed;
        if let Some(path) = &self.config {
            config = replaced(&config, path).with_context(|| path.display().to_string())?;
        }
        if let Some(plan) = &self.plan {
            config.plan = Some(plan_of(plan)?);
        }
        config.weights.extend(self.weight.iter().cloned());
        config.rate_factor = self.rate_factor.unwrap_or(config.rate_factor);
        config.seconds = self.time.or(config.seconds);
        config.settle = self.settle.or(config.settle);
        config.target_psnr = self.target_psnr.or(config.target_psnr);
        self.shape(&mut config)?;
        config.validate()?;
        Ok(config)
    }

    /// What they say once it is.
    pub(super) fn config_for(
        &self,
        source: &Source,
        mut config: TrainConfig,
        device: &TrainingDevice,
    ) -> anyhow::Result<TrainConfig> {
        if self.no_encoder {
            config.plan = Some(config.plan_for(&source.sizes()).without_encoder());
        }
        if let Some(steps) = &self.steps {
            let steps: Vec<u64> = steps
                .split('+')
                .map(|number| number.trim().parse())
                .collect::<Result<_, _>>()
                .with_context(|| format!("steps: found {steps:?}; allowed: `0+3000+1000`"))?;
            config.plan = Some(config.plan_for(&source.sizes()).with_steps(&steps)?);
        }
        if let Some(most) = self.max_bytes {
            config = smaller::fitted(source, config, device, most)?;
        }
        config.validate()?;
        Ok(config)
    }

    /// The shape of grids and synthesizer.
    fn shape(&self, config: &mut TrainConfig) -> anyhow::Result<()> {
        if let Some(hidden) = &self.hidden {
            config.hidden.clone_from(hidden);
        }
        if let Some(name) = &self.pyramid {
            config.pyramid = named("pyramid", name, PYRAMIDS)?;
        }
        if let Some(name) = &self.snap {
            config.snap = named("snap", name, CornerSnap::ALL.map(|s| (s.name(), s.into())))?;
        }
        if let Some(name) = &self.address {
            config.address = named(
                "address",
                name,
                AddressMode::ALL.map(|a| (a.name(), a.into())),
            )?;
        }
        if let Some(blocks) = self.blocks {
            config.residual_blocks = blocks;
        }
        if let Some(channels) = &self.grids {
            let [first, second] = channels.as_slice() else {
                anyhow::bail!(
                    "grids: found {} numbers; allowed: two, `8,16`",
                    channels.len()
                );
            };
            config.grids[0].channels = *first;
            config.grids[1].channels = *second;
        }
        if let Some(bits) = self.latent_bits {
            config.grids[0].bits = bits;
            config.grids[1].bits = bits;
        }
        if let Some(name) = &self.precision {
            let known = [Precision::Int8, Precision::Fp16];
            config.precision = named("precision", name, known.map(|p| (p.name(), p)))?;
        }
        if let Some(bits) = self.activation_bits {
            config.activation_bits = bits;
        }
        match self.weight_bits.as_deref() {
            None => {}
            Some([bits]) => {
                config.weight_bits = *bits;
                config.weight_bits_per_layer = None;
            }
            Some(bits) => config.weight_bits_per_layer = Some(bits.to_vec()),
        }
        Ok(())
    }
}

/// The choice with this name.
fn named<T: Copy, const N: usize>(
    field: &str,
    name: &str,
    choices: [(&str, T); N],
) -> anyhow::Result<T> {
    let found = choices.iter().find(|(known, _)| *known == name);
    found.map(|(_, choice)| *choice).with_context(|| {
        let names = choices.map(|(known, _)| known).join(", ");
        format!("{field}: found {name:?}; allowed: {names}")
    })
}

/// A plan by name, or the one in a file.
fn plan_of(name: &str) -> anyhow::Result<Plan> {
    if Plan::names().any(|known| known == name) {
        return Ok(Plan::by_name(name)?);
    }
    let text = std::fs::read_to_string(name).with_context(|| {
        let names: Vec<&str> = Plan::names().collect();
        format!(
            "plan: found {name:?}; allowed: {}, or a TOML file",
            names.join(", ")
        )
    })?;
    Plan::parse(&text).with_context(|| name.to_owned())
}

/// The configuration with the fields that a TOML file holds.
fn replaced(config: &TrainConfig, path: &Path) -> anyhow::Result<TrainConfig> {
    let fields: serde_json::Map<String, serde_json::Value> =
        toml::from_str(&std::fs::read_to_string(path)?)?;
    let mut value = serde_json::to_value(config)?;
    for (name, field) in fields {
        value[name] = field;
    }
    Ok(serde_json::from_value(value)?)
}
