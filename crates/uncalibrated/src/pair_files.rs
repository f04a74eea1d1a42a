//! A pair's matches and its rectified drawings, to look at.

use image::{GrayImage, Rgb, RgbImage, imageops};
use imageproc::drawing::{draw_antialiased_line_segment_mut, draw_hollow_circle_mut};
use imageproc::pixelops::interpolate;
use nalgebra::Point2;

use crate::PairResult;
use crate::vision::Rectification;
use picture::{EncodeError, png};
use sheet::{MATCHES_FRAME, MatchDocument, PairMatchesDocument};

const INLIER: Rgb<u8> = Rgb([0, 130, 60]);
const OUTLIER: Rgb<u8> = Rgb([215, 40, 40]);
const LINE: Rgb<u8> = Rgb([70, 110, 220]);
/// More epipolar lines than this hide the drawing.
const MAX_LINES: usize = 24;

/// A pair's matches as JSON, sheet frame: a document that a sheet may bring
/// again, changed.
pub(crate) fn matches_json(pair: &PairResult) -> Result<Vec<u8>, EncodeError> {
    let served = |point: Point2<f64>| [point.x + 0.5, point.y + 0.5];
    let entries = pair.matches.iter().zip(flags(pair)).map(|(found, inlier)| MatchDocument {
        left: served(found.points.left),
        right: served(found.points.right),
        distance: found.distance,
        inlier,
    });
    let document = PairMatchesDocument {
        left_azimuth_deg: pair.name.left.degrees(),
        right_azimuth_deg: pair.name.right.degrees(),
        frame: Some(MATCHES_FRAME.to_owned()),
        matches: Some(entries.collect()),
        ..PairMatchesDocument::default()
    };
    serde_json::to_vec_pretty(&document).map_err(|error| EncodeError::new("matches", error))
}

fn flags(pair: &PairResult) -> Vec<Option<bool>> {
    match pair.geometry() {
        Some(geometry) => geometry.inliers.iter().copied().map(Some).collect(),
        None => vec![None; pair.matches.len()],
    }
}

/// Both drawings side by side with their matches: inliers green, outliers red.
pub(crate) fn matches_png(
    pair: &PairResult,
    drawings: [&GrayImage; 2],
) -> Result<Vec<u8>, EncodeError> {
    let mut picture = side_by_side(drawings);
    let shift = drawings[0].width() as f32;
    let at = |point: Point2<f64>| (point.x as f32, point.y as f32);
    for (found, inlier) in pair.matches.iter().zip(flags(pair)) {
        let colour = if inlier == Some(true) { INLIER } else { OUTLIER };
        let (left, right) = (at(found.points.left), at(found.points.right));
        line(&mut picture, left, (right.0 + shift, right.1), colour);
        mark(&mut picture, left, colour);
        mark(&mut picture, (right.0 + shift, right.1), colour);
    }
    png(&picture)
}

/// The rectified drawings side by side, with the epipolar lines of some inliers.
pub(crate) fn rectified_png(
    pair: &PairResult,
    rectification: &Rectification,
    rectified: [&GrayImage; 2],
) -> Result<Vec<u8>, EncodeError> {
    let mut picture = side_by_side(rectified);
    let shift = rectified[0].width() as f32;
    let mut points: Vec<_> = pair
        .inliers()
        .iter()
        .map(|inlier| {
            (
                rectification.rectified_from_left.transform_point(&inlier.left),
                rectification.rectified_from_right.transform_point(&inlier.right),
            )
        })
        .collect();
    points.sort_by(|a, b| a.0.y.total_cmp(&b.0.y).then(a.0.x.total_cmp(&b.0.x)));
    let step = points.len().div_ceil(MAX_LINES).max(1);
    for (left, right) in points.iter().step_by(step) {
        let row = left.y as f32;
        line(&mut picture, (0.0, row), (2.0 * shift - 1.0, row), LINE);
        mark(&mut picture, (left.x as f32, row), INLIER);
        mark(&mut picture, (right.x as f32 + shift, right.y as f32), INLIER);
    }
    png(&picture)
}

fn side_by_side(drawings: [&GrayImage; 2]) -> RgbImage {
    let [left, right] = drawings;
    let height = left.height().max(right.height());
    let mut picture =
        RgbImage::from_pixel(left.width() + right.width(), height, Rgb([255, 255, 255]));
    let coloured = |image: &GrayImage| image::DynamicImage::from(image.clone()).to_rgb8();
    imageops::replace(&mut picture, &coloured(left), 0, 0);
    imageops::replace(&mut picture, &coloured(right), i64::from(left.width()), 0);
    picture
}

/// Whether a coordinate is near enough to the picture to be drawn at all.
fn drawable(picture: &RgbImage, point: (f32, f32)) -> bool {
    let margin = (picture.width() + picture.height()) as f32;
    let near = |value: f32, size: u32| value > -margin && value < size as f32 + margin;
    near(point.0, picture.width()) && near(point.1, picture.height())
}

fn line(picture: &mut RgbImage, start: (f32, f32), end: (f32, f32), colour: Rgb<u8>) {
    if drawable(picture, start) && drawable(picture, end) {
        let whole = |point: (f32, f32)| (point.0.round() as i32, point.1.round() as i32);
        draw_antialiased_line_segment_mut(picture, whole(start), whole(end), colour, interpolate);
    }
}

fn mark(picture: &mut RgbImage, point: (f32, f32), colour: Rgb<u8>) {
    if drawable(picture, point) {
        let centre = (point.0.round() as i32, point.1.round() as i32);
        draw_hollow_circle_mut(picture, centre, 3, colour);
    }
}
