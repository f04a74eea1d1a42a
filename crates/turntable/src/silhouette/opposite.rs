//! Views from opposite sides, whose silhouettes are mirror images.

use image::{GrayImage, imageops};

use super::{Silhouette, SilhouetteSource};
use frames::Azimuth;

/// Two views from opposite sides, whose silhouettes are mirror images.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct OppositePair {
    /// The lower azimuth of the two, degrees.
    pub azimuth_deg: f64,
    /// Intersection over union of the one with the other mirrored.
    pub iou: f64,
    /// Whether the two were made one: they are not when they contradict each other.
    pub joined: bool,
}

/// Silhouettes that overlap less than this show different things.
const MIN_IOU: f64 = 0.85;

/// Gives each two opposite views one silhouette: the given mask if one of them
/// has one, else the union, so that a gap in one outline is made good by the
/// other.
pub(super) fn join(silhouettes: &mut [Silhouette]) -> Vec<OppositePair> {
    let mut pairs = Vec::new();
    for first in 0..silhouettes.len() {
        let azimuth = silhouettes[first].azimuth;
        let across = Azimuth::from_degrees(azimuth.degrees() + 180.0);
        let second = (first + 1..silhouettes.len())
            .find(|&second| Ok(silhouettes[second].azimuth) == across);
        if let Some(second) = second {
            pairs.push(join_pair(silhouettes, first, second));
        }
    }
    pairs
}

fn join_pair(silhouettes: &mut [Silhouette], first: usize, second: usize) -> OppositePair {
    let iou = iou(&silhouettes[first].mask, &imageops::flip_horizontal(&silhouettes[second].mask));
    let joined = iou >= MIN_IOU;
    if joined {
        let given = [first, second].map(|i| silhouettes[i].source == SilhouetteSource::Given);
        match given {
            [true, true] => {}
            [true, false] => copy_mirrored(silhouettes, first, second),
            [false, true] => copy_mirrored(silhouettes, second, first),
            [false, false] => unite(silhouettes, first, second),
        }
    }
    OppositePair { azimuth_deg: silhouettes[first].azimuth.degrees(), iou, joined }
}

fn iou(a: &GrayImage, b: &GrayImage) -> f64 {
    let (mut both, mut either) = (0_u64, 0_u64);
    for (&a, &b) in a.as_raw().iter().zip(b.as_raw()) {
        both += u64::from(a != 0 && b != 0);
        either += u64::from(a != 0 || b != 0);
    }
    both as f64 / either.max(1) as f64
}

fn copy_mirrored(silhouettes: &mut [Silhouette], from: usize, to: usize) {
    let width = f64::from(silhouettes[from].mask.width());
    silhouettes[to].mask = imageops::flip_horizontal(&silhouettes[from].mask);
    silhouettes[to].intervals =
        silhouettes[from].intervals.iter().map(|row| mirrored(row, width)).collect();
    silhouettes[to].half_line_px = silhouettes[from].half_line_px;
    silhouettes[to].source = SilhouetteSource::Opposite;
}

fn unite(silhouettes: &mut [Silhouette], first: usize, second: usize) {
    let mut mask = silhouettes[first].mask.clone();
    let other = imageops::flip_horizontal(&silhouettes[second].mask);
    for (level, &other) in mask.iter_mut().zip(other.as_raw()) {
        *level |= other;
    }
    let width = f64::from(mask.width());
    let half_line_px =
        f64::midpoint(silhouettes[first].half_line_px, silhouettes[second].half_line_px);
    let intervals: Vec<_> = silhouettes[first]
        .intervals
        .iter()
        .zip(&silhouettes[second].intervals)
        .map(|(own, across)| united(own, &mirrored(across, width)))
        .collect();
    silhouettes[second].mask = imageops::flip_horizontal(&mask);
    silhouettes[second].intervals = intervals.iter().map(|row| mirrored(row, width)).collect();
    silhouettes[first].mask = mask;
    silhouettes[first].intervals = intervals;
    for index in [first, second] {
        silhouettes[index].half_line_px = half_line_px;
        silhouettes[index].source = SilhouetteSource::Joined;
    }
}

fn mirrored(row: &[(f64, f64)], width: f64) -> Vec<(f64, f64)> {
    row.iter().rev().map(|&(left, right)| (width - right, width - left)).collect()
}

/// Where one of two rows is covered. Ends that nearly coincide are averaged,
/// so that two drawings of one edge do not widen each other.
fn united(a: &[(f64, f64)], b: &[(f64, f64)]) -> Vec<(f64, f64)> {
    const SAME_PX: f64 = 2.0;
    let mut all: Vec<(f64, f64)> = a.iter().chain(b).copied().collect();
    all.sort_by(|p, q| p.0.total_cmp(&q.0));
    let mut union: Vec<(f64, f64)> = Vec::new();
    let near = |p: f64, q: f64| (p - q).abs() < SAME_PX;
    for (left, right) in all {
        match union.last_mut() {
            Some(last) if left <= last.1 => {
                last.0 = if near(last.0, left) { f64::midpoint(last.0, left) } else { last.0 };
                let both = f64::midpoint(last.1, right);
                last.1 = if near(last.1, right) { both } else { last.1.max(right) };
            }
            _ => union.push((left, right)),
        }
    }
    union
}
