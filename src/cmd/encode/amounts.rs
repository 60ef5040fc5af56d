//! Amounts: times, sizes and weights as people write them.

/// Seconds of `90`, `90s`, `15m`, `1h30m`.
pub(super) fn seconds(text: &str) -> Result<f64, String> {
    let refuse = || format!("found {text:?}; allowed: `90s`, `15m`, `1h30m`");
    let mut total = 0.0;
    let mut rest = text;
    while !rest.is_empty() {
        let digits = rest
            .find(|c: char| !c.is_ascii_digit() && c != '.')
            .unwrap_or(rest.len());
        let (number, after) = rest.split_at(digits);
        let number: f64 = number.parse().map_err(|_| refuse())?;
        let mut letters = after.chars();
        let unit = match letters.next() {
            None | Some('s') => 1.0,
            Some('m') => 60.0,
            Some('h') => 3600.0,
            Some(_) => return Err(refuse()),
        };
        total += number * unit;
        rest = letters.as_str();
    }
    if total > 0.0 {
        Ok(total)
    } else {
        Err(refuse())
    }
}

/// Bytes of `300000`, `300k`, `1.5M`, `256Ki`.
pub(super) fn bytes(text: &str) -> Result<u64, String> {
    let units = [
        ("Ki", 1024.0),
        ("Mi", 1_048_576.0),
        ("k", 1e3),
        ("K", 1e3),
        ("M", 1e6),
        ("", 1.0),
    ];
    let text_without_b = text.strip_suffix('B').unwrap_or(text);
    let found = units.iter().find_map(|(unit, size)| {
        let number: f64 = text_without_b.strip_suffix(unit)?.parse().ok()?;
        (number.is_finite() && number > 0.0).then_some((number * size) as u64)
    });
    found.ok_or_else(|| format!("found {text:?}; allowed: `300000`, `300k`, `1.5M`, `256Ki`"))
}

/// A map and its weight of `normal=2`.
pub(crate) fn weight(text: &str) -> Result<(String, f64), String> {
    let found = text
        .split_once('=')
        .and_then(|(map, weight)| Some((map.to_owned(), weight.parse().ok()?)));
    found.ok_or_else(|| format!("found {text:?}; allowed: a map and a number, `normal=2`"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_add_up_and_nonsense_is_refused() {
        for (text, expected) in [
            ("90", 90.0),
            ("1.5s", 1.5),
            ("15m", 900.0),
            ("1h30m", 5400.0),
            ("1h1m1s", 3661.0),
        ] {
            assert_eq!(seconds(text), Ok(expected), "{text}");
        }
        for text in ["", "0", "m", "15x", "1.2.3s", "-5s", "1h-30m", "inf"] {
            assert!(seconds(text).is_err(), "{text}");
        }
    }

    #[test]
    fn sizes_have_decimal_and_binary_units() {
        for (text, expected) in [
            ("300000", 300_000),
            ("300k", 300_000),
            ("300kB", 300_000),
            ("1.5M", 1_500_000),
            ("256Ki", 262_144),
            ("2MiB", 2_097_152),
        ] {
            assert_eq!(bytes(text), Ok(expected), "{text}");
        }
        for text in ["", "k", "-1", "0", "3x", "NaN", "inf"] {
            assert!(bytes(text).is_err(), "{text}");
        }
    }

    #[test]
    fn a_weight_is_a_map_and_a_number() {
        assert_eq!(weight("normal=2"), Ok(("normal".to_owned(), 2.0)));
        for text in ["normal", "normal=", "normal=x"] {
            assert!(weight(text).is_err(), "{text}");
        }
    }
}
