//! Spec: a stream as text.
//!
//! `NAME` or `NAME:KEY=VALUE,KEY=VALUE…`, or a path that ends in `.csv` or `.parquet`. Keys that are
//! left out have the values that [`AccessSpec`]'s text form shows; what is not known is refused.

use super::geometry::Geometry;
use super::interleave::Interleave;
use super::scene::{DetailKind, PixelOrder, SceneSpec};
use super::texels::{Mips, TexelOrder, TexelSpec};
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Where demands come from.
#[derive(Clone, Debug, PartialEq)]
pub enum AccessSpec {
    /// `raster`, `blocks`, `zorder`, `random`: a texel scan.
    Texels(TexelSpec),
    /// `quad`, `plane`, `sphere`: a scene.
    Scene(SceneSpec),
    /// A trace file.
    File(PathBuf),
}

/// Why a text is no stream.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SpecError {
    /// No such name.
    Name {
        /// What stands there.
        found: String,
        /// What may.
        allowed: &'static str,
    },
    /// An option without `=`, that is not known, or that stands there twice.
    Option {
        /// The name before it.
        of: String,
        /// What stands there.
        found: String,
        /// The keys that may, each once.
        allowed: String,
    },
    /// A value that the key cannot have.
    Value {
        /// The key.
        key: String,
        /// What stands there.
        found: String,
        /// What may.
        allowed: String,
    },
}

impl fmt::Display for SpecError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            SpecError::Name { found, allowed } => write!(f, "found `{found}`; allowed: {allowed}"),
            SpecError::Option { of, found, allowed } => {
                write!(f, "{of}: found `{found}`; allowed, each once: {allowed}")
            }
            SpecError::Value {
                key,
                found,
                allowed,
            } => write!(f, "{key}: found `{found}`; allowed: {allowed}"),
        }
    }
}

impl std::error::Error for SpecError {}

/// What a text can begin with.
const NAMES: &str = "raster, blocks, zorder, random, quad, plane, sphere, each with `:KEY=VALUE,…`, \
                     or a path that ends in .csv or .parquet";

/// Whether a path's name says that it is a trace file.
fn is_file(text: &str) -> bool {
    let extension = Path::new(text).extension();
    extension.is_some_and(|e| e.eq_ignore_ascii_case("csv") || e.eq_ignore_ascii_case("parquet"))
}

/// The options after a name, each to be taken once.
struct Options<'t> {
    name: &'t str,
    pairs: Vec<(&'t str, &'t str)>,
    known: Vec<&'static str>,
}

impl<'t> Options<'t> {
    fn new(
        name: &'t str,
        text: Option<&'t str>,
        known: &[&'static str],
    ) -> Result<Options<'t>, SpecError> {
        let mut options = Options {
            name,
            pairs: Vec::new(),
            known: known.to_vec(),
        };
        for option in text.map(|t| t.split(',')).into_iter().flatten() {
            let pair = option.split_once('=');
            let pair = pair.filter(|(key, _)| {
                known.contains(key) && options.pairs.iter().all(|(other, _)| other != key)
            });
            options
                .pairs
                .push(pair.ok_or_else(|| options.refuse(option))?);
        }
        Ok(options)
    }

    fn refuse(&self, found: &str) -> SpecError {
        SpecError::Option {
            of: self.name.to_owned(),
            found: found.to_owned(),
            allowed: self.known.join(", "),
        }
    }

    /// The value of a key, or the default.
    fn take<T>(
        &self,
        key: &'static str,
        default: T,
        allowed: &str,
        parse: impl Fn(&str) -> Option<T>,
    ) -> Result<T, SpecError> {
        let Some((_, found)) = self.pairs.iter().find(|(k, _)| *k == key) else {
            return Ok(default);
        };
        parse(found).ok_or_else(|| SpecError::Value {
            key: key.to_owned(),
            found: (*found).to_owned(),
            allowed: allowed.to_owned(),
        })
    }

    /// A number of a geometry; its range is looked at later.
    fn number(&self, key: &'static str, default: f64) -> Result<f64, SpecError> {
        self.take(key, default, "a number", |text| text.parse().ok())
    }
}

impl FromStr for AccessSpec {
    type Err = SpecError;

    fn from_str(text: &str) -> Result<AccessSpec, SpecError> {
        if is_file(text) {
            return Ok(AccessSpec::File(PathBuf::from(text)));
        }
        let (name, rest) = match text.split_once(':') {
            Some((name, rest)) => (name, Some(rest)),
            None => (text, None),
        };
        match name {
            "raster" => texels(Options::new(name, rest, &["mip"])?, TexelOrder::Raster),
            "blocks" => texels(Options::new(name, rest, &["mip"])?, TexelOrder::Blocks),
            "zorder" => texels(Options::new(name, rest, &["mip"])?, TexelOrder::ZOrder),
            "random" => {
                let options = Options::new(name, rest, &["mip", "seed", "count"])?;
                let whole = |text: &str| text.parse().ok();
                let seed = options.take("seed", 0, "0..=2^64 − 1", whole)?;
                let count = options.take("count", 65_536, "1..=2^64 − 1", |text| {
                    whole(text).filter(|&count| count > 0)
                })?;
                texels(options, TexelOrder::Random { seed, count })
            }
            "quad" => {
                let options = Options::new(name, rest, &["scale", "order", "detail"])?;
                let scale = options.number("scale", 1.0)?;
                scene(&options, Geometry::Quad { scale })
            }
            "plane" => {
                let known = ["height", "pitch", "fov", "size", "order", "detail"];
                let options = Options::new(name, rest, &known)?;
                let geometry = Geometry::Plane {
                    height: options.number("height", 1.7)?,
                    pitch: options.number("pitch", 10.0)?,
                    fov: options.number("fov", 60.0)?,
                    size: options.number("size", 1.0)?,
                };
                scene(&options, geometry)
            }
            "sphere" => {
                let known = ["distance", "fov", "repeat", "order", "detail"];
                let options = Options::new(name, rest, &known)?;
                let geometry = Geometry::Sphere {
                    distance: options.number("distance", 2.0)?,
                    fov: options.number("fov", 60.0)?,
                    repeat: options.number("repeat", 1.0)?,
                };
                scene(&options, geometry)
            }
            found => Err(SpecError::Name {
                found: found.to_owned(),
                allowed: NAMES,
            }),
        }
    }
}

fn texels(options: Options<'_>, order: TexelOrder) -> Result<AccessSpec, SpecError> {
    let mips = options.take("mip", Mips::All, "all, or 0..=255", |text| match text {
        "all" => Some(Mips::All),
        mip => mip.parse().ok().map(Mips::One),
    })?;
    Ok(AccessSpec::Texels(TexelSpec { order, mips }))
}

fn scene(options: &Options<'_>, geometry: Geometry) -> Result<AccessSpec, SpecError> {
    if let Some(parameter) = geometry.refused() {
        let (low, high) = (parameter.allowed.start(), parameter.allowed.end());
        return Err(SpecError::Value {
            key: parameter.name.to_owned(),
            found: parameter.value.to_string(),
            allowed: format!("{low} to {high}"),
        });
    }
    let (low, high) = PixelOrder::SIDES;
    let sides = format!("raster, zorder, or tiles:N with an even N of {low}..={high} pixels");
    let order = options.take("order", PixelOrder::Tiles { side: 8 }, &sides, |text| {
        let order = match text {
            "raster" => PixelOrder::Raster,
            "zorder" => PixelOrder::ZOrder,
            tiles => PixelOrder::Tiles {
                side: tiles.strip_prefix("tiles:")?.parse().ok()?,
            },
        };
        Some(order).filter(|order| order.is_allowed())
    })?;
    let kinds = "lod, gradients";
    let detail = options.take("detail", DetailKind::Gradients, kinds, |text| match text {
        "lod" => Some(DetailKind::Lod),
        "gradients" => Some(DetailKind::Gradients),
        _ => None,
    })?;
    Ok(AccessSpec::Scene(SceneSpec {
        geometry,
        order,
        detail,
    }))
}

impl fmt::Display for AccessSpec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            AccessSpec::Texels(TexelSpec { order, mips }) => {
                let name = match order {
                    TexelOrder::Raster => "raster",
                    TexelOrder::Blocks => "blocks",
                    TexelOrder::ZOrder => "zorder",
                    TexelOrder::Random { .. } => "random",
                };
                match mips {
                    Mips::One(mip) => write!(f, "{name}:mip={mip}")?,
                    Mips::All => write!(f, "{name}:mip=all")?,
                }
                match order {
                    TexelOrder::Random { seed, count } => write!(f, ",seed={seed},count={count}"),
                    TexelOrder::Raster | TexelOrder::Blocks | TexelOrder::ZOrder => Ok(()),
                }
            }
            AccessSpec::Scene(SceneSpec {
                geometry,
                order,
                detail,
            }) => {
                let name = match geometry {
                    Geometry::Quad { .. } => "quad",
                    Geometry::Plane { .. } => "plane",
                    Geometry::Sphere { .. } => "sphere",
                };
                write!(f, "{name}:")?;
                for parameter in geometry.parameters() {
                    write!(f, "{}={},", parameter.name, parameter.value)?;
                }
                match order {
                    PixelOrder::Raster => write!(f, "order=raster")?,
                    PixelOrder::Tiles { side } => write!(f, "order=tiles:{side}")?,
                    PixelOrder::ZOrder => write!(f, "order=zorder")?,
                }
                match detail {
                    DetailKind::Lod => write!(f, ",detail=lod"),
                    DetailKind::Gradients => write!(f, ",detail=gradients"),
                }
            }
            AccessSpec::File(path) => write!(f, "{}", path.display()),
        }
    }
}

/// `quads`, `tiles:N`, `random:N:SEED`; N pixels, even.
impl FromStr for Interleave {
    type Err = SpecError;

    fn from_str(text: &str) -> Result<Interleave, SpecError> {
        let parts: Vec<&str> = text.split(':').collect();
        let interleave = match parts.as_slice() {
            ["quads"] => Some(Interleave::QUADS),
            ["tiles", side] => side.parse().ok().map(|side| Interleave::Turns { side }),
            ["random", side, seed] => match (side.parse(), seed.parse()) {
                (Ok(side), Ok(seed)) => Some(Interleave::Random { side, seed }),
                (Err(_), _) | (_, Err(_)) => None,
            },
            _ => None,
        };
        let (low, high) = Interleave::SIDES;
        interleave
            .filter(|i| i.is_allowed())
            .ok_or_else(|| SpecError::Value {
                key: "interleave".to_owned(),
                found: text.to_owned(),
                allowed: format!(
                    "quads, tiles:N, random:N:SEED, with an even N of {low}..={high} pixels"
                ),
            })
    }
}

impl fmt::Display for Interleave {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Interleave::Turns { side: 2 } => write!(f, "quads"),
            Interleave::Turns { side } => write!(f, "tiles:{side}"),
            Interleave::Random { side, seed } => write!(f, "random:{side}:{seed}"),
        }
    }
}
