//! `find` on small drawings made here: kinds of drawings, hints, and images on
//! which it must not panic.

use image::{GrayImage, Rgba, RgbaImage};
use subject::{
    DrawingKind, Hints, Point, RemovedKind, Subject, SubjectError, SubjectOptions, Warning, find,
};

fn found(drawing: &RgbaImage, hints: &Hints) -> Subject {
    find(drawing, hints, &SubjectOptions::default(), &|| false).unwrap()
}

/// A bottle in outline, 200 x 260 px, without its outline from `gap`.
fn bottle(ink: [u8; 4], paper: [u8; 4], fill: [u8; 4]) -> RgbaImage {
    RgbaImage::from_fn(200, 260, |x, y| {
        let (x, y) = (f64::from(x) - 100.0, f64::from(y));
        let half = if y < 90.0 { 18.0 } else { (18.0 + (y - 90.0) * 0.6).min(50.0) };
        let side = half - x.abs();
        let ends = (y - 30.0).min(235.0 - y);
        let depth = side.min(ends);
        if depth < 0.0 {
            Rgba(paper)
        } else if depth < 2.5 {
            Rgba(ink)
        } else {
            Rgba(fill)
        }
    })
}

fn area(mask: &GrayImage) -> f64 {
    mask.iter().filter(|level| **level != 0).count() as f64
}

const BLACK: [u8; 4] = [0, 0, 0, 255];
const WHITE: [u8; 4] = [255; 4];

#[test]
fn kinds_of_drawings_give_one_mask() {
    let cases = [
        (bottle(BLACK, WHITE, WHITE), DrawingKind::LineArt),
        (bottle(WHITE, [20, 30, 90, 255], [20, 30, 90, 255]), DrawingKind::LineArt),
        (bottle(BLACK, [0; 4], [0; 4]), DrawingKind::InkLayer),
        (bottle(BLACK, [0; 4], WHITE), DrawingKind::CutOut),
        (bottle(BLACK, WHITE, [200, 120, 80, 255]), DrawingKind::Flat),
        (bottle([200, 120, 80, 255], [160, 160, 160, 255], [200, 120, 80, 255]), DrawingKind::Flat),
    ];
    let clean = area(&found(&cases[0].0, &Hints::default()).mask);
    for (drawing, kind) in cases {
        let subject = found(&drawing, &Hints::default());
        assert_eq!(subject.kind, kind);
        assert!(subject.warnings.is_empty(), "{kind:?}: {:?}", subject.warnings);
        assert!((area(&subject.mask) / clean - 1.0).abs() < 0.02, "{kind:?}");
        assert!(subject.ink.pixels().any(|p| p.0[0] < 60));
        assert_eq!(subject.ink.get_pixel(3, 3).0[0], 255);
    }
}

#[test]
fn clean_line_art_is_returned_as_it_was_drawn() {
    let drawing = bottle(BLACK, WHITE, WHITE);
    let subject = found(&drawing, &Hints::default());
    for (ink, pixel) in subject.ink.pixels().zip(drawing.pixels()) {
        assert_eq!(ink.0[0], pixel.0[0]);
    }
}

#[test]
fn hints_are_followed() {
    let drawing = bottle(BLACK, WHITE, WHITE);
    let square: Vec<Point> = [(10.0, 10.0), (50.0, 10.0), (50.0, 60.0), (10.0, 60.0)]
        .map(|(x, y)| Point { x, y })
        .into();
    let given = found(&drawing, &Hints { polygon: Some(square.clone()), ..Hints::default() });
    assert_eq!((given.kind, area(&given.mask)), (DrawingKind::Given, 2000.0));
    let all: Vec<Point> = [(0.0, 0.0), (200.0, 0.0), (200.0, 110.0), (0.0, 110.0)]
        .map(|(x, y)| Point { x, y })
        .into();
    let erased = found(
        &bottle(BLACK, WHITE, [90, 90, 200, 255]),
        &Hints { erase: vec![all], ..Hints::default() },
    );
    assert!(erased.mask.enumerate_pixels().all(|(_, y, p)| y >= 110 || p.0[0] == 0));
    assert!(erased.removed.iter().any(|r| r.kind == RemovedKind::Erased));
    let wrong = Hints { mask: Some(GrayImage::new(3, 3)), ..Hints::default() };
    let error = find(&drawing, &wrong, &SubjectOptions::default(), &|| false).unwrap_err();
    assert!(matches!(error, SubjectError::MaskSizeDiffers { found: (3, 3), .. }));
    let thin = Hints { polygon: Some(vec![Point::default(); 2]), ..Hints::default() };
    let error = find(&drawing, &thin, &SubjectOptions::default(), &|| false).unwrap_err();
    assert_eq!(error, SubjectError::TooFewPoints { found: 2 });
}

#[test]
fn a_figure_cut_by_the_page_is_closed_with_a_warning() {
    let drawing =
        image::imageops::crop_imm(&bottle(BLACK, WHITE, WHITE), 0, 0, 200, 180).to_image();
    let subject = found(&drawing, &Hints::default());
    assert!(subject.mask.get_pixel(100, 170).0[0] == 255);
    assert!(matches!(subject.warnings[..], [Warning::CutByEdge { .. }]), "{:?}", subject.warnings);
}

#[test]
fn large_drawings_are_refined_at_full_size() {
    let drawing = bottle(BLACK, WHITE, WHITE);
    let large = image::imageops::resize(&drawing, 800, 1040, image::imageops::FilterType::Nearest);
    let options = SubjectOptions { working_side_px: 300, ..SubjectOptions::default() };
    let coarse = find(&large, &Hints::default(), &options, &|| false).unwrap();
    let fine = found(&large, &Hints::default());
    let differing = coarse.mask.iter().zip(fine.mask.iter()).filter(|(a, b)| a != b).count();
    assert!((differing as f64) < 0.002 * area(&fine.mask), "{differing}");
}

#[test]
fn cancelling_is_an_error() {
    let drawing = bottle(BLACK, WHITE, WHITE);
    let result = find(&drawing, &Hints::default(), &SubjectOptions::default(), &|| true);
    assert_eq!(result.unwrap_err(), SubjectError::Cancelled);
}

#[test]
fn no_image_makes_it_panic() {
    let mut state = 9_u64;
    let mut random = move || {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (state >> 33) as u32
    };
    let mut images = vec![RgbaImage::new(0, 0), RgbaImage::new(0, 7), RgbaImage::new(5, 0)];
    for (w, h) in [(1, 1), (1, 9), (9, 1), (2, 2), (3, 200), (200, 3), (31, 17), (130, 140)] {
        for colour in [[0; 4], BLACK, WHITE, [0, 0, 0, 128], [120, 130, 140, 255]] {
            images.push(RgbaImage::from_pixel(w, h, Rgba(colour)));
        }
        for density in [2, 9, 200] {
            images.push(RgbaImage::from_fn(w, h, |_, _| {
                let v = random();
                if v % density == 0 { Rgba(v.to_le_bytes()) } else { Rgba(WHITE) }
            }));
            images.push(RgbaImage::from_fn(w, h, |_, _| {
                Rgba(random().wrapping_mul(5).to_le_bytes())
            }));
            images.push(RgbaImage::from_fn(w, h, |x, _| {
                let v = if x % density == 0 { 0 } else { 255 };
                Rgba([v, v, v, 255])
            }));
        }
    }
    let side: Vec<Point> =
        [(-5.0, -9.0), (1e9, 3.0), (f64::NAN, 2.0)].map(|(x, y)| Point { x, y }).into();
    let hints = Hints {
        erase: vec![side.clone()],
        attach: vec![Point { x: -1.0, y: f64::NAN }],
        ignore: side,
        ..Hints::default()
    };
    for image in images {
        for working_side_px in [1, 64, 2048] {
            let options = SubjectOptions { working_side_px, ..SubjectOptions::default() };
            let _ = find(&image, &Hints::default(), &options, &|| false);
            let _ = find(&image, &hints, &options, &|| false);
        }
    }
}
