//! The texel suite: small assets, decoded with every intermediate value.

use super::SuiteError;
use super::subjects::{Subject, subjects};
use crate::emit::Builder;
use crate::flag::{self, Flag};
use crate::naive;
use crate::stage;
use crate::synthetic::{self, Random};
use crate::vector::{Answer, TexelQuery, VectorFile};
use ntmu_isa::accumulate::Overflow;
use ntmu_isa::filter::FilterRule;
use ntmu_isa::half::SumOrder;
use ntmu_isa::layout::Layout;
use ntmu_isa::profile::{NamedProfile, Profile};
use ntmu_isa::rescale::Requantizer;
use ntmu_isa::round::Rounding;
use ntmu_isa::shape::Shape;
use ntmu_isa::{Asset, Program};
use ntmu_model::Request;
use ntmu_model::exec::Decoder;

/// The suite.
///
/// # Errors
/// Never: all specs are within the limits of an asset.
pub fn suite() -> Result<VectorFile, SuiteError> {
    let about = "channel codes of texels of small assets, with the values of every stage";
    let mut builder = Builder::new("texel", about);
    for (seed, subject) in (1..).zip(subjects()) {
        let asset = synthetic::asset(&subject.spec, seed).map_err(|error| SuiteError::Asset {
            name: subject.name.to_owned(),
            error,
        })?;
        builder.asset(subject.name, subject.comment, &asset);
        decode(&mut builder, &subject, &asset);
    }
    Ok(builder.build())
}

/// A request of the suite and what is special about it.
struct Place {
    request: Request,
    flag: Option<Flag>,
    comment: String,
}

fn decode(builder: &mut Builder, subject: &Subject, asset: &Asset) {
    let program = Program::compile(asset, Layout::LINEAR);
    let decoder = Decoder::new(asset, &program);
    let mut places = places(&asset.shape);
    separate(asset, &decoder, &mut places);
    for place in places {
        let request = place.request;
        let taps = decoder.taps(request);
        let is_seam = taps.grids.iter().zip([0, 1]).any(|(tap, grid)| {
            let (width, height) = asset.shape.level_size(grid, tap.corners.level);
            [(tap.corners.x, width), (tap.corners.y, height)]
                .iter()
                .any(|(axis, cells)| {
                    axis.first < 0 || axis.first + axis.stride as i32 >= *cells as i32
                })
        });
        let mip_in_level = asset.shape.pyramid.mip_in_level(request.mip());
        let grids = &asset.shape.grids;
        let is_deep = grids.iter().any(|grid| mip_in_level > grid.scale_log2);
        let is_coarse = asset.shape.pyramid.level_of(request.mip()) > 0;
        let mut flags = subject.flags.to_vec();
        flags.extend(place.flag);
        flags.extend(is_seam.then_some(flag::SEAM));
        flags.extend(is_deep.then_some(flag::DEEP_MIP));
        flags.extend(is_coarse.then_some(flag::COARSE_LEVEL));
        let overflows = naive::texel(asset, request).overflows;
        flags.extend((!overflows.is_empty()).then_some(flag::OVERFLOW));
        if flags.is_empty() {
            flags.push(flag::PLAIN);
        }
        let (x, y, mip) = (request.x(), request.y(), request.mip());
        let query = TexelQuery {
            asset: subject.name.to_owned(),
            x,
            y,
            mip,
        };
        let comment = format!("{}: ({x}, {y}) of mip {mip}{}", subject.name, place.comment);
        let answer = Answer::Channels(taps.codes.clone());
        builder.tapped(&comment, &flags, query, answer, stage::from_model(&taps));
    }
}

/// Corners of every mip, and a texel inside.
fn places(shape: &Shape) -> Vec<Place> {
    let mut random = Random::new(7);
    let mut places = Vec::new();
    for mip in 0..shape.mip_count {
        let (width, height) = shape.mip_size(mip);
        let (right, bottom) = (width - 1, height - 1);
        let mut texels = vec![(0, 0), (right, 0), (right, bottom)];
        texels.dedup();
        let mut texels: Vec<_> = texels
            .into_iter()
            .map(|at| (at, Some(flag::IMAGE_CORNER)))
            .collect();
        if width * height > 4 {
            let x = random.within(0, right as i32) as u32;
            texels.push(((x, random.within(0, bottom as i32) as u32), None));
        }
        places.extend(texels.into_iter().filter_map(|((x, y), flag)| {
            let request = Request::new(shape, x, y, mip).ok()?;
            Some(Place {
                request,
                flag,
                comment: String::new(),
            })
        }));
    }
    places
}

/// Adds, for every rule of the profile and every other choice for it, the first texel whose codes
/// the choice changes, unless a texel before does it already: to be wrong in one rule is to fail.
fn separate(asset: &Asset, decoder: &Decoder<'_>, places: &mut Vec<Place>) {
    for (rule, profile) in neighbours(asset.profile) {
        let mut parts = asset.clone().into_parts();
        parts.profile = profile;
        // A bias may be too wide for another accumulator.
        let Ok(other) = Asset::new(parts) else {
            continue;
        };
        let program = Program::compile(&other, Layout::LINEAR);
        let other = Decoder::new(&other, &program);
        let differs = |request| decoder.texel(request, &mut ()) != other.texel(request, &mut ());
        if places.iter().any(|place| differs(place.request)) {
            continue;
        }
        let all = (0..asset.shape.mip_count).flat_map(|mip| Request::blocks(&asset.shape, mip));
        if let Some(request) = all.into_iter().find(|&request| differs(request)) {
            let comment = format!(", which {rule} would change");
            places.push(Place {
                request,
                flag: Some(flag::SEPARATING),
                comment,
            });
        }
    }
}

/// Every profile that differs from this one in one rule, and that difference in words; then the
/// named profiles, which differ in several.
fn neighbours(profile: Profile) -> Vec<(String, Profile)> {
    let mut neighbours = Vec::new();
    let mut add = |name: String, neighbour| neighbours.push((name, neighbour));
    macro_rules! each {
        ($rule:literal, $all:expr, $($field:ident).+) => {
            for choice in $all {
                let mut other = profile;
                other.$($field).+ = choice;
                add(format!(concat!($rule, " {}"), choice.name()), other);
            }
        };
    }
    each!("interpolate", FilterRule::ALL, interpolate);
    each!("input", Rounding::ALL, input);
    each!("overflow", Overflow::ALL, accumulator.overflow);
    each!("leak", Rounding::ALL, leak);
    each!("requantize", Requantizer::ALL, requantize);
    each!("skip", Requantizer::ALL, skip);
    each!("output", Requantizer::ALL, output);
    each!("sum", SumOrder::ALL, sum);
    each!("convert", Rounding::ALL, convert);
    let mut other = profile;
    (other.accumulator.bits, other.residual_bits) = (32, 32);
    add("full widths".to_owned(), other);
    // The built-in profiles are read without an error.
    for named in NamedProfile::all().unwrap_or_default() {
        add(format!("profile {}", named.name), named.profile);
    }
    neighbours.retain(|(_, neighbour)| *neighbour != profile);
    neighbours
}
