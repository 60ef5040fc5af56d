//! Histogram: how far a device's codes lie from the oracle's reals.

use crate::oracle::number;
use ntmu_isa::shape::OutputFormat;
use ntmu_model::Request;
use serde::Serialize;
use std::collections::BTreeMap;

/// Where the largest distance was seen first.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Worst {
    /// Texel along x.
    pub x: u32,
    /// Texel along y.
    pub y: u32,
    /// Mip.
    pub mip: u8,
    /// Channel.
    pub channel: usize,
    /// The code seen.
    pub code: i32,
    /// The oracle's real, in the channel's units.
    pub oracle: f64,
}

/// Distances of codes from the oracle, in units of their channels: one code, or 2^−10 of a `Float16`
/// channel, see [`number::channel`].
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Histogram {
    /// `code − oracle`, both rounded to units (ties up), and how often.
    pub counts: BTreeMap<i64, u64>,
    /// Codes recorded.
    pub samples: u64,
    /// The largest |code − oracle|, in fractional LSB.
    pub max: f64,
    /// Σ (code − oracle)², in LSB².
    pub square_sum: f64,
    /// Where `max` was seen first.
    pub worst: Option<Worst>,
}

impl Histogram {
    /// Adds the channels of one texel. All slices have one entry per channel.
    pub fn record(
        &mut self,
        request: Request,
        formats: &[OutputFormat],
        codes: &[i32],
        oracle: &[f64],
    ) {
        let channels = formats.iter().zip(codes).zip(oracle);
        for (channel, ((&format, &code), &real)) in channels.enumerate() {
            self.record_channel(request, (channel, format), code, real);
        }
    }

    /// Adds one channel of one texel.
    pub fn record_channel(
        &mut self,
        request: Request,
        (channel, format): (usize, OutputFormat),
        code: i32,
        oracle: f64,
    ) {
        let units = number::channel(format, code);
        let nearest = |real: f64| (real + 0.5).floor() as i64;
        *self
            .counts
            .entry(nearest(units) - nearest(oracle))
            .or_default() += 1;
        let distance = (units - oracle).abs();
        self.samples += 1;
        self.square_sum += distance * distance;
        if self.worst.is_none() || distance > self.max {
            self.max = distance;
            let (x, y, mip) = (request.x(), request.y(), request.mip());
            self.worst = Some(Worst {
                x,
                y,
                mip,
                channel,
                code,
                oracle,
            });
        }
    }

    /// Adds another histogram's codes after this one's.
    pub fn merge(&mut self, other: &Histogram) {
        for (&distance, &count) in &other.counts {
            *self.counts.entry(distance).or_default() += count;
        }
        self.samples += other.samples;
        self.square_sum += other.square_sum;
        if other.worst.is_some() && (self.worst.is_none() || other.max > self.max) {
            self.max = other.max;
            self.worst = other.worst;
        }
    }

    /// The root mean square of |code − oracle|, in LSB; 0 where nothing was recorded.
    #[must_use]
    pub fn rms(&self) -> f64 {
        if self.samples == 0 {
            0.0
        } else {
            (self.square_sum / self.samples as f64).sqrt()
        }
    }
}
