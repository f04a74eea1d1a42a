//! How well a view's outline fits what its neighbours allow.
//!
//! In a row, every view's sight lines at the outline touch the section that the
//! others leave: for neighbours `s` before and `t` after,
//! `h(a) sin(s + t) <= h(a - s) sin t + h(a + t) sin s` for the section's
//! support `h` on the right, and mirrored on the left.

use super::NOISE_PX;
use super::profile::Profile;
use crate::raster::stroke_scale;

/// Wider angles between neighbours bound nothing, degrees.
const MAX_SPAN_DEG: f64 = 60.0;
const MIN_ROWS: usize = 8;
/// A view that fits in fewer of its rows is contradicted.
const CONTRADICTED: f64 = 0.5;
/// What leaving a view out must add to the others' mean consistency.
const MIN_GAIN: f64 = 0.05;
/// So many views must be left.
const MIN_LEFT: usize = 3;

/// Per row, how far the outline on the left and right is inside what the
/// neighbours allow it to touch, px; negative where it is not.
fn slacks(profiles: &[&Profile], index: usize) -> Option<Vec<(f64, f64)>> {
    let own = profiles[index];
    let nearest = |forward: bool| {
        let angle = |other: &&Profile| {
            let (from, to) = if forward { (own, *other) } else { (*other, own) };
            from.azimuth.degrees_to(to.azimuth)
        };
        let others = profiles.iter().copied().filter(|other| other.azimuth != own.azimuth);
        let found = others.min_by(|a, b| angle(a).total_cmp(&angle(b)))?;
        Some((found, angle(&found))).filter(|(_, degrees)| *degrees <= MAX_SPAN_DEG)
    };
    let ((before, s), (after, t)) = (nearest(false)?, nearest(true)?);
    let (s, t) = (s.to_radians(), t.to_radians());
    let touch = |a: f64, b: f64| (a * t.sin() + b * s.sin()) / (s + t).sin();
    let slack = |y: usize| {
        let (a, own, b) = (before.rows[y]?, own.rows[y]?, after.rows[y]?);
        Some((own.0 - touch(a.0, b.0), touch(a.1, b.1) - own.1))
    };
    let slacks: Vec<_> = (0..own.rows.len()).filter_map(slack).collect();
    (slacks.len() >= MIN_ROWS).then_some(slacks)
}

/// The share of the rows of view `index` or its neighbours that fit.
fn consistency(profiles: &[&Profile], index: usize) -> f64 {
    let own = profiles[index].rows.iter().flatten().count();
    let common =
        profiles.iter().filter(|other| other.azimuth != profiles[index].azimuth).map(|other| {
            let both = other
                .rows
                .iter()
                .zip(&profiles[index].rows)
                .filter(|(a, b)| a.is_some() && b.is_some());
            let either = other.rows.iter().flatten().count() + own;
            let both = both.count();
            both as f64 / (either - both).max(1) as f64
        });
    let (sum, count) = common.fold((0.0, 0.0), |(sum, count), share| (sum + share, count + 1.0));
    let shared = if count > 0.0 { sum / count } else { 1.0 };
    let fitting = slacks(profiles, index).map_or(1.0, |slacks| {
        let noise_px = NOISE_PX * stroke_scale(profiles[index].rows.len());
        let fits = slacks.iter().filter(|slack| slack.0.min(slack.1) > -noise_px).count();
        fits as f64 / slacks.len() as f64
    });
    shared * fitting
}

/// The views without which the others agree clearly better, by index: those
/// that contradict them rather than are contradicted. Three views cannot tell
/// which of them is wrong.
///
/// * `scores`: the [`consistencies`] of all `profiles`.
pub(super) fn contradicting(profiles: &[Profile], mut scores: Vec<f64>) -> Vec<usize> {
    let mut kept: Vec<usize> = (0..profiles.len()).collect();
    let mut contradicting = Vec::new();
    while kept.len() > MIN_LEFT && scores.iter().any(|&score| score < CONTRADICTED) {
        let without = |&left_out: &usize| {
            let rest = kept.iter().filter(|&&index| index != left_out);
            (left_out, consistencies(rest.map(|&index| &profiles[index])))
        };
        let best = kept.iter().map(without).max_by(|a, b| mean(&a.1).total_cmp(&mean(&b.1)));
        let Some((left_out, rest)) = best else { break };
        if mean(&rest) - mean(&scores) < MIN_GAIN {
            break;
        }
        kept.retain(|&index| index != left_out);
        contradicting.push(left_out);
        scores = rest;
    }
    contradicting
}

/// Of each view against all others.
pub(super) fn consistencies<'a>(profiles: impl IntoIterator<Item = &'a Profile>) -> Vec<f64> {
    let profiles: Vec<&Profile> = profiles.into_iter().collect();
    (0..profiles.len()).map(|index| consistency(&profiles, index)).collect()
}

pub(super) fn mean(scores: &[f64]) -> f64 {
    scores.iter().sum::<f64>() / scores.len().max(1) as f64
}
