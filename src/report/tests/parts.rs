//! What the page is made of: numbers, axes, bars, pictures.

use super::{picture, ramp, study};
use crate::report::html;
use crate::report::number::{bytes, decimal, integer, percent, psnr, signed, significant};
use crate::report::picture::{Pictures, reduced};
use crate::report::stacks::{causes, stack};
use crate::report::svg::{Axis, round_step, shortened};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use ndarray::arr3;

fn decode(uri: &str) -> image::DynamicImage {
    let file = STANDARD
        .decode(uri.strip_prefix("data:image/png;base64,").unwrap())
        .unwrap();
    image::load_from_memory(&file).unwrap()
}

#[test]
fn segments_of_a_bar_add_up_to_cycles_per_block() {
    let study = study();
    let causes = causes(&study.timing);
    assert_eq!(causes, ["compute", "latent-miss", "weight-fill"]);
    for row in &study.timing {
        let stack = stack(row, &causes).unwrap();
        let sum: f64 = stack.segments.iter().sum();
        // One rounding per quotient, product and sum of each segment.
        let allowed = 3.0 * causes.len() as f64 * f64::EPSILON * row.cycles_per_block;
        assert!((sum - row.cycles_per_block).abs() <= allowed, "{sum}");
    }
}

#[test]
fn pictures_show_codes_and_the_difference_eight_times() {
    let source = arr3(&[
        [[0.0, 1.0, 0.5, 0.25]],
        [[0.0, 1.0, 0.5, 0.25]],
        [[0.0, 1.0, 0.5, 0.2]],
    ]);
    let decoded = arr3(&[
        [[0.0, 0.5, 0.5, 0.25]],
        [[0.0, 1.0, 2.0, 0.25]],
        [[0.1, 1.0, 0.5, 0.2]],
    ]);
    let pictures = Pictures::draw(&picture(Some(&source), &decoded)).unwrap();
    assert_eq!(
        (pictures.factor, pictures.largest_difference),
        (1, Some(1.5))
    );
    let strip = &pictures.strips[0];
    let shown = decode(&strip.decoded).into_rgb8().into_raw();
    assert_eq!(shown, [0, 0, 26, 128, 255, 255, 128, 255, 128, 64, 64, 51]);
    let difference = decode(&strip.compared.as_ref().unwrap().difference)
        .into_rgb8()
        .into_raw();
    assert_eq!(difference, [0, 0, 204, 255, 0, 0, 0, 255, 0, 0, 0, 0]);
}

#[test]
fn any_number_of_channels_has_strips() {
    for (channels, ends) in [(1, vec![1]), (2, vec![2]), (3, vec![3]), (4, vec![3, 4])] {
        let texels = ramp(channels, 2, 2);
        let pictures = Pictures::draw(&picture(None, &texels)).unwrap();
        let found: Vec<_> = pictures
            .strips
            .iter()
            .map(|strip| strip.channels.end)
            .collect();
        assert_eq!(found, ends);
    }
    let two = arr3(&[[[0.2]], [[0.6]]]);
    let shown = decode(&Pictures::draw(&picture(None, &two)).unwrap().strips[0].decoded);
    assert_eq!(shown.into_rgb8().into_raw(), [51, 102, 153]);
}

#[test]
fn large_maps_are_reduced_by_whole_boxes_and_the_page_says_so() {
    let texels = ramp(1, 3, 1025);
    let pictures = Pictures::draw(&picture(None, &texels)).unwrap();
    assert_eq!(
        (
            pictures.factor,
            pictures.strips[0].width,
            pictures.strips[0].height
        ),
        (3, 342, 1)
    );
    let page = html(&study(), &[picture(None, &texels)]).unwrap();
    assert!(page.contains("Reduced from 1,025 × 3 texels"));
    assert!(page.contains("mean of 3 × 3 texels"));
    let cut = arr3(&[[[1.0, 3.0, 10.0], [5.0, 7.0, 20.0], [2.0, 4.0, 30.0]]]);
    assert_eq!(reduced(cut.view(), 2), arr3(&[[[4.0, 15.0], [3.0, 30.0]]]));
}

#[test]
fn numbers_read_well() {
    assert_eq!(
        [0, 999, 1000, 1_234_567].map(integer),
        ["0", "999", "1,000", "1,234,567"]
    );
    assert_eq!([-1200, 0, 7].map(signed), ["−1,200", "0", "+7"]);
    assert_eq!(decimal(-1234.567, 2), "−1,234.57");
    assert_eq!(
        [-0.001, f64::NAN, f64::NEG_INFINITY].map(|v| decimal(v, 2)),
        ["0.00", "—", "−∞"]
    );
    assert_eq!(
        [0.0, 0.012_34, 41.7, 1234.0, 1e-9].map(significant),
        ["0", "0.0123", "41.7", "1,234", "1.00e−9"]
    );
    assert_eq!(
        [f64::INFINITY, 31.118].map(psnr),
        ["∞ (identical)", "31.12"]
    );
    assert_eq!(percent(0.9371), "93.7 %");
    assert_eq!(
        [1023, 1024, 1_572_864].map(bytes),
        ["1023 B", "1.0 KiB", "1.50 MiB"]
    );
}

#[test]
fn ticks_are_round_and_within_the_axis() {
    assert_eq!(
        [0.03, 1.0, 1.1, 30.0].map(round_step),
        [0.05, 1.0, 2.0, 50.0]
    );
    let axis = Axis {
        values: (0.0, 1.0),
        pixels: (100.0, 0.0),
    };
    let ticks: Vec<_> = axis.ticks(5).into_iter().map(|(_, label)| label).collect();
    assert_eq!(ticks, ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
    assert_eq!(axis.at(0.25), 75.0);
    assert_eq!(shortened("abcdef", 4), "abc…");
}
