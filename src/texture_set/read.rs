//! A directory or a manifest to a texture set.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use ndarray::{Array2, Array3, ArrayView2, Axis};

use super::decode::{self, Planes};
use super::naming::{self, Component, Part};
use super::{Encoding, MAX_CHANNELS, Map, Skipped, TextureSet, TextureSetError, manifest, mips};

/// One image file and the maps to take from it.
#[derive(Debug)]
struct Source {
    path: PathBuf,
    file: String,
    parts: Vec<Part>,
    /// Map for an alpha that is not opaque and that no part reads; `None` leaves it out.
    alpha_map: Option<String>,
}

/// A map and its channels, not yet placed in the set.
struct Loaded {
    map: Map,
    path: PathBuf,
    planes: Vec<Array2<f32>>,
}

impl TextureSet {
    /// Reads a set from a directory of images, a directory with `texture_set.toml`, or a `.toml`
    /// manifest.
    ///
    /// Images are PNG (8, 16 bits), JPEG, TGA, TIFF (8, 16 bits, float) and EXR. In a directory
    /// the names tell the maps: ambientCG (`_Color`, `_NormalGL`, `_NormalDX`, `_Displacement`, …),
    /// glTF (`_baseColor`, `_occlusionRoughnessMetallic`, …), Poly Haven (`_diff`, `_nor_gl`,
    /// `_arm`, …), packed terrain (`_alb_ht`, `_nrm_rgh`) and plain stems (`color`, `albedo`, …);
    /// any other image is a map named by its stem. Maps are stacked as color, normal, roughness,
    /// height, occlusion, metallic, opacity, emissive, then the others by name; a manifest's maps
    /// keep its order. An image with red = green = blue throughout has 1 channel. An alpha
    /// channel that is opaque throughout is dropped; otherwise the alpha of a colour image is
    /// the map `opacity`. Of two normal maps green-up is kept. Subdirectories are not entered.
    ///
    /// # Errors
    ///
    /// [`TextureSetError`]: no image, a file that cannot be read or decoded, sizes that differ or
    /// are not 1 to 16384, one map in two files, more than 16 channels, floating-point texels
    /// outside 0..=1, or a malformed manifest.
    pub fn read(path: &Path) -> Result<TextureSet, TextureSetError> {
        let at = |source| TextureSetError::Io {
            path: path.to_owned(),
            source,
        };
        if fs::metadata(path).map_err(at)?.is_dir() {
            let beside = path.join(manifest::FILE_NAME);
            if beside.is_file() {
                read_manifest(&beside)
            } else {
                read_directory(path)
            }
        } else if path
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("toml"))
        {
            read_manifest(path)
        } else {
            Err(TextureSetError::NotASet {
                path: path.to_owned(),
            })
        }
    }
}

fn read_manifest(path: &Path) -> Result<TextureSet, TextureSetError> {
    let text = fs::read_to_string(path).map_err(|source| TextureSetError::Io {
        path: path.to_owned(),
        source,
    })?;
    let manifest = manifest::parse(path, &text)?;
    let order: Vec<String> = manifest
        .maps
        .iter()
        .map(|(_, part)| part.map.clone())
        .collect();
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut sources: Vec<Source> = Vec::new();
    for (file, part) in manifest.maps {
        // Listed channels are all the author wants of the file.
        let alpha_map = part
            .components
            .is_none()
            .then(|| naming::alpha_map(std::slice::from_ref(&part), ""));
        if let Some(source) = sources.iter_mut().find(|source| source.file == file) {
            source.parts.push(part);
            source.alpha_map = None;
        } else {
            sources.push(Source {
                path: folder.join(&file),
                file,
                parts: vec![part],
                alpha_map,
            });
        }
    }
    let position = |name: &str| {
        order
            .iter()
            .position(|map| map == name)
            .unwrap_or(order.len())
    };
    assemble(path, manifest.name, sources, Vec::new(), |map| {
        (position(&map.name), map.name.clone())
    })
}

fn read_directory(folder: &Path) -> Result<TextureSet, TextureSetError> {
    let at = |source| TextureSetError::Io {
        path: folder.to_owned(),
        source,
    };
    let mut entries = BTreeMap::new();
    for entry in fs::read_dir(folder).map_err(at)? {
        let path = entry.map_err(at)?.path();
        if !path.is_dir() {
            let file = path
                .file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned();
            entries.insert(file, path);
        }
    }
    let mut sources = Vec::new();
    let mut skipped = Vec::new();
    for (file, path) in entries {
        let extension = path.extension().unwrap_or_default().to_string_lossy();
        let stem = path
            .file_stem()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        if file.starts_with('.') {
            skipped.push(Skipped {
                file,
                reason: "its name starts with a dot".to_owned(),
            });
        } else if !decode::is_image(&extension) {
            let reason = "not an image of a supported format".to_owned();
            skipped.push(Skipped { file, reason });
        } else {
            let parts = naming::parts_of(&stem);
            let alpha_map =
                (!parts.iter().any(reads_alpha)).then(|| naming::alpha_map(&parts, &stem));
            sources.push(Source {
                path,
                file,
                parts,
                alpha_map,
            });
        }
    }
    drop_green_down_twin(&mut sources, &mut skipped);
    skipped.sort_by(|a, b| a.file.cmp(&b.file));
    if sources.is_empty() {
        return Err(TextureSetError::NoImages {
            path: folder.to_owned(),
        });
    }
    let full = fs::canonicalize(folder).map_err(at)?;
    let name = full
        .file_name()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    let name = if name.is_empty() {
        "texture set".to_owned()
    } else {
        name
    };
    assemble(folder, name, sources, skipped, |map| {
        let (rank, name) = naming::rank(&map.name);
        (rank, name.to_owned())
    })
}

fn reads_alpha(part: &Part) -> bool {
    part.components
        .as_ref()
        .is_some_and(|components| components.contains(&Component::A))
}

/// Publishers ship the same normals twice; one of them is information, both are redundancy.
fn drop_green_down_twin(sources: &mut Vec<Source>, skipped: &mut Vec<Skipped>) {
    let holds = |source: &Source, encoding: Encoding| {
        source
            .parts
            .iter()
            .any(|part| part.map == "normal" && part.encoding == encoding)
    };
    let Some(kept) = sources
        .iter()
        .find(|source| holds(source, Encoding::NormalGl))
    else {
        return;
    };
    let reason = format!("green-down twin of {}", kept.file);
    sources.retain(|source| {
        let twin = holds(source, Encoding::NormalDx);
        if twin {
            skipped.push(Skipped {
                file: source.file.clone(),
                reason: reason.clone(),
            });
        }
        !twin
    });
}

fn assemble<K: Ord>(
    at: &Path,
    name: String,
    sources: Vec<Source>,
    skipped: Vec<Skipped>,
    order: impl Fn(&Map) -> K,
) -> Result<TextureSet, TextureSetError> {
    let (width, height) = common_size(at, &sources)?;
    let planned = sources
        .iter()
        .flat_map(|s| s.parts.iter().map(|p| (p.map.as_str(), &s.path)));
    refuse_duplicates(planned)?;
    let counted = |maps: Vec<(String, usize)>| {
        let total: usize = maps.iter().map(|(_, channels)| channels).sum();
        if total <= MAX_CHANNELS {
            return Ok(());
        }
        Err(TextureSetError::TooManyChannels {
            path: at.to_owned(),
            maps,
        })
    };
    // Every map has at least one channel: a folder of photographs is refused without decoding it.
    counted(
        sources
            .iter()
            .flat_map(|s| s.parts.iter().map(|p| (p.map.clone(), 1)))
            .collect(),
    )?;

    let mut loaded = Vec::new();
    for source in &sources {
        load(source, &mut loaded)?;
    }
    refuse_duplicates(loaded.iter().map(|l| (l.map.name.as_str(), &l.path)))?;
    loaded.sort_by_key(|l| order(&l.map));
    counted(
        loaded
            .iter()
            .map(|l| (l.map.name.clone(), l.planes.len()))
            .collect(),
    )?;

    let channels = loaded.iter().map(|l| l.planes.len()).sum();
    let mut mip0 = Array3::zeros((channels, height as usize, width as usize));
    let mut maps = Vec::with_capacity(loaded.len());
    let mut first_channel = 0;
    for Loaded { map, planes, .. } in loaded {
        for (plane, mut target) in planes
            .iter()
            .zip(mip0.axis_iter_mut(Axis(0)).skip(first_channel))
        {
            target.assign(plane);
        }
        maps.push(Map {
            first_channel,
            ..map
        });
        first_channel += planes.len();
    }
    let texels = mips::mip_chain(mip0);
    Ok(TextureSet {
        name,
        width,
        height,
        maps,
        texels,
        skipped,
    })
}

fn common_size(at: &Path, sources: &[Source]) -> Result<(u32, u32), TextureSetError> {
    let mut common: Option<(&Path, (u32, u32))> = None;
    for source in sources {
        let size = decode::size(&source.path)?;
        match common {
            None => common = Some((&source.path, size)),
            Some((first, first_size)) if first_size != size => {
                return Err(TextureSetError::MixedSizes {
                    first: first.to_owned(),
                    first_size,
                    second: source.path.clone(),
                    second_size: size,
                });
            }
            Some(_) => {}
        }
    }
    common
        .map(|(_, size)| size)
        .ok_or_else(|| TextureSetError::NoImages {
            path: at.to_owned(),
        })
}

fn refuse_duplicates<'a>(
    maps: impl Iterator<Item = (&'a str, &'a PathBuf)>,
) -> Result<(), TextureSetError> {
    let mut seen: BTreeMap<&str, &PathBuf> = BTreeMap::new();
    for (map, path) in maps {
        if let Some(first) = seen.insert(map, path) {
            return Err(TextureSetError::DuplicateMap {
                map: map.to_owned(),
                first: first.clone(),
                second: path.clone(),
            });
        }
    }
    Ok(())
}

fn load(source: &Source, loaded: &mut Vec<Loaded>) -> Result<(), TextureSetError> {
    let Planes {
        values,
        alpha,
        bit_depth,
    } = decode::decode(&source.path)?;
    let colours = values.len_of(Axis(0)) - usize::from(alpha);
    let mut push = |name: &str, encoding: Encoding, planes: Vec<Array2<f32>>| {
        // Floating-point files hold light, not codes with a transfer function.
        let linear = encoding == Encoding::Srgb && bit_depth == 32;
        let map = Map {
            name: name.to_owned(),
            file: source.file.clone(),
            first_channel: 0,
            channel_count: planes.len(),
            bit_depth,
            encoding: if linear { Encoding::Linear } else { encoding },
        };
        loaded.push(Loaded {
            map,
            path: source.path.clone(),
            planes,
        });
    };
    for part in &source.parts {
        let indices = match &part.components {
            None => (0..colours).collect(),
            Some(components) => components
                .iter()
                .map(|component| match component {
                    Component::R => Some(0),
                    Component::G => Some(1.min(colours - 1)),
                    Component::B => Some(2.min(colours - 1)),
                    Component::A => alpha.then_some(colours),
                })
                .collect::<Option<Vec<_>>>()
                .ok_or_else(|| TextureSetError::NoAlpha {
                    path: source.path.clone(),
                    map: part.map.clone(),
                })?,
        };
        let views: Vec<_> = indices
            .iter()
            .map(|&i| values.index_axis(Axis(0), i))
            .collect();
        push(&part.map, part.encoding, owned(&views));
    }
    if let Some(name) = &source.alpha_map
        && alpha
    {
        let plane = values.index_axis(Axis(0), colours);
        if plane.iter().any(|&value| value != 1.0) {
            push(name, Encoding::Linear, owned(&[plane]));
        }
    }
    Ok(())
}

/// Copies the planes; three or more that are equal throughout are grey and become one.
fn owned(planes: &[ArrayView2<'_, f32>]) -> Vec<Array2<f32>> {
    let grey = planes.len() >= 3 && planes.windows(2).all(|pair| pair[0] == pair[1]);
    let kept = if grey { &planes[..1] } else { planes };
    kept.iter().map(ArrayView2::to_owned).collect()
}
