//! Maps: source, reconstruction and difference side by side.

use super::number::{decimal, integer, percent, psnr};
use super::picture::{AMPLIFICATION, LARGEST_SIDE, Pictures, Strip};
use super::{MapPicture, ReportError};
use crate::quality::{Figures, MapQuality};
use crate::study::Study;
use maud::{Markup, html};

/// A picture narrower than this is enlarged by whole pixels, not smoothed.
const SMALL: usize = 384;

/// All maps.
///
/// # Errors
/// When a map cannot be drawn.
pub(super) fn section(study: &Study, pictures: &[MapPicture<'_>]) -> Result<Markup, ReportError> {
    let drawn = pictures
        .iter()
        .map(|map| Ok((map, Pictures::draw(map)?)))
        .collect::<Result<Vec<_>, ReportError>>()?;
    let compared = drawn.iter().any(|(map, _)| map.source.is_some());
    Ok(html! {
        section #maps {
            h2 { "Maps" }
            p {
                "Mip 0 of each map, as stored codes: nothing is converted for the screen. "
                @if compared {
                    "The difference is |source − reconstruction| × " (AMPLIFICATION)
                    ", clipped: black is equal, full brightness is 1/" (AMPLIFICATION)
                    " of full scale or more."
                }
            }
            @if drawn.is_empty() { p.missing { "No map was given to show." } }
            @for (map, pictures) in &drawn {
                (one(map, pictures, quality_of(study, map.map)))
            }
        }
    })
}

fn quality_of<'a>(study: &'a Study, name: &str) -> Option<&'a MapQuality> {
    study
        .quality
        .as_ref()?
        .maps
        .iter()
        .find(|map| map.map == name)
}

fn one(map: &MapPicture<'_>, pictures: &Pictures, quality: Option<&MapQuality>) -> Markup {
    html! {
        article.map {
            h3 { (map.map) }
            p.figures {
                @if let Some(quality) = quality {
                    @if let Some(mip0) = quality.mips.first() { (figures("mip 0", mip0)) }
                    (figures("whole chain", &quality.overall))
                }
                @if let Some(largest) = pictures.largest_difference {
                    span { "largest difference at mip 0 " b { (percent(largest.into())) } " of full scale" }
                }
            }
            @for strip in &pictures.strips {
                div.strip {
                    @if let Some(compared) = &strip.compared {
                        (figure(map.map, strip, "Source", &compared.source))
                    }
                    (figure(map.map, strip, "Reconstruction", &strip.decoded))
                    @if let Some(compared) = &strip.compared {
                        (figure(map.map, strip, &difference_caption(), &compared.difference))
                    }
                }
            }
            p.caption {
                @for strip in &pictures.strips { (channels(strip)) " " }
                @if pictures.factor > 1 {
                    (reduction(pictures)) " "
                }
                @if map.source.is_none() {
                    span.missing { "No source was given: there is nothing to compare with, so \
                        source and difference are left out." }
                }
            }
        }
    }
}

fn difference_caption() -> String {
    format!("Difference × {AMPLIFICATION}")
}

fn figures(over: &str, figures: &Figures) -> Markup {
    html! {
        span { (over) " PSNR " b { (psnr(figures.psnr)) } " dB, SSIM " b { (decimal(figures.ssim, 4)) } }
    }
}

fn figure(map: &str, strip: &Strip, caption: &str, uri: &str) -> Markup {
    html! {
        figure {
            img.pixels[strip.width < SMALL] src=(uri) width=(strip.width) height=(strip.height)
                alt={ (caption) " of " (map) };
            figcaption { (caption) }
        }
    }
}

fn channels(strip: &Strip) -> Markup {
    let first = strip.channels.start;
    html! {
        @match strip.channels.len() {
            1 => { "Channel " (first) " of the map as grey." }
            2 => { "Channel " (first) " in red, channel " (first + 1)
                " of the map in blue, their mean in green: grey where they are equal." }
            _ => { "Channels " (first) " to " (first + 2) " of the map as red, green, blue." }
        }
    }
}

fn reduction(pictures: &Pictures) -> Markup {
    let (width, height) = pictures.size;
    let factor = pictures.factor;
    html! {
        "Reduced from " (integer(width as u64)) " × " (integer(height as u64))
        " texels, more than " (LARGEST_SIDE) " along an axis: each pixel is the mean of "
        (factor) " × " (factor) " texels, of the difference too."
    }
}
