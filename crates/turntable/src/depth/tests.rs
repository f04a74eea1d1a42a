//! Tests of depth from lines, on solids whose drawings and depth are known exactly.

use std::sync::Mutex;

use image::{GrayImage, Luma};

use super::contours::Contours;
use super::graph::PixelGraph;
use super::*;
use crate::depth_map::Confidence;
use crate::ink::InkMap;
use crate::silhouette::{SilhouetteOptions, Silhouettes};
use crate::views::ViewSet;
use frames::Azimuth;
use progress::{Cancelled, Observer, Progress, Silent};
use sheet::View;

const WIDTH: u32 = 260;
const HEIGHT: u32 = 170;
const HALF_HEIGHT: f64 = 60.0;

/// A solid whose drawings and depth are known exactly.
trait Subject {
    /// Distance of (x, y), px from axis and origin's row, to the nearest line.
    fn line_distance(&self, azimuth_rad: f64, x: f64, y: f64) -> f64;
    /// Depth of the surface, `None` beside the subject.
    fn depth(&self, azimuth_rad: f64, x: f64, y: f64) -> Option<f64>;
}

/// An upright cylinder beside the axis.
struct Cylinder {
    x: f64,
    y: f64,
    radius: f64,
}

impl Subject for Cylinder {
    fn line_distance(&self, azimuth_rad: f64, x: f64, y: f64) -> f64 {
        let x = x - turned(azimuth_rad, self.x, self.y).0;
        upright_lines(&[-self.radius, self.radius], x, y)
    }

    fn depth(&self, azimuth_rad: f64, x: f64, y: f64) -> Option<f64> {
        let (centre, depth) = turned(azimuth_rad, self.x, self.y);
        let inside = self.radius.powi(2) - (x - centre).powi(2);
        (inside > 0.0 && y.abs() < HALF_HEIGHT).then(|| depth - inside.sqrt())
    }
}

struct Ball {
    radius: f64,
}

impl Subject for Ball {
    fn line_distance(&self, _: f64, x: f64, y: f64) -> f64 {
        (x.hypot(y) - self.radius).abs()
    }

    fn depth(&self, _: f64, x: f64, y: f64) -> Option<f64> {
        let inside = self.radius.powi(2) - x * x - y * y;
        (inside > 0.0).then(|| -inside.sqrt())
    }
}

/// An upright box around the axis.
struct Block {
    half: f64,
}

impl Block {
    fn corners(&self, azimuth_rad: f64) -> Vec<(f64, f64)> {
        let signs = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let corner = |(x, y)| turned(azimuth_rad, x * self.half, y * self.half);
        let mut corners: Vec<_> = signs.into_iter().map(corner).collect();
        // The farthest corner is hidden.
        corners.sort_by(|a, b| a.1.total_cmp(&b.1));
        corners.truncate(3);
        corners.sort_by(|a, b| a.0.total_cmp(&b.0));
        corners
    }
}

impl Subject for Block {
    fn line_distance(&self, azimuth_rad: f64, x: f64, y: f64) -> f64 {
        let columns: Vec<f64> = self.corners(azimuth_rad).iter().map(|corner| corner.0).collect();
        upright_lines(&columns, x, y)
    }

    fn depth(&self, azimuth_rad: f64, x: f64, y: f64) -> Option<f64> {
        let corners = self.corners(azimuth_rad);
        let side = corners.windows(2).find(|side| (side[0].0..side[1].0).contains(&x))?;
        let share = (x - side[0].0) / (side[1].0 - side[0].0);
        (y.abs() < HALF_HEIGHT).then(|| side[0].1 + share * (side[1].1 - side[0].1))
    }
}

/// Column and depth of the point (X, Y) in the view at an azimuth.
fn turned(azimuth_rad: f64, x: f64, y: f64) -> (f64, f64) {
    let (sine, cosine) = azimuth_rad.sin_cos();
    (x * cosine + y * sine, y * cosine - x * sine)
}

/// Distance to upright lines between the upper and lower edge, and to those
/// edges from the first to the last line.
fn upright_lines(columns: &[f64], x: f64, y: f64) -> f64 {
    let beyond = |value: f64, low: f64, high: f64| (low - value).max(value - high).max(0.0);
    let outside = beyond(y, -HALF_HEIGHT, HALF_HEIGHT);
    let upright = columns.iter().map(|column| (x - column).hypot(outside));
    let ends = beyond(x, columns[0], columns[columns.len() - 1]);
    let level = [-HALF_HEIGHT, HALF_HEIGHT].map(|edge| (y - edge).hypot(ends));
    upright.chain(level).fold(f64::INFINITY, f64::min)
}

fn drawn(subject: &dyn Subject, degrees: f64) -> View {
    let azimuth = Azimuth::from_degrees(degrees).unwrap();
    let image = GrayImage::from_fn(WIDTH, HEIGHT, |u, v| {
        let (x, y) = centred(u, v);
        // A stroke of 1.5 px, its edge one pixel soft.
        let ink = (0.75 + 0.5 - subject.line_distance(azimuth.radians(), x, y)).clamp(0.0, 1.0);
        Luma([(255.0 * (1.0 - ink)).round() as u8])
    });
    View::level(azimuth, image, None)
}

fn centred(u: u32, v: u32) -> (f64, f64) {
    (f64::from(u) + 0.5 - f64::from(WIDTH) / 2.0, f64::from(v) + 0.5 - f64::from(HEIGHT) / 2.0)
}

fn depths_of(subject: &dyn Subject, degrees: &[f64]) -> Vec<LineEstimate> {
    let views = degrees.iter().map(|&degrees| drawn(subject, degrees)).collect();
    let views = ViewSet::of_owned(views).unwrap();
    let silhouettes = Silhouettes::of_views(&views, &SilhouetteOptions::default()).unwrap();
    estimate(&views, &silhouettes, &DepthOptions::default(), &Silent).unwrap()
}

/// Pearson's correlation with the truth and the mean absolute error, px.
fn compared(subject: &dyn Subject, found: &LineEstimate) -> (f64, f64) {
    let mut pairs = Vec::new();
    let map = found.map.as_ref().unwrap();
    for (u, v, pixel) in map.depth_px.enumerate_pixels() {
        let (x, y) = centred(u, v);
        if let Some(truth) = subject.depth(found.azimuth.radians(), x, y) {
            assert!(!pixel.0[0].is_nan(), "no depth at {u}, {v}");
            pairs.push((f64::from(pixel.0[0]), truth));
        }
    }
    let count = pairs.len() as f64;
    let mean = |value: fn(&(f64, f64)) -> f64| pairs.iter().map(value).sum::<f64>() / count;
    let (found, truth) = (mean(|p| p.0), mean(|p| p.1));
    let covariance = mean(|p| p.0 * p.1) - found * truth;
    let spread = (mean(|p| p.0 * p.0) - found * found) * (mean(|p| p.1 * p.1) - truth * truth);
    (covariance / spread.sqrt(), mean(|p| (p.0 - p.1).abs()))
}

/// A drawing of 120 by 60 px of a frame from (10, 10) to (109, 49), with more
/// ink `inside` it.
pub(super) fn framed(inside: impl Fn(u32, u32) -> bool) -> (Contours, PixelGraph) {
    let image = GrayImage::from_fn(120, 60, |x, y| {
        let edge = [10, 109].contains(&x) && (10..50).contains(&y)
            || [10, 49].contains(&y) && (10..110).contains(&x);
        Luma([if edge || inside(x, y) { 0 } else { 255 }])
    });
    let ink = InkMap::from_image(&image);
    let view = |degrees| View::level(Azimuth::from_degrees(degrees).unwrap(), image.clone(), None);
    let views = ViewSet::of_owned(vec![view(0.0), view(90.0)]).unwrap();
    let silhouettes = Silhouettes::of_views(&views, &SilhouetteOptions::default()).unwrap();
    let contours = Contours::new(&ink, &silhouettes.silhouettes[0]);
    let graph = PixelGraph::new(silhouettes.silhouettes[0].mask(), &contours);
    (contours, graph)
}

#[test]
fn a_cylinder_beside_the_axis_is_round_and_in_its_place() {
    let subject = Cylinder { x: 40.0, y: -20.0, radius: 50.0 };
    let found = depths_of(&subject, &[25.0, 30.0, 35.0, 40.0, 45.0, 50.0, 55.0]);
    let (correlation, error) = compared(&subject, &found[3]);
    assert!(correlation > 0.95 && error < 6.0, "{correlation} {error}");
    assert!(found[3].matched_share > 0.9);
}

#[test]
fn a_box_has_its_edge_in_front_and_flat_sides() {
    let subject = Block { half: 60.0 };
    let found = depths_of(&subject, &[30.0, 35.0, 40.0]);
    let (correlation, error) = compared(&subject, &found[1]);
    assert!(correlation > 0.95 && error < 8.0, "{correlation} {error}");
}

#[test]
fn a_ball_is_round_from_three_views() {
    let subject = Ball { radius: 60.0 };
    let found = depths_of(&subject, &[0.0, 5.0, 10.0]);
    let (correlation, error) = compared(&subject, &found[1]);
    assert!(correlation > 0.9 && error < 10.0, "{correlation} {error}");
}

#[test]
fn an_end_view_takes_the_nearer_of_two_edges_in_one_line() {
    // Seen along its sides, the box has a near and a far edge in each line,
    // and neighbours on one side only to tell.
    let subject = Block { half: 60.0 };
    let found = depths_of(&subject, &[70.0, 75.0, 80.0, 85.0, 90.0]);
    let (_, error) = compared(&subject, &found[4]);
    // The far edges, 120 px behind, would leave a multiple of it.
    assert!(error < 12.0, "{error}");
}

#[test]
fn the_outside_has_neither_depth_nor_confidence() {
    let found = depths_of(&Ball { radius: 60.0 }, &[0.0, 5.0, 10.0]);
    let map = found[1].map.as_ref().unwrap();
    for (depth, level) in map.depth_px.pixels().zip(map.confidence.pixels()) {
        assert_eq!(depth.0[0].is_nan(), level.0[0] == Confidence::Outside as u8);
    }
    let lines = map.confidence.pixels().any(|level| level.0[0] == Confidence::Lines as u8);
    assert!(lines);
}

#[test]
fn wide_views_have_no_lines_in_common_and_say_so() {
    let subject = Cylinder { x: 0.0, y: 0.0, radius: 50.0 };
    let found = depths_of(&subject, &[0.0, 45.0, 90.0]);
    let expected = Fallback::NoNeighbours { nearest_deg: 45.0 };
    assert_eq!(found[1].map.as_ref().unwrap_err(), &expected);
}

#[test]
fn the_same_drawings_give_the_same_depth() {
    let views = [30.0, 35.0, 40.0];
    let bits = |found: &[LineEstimate]| -> Vec<u32> {
        let maps = found.iter().flat_map(|view| &view.map);
        maps.flat_map(|map| map.depth_px.as_raw().iter().map(|d| d.to_bits())).collect()
    };
    let subject = Block { half: 50.0 };
    let several = bits(&depths_of(&subject, &views));
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    assert_eq!(pool.install(|| bits(&depths_of(&subject, &views))), several);
}

/// Notes the steps that are done and stops after the first.
struct StopAfterLines(Mutex<Vec<usize>>);

impl Observer for StopAfterLines {
    fn progress(&self, progress: Progress) {
        self.0.lock().unwrap().push(progress.done);
    }

    fn is_cancelled(&self) -> bool {
        self.0.lock().unwrap().contains(&1)
    }
}

#[test]
fn a_cancelled_estimate_stops_before_the_stage() {
    let views = ViewSet::of_owned(vec![
        drawn(&Ball { radius: 40.0 }, 0.0),
        drawn(&Ball { radius: 40.0 }, 5.0),
    ])
    .unwrap();
    let silhouettes = Silhouettes::of_views(&views, &SilhouetteOptions::default()).unwrap();
    let log = StopAfterLines(Mutex::default());
    let error = estimate(&views, &silhouettes, &DepthOptions::default(), &log).unwrap_err();
    assert_eq!(error, DepthError::Cancelled(Cancelled));
    assert_eq!(*log.0.lock().unwrap(), [0, 1]);
}
