//! Depth and curvature of the lines of every view, from all views that see them.

use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;

use super::contours::{Contours, Crossing};
use super::filters::{running_median, weighted_gaussian};
use super::predicted_lines::adopted;
use super::triples::{Bounds, Match, Neighbour, TripleGeometry, match_triples};

/// Views farther away do not see the same line, degrees.
const TRACK_REACH_DEG: f64 = 20.5;
/// The largest residual of a track, px.
const MAX_TRACK_RESIDUAL_PX: f64 = 0.8;
/// Standard deviation of a smoothed crossing's column, px.
const TRACK_SIGMA_PX: f64 = 0.15;
/// How many times its own scatter a track may be off: its views are few, and
/// what makes them scatter is rarely noise.
const TRACK_DOUBT: f64 = 3.0;

/// A view's lines and its neighbours.
pub(super) struct LineView<'a> {
    pub azimuth_rad: f64,
    pub contours: &'a Contours,
    pub bounds: Bounds<'a>,
    /// The view before and after it to match with, if near enough.
    pub before: Option<usize>,
    pub after: Option<usize>,
}

/// Per crossing of a view: where its line is in depth. NaN where unknown.
#[derive(Clone, Debug)]
pub(super) struct LineDepths {
    pub depth_px: Vec<f64>,
    /// Signed radius of curvature of the horizontal section and its standard deviation.
    pub rho_px: Vec<f64>,
    pub rho_sigma_px: Vec<f64>,
    /// Whether `rho_px` comes from five or more views.
    pub rho_is_tracked: Vec<bool>,
}

/// Per crossing the partner in the views before and after.
#[derive(Clone, Debug, Default)]
struct Partners {
    before: Vec<Option<u32>>,
    after: Vec<Option<u32>>,
}

/// The azimuth of `to` from `from`, in (-pi, pi].
pub(super) fn angle_between(from_rad: f64, to_rad: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    let angle = (to_rad - from_rad).rem_euclid(turn);
    if angle > turn / 2.0 { angle - turn } else { angle }
}

/// Finds the depth of the lines of every view.
pub(super) fn line_depths(views: &[LineView<'_>]) -> Vec<LineDepths> {
    let triples: Vec<_> = views.par_iter().map(|view| triple(views, view)).collect();
    let links = links(views, &triples);
    let lines: Vec<LineDepths> = (0..views.len())
        .into_par_iter()
        .map(|index| {
            let local = triples[index].as_ref().map(|(geometry, matches)| {
                from_triple(views[index].contours, views[index].bounds.unit_px, geometry, matches)
            });
            combined(views, &links, index, local)
        })
        .collect();
    (0..views.len()).into_par_iter().map(|index| adopted(views, &lines, index)).collect()
}

type Triple = (TripleGeometry, Vec<Option<Match>>);

fn triple(views: &[LineView<'_>], view: &LineView<'_>) -> Option<Triple> {
    let neighbour = |index: usize| Neighbour {
        contours: views[index].contours,
        angle_rad: angle_between(view.azimuth_rad, views[index].azimuth_rad),
    };
    let (before, after) = (neighbour(view.before?), neighbour(view.after?));
    let matches = match_triples(before, view.contours, after, view.bounds);
    Some((TripleGeometry::new(before.angle_rad, after.angle_rad), matches))
}

/// Links of views with two neighbours are their matches; those of the first
/// and last view are their neighbours' matches, turned round.
fn links(views: &[LineView<'_>], triples: &[Option<Triple>]) -> Vec<Partners> {
    let turned = |index: usize, other: Option<usize>, pick: fn(&Match) -> u32| {
        let mut turned: Vec<Option<(u32, f64)>> = vec![None; views[index].contours.crossings.len()];
        let matches = other.and_then(|other| triples[other].as_ref());
        for (from, matched) in matches.iter().flat_map(|(_, matches)| matches.iter().enumerate()) {
            let Some(matched) = matched else { continue };
            // Of lines that fall on one, the nearest to the camera is the one seen.
            let slot = &mut turned[pick(matched) as usize];
            if slot.is_none_or(|(_, depth_px)| matched.depth_px < depth_px) {
                *slot = Some((from as u32, matched.depth_px));
            }
        }
        turned.into_iter().map(|slot| slot.map(|(from, _)| from)).collect()
    };
    let direct = |matches: &[Option<Match>], pick: fn(&Match) -> u32| {
        matches.iter().map(|matched| matched.as_ref().map(pick)).collect()
    };
    let of_view = |index: usize| match &triples[index] {
        Some((_, matches)) => Partners {
            before: direct(matches, |matched| matched.before),
            after: direct(matches, |matched| matched.after),
        },
        None => Partners {
            before: turned(index, views[index].before, |matched| matched.after),
            after: turned(index, views[index].after, |matched| matched.before),
        },
    };
    (0..views.len()).map(of_view).collect()
}

/// Smooths what one triple says along the chains.
fn from_triple(
    contours: &Contours,
    unit_px: f64,
    geometry: &TripleGeometry,
    matches: &[Option<Match>],
) -> LineDepths {
    let mut lines = LineDepths::unknown(matches.len());
    for chain in &contours.chains {
        let found: Vec<_> = chain.iter().map(|&index| matches[index as usize]).collect();
        if chain.len() < 3 || found.iter().flatten().count() < 3 {
            continue;
        }
        let crossings: Vec<&Crossing> =
            chain.iter().map(|&index| &contours.crossings[index as usize]).collect();
        let pick = |value: fn(&Match) -> f64| -> Vec<f64> {
            found.iter().map(|matched| matched.as_ref().map_or(f64::NAN, value)).collect()
        };
        let depth = smooth_depth(&pick(|matched| matched.depth_px), &crossings, unit_px);
        let (rho, sigma) = smooth_rho(&pick(|matched| matched.rho_px), &crossings, geometry);
        for (k, &index) in chain.iter().enumerate() {
            lines.depth_px[index as usize] = depth[k];
            lines.rho_px[index as usize] = rho[k];
            lines.rho_sigma_px[index as usize] = sigma[k];
        }
    }
    lines
}

fn smooth_depth(raw: &[f64], crossings: &[&Crossing], unit_px: f64) -> Vec<f64> {
    let median = filled(&running_median(raw, 3));
    let weights: Vec<f64> = raw
        .iter()
        .zip(&median)
        .zip(crossings)
        .map(|((value, median), crossing)| {
            let steep = crossing.slope.abs();
            let near = (value - median).abs() < 12.0 * unit_px * (1.0 + steep);
            if near { 1.0 / (1.0 + 4.0 * steep * steep) } else { 0.0 }
        })
        .collect();
    let mut smooth = vec![f64::NAN; raw.len()];
    let mut start = 0;
    for end in 1..=raw.len() {
        let jump = end == raw.len() || (median[end] - median[end - 1]).abs() > 25.0 * unit_px;
        if jump {
            let (part, _) = weighted_gaussian(&raw[start..end], &weights[start..end], 3.0, 0.02);
            smooth[start..end].copy_from_slice(&part);
            start = end;
        }
    }
    smooth
}

/// NaN replaced by the nearest known value above or below.
fn filled(values: &[f64]) -> Vec<f64> {
    let mut filled = values.to_vec();
    for k in 1..filled.len() {
        if filled[k].is_nan() {
            filled[k] = filled[k - 1];
        }
    }
    for k in (0..filled.len().saturating_sub(1)).rev() {
        if filled[k].is_nan() {
            filled[k] = filled[k + 1];
        }
    }
    filled
}

/// Averages the curvature along a chain. Its deviation falls with the number
/// of sub-pixel phases that the chain runs through.
fn smooth_rho(
    raw: &[f64],
    crossings: &[&Crossing],
    geometry: &TripleGeometry,
) -> (Vec<f64>, Vec<f64>) {
    const SIGMA_ROWS: f64 = 12.0;
    const PHASES_PER_ROW: f64 = 60.0;
    let per_rho = 6.0_f64.sqrt() / geometry.rho_noise;
    let plausible = |rho: f64| rho.is_finite() && (rho * per_rho).abs() < 4.0;
    let weights: Vec<f64> = raw
        .iter()
        .zip(crossings)
        .map(|(&rho, crossing)| {
            let weight = 1.0 / (1.0 + 4.0 * crossing.slope * crossing.slope);
            if plausible(rho) { weight } else { 0.0 }
        })
        .collect();
    let (rho, total) = weighted_gaussian(raw, &weights, SIGMA_ROWS, 1e-6);
    let sigma = crossings
        .iter()
        .zip(&total)
        .map(|(crossing, total)| {
            let phases = (crossing.slope.abs() * PHASES_PER_ROW).clamp(1.0, 30.0) * total.min(1.0);
            (0.35 / per_rho).hypot(10.0 * phases.max(1e-9).sqrt()) / phases.max(1e-9).sqrt()
        })
        .collect();
    (rho, sigma)
}

impl LineDepths {
    /// Nothing known of any crossing.
    pub(super) fn unknown(crossings: usize) -> Self {
        Self {
            depth_px: vec![f64::NAN; crossings],
            rho_px: vec![f64::NAN; crossings],
            rho_sigma_px: vec![f64::NAN; crossings],
            rho_is_tracked: vec![false; crossings],
        }
    }

    /// The share of crossings whose depth is known.
    pub(super) fn matched_share(&self) -> f64 {
        let known = self.depth_px.iter().filter(|depth| !depth.is_nan()).count();
        known as f64 / self.depth_px.len().max(1) as f64
    }
}

/// A line fitted to the columns at which several views cross it.
#[derive(Clone, Copy, Debug)]
struct Track {
    depth_px: f64,
    rho_px: f64,
    rho_sigma_px: f64,
    residual_px: f64,
    views: usize,
    /// Views before and after the one that is tracked from.
    sides: (usize, usize),
}

/// Prefers what many views say where their fit is good.
fn combined(
    views: &[LineView<'_>],
    links: &[Partners],
    index: usize,
    local: Option<LineDepths>,
) -> LineDepths {
    let view = &views[index];
    let one_sided = local.is_none();
    let count = view.contours.crossings.len();
    let mut lines = local.unwrap_or_else(|| LineDepths::unknown(count));
    let tracks: Vec<_> =
        (0..count).map(|crossing| track(views, links, index, crossing as u32)).collect();
    let good = |track: &Track| {
        let enough = if one_sided {
            track.views >= 3
        } else {
            track.views >= 5 && track.sides.0 >= 2 && track.sides.1 >= 2
        };
        enough && track.residual_px < MAX_TRACK_RESIDUAL_PX
    };
    let pick = |value: fn(&Track) -> f64| -> Vec<f64> {
        tracks
            .iter()
            .map(|track| track.as_ref().filter(|track| good(track)).map_or(f64::NAN, value))
            .collect()
    };
    let unit = view.bounds.unit_px;
    let depth_sigma = if one_sided { 3.0 } else { 2.0 };
    let depth = along_chains(view.contours, &pick(|track| track.depth_px), depth_sigma, unit);
    let rho = along_chains(view.contours, &pick(|track| track.rho_px), 6.0, unit);
    let sigma = pick(|track| track.rho_sigma_px);
    for k in 0..count {
        let own = lines.depth_px[k];
        if !depth[k].is_nan() && (own.is_nan() || (depth[k] - own).abs() < 12.0 * unit) {
            lines.depth_px[k] = depth[k];
        }
        if !rho[k].is_nan() && !sigma[k].is_nan() {
            lines.rho_px[k] = rho[k];
            lines.rho_sigma_px[k] = sigma[k];
            lines.rho_is_tracked[k] = true;
        }
    }
    lines
}

pub(super) fn along_chains(
    contours: &Contours,
    values: &[f64],
    sigma: f64,
    unit_px: f64,
) -> Vec<f64> {
    let mut smooth = vec![f64::NAN; values.len()];
    for chain in contours.chains.iter().filter(|chain| chain.len() >= 3) {
        let raw: Vec<f64> = chain.iter().map(|&index| values[index as usize]).collect();
        if raw.iter().filter(|value| !value.is_nan()).count() < 3 {
            continue;
        }
        let median = running_median(&raw, 4);
        let near = |(value, median): (&f64, &f64)| {
            if (value - median).abs() < 30.0 * unit_px { 1.0 } else { 0.0 }
        };
        let weights: Vec<f64> = raw.iter().zip(&median).map(near).collect();
        let (part, _) = weighted_gaussian(&raw, &weights, sigma, 0.05);
        for (&index, value) in chain.iter().zip(part) {
            smooth[index as usize] = value;
        }
    }
    smooth
}

/// Follows a crossing through the views on both sides and fits
/// `rho (1 - cos t) + x cos t + d sin t` to its columns.
fn track(views: &[LineView<'_>], links: &[Partners], index: usize, crossing: u32) -> Option<Track> {
    let mut samples = vec![(0.0, views[index].contours.crossings[crossing as usize].x_px)];
    let before = follow(views, links, (index, crossing), false, &mut samples);
    let after = follow(views, links, (index, crossing), true, &mut samples);
    if samples.len() < 3 {
        return None;
    }
    fit(&samples, (before, after))
}

/// Adds the angle and column of every view that the crossing is followed to.
fn follow(
    views: &[LineView<'_>],
    links: &[Partners],
    start: (usize, u32),
    forward: bool,
    samples: &mut Vec<(f64, f64)>,
) -> usize {
    /// How exactly a match must point back to where it came from, px.
    const RETURN_PX: f64 = 1.0;
    let step = |(view, crossing): (usize, u32), forward: bool| {
        let (links, next) = if forward {
            (&links[view].after, views[view].after)
        } else {
            (&links[view].before, views[view].before)
        };
        Some((next?, links[crossing as usize]?))
    };
    let column =
        |(view, crossing): (usize, u32)| views[view].contours.crossings[crossing as usize].x_px;
    let mut here = start;
    let mut added = 0;
    while let Some(next) = step(here, forward) {
        let angle = angle_between(views[start.0].azimuth_rad, views[next.0].azimuth_rad);
        let wrapped = (angle > 0.0) != forward || next.0 == start.0;
        if angle.to_degrees().abs() > TRACK_REACH_DEG || wrapped {
            break;
        }
        samples.push((angle, column(next)));
        added += 1;
        let back = step(next, !forward);
        if !back.is_some_and(|b| b.0 == here.0 && (column(b) - column(here)).abs() < RETURN_PX) {
            break;
        }
        here = next;
    }
    added
}

fn fit(samples: &[(f64, f64)], sides: (usize, usize)) -> Option<Track> {
    let row = |angle: f64| Vector3::new(1.0 - angle.cos(), angle.cos(), angle.sin());
    let (mut normal, mut right) = (Matrix3::zeros(), Vector3::zeros());
    for &(angle, column) in samples {
        normal += row(angle) * row(angle).transpose();
        right += row(angle) * column;
    }
    let covariance = normal.try_inverse()?;
    let solution = covariance * right;
    let squares: f64 =
        samples.iter().map(|&(angle, column)| (row(angle).dot(&solution) - column).powi(2)).sum();
    let spare = samples.len() as f64 - 3.0;
    let scatter_px = if spare > 0.0 { (squares / spare).sqrt() } else { 0.0 };
    let sigma_px = TRACK_SIGMA_PX.max(TRACK_DOUBT * scatter_px);
    Some(Track {
        depth_px: solution[2],
        rho_px: solution[0],
        rho_sigma_px: sigma_px * covariance[(0, 0)].max(0.0).sqrt() + 3.0,
        residual_px: (squares / samples.len() as f64).sqrt(),
        views: samples.len(),
        sides,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_track_gives_depth_and_radius() {
        let (x, d, rho) = (30.0, 12.0, -80.0);
        let at = |t: f64| rho * (1.0 - t.cos()) + x * t.cos() + d * t.sin();
        let samples: Vec<_> = [0.0, 0.09, 0.17, -0.1].iter().map(|&t| (t, at(t))).collect();
        let track = fit(&samples, (1, 2)).unwrap();
        assert!((track.depth_px - d).abs() < 1e-6 && (track.rho_px - rho).abs() < 1e-4);
        assert!(track.residual_px < 1e-9 && track.rho_sigma_px > 3.0);
    }

    #[test]
    fn the_two_edges_of_a_thin_side_are_not_one_round_one() {
        // A side 30 px wide is seen edgewise at 0: before, one of its edges is
        // the outline, after it the other.
        let (x, near, far) = (150.0, 30.0, 60.0);
        let outline = |t: f64| x * t.cos() + t.sin() * if t < 0.0 { near } else { far };
        let samples = [-20, -15, -10, -5, 0, 5, 10, 15, 20]
            .map(|degrees: i32| f64::from(degrees).to_radians())
            .map(|t| (t, outline(t)));
        let track = fit(&samples, (4, 4)).unwrap();
        assert!(track.residual_px < MAX_TRACK_RESIDUAL_PX && track.rho_px > 30.0, "{track:?}");
        assert!(track.rho_px < 3.0 * track.rho_sigma_px, "{track:?}");
    }

    #[test]
    fn angles_wrap_to_the_nearer_side() {
        let angle = angle_between(350_f64.to_radians(), 10_f64.to_radians());
        assert!((angle.to_degrees() - 20.0).abs() < 1e-9);
        assert!((angle_between(0.1, 0.0) + 0.1).abs() < 1e-12);
    }

    #[test]
    fn gaps_are_filled_from_what_is_nearest() {
        let gaps = [f64::NAN, 2.0, f64::NAN, 5.0, f64::NAN];
        assert_eq!(filled(&gaps), [2.0, 2.0, 2.0, 5.0, 5.0]);
    }
}
