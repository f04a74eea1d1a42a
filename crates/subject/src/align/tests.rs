//! Alignment of views whose scale, place and frame are known.

use image::{GrayImage, Luma, RgbaImage};

use super::*;
use crate::{Hints, SubjectOptions, find, hypotheses};

/// A body of elliptic sections that leans and has a nose, seen at an azimuth:
/// per height its middle in depth and its half widths.
fn mask(azimuth_deg: f64, scale: f64, dx: f64, dy: f64, size: (u32, u32)) -> GrayImage {
    let (s, c) = azimuth_deg.to_radians().sin_cos();
    GrayImage::from_fn(size.0, size.1, |x, y| {
        let u = (f64::from(x) + 0.5 - f64::from(size.0) / 2.0 - dx) / scale;
        let v = (f64::from(y) + 0.5 - f64::from(size.1) / 2.0 - dy) / scale;
        let inside = |depth: f64, across: f64, half: (f64, f64)| {
            let middle = depth * s + across * c;
            (u - middle).abs() <= (half.0 * c).hypot(half.1 * s)
        };
        let body = v.abs() < 110.0 && inside(0.15 * v, 0.0, (40.0 + 0.1 * v, 26.0));
        let nose = (v + 70.0).abs() < 18.0 && inside(-85.0, 0.0, (8.0, 14.0));
        let foot = (100.0..110.0).contains(&v) && inside(-30.0, 0.0, (36.0, 30.0));
        Luma([if body || nose || foot { 255 } else { 0 }])
    })
}

fn subject(mask: GrayImage) -> Subject {
    let drawing = RgbaImage::from_pixel(mask.width(), mask.height(), image::Rgba([255; 4]));
    let hints = Hints { mask: Some(mask), ..Hints::default() };
    find(&drawing, &hints, &SubjectOptions::default(), &|| false).unwrap()
}

fn views<'a>(azimuths: &[f64], subjects: &'a [Subject]) -> Vec<View<'a>> {
    let pairs = azimuths.iter().zip(subjects);
    pairs.map(|(azimuth_deg, subject)| View { azimuth_deg: *azimuth_deg, subject }).collect()
}

const AZIMUTHS: [f64; 4] = [0.0, 45.0, 90.0, 180.0];
const SIZE: (u32, u32) = (300, 260);

fn clean() -> Vec<Subject> {
    AZIMUTHS.map(|a| subject(mask(a, 1.0, 0.0, 0.0, SIZE))).into()
}

#[test]
fn a_clean_sheet_stays_as_it_is() {
    let subjects = clean();
    let views = views(&AZIMUTHS, &subjects);
    let alignment = align(&views, &AlignOptions::default());
    assert!(!alignment.changes);
    let aligned = apply(&alignment, &views);
    assert_eq!(aligned[2].mask, subjects[2].mask);
    let masks: Vec<&GrayImage> = aligned.iter().map(|view| &view.mask).collect();
    assert!(trust(&alignment, &masks, true).iter().all(Option::is_none));
    let found = hypotheses(&views, &alignment, &Default::default());
    assert!(found.suggestions.is_empty(), "{found:?}");
}

#[test]
fn scale_and_height_are_recovered() {
    let subjects: Vec<Subject> = AZIMUTHS
        .iter()
        .zip([1.0, 0.9, 1.0, 1.0])
        .map(|(a, scale)| subject(mask(*a, scale, 0.0, if scale < 1.0 { 6.0 } else { 0.0 }, SIZE)))
        .collect();
    let views = views(&AZIMUTHS, &subjects);
    let alignment = align(&views, &AlignOptions::default());
    assert!((alignment.views[1].transform.scale * 0.9 - 1.0).abs() < 0.006, "{alignment:?}");
    let aligned = apply(&alignment, &views);
    let truth = mask(45.0, 1.0, 0.0, 0.0, SIZE);
    let pairs = aligned[1].mask.iter().zip(truth.iter());
    let differing = pairs.filter(|(a, b)| a != b).count();
    assert!(differing < 700, "{differing}");
}

#[test]
fn views_in_their_own_frames_share_a_canvas() {
    let sizes = [(220, 240), (260, 250), (240, 300), (230, 236)];
    let scales = [1.0, 1.1, 1.3, 0.9];
    let subjects: Vec<Subject> = (0..4)
        .map(|k| subject(mask(AZIMUTHS[k], scales[k], 3.0 * k as f64, 0.0, sizes[k])))
        .collect();
    let alignment = align(&views(&AZIMUTHS, &subjects), &AlignOptions::default());
    let first = alignment.views[0].transform.scale;
    for (view, scale) in alignment.views.iter().zip(scales) {
        assert!((view.transform.scale * scale / first - 1.0).abs() < 0.008, "{alignment:?}");
    }
    assert!(alignment.changes);
    assert!((alignment.canvas.axis_x - f64::from(alignment.canvas.width) / 2.0).abs() < 1.0);
}

#[test]
fn a_profile_of_the_wrong_side_is_named() {
    let mut subjects = clean();
    subjects[2] = subject(image::imageops::flip_horizontal(&mask(90.0, 1.0, 0.0, 0.0, SIZE)));
    let views = views(&AZIMUTHS, &subjects);
    let alignment = align(&views, &AlignOptions::default());
    let found = hypotheses(&views, &alignment, &Default::default());
    let first = found.suggestions.first().map(|verdict| verdict.suggestion.to_string());
    assert_eq!(first.as_deref(), Some("view 90 fits better as 270"), "{found:?}");
}

#[test]
fn no_views_and_one_view_are_left_alone() {
    let none = align(&[], &AlignOptions::default());
    assert!(none.views.is_empty() && !none.changes);
    assert!(apply(&none, &[]).is_empty() && trust(&none, &[], true).is_empty());
    let one = [subject(mask(0.0, 1.0, 0.0, 0.0, SIZE))];
    let alignment = align(&views(&[0.0], &one), &AlignOptions::default());
    assert!(!alignment.changes);
}

#[test]
fn a_view_without_its_nose_is_not_trusted_there() {
    let mut subjects = clean();
    let side = &mut subjects[2].mask;
    // Facing left, the nose is left of the body.
    let nose: Vec<_> = side
        .enumerate_pixels()
        .filter(|(x, y, p)| *x < 105 && *y < 80 && p.0[0] > 0)
        .map(|(x, y, _)| (x, y))
        .collect();
    assert!(nose.len() > 100);
    nose.iter().for_each(|&(x, y)| side.put_pixel(x, y, Luma([0])));
    let views = views(&AZIMUTHS, &subjects);
    let alignment = align(&views, &AlignOptions::default());
    let masks: Vec<&GrayImage> = subjects.iter().map(|subject| &subject.mask).collect();
    let found = trust(&alignment, &masks, false);
    let doubted = |k: usize| {
        found[k].as_ref().map_or(0, |map| map.iter().filter(|level| **level == 0).count())
    };
    assert!(doubted(2) > nose.len() / 3, "{} of {}", doubted(2), nose.len());
    assert_eq!([0, 1, 3].map(doubted), [0; 3]);
}

#[test]
fn a_view_without_its_top_keeps_its_size() {
    let mut subjects = clean();
    let side = &mut subjects[2].mask;
    (0..60).for_each(|y| (0..SIZE.0).for_each(|x| side.put_pixel(x, y, Luma([0]))));
    let views = views(&AZIMUTHS, &subjects);
    let alignment = align(&views, &AlignOptions::default());
    assert_eq!(alignment.views[2].transform.scale, 1.0, "{:?}", alignment.views[2]);
    let masks: Vec<&GrayImage> = subjects.iter().map(|subject| &subject.mask).collect();
    let found = trust(&alignment, &masks, false);
    let doubted = |k: usize| {
        found[k].as_ref().map_or(0, |map| map.iter().filter(|level| **level == 0).count())
    };
    assert!(doubted(2) > 800, "{}", doubted(2));
}

#[test]
fn what_a_person_says_of_a_view_is_done() {
    let subjects: Vec<Subject> = AZIMUTHS
        .iter()
        .zip([1.0, 0.6, 1.0, 1.0])
        .map(|(a, scale)| {
            subject(mask(*a, scale, if scale < 1.0 { -30.0 } else { 0.0 }, 0.0, SIZE))
        })
        .collect();
    let views = views(&AZIMUTHS, &subjects);
    let mut alignment = align(&views, &AlignOptions::default());
    let mut hands = [ByHand::default(); 4];
    // 260 rows: the feet are 110 below the middle, drawn at .6 of their distance.
    hands[1] = ByHand { axis_x: Some(120.0), ground_y: Some(130.0 + 66.0), scale: Some(1.0 / 0.6) };
    place_by_hand(&mut alignment, &views, &hands);
    let flags: Vec<bool> = alignment.views.iter().map(|view| view.by_hand).collect();
    assert_eq!(flags, [false, true, false, false]);
    assert_eq!(alignment.canvas.width, SIZE.0, "nothing reaches beyond the canvas");
    let aligned = apply(&alignment, &views);
    let truth = mask(45.0, 1.0, 0.0, 0.0, SIZE);
    let differing = aligned[1].mask.iter().zip(truth.iter()).filter(|(a, b)| a != b).count();
    assert!(differing < 700, "{differing}");
}

#[test]
fn the_canvas_grows_for_what_is_placed_beyond_it() {
    let subjects = clean();
    let views = views(&AZIMUTHS, &subjects);
    let mut alignment = align(&views, &AlignOptions::default());
    let mut hands = [ByHand::default(); 4];
    hands[3].scale = Some(2.0);
    place_by_hand(&mut alignment, &views, &hands);
    let canvas = alignment.canvas;
    assert!(canvas.height > SIZE.1 && canvas.height <= 2 * SIZE.1, "{canvas:?}");
    assert_eq!(canvas.axis_x, f64::from(canvas.width) / 2.0);
    let aligned = apply(&alignment, &views);
    let area = |mask: &GrayImage| mask.iter().filter(|level| **level != 0).count() as f64;
    let grown = area(&aligned[3].mask) / area(&subjects[3].mask);
    assert!((grown - 4.0).abs() < 0.1, "{grown}");
    // The others stand on the same row and turn about the same column.
    assert_eq!(area(&aligned[0].mask), area(&subjects[0].mask));
    hands[3].scale = Some(1e6);
    let mut alignment = align(&views, &AlignOptions::default());
    place_by_hand(&mut alignment, &views, &hands);
    assert!(alignment.canvas.width <= 2 * SIZE.0 && alignment.canvas.height <= 2 * SIZE.1);
}

#[test]
fn all_views_are_as_large_as_a_canvas_that_grew_below() {
    let subjects = clean();
    let views = views(&AZIMUTHS, &subjects);
    let mut alignment = align(&views, &AlignOptions::default());
    let mut hands = [ByHand::default(); 4];
    // It stands so far up in its drawing that its feet reach beyond.
    hands[0].ground_y = Some(alignment.views[0].rows[1] - 60.0);
    place_by_hand(&mut alignment, &views, &hands);
    let (canvas, stays) = (alignment.canvas, alignment.views[1].transform);
    assert!(canvas.height > SIZE.1 && stays == Transform::IDENTITY, "{canvas:?}, {stays:?}");
    for laid in apply(&alignment, &views) {
        assert_eq!(laid.mask.dimensions(), (canvas.width, canvas.height));
    }
}
