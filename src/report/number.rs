//! Numbers for readers: digits in groups of three, a true minus sign, named infinities.

/// `1234567` as `1,234,567`.
pub(super) fn integer(value: u64) -> String {
    group(&value.to_string())
}

/// With its sign, unless it is zero: `−1`, `0`, `+1`.
pub(super) fn signed(value: i128) -> String {
    match value.signum() {
        -1 => format!("−{}", group(&value.unsigned_abs().to_string())),
        0 => "0".to_owned(),
        _ => format!("+{}", group(&value.to_string())),
    }
}

/// With `digits` behind the point.
pub(super) fn decimal(value: f64, digits: usize) -> String {
    if value.is_nan() {
        return "—".to_owned();
    }
    let magnitude = if value.is_infinite() {
        "∞".to_owned()
    } else {
        let text = format!("{:.digits$}", value.abs());
        match text.split_once('.') {
            Some((whole, fraction)) => format!("{}.{fraction}", group(whole)),
            None => group(&text),
        }
    };
    let is_zero = magnitude
        .chars()
        .all(|character| matches!(character, '0' | '.'));
    if value < 0.0 && !is_zero {
        format!("−{magnitude}")
    } else {
        magnitude
    }
}

/// With at least three significant digits, for figures whose size is not known beforehand.
pub(super) fn significant(value: f64) -> String {
    let magnitude = value.abs();
    if magnitude == 0.0 {
        "0".to_owned()
    } else if magnitude < 1e-6 {
        format!("{value:.2e}").replace('-', "−")
    } else {
        let digits = (2.0 - magnitude.log10().floor()).clamp(0.0, 9.0);
        decimal(value, digits as usize)
    }
}

/// A PSNR in dB; equal images have an infinite one.
pub(super) fn psnr(value: f64) -> String {
    if value == f64::INFINITY {
        "∞ (identical)".to_owned()
    } else {
        decimal(value, 2)
    }
}

/// A share of 1 in per cent.
pub(super) fn percent(share: f64) -> String {
    format!("{} %", decimal(100.0 * share, 1))
}

/// A number of bytes in KiB or MiB.
pub(super) fn bytes(value: u64) -> String {
    match value {
        0..1024 => format!("{value} B"),
        1024..1_048_576 => format!("{} KiB", decimal(value as f64 / 1024.0, 1)),
        1_048_576.. => format!("{} MiB", decimal(value as f64 / 1_048_576.0, 2)),
    }
}

fn group(digits: &str) -> String {
    let mut text = String::with_capacity(digits.len() + digits.len() / 3);
    for (position, digit) in digits.char_indices() {
        if position > 0 && (digits.len() - position).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}
