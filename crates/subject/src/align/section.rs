//! Level sections of the visual hull: what a row's extents in several views
//! leave, and what of a view's extent they cannot explain.

use super::profile::Rows;

/// Extents are known this well, px.
pub(crate) const NOISE_PX: f64 = 1.5;

/// A convex polygon in the ground plane, axis at the origin, px.
pub(crate) struct Section(Vec<(f64, f64)>);

impl Section {
    /// What lies within all strips `(azimuth_deg, left, right)`; empty if they
    /// contradict each other.
    pub(crate) fn within(strips: &[(f64, f64, f64)]) -> Self {
        let far = strips.iter().map(|s| s.1.abs().max(s.2.abs())).fold(1.0, f64::max) * 40.0;
        let mut polygon = vec![(-far, -far), (far, -far), (far, far), (-far, far)];
        for &(azimuth_deg, left, right) in strips {
            let (s, c) = azimuth_deg.to_radians().sin_cos();
            polygon = clipped(&polygon, (c, s), right);
            polygon = clipped(&polygon, (-c, -s), -left);
        }
        Self(polygon)
    }

    /// The section's shadow at an azimuth, px.
    pub(crate) fn shadow(&self, azimuth_deg: f64) -> Option<(f64, f64)> {
        let (s, c) = azimuth_deg.to_radians().sin_cos();
        let along = self.0.iter().map(|(x, y)| x * c + y * s);
        let ends = along.fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(v), b.max(v)));
        (ends.0 <= ends.1).then_some(ends)
    }

    /// How much of a strip `(azimuth_deg, left, right)` the section does not
    /// explain beyond `slack_px` at either end, px.
    pub(crate) fn beyond(&self, strip: &(f64, f64, f64), slack_px: f64) -> f64 {
        let (azimuth_deg, left, right) = *strip;
        match self.shadow(azimuth_deg) {
            None => right - left,
            Some((a, b)) => (a - left - slack_px).max(0.0) + (right - b - slack_px).max(0.0),
        }
    }
}

/// The part of a polygon where `normal · p <= limit`.
///
/// # Source
/// Sutherland & Hodgman 1974, Reentrant polygon clipping.
fn clipped(polygon: &[(f64, f64)], normal: (f64, f64), limit: f64) -> Vec<(f64, f64)> {
    let over = |p: &(f64, f64)| p.0 * normal.0 + p.1 * normal.1 - limit;
    let mut kept = Vec::with_capacity(polygon.len() + 1);
    for (k, a) in polygon.iter().enumerate() {
        let b = &polygon[(k + 1) % polygon.len()];
        let (da, db) = (over(a), over(b));
        if da <= 0.0 {
            kept.push(*a);
        }
        if (da < 0.0) != (db < 0.0) && da != db {
            let t = da / (da - db);
            kept.push((a.0 + t * (b.0 - a.0), a.1 + t * (b.1 - a.1)));
        }
    }
    kept
}

/// The strips of row `y`, shifted.
pub(crate) fn strips(
    azimuths_deg: &[f64],
    views: &[Rows],
    shifts: &[f64],
    y: usize,
    noise_px: f64,
) -> Vec<Option<(f64, f64, f64)>> {
    let strip = |k: usize| {
        let (left, right) = views[k].get(y).copied().flatten()?;
        Some((azimuths_deg[k], left - shifts[k] - noise_px, right - shifts[k] + noise_px))
    };
    (0..views.len()).map(strip).collect()
}

/// Per view, how much of its rows' extents all views together cannot explain,
/// share of their widths: 0 if they agree.
pub(crate) fn unexplained(azimuths_deg: &[f64], views: &[Rows], shifts: &[f64]) -> Vec<f64> {
    let count = views.iter().map(Vec::len).min().unwrap_or(0);
    let mut missing = vec![0.0; views.len()];
    let mut widths = vec![0.0; views.len()];
    for y in 0..count {
        let all = strips(azimuths_deg, views, shifts, y, NOISE_PX);
        let shown: Vec<_> = all.iter().flatten().copied().collect();
        if shown.len() < 2 {
            continue;
        }
        let section = Section::within(&shown);
        for (k, strip) in all.iter().enumerate() {
            let Some(strip @ (_, left, right)) = strip else { continue };
            widths[k] += right - left;
            missing[k] += section.beyond(strip, 2.0 * NOISE_PX).min(right - left);
        }
    }
    missing.iter().zip(&widths).map(|(missing, width)| missing / f64::max(*width, 1.0)).collect()
}
