//! Files of the refuse suite about the pyramid and the version that brought it.

use super::SuiteError;
use super::container::Container;
use super::refuse::{accepted, asset};
use crate::emit::Builder;
use crate::flag;
use crate::synthetic::Spec;
use ntmu_isa::pyramid::Pyramid;

/// Where the section of the shape has its pyramid.
const PYRAMID: usize = 15;

/// Files with a pyramid, or with what is none. `plain` is of a version that has none.
///
/// # Errors
/// Never: the spec is within the limits of an asset.
pub(super) fn pyramid_fields(builder: &mut Builder, plain: &Container) -> Result<(), SuiteError> {
    let (range, clash) = (&[flag::FIELD_RANGE], &[flag::CONTRADICTION]);
    let mut newer = plain.clone();
    newer.version = (2, 1);
    accepted(
        builder,
        "no pyramid in a file of version 2.1",
        newer.to_bytes(),
    );
    let mut spec = Spec::small(8, 8).with_bits(7, 8);
    spec.shape.pyramid = Pyramid::EVERY_MIP;
    // Four mips: level 0 serves them all.
    let one_level = asset(spec.clone())?.to_bytes();
    accepted(
        builder,
        "a pyramid of which one level is needed",
        one_level.clone(),
    );
    (spec.shape.width, spec.shape.height, spec.shape.mip_count) = (16, 16, 5);
    let two_levels = asset(spec)?.to_bytes();
    accepted(builder, "a pyramid of two levels", two_levels.clone());
    let parsed = |file: &[u8]| Container::parse(file);
    let (Some(one_level), Some(two_levels)) = (parsed(&one_level), parsed(&two_levels)) else {
        return Ok(());
    };
    for code in [0x10, 0x12, 0x89] {
        let (first, each) = (code >> 4, code & 15);
        let comment = format!("a pyramid of {first} mips and then every {each}");
        let file = one_level.with("SHAP", PYRAMID, &[code]).to_bytes();
        builder.refused(&comment, range, file);
    }
    let mut older = one_level;
    older.version = (2, 0);
    builder.refused(
        "a pyramid in a file of version 2.0",
        &[flag::RESERVED],
        older.to_bytes(),
    );
    let single = two_levels.with("SHAP", PYRAMID, &[0]).to_bytes();
    builder.refused("latents of two levels where there is one", clash, single);
    let mut short = two_levels;
    for (letters, body) in &mut short.sections {
        if letters == b"GRD0" {
            body.pop();
        }
    }
    let comment = "grid 0 without the latents of its last level";
    builder.refused(comment, clash, short.to_bytes());
    Ok(())
}
