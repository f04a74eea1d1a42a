//! Tests of registration: views that are off are found and put back, others left alone.

use super::*;
use crate::silhouette::SilhouetteOptions;

const HALF_HEIGHT: f64 = 50.0;

/// A solid box turned to `degrees`, drawn `scale` times as large and moved.
fn block(degrees: f64, scale: f64, (dx, dy): (f64, f64)) -> View {
    let azimuth = Azimuth::from_degrees(degrees).unwrap();
    let (sine, cosine) = azimuth.radians().sin_cos();
    let half = scale * (40.0 * cosine.abs() + 25.0 * sine.abs());
    let image = GrayImage::from_fn(180, 160, |u, v| {
        let (x, y) = (f64::from(u) + 0.5 - 90.0 - dx, f64::from(v) + 0.5 - 80.0 - dy);
        let depth = (x.abs() - half).max(y.abs() - scale * HALF_HEIGHT);
        let ink = (0.75 + 0.5 - depth.abs()).clamp(0.0, 1.0);
        Luma([(255.0 * (1.0 - ink)).round() as u8])
    });
    View::level(azimuth, image, None)
}

fn registered(odd: View) -> (ViewSet<'static>, Vec<ViewRegistration>) {
    let mut views: Vec<View> = [0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0]
        .into_iter()
        .map(|degrees| block(degrees, 1.0, (0.0, 0.0)))
        .collect();
    views[3] = odd;
    let views = ViewSet::of_owned(views).unwrap();
    let silhouettes = Silhouettes::of_views(&views, &SilhouetteOptions::default()).unwrap();
    let found = register(&views, &silhouettes);
    (views, found)
}

#[test]
fn views_that_agree_are_left_alone() {
    let (views, found) = registered(block(45.0, 1.0, (0.0, 0.0)));
    assert!(found.iter().all(|found| !found.corrects() && found.consistency > 0.95));
    assert!(corrected(&views, &found).is_none());
}

#[test]
fn a_scaled_and_lowered_view_is_put_back() {
    let (views, found) = registered(block(45.0, 1.1, (0.0, 6.0)));
    assert!((found[3].scale - 1.1).abs() < 0.02, "{:?}", found[3]);
    assert!((found[3].shift_y_px - 6.0).abs() < 1.0, "{:?}", found[3]);
    assert!(found.iter().enumerate().all(|(k, found)| k == 3 || found.scale == 1.0));
    let mended = corrected(&views, &found).unwrap();
    let silhouettes = Silhouettes::of_views(&mended, &SilhouetteOptions::default()).unwrap();
    assert!(register(&mended, &silhouettes).iter().all(|found| found.scale == 1.0));
}

#[test]
fn a_view_shifted_sideways_is_named_and_put_back() {
    let (_, found) = registered(block(45.0, 1.0, (7.0, 0.0)));
    assert!((found[3].shift_x_px - 7.0).abs() < 2.5, "{:?}", found[3]);
    let others = found.iter().enumerate().filter(|(k, _)| *k != 3);
    assert!(others.map(|(_, found)| found.shift_x_px.abs()).fold(0.0, f64::max) < 2.5);
}

#[test]
fn a_view_of_something_else_scores_low() {
    let (_, found) = registered(block(45.0, 1.0, (0.0, 0.0)));
    let (_, odd) = registered({
        let mut odd = block(0.0, 1.6, (0.0, 0.0));
        odd.azimuth = Azimuth::from_degrees(45.0).unwrap();
        // As tall as the others, but far too wide.
        odd.image = GrayImage::from_fn(180, 160, |u, v| {
            let (x, y) = (f64::from(u) + 0.5 - 90.0, f64::from(v) + 0.5 - 80.0);
            let depth = (x.abs() - 75.0).max(y.abs() - HALF_HEIGHT);
            Luma([(255.0 * (depth.abs() - 0.25).clamp(0.0, 1.0)).round() as u8])
        });
        odd
    });
    assert!(odd[3].consistency < 0.2 && found[3].consistency > 0.95, "{:?}", odd[3]);
    assert!(found.iter().all(|found| !found.contradicts));
    let named: Vec<bool> = odd.iter().map(|found| found.contradicts).collect();
    assert_eq!(named, [false, false, false, true, false, false, false]);
}

#[test]
fn a_view_too_narrow_for_its_neighbours_contradicts_them_not_they_it() {
    let (_, found) = registered({
        let azimuth = Azimuth::from_degrees(45.0).unwrap();
        View { azimuth, ..block(90.0, 1.0, (0.0, 0.0)) }
    });
    // The neighbours do not fit it, yet it is the odd one.
    assert!(found[2].consistency < 0.5 && found[4].consistency < 0.5, "{found:?}");
    let named: Vec<bool> = found.iter().map(|found| found.contradicts).collect();
    assert_eq!(named, [false, false, false, true, false, false, false]);
}

fn drawn_with(errors: &[(f64, f64, f64, f64)]) -> Vec<ViewRegistration> {
    let views = errors.iter().map(|&(degrees, scale, dx, dy)| block(degrees, scale, (dx, dy)));
    let views = ViewSet::of_owned(views.collect()).unwrap();
    let options = SilhouetteOptions::default();
    register(&views, &Silhouettes::of_views_alone(&views, &options).unwrap())
}

#[test]
fn shifts_of_a_full_turn_are_found_up_to_the_subjects_own_place() {
    let dx = [2.0, -3.0, 1.5, 0.0, -2.5, 2.0, 3.0, -1.0];
    let dy = [1.0, -2.0, 2.5, -2.5, 0.0, 2.0, -1.0, 0.0];
    let scale = [1.0, 1.02, 0.985, 1.01, 1.0, 0.98, 1.015, 0.99];
    let errors: Vec<_> = (0..8).map(|k| (45.0 * k as f64, scale[k], dx[k], dy[k])).collect();
    let found = drawn_with(&errors);
    // What is left is one move of the subject: X cos a + Y sin a.
    let left: Vec<f64> = found.iter().zip(dx).map(|(f, dx)| dx - f.shift_x_px).collect();
    let project = |wave: fn(f64) -> f64| -> f64 {
        let azimuths = found.iter().map(|found| wave(found.azimuth.radians()));
        azimuths.zip(&left).map(|(wave, left)| wave * left / 4.0).sum()
    };
    let (x, y) = (project(f64::cos), project(f64::sin));
    let mean_dy = dy.iter().sum::<f64>() / 8.0;
    for (k, found) in found.iter().enumerate() {
        let (sine, cosine) = found.azimuth.radians().sin_cos();
        assert!((left[k] - x * cosine - y * sine).abs() < 0.8, "view {k}: {left:?}");
        assert!((found.shift_y_px - dy[k] + mean_dy).abs() < 1.0, "view {k}: {found:?}");
        assert!((found.scale - scale[k]).abs() < 0.012, "view {k}: {found:?}");
    }
}

#[test]
fn of_three_views_the_middle_ones_contradiction_is_found() {
    let found = drawn_with(&[(0.0, 1.0, 0.0, 2.0), (45.0, 1.0, 5.0, -2.0), (90.0, 1.0, 0.0, 0.0)]);
    // Only dx(45) - (dx(0) + dx(90)) cos 45 can be seen.
    let [front, middle, side] = [0, 1, 2].map(|k| found[k].shift_x_px);
    let contradiction = middle - (front + side) * std::f64::consts::FRAC_1_SQRT_2;
    assert!((contradiction - 5.0).abs() < 1.0, "{found:?}");
}
