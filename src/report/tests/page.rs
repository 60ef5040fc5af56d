//! What the page says and shows.

use super::{charge, picture, ramp, row, study};
use crate::report::{MapPicture, ReportError, html};
use crate::study::TwinStudy;
use crate::timing::lab::{Lab, Sizes};
use std::sync::LazyLock;

#[test]
fn hostile_names_are_escaped_wherever_they_come_from() {
    let hostile = "</td></text><script>alert('x')</script>\"&";
    let mut study = study();
    study.asset.name = hostile.to_owned();
    study.quality.as_mut().unwrap().maps[0].map = hostile.to_owned();
    study.timing = vec![row(hostile, hostile, vec![charge(hostile, 9)])];
    study.timing[0].bottleneck = hostile.to_owned();
    let decoded = ramp(3, 4, 8);
    let map = MapPicture {
        map: hostile,
        source: None,
        decoded: decoded.view(),
    };
    let twins = [
        TwinStudy::Skipped {
            reason: hostile.to_owned(),
        },
        TwinStudy::Ran {
            adapter: hostile.to_owned(),
            codes: 1,
            differing: 0,
            first: None,
        },
    ];
    for twin in twins {
        study.twin = twin;
        let page = html(&study, &[map]).unwrap();
        assert!(!page.contains("<script"));
        assert!(!page.contains("\"&"), "an attribute ends early");
        assert!(page.contains("&lt;/td&gt;&lt;/text&gt;&lt;script&gt;alert"));
    }
}

#[test]
fn nothing_is_loaded_and_nothing_runs() {
    let texels = ramp(3, 4, 8);
    let page = html(&study(), &[picture(Some(&texels), &texels)]).unwrap();
    for external in [
        "http:", "https:", "<script", "<link", "@import", "url(", "src=\"", " on",
    ] {
        for rest in page.split(external).skip(1) {
            let inside = match external {
                "src=\"" => rest.starts_with("data:image/png;base64,"),
                "url(" => rest.starts_with("#hatch)"),
                // A word of a sentence, not an event's attribute.
                " on" => !rest
                    .split([' ', '<', '.', ','])
                    .next()
                    .unwrap()
                    .contains('='),
                _ => false,
            };
            assert!(
                inside,
                "{external}{}",
                rest.chars().take(40).collect::<String>()
            );
        }
    }
}

#[test]
fn the_same_study_gives_the_same_bytes() {
    let (source, decoded) = (ramp(4, 4, 8), ramp(4, 4, 8) * 0.9);
    let page = || html(&study(), &[picture(Some(&source), &decoded)]).unwrap();
    assert_eq!(page(), page());
}

#[test]
fn a_ledger_that_does_not_add_up_is_refused() {
    let mut study = study();
    study.timing[1].ledger[0].cycles += 1;
    let error = html(&study, &[]).unwrap_err();
    assert!(
        matches!(
            error,
            ReportError::Ledger {
                found: 405,
                allowed: 404,
                ..
            }
        ),
        "{error}"
    );
}

#[test]
fn every_number_of_the_tables_is_in_the_page() {
    let page = html(&study(), &[]).unwrap();
    let facts = "8 × 4|40 texels|3 / 5|w7a8|nt-d3d11@0123456789abcdef|5,376|41.6 KiB|42,576|36,864|5,712|0.577|31.11";
    let quality = "34.57|0.9123|∞ (identical)|1.0000|35.11|0.9200|33.33|0.8765|32.22|0.8654|\
                   0.8543|8×4|4×2";
    let exactness = "786,429|777,017|4,210|5,202|0.5353 %|98.8032 %|0.6615 %|1.83|0.296|0.291|\
                     41.7|>−1<|>+1<";
    let cycles = "45.70|40.40|31.41|1.45 ×|1.29 ×|27.18|93.7 %|61.1 %|1,234.6|MAC array|44.4|55.5|30.33|99.44|35.55|888.81|21.71|765.4|26.26|0.92|40.00|\
                  5.70|0.30|40.10|87.5 %|12.5 %|99.3 %|0.7 %";
    let precision = "34.25|33.50|29.75|0.561|0.455|6,021|31.09|layer 2: found a table|30.50|0.490";
    let numbers = [facts, quality, exactness, cycles, precision];
    for number in numbers.iter().flat_map(|section| section.split('|')) {
        assert!(page.contains(number), "{number}");
    }
}

#[test]
fn a_map_without_source_shows_the_reconstruction_alone_and_says_so() {
    let texels = ramp(3, 4, 8);
    let page = |source| html(&study(), &[picture(source, &texels)]).unwrap();
    let (with, without) = (page(Some(&texels)), page(None));
    assert_eq!(with.matches("<img").count(), 3);
    assert!(with.contains("Difference × 8") && !with.contains("No source was given"));
    assert_eq!(without.matches("<img").count(), 1);
    assert!(!without.contains("Difference × 8") && without.contains("No source was given"));
}

#[test]
fn what_was_not_done_is_said() {
    let mut study = study();
    study.quality = None;
    study.sweep.clear();
    study.timing.clear();
    study.oracle.histogram.clear();
    study.twin = TwinStudy::Skipped {
        reason: "no adapter was found".to_owned(),
    };
    let page = html(&study, &[]).unwrap();
    for said in [
        "GPU twin skipped:</b> no adapter was found",
        "the GPU twin did not run",
        "quality was not measured",
        "nothing to sweep against",
        "No unit was simulated",
        "No map was given",
    ] {
        assert!(page.contains(said), "{said}");
    }
}

#[test]
fn a_failed_check_is_said_with_its_place() {
    let mut study = study();
    study.twin = TwinStudy::Ran {
        adapter: "some adapter".to_owned(),
        codes: 9,
        differing: 2,
        first: Some((1, 2, 3, 4, -5, 6)),
    };
    study.oracle.max = 42.0;
    let page = html(&study, &[]).unwrap();
    assert!(page.contains("A check failed."));
    assert!(page.contains("on 2 of 9 codes (some adapter)"));
    assert!(
        page.contains("mip 1, channel 2, row 3, column 4, where the model has −5 and the twin 6")
    );
    assert!(page.contains("Model outside the proven bound"));
}

#[test]
fn maps_that_cannot_be_compared_are_refused() {
    let (small, large, none) = (ramp(1, 2, 2), ramp(1, 2, 3), ramp(1, 0, 2));
    let error = html(&study(), &[picture(Some(&large), &small)]).unwrap_err();
    assert!(matches!(
        error,
        ReportError::Shape {
            found: (1, 2, 3),
            allowed: (1, 2, 2),
            ..
        }
    ));
    let error = html(&study(), &[picture(None, &none)]).unwrap_err();
    assert!(matches!(
        error,
        ReportError::Empty {
            found: (1, 0, 2),
            ..
        }
    ));
}

#[test]
fn odd_figures_do_not_stop_the_report() {
    let mut study = study();
    study.oracle.histogram = vec![(i64::MIN, 1), (i64::MAX, 2)];
    study.oracle.bound = f64::INFINITY;
    for point in &mut study.sweep {
        point.psnr = f64::INFINITY;
    }
    study.timing[0] = row("none", "linear", Vec::new());
    study.timing[1].closed_form_per_block = f64::NAN;
    assert!(
        html(&study, &[])
            .unwrap()
            .contains("No point has a finite PSNR")
    );
}
/// Every experiment on the built-in asset, on small scenes.
static LAB: LazyLock<Lab> = LazyLock::new(|| {
    let asset = crate::built_in::asset().unwrap();
    Lab::run(&asset, &Sizes::QUICK, |_| ()).unwrap()
});

#[test]
fn every_experiment_has_its_figure_and_no_figure_has_a_number_that_is_none() {
    let mut study = study();
    let without = html(&study, &[]).unwrap();
    assert!(!without.contains("id=\"experiments\""));
    study.lab = Some(LAB.clone());
    let page = html(&study, &[]).unwrap();
    assert!(page.contains("id=\"experiments\""));
    for figure in [
        "Relative performance of BC7, 3 maps over the depth of the corner FIFO",
        "Bytes from memory per pixel for each layout and cache line",
        "Bytes from memory per pixel over the size of the cache",
        "Cycles per block over the number of materials",
        "Roofline",
        "Energy per texel block by part",
        "Lines missed over the screen",
    ] {
        assert!(page.contains(figure), "{figure}");
    }
    assert_eq!(page.matches("data:image/png;base64,").count(), 3);
    assert!(!page.contains("NaN") && !page.contains(",inf") && !page.contains("\"inf"));
    // An element with two class attributes would lose the second.
    for tag in page.split('<') {
        let tag = tag.split('>').next().unwrap_or_default();
        assert!(tag.matches(" class=").count() <= 1, "{tag}");
    }
}
