//! A certificate as rows of text, for people.

use super::{Certificate, LayerCertificate, Method, RealRange, Sums};

/// The headings of [`Certificate::rows`].
pub const HEADINGS: [&str; 6] = [
    "layer",
    "method",
    "sums",
    "accumulator",
    "rescale",
    "outputs",
];

impl Certificate {
    /// One row a layer, in the columns of [`HEADINGS`].
    #[must_use]
    pub fn rows(&self) -> Vec<[String; 6]> {
        self.layers.iter().map(layer).collect()
    }

    /// One line a channel.
    #[must_use]
    pub fn channel_lines(&self) -> Vec<String> {
        self.channels
            .iter()
            .map(|c| {
                format!(
                    "channel {} ({}): at most {:.2} from the real network by {}, about {:.3} (rms of {} \
                     texels) by {}",
                    c.channel,
                    c.format,
                    c.worst,
                    c.worst_method,
                    c.typical,
                    c.typical_texels,
                    c.typical_method
                )
            })
            .collect()
    }
}

fn layer(layer: &LayerCertificate) -> [String; 6] {
    let method = match layer.method {
        Method::Exact => "exact",
        Method::Interval => "interval",
    };
    let (sums, accumulator, rescale) = match &layer.sums {
        Sums::Integer(sums) => {
            let width = sums
                .width
                .map_or("more than 32".to_owned(), |bits| bits.to_string());
            let verdict = if sums.is_wide_enough {
                "enough"
            } else {
                "may overflow"
            };
            let unsafe_rows = sums
                .rows
                .iter()
                .filter(|row| !row.rescales.iter().all(super::Rescale::is_safe))
                .count();
            (
                format!("{} to {}", sums.sums.low, sums.sums.high),
                format!("{width} bits; {} {verdict}", sums.profile_width),
                if unsafe_rows == 0 {
                    "safe".to_owned()
                } else {
                    format!("{unsafe_rows} of {} rows not safe", sums.rows.len())
                },
            )
        }
        Sums::Half(sums) => {
            let rounding = if sums.is_exact {
                "exact in every order".to_owned()
            } else {
                format!(
                    "off by {:.1e} at most, the register by {:.1e}",
                    sums.sum_rounding, sums.register_rounding
                )
            };
            let saturation = if sums.may_saturate {
                "may saturate"
            } else {
                "no saturation"
            };
            (
                format!("up to {:.3e}", sums.largest),
                format!("{}: {rounding}", sums.order.name()),
                saturation.to_owned(),
            )
        }
    };
    [
        layer.layer.to_string(),
        method.to_owned(),
        sums,
        accumulator,
        rescale,
        outputs(&layer.outputs),
    ]
}

fn outputs(lanes: &[RealRange]) -> String {
    let both = lanes.iter().copied().reduce(|one, other| RealRange {
        low: one.low.min(other.low),
        high: one.high.max(other.high),
    });
    both.map_or("channels".to_owned(), |range| {
        format!("{} to {}", number(range.low), number(range.high))
    })
}

/// An integer as it is, another real with five digits.
fn number(real: f64) -> String {
    if real.fract() == 0.0 {
        format!("{real}")
    } else {
        format!("{real:.4e}")
    }
}
