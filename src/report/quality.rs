//! Quality: PSNR and SSIM per map and mip.

use super::number::{decimal, integer, psnr};
use crate::quality::{Figures, Quality};
use crate::study::Study;
use maud::{Markup, html};

/// The table, or why there is none.
pub(super) fn section(study: &Study) -> Markup {
    html! {
        section #quality {
            h2 { "Quality" }
            @match &study.quality {
                Some(quality) => {
                    p {
                        "PSNR in dB (higher is better, peak 1), SSIM in grey below it (1 is equal), \
                         against the source. Figures over several channels or mips weigh every \
                         value the same, so mip 0 has about three quarters of the whole chain."
                    }
                    (table(study.asset.size, quality))
                }
                None => { p.missing { "No source was given: quality was not measured." } }
            }
        }
    }
}

fn table(size: (u32, u32), quality: &Quality) -> Markup {
    let chains = quality.maps.iter().map(|map| map.mips.len());
    let mips = chains.chain([quality.mips.len()]).max().unwrap_or(0);
    html! {
        div.scroll {
            table {
                thead {
                    tr {
                        th scope="col" { "Map" }
                        @for mip in 0..mips { th.number scope="col" { "mip " (mip) (size_of(size, mip)) } }
                        th.number.total scope="col" { "whole chain" }
                    }
                }
                tbody {
                    @for map in &quality.maps {
                        (row(&map.map, &map.mips, mips, &map.overall))
                    }
                }
                tfoot { (row("all channels", &quality.mips, mips, &quality.overall)) }
            }
        }
    }
}

fn size_of(size: (u32, u32), mip: usize) -> Markup {
    let side = |texels: u32| u64::from(texels.checked_shr(mip as u32).unwrap_or(0).max(1));
    html! { small { (integer(side(size.0))) "×" (integer(side(size.1))) } }
}

fn row(name: &str, chain: &[Figures], mips: usize, overall: &Figures) -> Markup {
    html! {
        tr {
            th scope="row" { (name) }
            @for mip in 0..mips {
                td.number {
                    @match chain.get(mip) {
                        Some(figures) => (cell(figures)),
                        None => "—",
                    }
                }
            }
            td.number.total { (cell(overall)) }
        }
    }
}

fn cell(figures: &Figures) -> Markup {
    html! { (psnr(figures.psnr)) small { (decimal(figures.ssim, 4)) } }
}
