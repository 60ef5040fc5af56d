//! `ntmu sample`: an asset at normalised coordinates.

use super::profile::ProfileChoice;
use crate::Verdict;
use crate::{console, files};
use anyhow::Context as _;
use ntmu::isa::layout::Layout;
use ntmu::isa::sampler::plan::{Probe, Spot, Square};
use ntmu::isa::sampler::{
    Address, Detail, Filter, MipBlend, MipFilter, Order, SampleRequest, Sampler,
};
use ntmu::isa::{Asset, Program};
use ntmu::model::exec::Decoder;
use ntmu::model::sampler::{Probes, Texture};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use std::path::PathBuf;

/// Coordinates, levels and gradients are f32 numbers (also nan and inf), or f32 bits as 0x….
#[derive(clap::Args)]
#[command(allow_negative_numbers = true)]
pub(crate) struct Sample {
    /// The asset, an .ntx file.
    asset: PathBuf,
    /// Across the texture, 0 to 1.
    #[arg(value_parser = float_bits)]
    u: u32,
    /// Down the texture, 0 to 1.
    #[arg(value_parser = float_bits)]
    v: u32,
    /// The level of detail.
    #[arg(long, default_value = "0", value_parser = float_bits)]
    lod: u32,
    /// du/dx,dv/dx,du/dy,dv/dy instead of a level of detail.
    #[arg(long, value_delimiter = ',', value_parser = float_bits, conflicts_with = "lod")]
    gradients: Option<Vec<u32>>,
    /// A TOML file with a sampler's state; the options below replace its keys.
    #[arg(long, value_name = "FILE")]
    sampler: Option<PathBuf>,
    /// point or linear.
    #[arg(long, value_parser = choice::<Filter>)]
    filter: Option<Filter>,
    /// base, point or linear.
    #[arg(long, value_parser = choice::<MipFilter>)]
    mip_filter: Option<MipFilter>,
    /// wrap, mirror, mirror-once, clamp or border; along both axes.
    #[arg(long, value_parser = choice::<Address>)]
    address: Option<Address>,
    /// decode-then-filter or filter-then-decode.
    #[arg(long, value_parser = choice::<Order>)]
    order: Option<Order>,
    /// codes or level: how two mips are joined where the filter comes first.
    #[arg(long, value_parser = choice::<MipBlend>)]
    mip_blend: Option<MipBlend>,
    /// The most probes of an anisotropic footprint.
    #[arg(long, value_name = "PROBES")]
    max_anisotropy: Option<u8>,
    /// Take one texel of the footprint, chosen by these random bits.
    #[arg(long, value_name = "BITS")]
    random: Option<u64>,
    /// Gather this channel's four texels instead of filtering.
    #[arg(long, value_name = "CHANNEL")]
    gather: Option<usize>,
    #[command(flatten)]
    profile: ProfileChoice,
}

/// The bits of an f32 number.
fn float_bits(text: &str) -> Result<u32, String> {
    match text.strip_prefix("0x") {
        Some(digits) => u32::from_str_radix(digits, 16).map_err(|e| e.to_string()),
        None => text.parse().map(f32::to_bits).map_err(|e| e.to_string()),
    }
}

/// A choice by the name that files use.
fn choice<T: DeserializeOwned>(name: &str) -> Result<T, String> {
    serde_json::from_value(Value::from(name)).map_err(|e| e.to_string())
}

impl Sample {
    pub(crate) fn run(self, json: bool) -> anyhow::Result<Verdict> {
        let asset = self.profile.apply(files::read_asset(&self.asset)?)?;
        let request = self.request()?;
        let sampler = self.sampler()?;
        let program = Program::compile(&asset, Layout::LINEAR);
        let decoder = Decoder::new(&asset, &program);
        let texture = Texture::new(&decoder, sampler).context("sampler")?;
        let result = match self.gather {
            Some(channel) => {
                let channels = asset.shape.channel_count();
                let gathered = texture.gather(channel, &request).with_context(|| {
                    format!(
                        "gather: found channel {channel}; allowed: 0..={}",
                        channels - 1
                    )
                })?;
                json!({
                    "gathered": gathered.codes, "texels": gathered.texels, "mip": gathered.mip,
                    "reads": gathered.reads, "decodes": gathered.decodes,
                })
            }
            None => {
                let sample = texture.sample(&request);
                json!({
                    "codes": sample.codes, "maps": maps(&asset, &sample.codes),
                    "probes": probes(&sample.probes), "reads": sample.reads,
                    "decodes": sample.decodes,
                })
            }
        };
        if json {
            let mut result = result;
            result["profile"] = json!(asset.profile.identity());
            result["sampler"] = json!(texture.sampler());
            console::print_json(&result)?;
        } else {
            print(&result);
        }
        Ok(Verdict::Fine)
    }

    fn request(&self) -> anyhow::Result<SampleRequest> {
        let detail = match self.gradients.as_deref() {
            None => Detail::Lod(self.lod),
            Some(&[ux, vx, uy, vy]) => Detail::Gradients {
                x: [ux, vx],
                y: [uy, vy],
            },
            Some(other) => anyhow::bail!(
                "gradients: found {} numbers; allowed: four, `du/dx,dv/dx,du/dy,dv/dy`",
                other.len()
            ),
        };
        Ok(SampleRequest {
            place: [self.u, self.v],
            detail,
            random: self.random.unwrap_or(0),
        })
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
            sampler.filter = filter;
        }
        if let Some(mip_filter) = self.mip_filter {
            sampler.mip_filter = mip_filter;
        }
        if let Some(address) = self.address {
            sampler.address = [address; 2];
        }
        if let Some(order) = self.order {
            sampler.order = order;
        }
        if let Some(mip_blend) = self.mip_blend {
            sampler.mip_blend = mip_blend;
        }
        if let Some(probes) = self.max_anisotropy {
            sampler.max_anisotropy = probes;
        }
        sampler.stochastic |= self.random.is_some();
        Ok(sampler)
    }
}

fn maps(asset: &Asset, codes: &[i32]) -> Vec<Value> {
    let maps = asset.metadata.maps.iter();
    maps.map(|map| {
        let first = usize::from(map.first_channel);
        let codes = &codes[first..first + usize::from(map.channel_count)];
        json!({ "map": map.name, "codes": codes })
    })
    .collect()
}

fn probes(probes: &Probes) -> Value {
    match probes {
        Probes::Squares(probes) => each(probes, |square: &Square| {
            json!({
                "mip": square.mip, "columns": square.columns, "rows": square.rows,
                "fractions": square.fractions,
            })
        }),
        Probes::Spots(probes) => each(
            probes,
            |spot: &Spot| json!({ "mip": spot.mip, "coordinates": spot.coordinates, "lod": spot.lod }),
        ),
    }
}

fn each<T>(probes: &[Probe<T>], describe: impl Fn(&T) -> Value) -> Value {
    let probes = probes.iter().map(|probe| {
        json!({
            "near": describe(&probe.near), "far": probe.far.as_ref().map(&describe),
            "fraction": probe.fraction,
        })
    });
    probes.collect()
}

fn print(result: &Value) {
    let mut text = String::new();
    if let Some(maps) = result["maps"].as_array() {
        for map in maps {
            let name = map["map"].as_str().unwrap_or_default();
            text.push_str(&format!("{name:<12} {}\n", map["codes"]));
        }
    } else {
        text.push_str(&format!("gathered     {}\n", result["gathered"]));
    }
    text.push_str(&format!(
        "{} reads, {} runs of the synthesizer\n",
        result["reads"], result["decodes"]
    ));
    console::print(&text);
}
