//! Depth maps read off the solid.
//!
//! Where outlines from all around bound the solid and depth from lines has
//! carved it, its surface is nearer the truth than the map of any one view: it
//! averages what all views tell, and is round where a single view only guesses.

use std::collections::VecDeque;

use image::{GrayImage, ImageBuffer, Luma};
use rayon::prelude::*;

use crate::depth_map::{Confidence, DepthMap};
use crate::silhouette::Silhouettes;
use crate::surface::projection::{DepthBuffer, Rig};
use crate::views::ViewSet;

use super::estimate::{DepthSource, LineEstimate, Subject, ViewDepth};
use super::hull::Hulls;
use crate::options::DepthFrom;
use mesh::Mesh;

/// Outlines bound a solid well if this many look along directions this far apart.
const BOUNDING_DIRECTIONS: usize = 3;
const DIRECTIONS_APART_DEG: f64 = 30.0;

/// The depth of every view: that of its lines or that of the solid's surface.
///
/// Views whose lines tell nothing take it from the solid; so do, if `from` is
/// [`DepthFrom::Auto`], all views of a set that bounds the solid well.
///
/// * `surface`: the solid, turntable frame, px.
/// * `estimates`: of `views`, in their order.
pub fn read(
    surface: &Mesh,
    views: &ViewSet,
    silhouettes: &Silhouettes,
    estimates: Vec<LineEstimate>,
    from: DepthFrom,
) -> Vec<ViewDepth> {
    let all = match from {
        DepthFrom::Auto => bounds_well(&views.azimuths().map(|a| a.degrees()).collect::<Vec<_>>()),
        DepthFrom::Lines => false,
        DepthFrom::Solid => true,
    };
    let needed = |estimate: &LineEstimate| all || estimate.map.is_err();
    if !estimates.iter().any(needed) {
        return estimates.into_iter().filter_map(LineEstimate::alone).collect();
    }
    let rig = Rig::of_views(views);
    let silhouettes = &silhouettes.silhouettes;
    let hulls = Hulls::new(views, silhouettes, Subject::new(views, silhouettes).reach_px());
    let of_view = |(view, estimate): (usize, LineEstimate)| {
        if !needed(&estimate) {
            return estimate.alone();
        }
        let mask = silhouettes[view].mask();
        let depth_px = seen(surface, &rig, view, mask);
        let near_px = hulls.of_view(view).near_px;
        let confidence = confidence(&depth_px, &near_px, estimate.map.as_ref().ok());
        Some(ViewDepth {
            azimuth: estimate.azimuth,
            map: DepthMap { depth_px, confidence },
            matched_share: estimate.matched_share,
            source: DepthSource::Solid,
            fallback: estimate.map.err(),
        })
    };
    estimates.into_par_iter().enumerate().filter_map(of_view).collect()
}

/// The depth of a view from above or below: what the solid shows it.
///
/// * `rig`: of that view alone.
pub(crate) fn of_elevated(surface: &Mesh, rig: &Rig, mask: &GrayImage) -> ViewDepth {
    let depth_px = seen(surface, rig, 0, mask);
    let level = |depth: &Luma<f32>| {
        if depth.0[0].is_nan() { Confidence::Outside } else { Confidence::Guessed }
    };
    let confidence = depth_px.pixels().map(|depth| level(depth) as u8).collect();
    let confidence = GrayImage::from_raw(mask.width(), mask.height(), confidence);
    ViewDepth {
        azimuth: rig.viewpoints[0].azimuth,
        map: DepthMap { depth_px, confidence: confidence.unwrap_or_default() },
        matched_share: 0.0,
        source: DepthSource::Solid,
        fallback: None,
    }
}

/// Whether enough outlines look along directions far enough apart; opposite
/// views look along one.
fn bounds_well(azimuths_deg: &[f64]) -> bool {
    const HALF_TURN_DEG: f64 = 180.0;
    let mut lines: Vec<f64> = azimuths_deg.iter().map(|a| a.rem_euclid(HALF_TURN_DEG)).collect();
    lines.sort_by(f64::total_cmp);
    let apart = |a: f64, b: f64| {
        let angle = (a - b).abs();
        angle.min(HALF_TURN_DEG - angle) >= DIRECTIONS_APART_DEG
    };
    let mut taken: Vec<f64> = Vec::new();
    for line in lines {
        if taken.iter().all(|&other| apart(line, other)) {
            taken.push(line);
        }
    }
    taken.len() >= BOUNDING_DIRECTIONS
}

type Map = ImageBuffer<Luma<f32>, Vec<f32>>;

/// The depth of the surface's front inside `mask`, px; NaN outside. Pixels that
/// the surface leaves out take the depth of the nearest one that it covers.
fn seen(surface: &Mesh, rig: &Rig, view: usize, mask: &GrayImage) -> Map {
    let buffer = DepthBuffer::of_view(surface, rig, view, 1.0);
    let inside = |x: u32, y: u32| mask.get_pixel(x, y).0[0] != 0;
    let mut depth = Map::from_fn(mask.width(), mask.height(), |x, y| {
        let nearest = buffer.nearest(x as usize, y as usize).filter(|_| inside(x, y));
        Luma([nearest.unwrap_or(f32::NAN)])
    });
    spread(&mut depth, mask);
    depth
}

/// Carries known depths on to all of `mask`; 0, the axis plane, if there are none.
fn spread(depth: &mut Map, mask: &GrayImage) {
    let known = |pixel: &Luma<f32>| !pixel.0[0].is_nan();
    let (width, height) = mask.dimensions();
    let mut open: VecDeque<(u32, u32)> =
        depth.enumerate_pixels().filter(|(_, _, d)| known(d)).map(|(x, y, _)| (x, y)).collect();
    while let Some((x, y)) = open.pop_front() {
        let here = *depth.get_pixel(x, y);
        let beside = [(x.wrapping_sub(1), y), (x + 1, y), (x, y.wrapping_sub(1)), (x, y + 1)];
        for (x, y) in beside.into_iter().filter(|&(x, y)| x < width && y < height) {
            if mask.get_pixel(x, y).0[0] != 0 && !known(depth.get_pixel(x, y)) {
                depth.put_pixel(x, y, here);
                open.push_back((x, y));
            }
        }
    }
    // Parts that the surface leaves out whole.
    for (depth, level) in depth.pixels_mut().zip(mask.pixels()) {
        if level.0[0] != 0 && !known(depth) {
            depth.0[0] = 0.0;
        }
    }
}

/// What the surface's depth rests on, per pixel.
///
/// * `near_px`: the visual hull's bound.
/// * `lines`: what the view's own lines tell.
fn confidence(depth_px: &Map, near_px: &[f32], lines: Option<&DepthMap>) -> GrayImage {
    /// As near to the hull or to a line's depth as the mesh is exact, px.
    const TOLERANCE_PX: f32 = 4.0;
    let of_pixel = |pixel: usize, depth: f32| {
        let lines = lines.filter(|map| {
            let apart = (map.depth_px.as_raw()[pixel] - depth).abs();
            map.confidence.as_raw()[pixel] == Confidence::Lines as u8 && apart < TOLERANCE_PX
        });
        if depth.is_nan() {
            Confidence::Outside
        } else if lines.is_some() {
            Confidence::Lines
        } else if depth < near_px[pixel] + TOLERANCE_PX {
            Confidence::Hull
        } else {
            Confidence::Guessed
        }
    };
    let mut levels = GrayImage::new(depth_px.width(), depth_px.height());
    for (pixel, (level, depth)) in levels.pixels_mut().zip(depth_px.pixels()).enumerate() {
        level.0[0] = of_pixel(pixel, depth.0[0]) as u8;
    }
    levels
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_directions_bound_a_solid_and_opposites_are_one() {
        assert!(bounds_well(&[0.0, 45.0, 90.0]));
        assert!(bounds_well(&[0.0, 15.0, 30.0, 45.0, 60.0]));
        assert!(!bounds_well(&[40.0, 45.0, 50.0]));
        assert!(!bounds_well(&[0.0, 90.0, 180.0, 270.0]));
        // The last is only 10 degrees from the first, seen from behind.
        assert!(!bounds_well(&[0.0, 80.0, 170.0]));
    }

    #[test]
    fn depth_is_carried_on_inside_the_mask_only() {
        let mask = GrayImage::from_fn(6, 1, |x, _| Luma([if x == 3 { 0 } else { 255 }]));
        let mut depth = Map::from_pixel(6, 1, Luma([f32::NAN]));
        depth.put_pixel(1, 0, Luma([7.0]));
        spread(&mut depth, &mask);
        assert_eq!(depth.as_raw()[..3], [7.0; 3]);
        assert!(depth.as_raw()[3].is_nan());
        // Nothing is known of the other part.
        assert_eq!(depth.as_raw()[4..], [0.0; 2]);
    }
}
