//! Tests of imperfect drawings: each value does what it says, and only that.

use nalgebra::Point2;

use super::*;
use crate::{DegradeOptions, DegradePreset};

fn line(kind: LineKind, length: f64) -> Stroke {
    Stroke {
        kind,
        points: vec![Point2::new(0.0, 0.0), Point2::new(length, 0.0)],
        widths_px: Vec::new(),
    }
}

fn random(seed: u64) -> ChaCha8Rng {
    view_random(seed, frames::Azimuth::from_degrees(30.0).unwrap().into())
}

fn middle() -> Degradation {
    DegradeOptions::preset(DegradePreset::Middle, 1).resolved(1.5).unwrap()
}

#[test]
fn presets_are_the_documented_values() {
    let middle = middle();
    let expected = Degradation {
        wobble_rms_px: 1.0,
        wobble_wavelength_px: 40.0,
        gap_share: 0.02,
        width_min_px: 1.0,
        width_max_px: 2.5,
        scale_error: 0.02,
        shift_px: 3.0,
        azimuth_error_deg: 2.0,
        missing_interior: 0.2,
        jpeg_quality: 75,
        ..middle.clone()
    };
    assert_eq!(middle, expected);
    let heavy = DegradeOptions::preset(DegradePreset::Heavy, 1).resolved(1.5).unwrap();
    assert_eq!((heavy.wobble_rms_px, heavy.gap_share, heavy.jpeg_quality), (2.0, 0.04, 50));
    let light = DegradeOptions::preset(DegradePreset::Light, 1).resolved(1.5).unwrap();
    assert_eq!((light.wobble_rms_px, light.shift_px, light.jpeg_quality), (0.5, 1.5, 88));
    assert_eq!(DegradeOptions::default().resolved(1.5), None);
}

#[test]
fn one_parameter_alone_changes_only_that() {
    let options = DegradeOptions { shift_px: Some(5.0), ..DegradeOptions::default() };
    let only_shift = options.resolved(1.5).unwrap();
    assert_eq!(only_shift.shift_px, 5.0);
    assert_eq!((only_shift.wobble_rms_px, only_shift.jpeg_quality), (0.0, 0));
    let drawn = only_shift.redraw(&[line(LineKind::Crease, 50.0)], &mut random(3));
    assert!(drawn[0].points.iter().all(|p| p.y == 0.0));
}

#[test]
fn lines_wobble_by_the_given_deviation() {
    let steady = Degradation { gap_share: 0.0, missing_interior: 0.0, ..middle() };
    let strokes: Vec<_> = (0..40).map(|_| line(LineKind::Silhouette, 400.0)).collect();
    let drawn = steady.redraw(&strokes, &mut random(5));
    let deviations: Vec<f64> = drawn.iter().flat_map(|s| &s.points).map(|p| p.y * p.y).collect();
    let rms = (deviations.iter().sum::<f64>() / deviations.len() as f64).sqrt();
    assert!((rms - 1.0).abs() < 0.1, "{rms}");
    let widths: Vec<_> = drawn.iter().flat_map(|s| s.widths_px.iter().copied()).collect();
    assert!(widths.iter().all(|w| (1.0..=2.5).contains(w)));
    let spread =
        widths.iter().copied().fold(0.0, f64::max) - widths.iter().copied().fold(9.0, f64::min);
    assert!(spread > 1.2, "{spread}");
}

#[test]
fn gaps_take_their_share_of_the_length() {
    let gappy =
        Degradation { wobble_rms_px: 0.0, gap_share: 0.1, missing_interior: 0.0, ..middle() };
    let strokes: Vec<_> = (0..200).map(|_| line(LineKind::Silhouette, 150.0)).collect();
    let drawn = gappy.redraw(&strokes, &mut random(6));
    let left: f64 = drawn.iter().map(Stroke::length_px).sum::<f64>() / (200.0 * 150.0);
    assert!((0.85..0.93).contains(&left), "{left}");
    assert!(drawn.len() > 300);
}

#[test]
fn a_fifth_of_the_interior_strokes_is_missing_and_no_outline() {
    let gapless = Degradation { gap_share: 0.0, ..middle() };
    let mut strokes: Vec<_> = (0..50).map(|_| line(LineKind::Crease, 20.0)).collect();
    strokes.extend((0..10).map(|_| line(LineKind::Silhouette, 20.0)));
    let drawn = gapless.redraw(&strokes, &mut random(7));
    let outlines = drawn.iter().filter(|stroke| stroke.kind == LineKind::Silhouette).count();
    assert_eq!((drawn.len() - outlines, outlines), (40, 10));
}

#[test]
fn view_errors_stay_within_their_limits_and_vary() {
    let middle = middle();
    let errors: Vec<_> = (0..200).map(|seed| middle.view_error(&mut random(seed))).collect();
    assert!(errors.iter().all(|e| {
        (e.scale - 1.0).abs() <= 0.02
            && e.shift_px.iter().all(|s| s.abs() <= 3.0)
            && e.azimuth_error_deg.abs() <= 2.0
    }));
    let largest = errors.iter().map(|e| e.azimuth_error_deg.abs()).fold(0.0, f64::max);
    assert!(largest > 1.8, "{largest}");
    assert_eq!(errors[0], middle.view_error(&mut random(0)));
}

#[test]
fn pencil_is_grey_and_paper_not_quite_white() {
    let mut ink = GrayImage::new(64, 64);
    (0..64).for_each(|x| ink.put_pixel(x, 32, image::Luma([255])));
    let drawing = middle().on_paper(&ink, &mut random(8));
    let mean =
        |row: u32| (0..64).map(|x| f64::from(drawing.get_pixel(x, row).0[0])).sum::<f64>() / 64.0;
    assert!((60.0..130.0).contains(&mean(32)), "{}", mean(32));
    assert!((240.0..255.0).contains(&mean(10)), "{}", mean(10));
}
