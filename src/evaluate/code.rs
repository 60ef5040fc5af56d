//! Code: one point, from the set to its result and its files.

use super::codec::Codec;
use super::machine::{self, Machine};
use super::result::{MapRecord, PointResult, SetRecord, write, write_json};
use super::{EvaluateError, Place, measured, neural};
use crate::rival::astcenc::Astcenc;
use crate::rival::{Coded, astc, bc};
use crate::texture_set::TextureSet;
use ndarray::Array3;
use serde_json::{Value, json};
use std::sync::atomic::AtomicBool;

/// What a codec of either kind made.
struct Made {
    mips: Vec<Array3<f32>>,
    bits: u64,
    bppc: f64,
    bppc_mip0: Option<f64>,
    encode_seconds: f64,
    decode_seconds: f64,
    encoder: String,
    details: Value,
}

/// Makes a point and writes its files: the asset of a neural codec first, the result last, so that a
/// result stands for a finished point.
pub(super) fn code(
    set: &TextureSet,
    fingerprint: &str,
    codec: &Codec,
    place: &Place,
    stop: &AtomicBool,
    after_part: &mut dyn FnMut(usize, usize),
) -> Result<PointResult, EvaluateError> {
    let made = match codec {
        Codec::Neural(codec) => {
            let trained = neural::code(set, codec, &place.checkpoint, stop, after_part)?;
            write(&place.asset, &trained.bytes)?;
            Made {
                mips: trained.mips,
                bits: trained.bits,
                bppc: trained.bppc,
                bppc_mip0: None,
                encode_seconds: trained.encode_seconds,
                decode_seconds: trained.decode_seconds,
                encoder: concat!("ntmu ", env!("CARGO_PKG_VERSION")).to_owned(),
                details: trained.report,
            }
        }
        Codec::Astc { block, quality } => {
            let astcenc = Astcenc::find()?;
            let coded = astc::code(set, *block, *quality, &astcenc, after_part)?;
            let how = format!("{}, {quality}", coded.encoder);
            from_blocks(coded, how)
        }
        Codec::Bc { scalars } => {
            let coded = bc::code(set, *scalars, after_part);
            let how = coded.encoder.clone();
            from_blocks(coded, how)
        }
    };
    let result = result(set, fingerprint, codec, &place.id, made)?;
    write_json(&place.result, &result)?;
    if place.checkpoint.exists() {
        std::fs::remove_file(&place.checkpoint).map_err(EvaluateError::io(&place.checkpoint))?;
    }
    Ok(result)
}

fn from_blocks(coded: Coded, encoder: String) -> Made {
    Made {
        bits: coded.bits.iter().sum(),
        bppc: coded.bppc(),
        bppc_mip0: Some(coded.bppc_mip0()),
        encode_seconds: coded.encode_seconds,
        decode_seconds: coded.decode_seconds,
        encoder,
        details: json!({ "packs": coded.packs, "bits_per_mip": coded.bits }),
        mips: coded.mips,
    }
}

fn result(
    set: &TextureSet,
    fingerprint: &str,
    codec: &Codec,
    id: &str,
    made: Made,
) -> Result<PointResult, EvaluateError> {
    let quality = measured::quality(set, &made.mips)?;
    let finite = |psnr: f64| psnr.is_finite().then_some(psnr);
    let maps = quality.maps.iter().map(|map| MapRecord {
        name: map.map.clone(),
        psnr: map.mips.first().and_then(|figures| finite(figures.psnr)),
    });
    let value = |value: Result<Value, serde_json::Error>, part: &str| {
        value.map_err(|error| EvaluateError::Curve {
            name: part.to_owned(),
            found: error.to_string(),
        })
    };
    Ok(PointResult {
        id: id.to_owned(),
        set: SetRecord {
            name: set.name.clone(),
            fingerprint: fingerprint.to_owned(),
            width: set.width,
            height: set.height,
            channels: set.channel_count(),
            mips: set.texels.len(),
        },
        label: codec.to_string(),
        codec: value(serde_json::to_value(codec), "codec")?,
        bits: made.bits,
        bppc: made.bppc,
        bppc_mip0: made.bppc_mip0,
        psnr: finite(quality.overall.psnr),
        ssim: quality.overall.ssim,
        maps: maps.collect(),
        quality: value(serde_json::to_value(&quality), "quality")?,
        encode_seconds: made.encode_seconds,
        decode_seconds: made.decode_seconds,
        encoder: made.encoder,
        details: made.details,
        machine: Machine::this(),
        finished: machine::now(),
        ntmu: env!("CARGO_PKG_VERSION").to_owned(),
    })
}
