//! The head of the report: what was studied, and whether it holds.

use super::number::{bytes, decimal, integer, psnr, significant};
use crate::study::{OracleStudy, Study, TwinStudy};
use maud::{Markup, html};

/// Title, verdict, facts.
pub(super) fn section(study: &Study) -> Markup {
    html! {
        p.kicker { "Neural texture mapping unit · study of one asset" }
        h1 { (study.asset.name) }
        nav aria-label="Sections" {
            a href="#maps" { "Maps" }
            a href="#quality" { "Quality" }
            a href="#exactness" { "Exactness" }
            a href="#timing" { "Cycles" }
            @if study.lab.is_some() { a href="#experiments" { "Experiments" } }
            a href="#precision" { "Precision" }
        }
        (verdict(study))
        (facts(study))
    }
}

fn verdict(study: &Study) -> Markup {
    html! {
        div.verdict.fails[!study.holds()] {
            p.headline {
                @if !study.holds() { "A check failed." }
                @else if matches!(study.twin, TwinStudy::Skipped { .. }) {
                    "Every check that ran holds; the GPU twin did not run."
                }
                @else { "Every check holds." }
            }
            ul {
                (twin(&study.twin))
                (oracle(&study.oracle))
            }
        }
    }
}

fn line(class: &str, mark: &str, what: Markup) -> Markup {
    html! { li class=(class) { span.mark aria-hidden="true" { (mark) } span { (what) } } }
}

fn twin(twin: &TwinStudy) -> Markup {
    match twin {
        TwinStudy::Ran {
            adapter,
            codes,
            differing: 0,
            ..
        } => line(
            "good",
            "✓",
            html! { b { "Model = GPU twin" } " on all " (integer(*codes)) " codes (" (adapter) ")." },
        ),
        TwinStudy::Ran {
            adapter,
            codes,
            differing,
            first,
        } => line(
            "bad",
            "✗",
            html! {
                b { "Model ≠ GPU twin" } " on " (integer(*differing)) " of " (integer(*codes))
                " codes (" (adapter) ")."
                @if let Some((mip, channel, row, column, model, twin)) = first {
                    " The first: mip " (mip) ", channel " (channel) ", row " (row) ", column "
                    (column) ", where the model has " (code(*model))
                    " and the twin " (code(*twin)) "."
                }
            },
        ),
        TwinStudy::Failed { reason } => line(
            "bad",
            "✗",
            html! { b { "The GPU twin failed:" } " " (reason) },
        ),
        TwinStudy::Skipped { reason } => line(
            "open",
            "–",
            html! { b { "GPU twin skipped:" } " " (reason) },
        ),
    }
}

fn code(code: i32) -> String {
    decimal(code.into(), 0)
}

fn oracle(oracle: &OracleStudy) -> Markup {
    let (class, mark, claim) = if oracle.holds() {
        ("good", "✓", "Model within the proven bound of the oracle")
    } else {
        ("bad", "✗", "Model outside the proven bound of the oracle")
    };
    let what = html! {
        b { (claim) } " on " (integer(oracle.codes)) " codes: largest difference "
        (significant(oracle.max)) "\u{a0}LSB, proven bound " (significant(oracle.bound))
        "\u{a0}LSB; rms " (significant(oracle.rms)) "\u{a0}LSB, predicted typical "
        (significant(oracle.typical)) "\u{a0}LSB."
    };
    line(class, mark, what)
}

fn fact(name: &str, value: Markup, note: Markup) -> Markup {
    html! { div { dt { (name) } dd { (value) } dd.note { (note) } } }
}

fn facts(study: &Study) -> Markup {
    let asset = &study.asset;
    let total = asset.grid_bytes.saturating_add(asset.parameter_bytes);
    let [first, second] = asset.latent_bits;
    html! {
        dl.facts {
            (fact("Size", html! { (integer(asset.size.0.into())) " × " (integer(asset.size.1.into())) },
                html! { (asset.mips) " mips, " (integer(asset.texels)) " texels in all" }))
            (fact("Channels", html! { (asset.channels) }, html! { "decoded together, per texel" }))
            (fact("Latents", html! { (first) " / " (second) span.unit { " bit" } },
                html! { "per latent of grid 0 / grid 1" }))
            (fact("Precision", html! { (asset.precision) },
                html! { "bits of weights (w) and activations (a)" }))
            (fact("Profile", html! { (asset.profile) },
                html! { "the choices of the arithmetic, name and hash" }))
            (fact("MAC per texel", html! { (integer(asset.macs_per_texel.into())) },
                html! { "multiply-accumulates of the synthesizer" }))
            (fact("Stored", html! { (bytes(total)) },
                html! { (integer(total)) " B = grids " (integer(asset.grid_bytes)) " + parameters "
                    (integer(asset.parameter_bytes)) }))
            (fact("BPPC", html! { (decimal(asset.bppc, 3)) },
                html! { "bits per pixel and channel, parameters counted; 8-bit images: 8" }))
            @if let Some(quality) = &study.quality {
                (fact("PSNR", html! { (psnr(quality.overall.psnr)) span.unit { " dB" } },
                    html! { "whole chain; SSIM " (decimal(quality.overall.ssim, 4)) }))
            }
        }
        p.note {
            "LSB: one step of an output code. Oracle: a decoder in real numbers that shares no \
             arithmetic with the model. GPU twin: the same integers computed by a shader."
        }
    }
}
