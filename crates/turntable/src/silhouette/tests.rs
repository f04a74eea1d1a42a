//! Tests of silhouettes: outlines with gaps, masks, opposite views.

use image::{GrayImage, Luma};

use super::*;

const WIDTH: u32 = 120;
const HEIGHT: u32 = 90;

/// Anti-aliased stroke of `width_px` along the zero set of `distance` (px), ink on white.
fn stroke(width_px: f64, distance: impl Fn(f64, f64) -> f64) -> GrayImage {
    GrayImage::from_fn(WIDTH, HEIGHT, |x, y| {
        let (mut ink, samples) = (0.0, 8);
        for i in 0..samples * samples {
            let u = f64::from(x) + (f64::from(i % samples) + 0.5) / f64::from(samples);
            let v = f64::from(y) + (f64::from(i / samples) + 0.5) / f64::from(samples);
            ink += f64::from(u8::from(distance(u, v).abs() < width_px / 2.0));
        }
        Luma([(255.0 * (1.0 - ink / f64::from(samples * samples))).round() as u8])
    })
}

fn circle(centre: f64, radius: f64) -> impl Fn(f64, f64) -> f64 {
    move |u, v| (u - centre).hypot(v - 45.0) - radius
}

fn view(degrees: f64, image: GrayImage) -> View {
    View::level(Azimuth::from_degrees(degrees).unwrap(), image, None)
}

fn silhouette(image: GrayImage) -> Silhouette {
    Silhouette::of_view(&view(0.0, image), &SilhouetteOptions::default()).unwrap()
}

#[test]
fn a_circle_is_filled_and_measured_at_the_middle_of_its_line() {
    let found = silhouette(stroke(1.5, circle(60.0, 30.0)));
    assert_eq!(found.source(), SilhouetteSource::Filled { closed_gap_px: 0 });
    assert!((found.half_line_px() - 0.75).abs() < 0.1, "{}", found.half_line_px());
    let area = std::f64::consts::PI * 30.75 * 30.75;
    assert!((found.area_px() as f64 / area - 1.0).abs() < 0.02);
    for y in [30, 45, 60] {
        let half = (900.0 - (f64::from(y) + 0.5 - 45.0_f64).powi(2)).sqrt();
        let &[(left, right)] = found.intervals_px(y as usize) else { panic!("one run in row {y}") };
        assert!((left - (60.0 - half)).abs() < 0.4, "row {y}: {left} {half}");
        assert!((right - (60.0 + half)).abs() < 0.4, "row {y}: {right} {half}");
    }
}

#[test]
fn a_gap_in_the_outline_does_not_let_the_outside_in() {
    let ring = circle(60.0, 30.0);
    let gap = |px: f64| {
        stroke(1.5, |u, v| if u > 60.0 && (v - 45.0).abs() < px / 2.0 { 9.0 } else { ring(u, v) })
    };
    let whole = silhouette(stroke(1.5, circle(60.0, 30.0))).area_px() as f64;
    let found = silhouette(gap(7.0));
    assert!((found.area_px() as f64 / whole - 1.0).abs() < 0.02);
    assert!(matches!(found.source(), SilhouetteSource::Filled { closed_gap_px: 6..=8 }));
    let open = silhouette(gap(24.0));
    assert!((open.area_px() as f64) < 0.2 * whole);
}

#[test]
fn a_slit_between_legs_stays_open() {
    let legs = |u: f64, v: f64| {
        let outer = (u - 60.0).abs().max((v - 45.0).abs()) - 30.0;
        let slit = ((u - 60.0).abs() - 3.0).max(40.0 - v);
        outer.max(-slit)
    };
    let found = silhouette(stroke(1.5, legs));
    assert!(!found.contains(60, 60));
    assert!(found.contains(60, 30));
    assert_eq!(found.intervals_px(60).len(), 2);
}

#[test]
fn a_given_mask_wins_over_the_drawing() {
    let mut masked = view(0.0, stroke(1.5, circle(60.0, 30.0)));
    masked.mask = Some(GrayImage::from_fn(WIDTH, HEIGHT, |x, _| {
        Luma([if x == 50 {
            127
        } else if (40..70).contains(&x) {
            128
        } else {
            0
        }])
    }));
    let found = Silhouette::of_view(&masked, &SilhouetteOptions::default()).unwrap();
    assert_eq!(found.source(), SilhouetteSource::Given);
    assert_eq!(found.intervals_px(10), [(40.0, 50.0), (51.0, 70.0)]);
    assert_eq!(found.half_line_px(), 0.0);
}

#[test]
fn blank_and_full_pages_are_refused() {
    let blank = view(0.0, GrayImage::from_pixel(WIDTH, HEIGHT, Luma([255])));
    let options = SilhouetteOptions::default();
    assert!(matches!(
        Silhouette::of_view(&blank, &options),
        Err(SilhouetteError::TooSmall { found_px: 0, .. })
    ));
    let mut full = blank;
    full.mask = Some(GrayImage::from_pixel(WIDTH, HEIGHT, Luma([255])));
    assert!(matches!(
        Silhouette::of_view(&full, &options),
        Err(SilhouetteError::CoversImage { .. })
    ));
}

#[test]
fn opposite_views_share_a_silhouette() {
    let with_leak = |u: f64, v: f64| {
        if u > 50.0 && (v - 45.0).abs() < 12.0 { 9.0 } else { circle(50.0, 30.0)(u, v) }
    };
    let views = ViewSet::of_owned(vec![
        view(0.0, stroke(1.5, circle(50.0, 30.0))),
        view(180.0, stroke(1.5, circle(69.0, 30.0))),
        view(90.0, stroke(1.5, with_leak)),
    ])
    .unwrap();
    let found = Silhouettes::of_views(&views, &SilhouetteOptions::default()).unwrap();
    assert_eq!(found.opposites.len(), 1);
    assert!(found.opposites[0].joined && found.opposites[0].iou > 0.9);
    let [front, side, back] = &found.silhouettes[..] else { panic!("three views") };
    assert_eq!(front.source(), SilhouetteSource::Joined);
    assert!(matches!(side.source(), SilhouetteSource::Filled { .. }));
    for y in 0..i64::from(HEIGHT) {
        for x in 0..i64::from(WIDTH) {
            assert_eq!(front.contains(x, y), back.contains(i64::from(WIDTH) - 1 - x, y));
        }
    }
    let (left, _) = front.intervals_px(45)[0];
    let (_, right) = back.intervals_px(45)[0];
    assert!((left - (f64::from(WIDTH) - right)).abs() < 1e-9);
}

#[test]
fn contradicting_opposites_are_left_alone() {
    let views = ViewSet::of_owned(vec![
        view(0.0, stroke(1.5, circle(30.0, 20.0))),
        view(180.0, stroke(1.5, circle(30.0, 20.0))),
    ])
    .unwrap();
    let found = Silhouettes::of_views(&views, &SilhouetteOptions::default()).unwrap();
    assert!(!found.opposites[0].joined);
    assert!(matches!(found.silhouettes[0].source(), SilhouetteSource::Filled { .. }));
}

#[test]
fn paper_around_the_drawing_changes_nothing() {
    let ring = circle(60.0, 30.0);
    // A gap that lines bridge and a wide one that only a given width closes.
    let gapped = stroke(2.0, |u, v| {
        let angle = (v - 45.0).atan2(u - 60.0);
        if angle.abs() < 0.06 || (angle - 1.5).abs() < 0.13 { 9.0 } else { ring(u, v) }
    });
    let mut wide = GrayImage::from_pixel(WIDTH + 70, HEIGHT + 50, Luma([255]));
    image::imageops::replace(&mut wide, &gapped, 40, 30);
    let (own, padded) = (silhouette(gapped), silhouette(wide));
    assert_eq!(padded.source(), own.source());
    assert_eq!(padded.area_px(), own.area_px());
    assert!(
        own.mask()
            .enumerate_pixels()
            .all(|(x, y, level)| { padded.mask().get_pixel(x + 40, y + 30) == level })
    );
    let (width, wider) = (WIDTH as usize, WIDTH as usize + 70);
    let moved = own.bridges().iter().map(|index| (index / width + 30) * wider + index % width + 40);
    assert!(!own.bridges().is_empty());
    assert_eq!(padded.bridges(), moved.collect::<Vec<_>>());
}

#[test]
fn only_changed_views_are_found_again() {
    let views = |radius: f64| {
        let images = [0.0, 60.0].map(|degrees| view(degrees, stroke(1.5, circle(60.0, radius))));
        ViewSet::of_owned(images.to_vec()).unwrap()
    };
    let options = SilhouetteOptions::default();
    let before = Silhouettes::of_views_alone(&views(20.0), &options).unwrap();
    let after = before.clone().with_changed(&views(30.0), |view| view == 1, &options).unwrap();
    assert_eq!(after.silhouettes[0].area_px(), before.silhouettes[0].area_px());
    assert!(after.silhouettes[1].area_px() > 2 * before.silhouettes[1].area_px());
}
