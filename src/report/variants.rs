//! Variants: the same asset in other numbers and under other profiles.

use super::number::{integer, percent, psnr};
use crate::study::{Study, Variant, VariantOutcome};
use maud::{Markup, html};

/// The section; nothing where no variant was tried.
pub(super) fn section(study: &Study) -> Markup {
    html! {
        @if !study.variants.tried.is_empty() {
            section #variants {
                h2 { "Other numbers, other profiles" }
                p {
                    "The same training, rounded to other widths or decoded by the choices of other \
                     implementations, against the codes of the asset as it is ("
                    (study.asset.precision) ", profile " code { (study.asset.profile) } "), at "
                    (integer(study.variants.texels as u64)) " texels of all mips"
                    @if let Some(own) = study.variants.psnr { ", where it has " (psnr(own)) " dB" }
                    ". A row of zeros is a choice that this asset never meets."
                }
                table {
                    thead {
                        tr {
                            th scope="col" { "instead" }
                            th.number scope="col" { "codes that differ" }
                            th.number scope="col" { "share" }
                            th.number scope="col" { "at most, LSB" }
                            th.number scope="col" { "PSNR, dB" }
                        }
                    }
                    tbody { @for variant in &study.variants.tried { (row(variant)) } }
                }
            }
        }
    }
}

fn row(variant: &Variant) -> Markup {
    html! {
        tr {
            th scope="row" { (variant.name) }
            @match &variant.outcome {
                VariantOutcome::Decoded { differing, codes, largest, psnr: found, .. } => {
                    td.number { (integer(*differing)) }
                    td.number { (percent(*differing as f64 / (*codes).max(1) as f64)) }
                    td.number { (integer(u64::from(*largest))) }
                    td.number { @match found { Some(found) => { (psnr(*found)) } None => { "—" } } }
                }
                VariantOutcome::Impossible { reason } => { td colspan="4" { (reason) } }
            }
        }
    }
}
