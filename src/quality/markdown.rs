//! Markdown: the tables that the paper prints for its sets (Tables 4 and 5), a row a map and mip.

use super::{Figures, MapQuality, Quality};
use crate::curve::markdown_cell;
use crate::metrics::{AngleFigures, LEAST_SIDE};

impl Quality {
    /// One table of all maps and one over them, with what a dash means below.
    #[must_use]
    pub fn markdown(&self) -> String {
        let has_angles = self.maps.iter().any(|map| map.angles.is_some());
        let has_scores = self.maps.iter().any(|map| map.perceptual.is_some());
        let mut heads = vec!["Map", "Mip", "Resolution", "PSNR (dB)", "SSIM"];
        if has_angles {
            heads.extend(["Angle, mean (°)", "95 % (°)", "worst (°)"]);
        }
        if has_scores {
            heads.push("SSIMULACRA2");
        }
        let mut text = line(heads.iter().map(|head| (*head).to_owned()));
        text += &format!("|---|{}\n", "---:|".repeat(heads.len() - 1));
        let mut row =
            |name: &str, mip: Option<usize>, figures: Figures, map: Option<&MapQuality>| {
                let mut cells = vec![markdown_cell(name)];
                cells.push(mip.map_or("all".to_owned(), |mip| mip.to_string()));
                cells.push(mip.map_or(String::new(), |mip| self.resolution(mip)));
                cells.push(number(figures.psnr, 2));
                cells.push(number(figures.ssim, 4));
                if has_angles {
                    let angles = map.and_then(|map| map.angles.as_ref());
                    cells.extend(degrees(angles.and_then(|angles| match mip {
                        None => Some(&angles.overall),
                        Some(mip) => angles.mips.get(mip),
                    })));
                }
                if has_scores {
                    let scores = map.and_then(|map| map.perceptual.as_ref());
                    let score = scores.and_then(|scores| match mip {
                        None => scores.overall,
                        Some(mip) => scores.mips.get(mip).copied().flatten(),
                    });
                    cells.push(number(score.unwrap_or(f64::NAN), 2));
                }
                text += &line(cells);
            };
        for map in &self.maps {
            for (mip, figures) in map.mips.iter().enumerate() {
                row(&map.map, Some(mip), *figures, Some(map));
            }
            row(&map.map, None, map.overall, Some(map));
        }
        for (mip, figures) in self.mips.iter().enumerate() {
            row("all maps", Some(mip), *figures, None);
        }
        row("all maps", None, self.overall, None);
        text + &self.notes(has_scores)
    }

    fn resolution(&self, mip: usize) -> String {
        let size = self.sizes.get(mip);
        size.map_or(String::new(), |(width, height)| {
            format!("{width} × {height}")
        })
    }

    /// What the tables do not show.
    fn notes(&self, has_scores: bool) -> String {
        let mut notes = String::new();
        let small = |(width, height): &&(usize, usize)| (*width).min(*height) < LEAST_SIDE;
        let left_out = self.sizes.iter().filter(small).count();
        if has_scores && left_out > 0 {
            notes += &format!(
                "- SSIMULACRA2 needs {LEAST_SIDE} × {LEAST_SIDE} texels: {left_out} smaller mips \
                 are left out.\n"
            );
        }
        for map in &self.maps {
            if let Some(angles) = &map.angles
                && angles.overall.undefined > 0
            {
                notes += &format!(
                    "- {}: {} normals of length 0 have no angle and are left out of {}.\n",
                    map.map,
                    angles.overall.undefined,
                    angles.overall.undefined + angles.overall.vectors
                );
            }
        }
        if let Some(share) = self.masked_share {
            notes += &format!(
                "- Measured within a mask that has {:.2} % of mip 0; without SSIMULACRA2, which is \
                 not defined there.\n",
                100.0 * share
            );
        }
        if notes.is_empty() {
            notes
        } else {
            format!("\n{notes}")
        }
    }
}

fn line(cells: impl IntoIterator<Item = String>) -> String {
    let cells: Vec<String> = cells.into_iter().collect();
    format!("| {} |\n", cells.join(" | "))
}

fn degrees(figures: Option<&AngleFigures>) -> [String; 3] {
    let cell = |value: fn(&AngleFigures) -> Option<f64>| {
        number(figures.and_then(value).unwrap_or(f64::NAN), 3)
    };
    [cell(|f| f.mean), cell(|f| f.p95), cell(|f| f.worst)]
}

/// ∞ for equal images, a dash where there is nothing.
fn number(value: f64, digits: usize) -> String {
    if value.is_nan() {
        "—".to_owned()
    } else if value.is_infinite() {
        "∞".to_owned()
    } else {
        format!("{value:.digits$}")
    }
}

#[cfg(test)]
mod tests {
    use crate::quality::{MapChannels, Quality};
    use ndarray::Array3;
    use ntmu_isa::asset::Encoding;

    #[test]
    fn every_map_and_mip_has_a_row_of_its_own() {
        // A height off by 1/2 in mip 0 and equal in mip 1; a normal of length 0 in one texel.
        let mut a = [Array3::zeros((4, 2, 4)), Array3::zeros((4, 1, 2))];
        let mut b = a.clone();
        b[0].index_axis_mut(ndarray::Axis(0), 3).fill(0.5);
        for channel in 0..3 {
            a[0][[channel, 0, 0]] = 0.5;
            b[0][[channel, 0, 0]] = 0.5;
        }
        let map = |name: &str, channels, encoding| MapChannels {
            name: name.to_owned(),
            channels,
            encoding,
        };
        let maps = [
            map("normal", 0..3, Encoding::NormalDx),
            map("height", 3..4, Encoding::Linear),
        ];
        let text = Quality::measure(&a, &b, &maps).unwrap().markdown();
        let rows: Vec<&str> = text.lines().collect();
        assert_eq!(
            rows[0],
            "| Map | Mip | Resolution | PSNR (dB) | SSIM | Angle, mean (°) | 95 % (°) | worst (°) |"
        );
        assert_eq!(
            rows[2],
            "| normal | 0 | 4 × 2 | ∞ | 1.0000 | 0.000 | 0.000 | 0.000 |"
        );
        assert!(
            rows[5].starts_with("| height | 0 | 4 × 2 | 6.02 | "),
            "{}",
            rows[5]
        );
        assert!(rows[5].ends_with(" | — | — | — |"));
        assert!(rows[6].starts_with("| height | 1 | 2 × 1 | ∞ | 1.0000 |"));
        assert!(
            rows[10].starts_with("| all maps | all |  | "),
            "{}",
            rows[10]
        );
        assert_eq!(
            rows[12],
            "- normal: 1 normals of length 0 have no angle and are left out of 10."
        );
    }
}
