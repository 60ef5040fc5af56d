//! Plan: which sets, which codecs, at which rates.
//!
//! ```toml
//! name = "six sets"
//! seed = 1                                  # optional, 1
//! sets = ["$NTMU_TEXTURES/Wood063_1K", "built-in", "built-in 64"]
//!
//! [[curve]]
//! name = "CNTC"
//! codec = "neural"
//! presets = ["cntc-16", "cntc-32", "cntc-64"]
//! effort = "medium"                         # optional, as are the next four
//! plan = "direct"                           # a training plan, in the place of the effort's
//! precision = "int8"
//! backend = "wgpu"                          # as in `encode --backend`
//! config = { uniform_mips = 0.05 }          # fields of the training configuration
//!
//! [[curve]]
//! name = "ASTC"
//! codec = "astc"
//! blocks = ["12x12", "10x10", "8x8", "6x6"]
//! quality = "exhaustive"                    # optional
//!
//! [[curve]]
//! name = "BC"
//! codec = "bc"
//! scalars = ["together", "alone"]           # optional, ["alone"]
//! ```
//!
//! A set is a folder or manifest, relative to the plan, `$NAME` at its start being a variable of the
//! environment; or `built-in`, with the texels along a side, a power of two. A curve is a codec at its rates. Unknown
//! keys are errors.

use super::EvaluateError;
use super::codec::{Codec, Effort, Neural};
use crate::rival::astc::{AstcQuality, Block};
use crate::rival::packing::Scalars;
use crate::texture_set::{MAX_SIZE, TextureSet, TextureSetError};
use crate::{brick_wall, built_in};
use ntmu_isa::preset::Preset;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A checked plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Its name.
    pub name: String,
    /// The seed of neural codecs and of nothing else.
    pub seed: u64,
    /// The sets.
    pub sets: Vec<SetPlace>,
    /// The curves.
    pub curves: Vec<PlannedCurve>,
}

/// Where a set comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SetPlace {
    /// A folder of images or a manifest.
    Folder(PathBuf),
    /// The built-in set.
    BuiltIn {
        /// Texels along a side, a power of two up to [`MAX_SIZE`].
        size: u32,
    },
}

/// A codec at its rates.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedCurve {
    /// Its name in tables and plots.
    pub name: String,
    /// One codec for each rate.
    pub codecs: Vec<Codec>,
}

impl SetPlace {
    /// The set.
    ///
    /// # Errors
    /// When it cannot be read.
    pub fn read(&self) -> Result<TextureSet, TextureSetError> {
        match self {
            SetPlace::Folder(path) => TextureSet::read(path),
            SetPlace::BuiltIn { size } => Ok(brick_wall::generate(*size, built_in::SEED)),
        }
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPlan {
    name: String,
    #[serde(default = "first_seed")]
    seed: u64,
    sets: Vec<String>,
    curve: Vec<RawCurve>,
}

fn first_seed() -> u64 {
    1
}

#[derive(Deserialize)]
#[serde(tag = "codec", rename_all = "kebab-case", deny_unknown_fields)]
enum RawCurve {
    Neural {
        name: String,
        presets: Vec<String>,
        effort: Option<Effort>,
        plan: Option<String>,
        precision: Option<String>,
        backend: Option<String>,
        #[serde(default)]
        config: BTreeMap<String, serde_json::Value>,
    },
    Astc {
        name: String,
        blocks: Vec<Block>,
        #[serde(default = "exhaustive")]
        quality: AstcQuality,
    },
    Bc {
        name: String,
        #[serde(default = "alone")]
        scalars: Vec<Scalars>,
    },
}

fn exhaustive() -> AstcQuality {
    AstcQuality::EXHAUSTIVE
}

fn alone() -> Vec<Scalars> {
    vec![Scalars::Alone]
}

impl Plan {
    /// Reads a plan.
    ///
    /// # Errors
    /// [`EvaluateError`] when the file cannot be read or is no plan.
    pub fn read(path: &Path) -> Result<Plan, EvaluateError> {
        let text = std::fs::read_to_string(path).map_err(EvaluateError::io(path))?;
        Plan::parse(path, &text)
    }

    /// Checks the text of the plan at `path`.
    ///
    /// # Errors
    /// [`EvaluateError::Plan`] when it is no plan.
    pub fn parse(path: &Path, text: &str) -> Result<Plan, EvaluateError> {
        let refuse = |field: &str, found: String, allowed: &str| EvaluateError::Plan {
            path: path.to_owned(),
            field: field.to_owned(),
            found,
            allowed: allowed.to_owned(),
        };
        let raw: RawPlan = toml::from_str(text).map_err(|error| {
            let found = error.to_string().trim_end().to_owned();
            refuse(
                "plan",
                found,
                "`name`, `sets`, and for each `[[curve]]`: name, codec, rates",
            )
        })?;
        if raw.name.trim().is_empty() {
            return Err(refuse("name", "an empty name".to_owned(), "a name"));
        }
        if raw.sets.is_empty() || raw.curve.is_empty() {
            let found = format!("{} sets and {} curves", raw.sets.len(), raw.curve.len());
            return Err(refuse("plan", found, "at least one of each"));
        }
        let folder = path.parent().unwrap_or(Path::new(""));
        let sets = raw.sets.iter().map(|set| {
            place(folder, set).map_err(|(found, allowed)| refuse("sets", found, allowed))
        });
        let sets = sets.collect::<Result<Vec<SetPlace>, _>>()?;
        let mut curves: Vec<PlannedCurve> = Vec::new();
        for curve in raw.curve {
            let curve = planned(curve, raw.seed)
                .map_err(|(field, found, allowed)| refuse(field, found, &allowed))?;
            if curve.name.trim().is_empty() || curves.iter().any(|c| c.name == curve.name) {
                let found = format!("{:?}", curve.name);
                return Err(refuse(
                    "curve.name",
                    found,
                    "a name that no other curve has",
                ));
            }
            if curve.codecs.is_empty() {
                let found = format!("curve {:?} without a rate", curve.name);
                return Err(refuse("curve", found, "at least one"));
            }
            curves.push(curve);
        }
        Ok(Plan {
            name: raw.name,
            seed: raw.seed,
            sets,
            curves,
        })
    }
}

fn place(folder: &Path, text: &str) -> Result<SetPlace, (String, &'static str)> {
    let mut words = text.split_whitespace();
    if words.next() == Some("built-in") {
        let size = match (words.next(), words.next()) {
            (None, _) => Some(built_in::SIZE),
            (Some(size), None) => size
                .parse()
                .ok()
                .filter(|size: &u32| size.is_power_of_two() && *size <= MAX_SIZE),
            (Some(_), Some(_)) => None,
        };
        let size = size.ok_or_else(|| {
            (
                format!("{text:?}"),
                "built-in, or built-in 64, a power of two",
            )
        })?;
        return Ok(SetPlace::BuiltIn { size });
    }
    let Some(rest) = text.strip_prefix('$') else {
        return Ok(SetPlace::Folder(folder.join(text)));
    };
    let (variable, rest) = rest.split_once('/').unwrap_or((rest, ""));
    let start = std::env::var_os(variable).filter(|value| !value.is_empty());
    let start = start.ok_or_else(|| {
        let found = format!("{text:?} with ${variable} not set");
        (found, "a folder, with variables that are set")
    })?;
    Ok(SetPlace::Folder(PathBuf::from(start).join(rest)))
}

type Refusal = (&'static str, String, String);

fn planned(curve: RawCurve, seed: u64) -> Result<PlannedCurve, Refusal> {
    Ok(match curve {
        RawCurve::Neural {
            name,
            presets,
            effort,
            plan,
            precision,
            backend,
            config,
        } => {
            for preset in &presets {
                if Preset::by_name(preset).is_none() {
                    let allowed = Preset::ALL.map(|preset| preset.name).join(", ");
                    return Err(("curve.presets", format!("{preset:?}"), allowed));
                }
            }
            if let Some(Effort::Number(effort @ 101..)) = effort {
                return Err(("curve.effort", effort.to_string(), "0 to 100".to_owned()));
            }
            let codecs = presets.into_iter().map(|preset| {
                Codec::Neural(Neural {
                    preset,
                    effort: effort.clone(),
                    plan: plan.clone(),
                    precision: precision.clone(),
                    backend: backend.clone(),
                    config: config.clone(),
                    seed,
                })
            });
            PlannedCurve {
                codecs: codecs.collect(),
                name,
            }
        }
        RawCurve::Astc {
            name,
            blocks,
            quality,
        } => PlannedCurve {
            name,
            codecs: blocks
                .into_iter()
                .map(|block| Codec::Astc { block, quality })
                .collect(),
        },
        RawCurve::Bc { name, scalars } => PlannedCurve {
            name,
            codecs: scalars
                .into_iter()
                .map(|scalars| Codec::Bc { scalars })
                .collect(),
        },
    })
}
