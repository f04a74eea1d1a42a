//! The visual hull's depth interval along a view's lines of sight.

use super::super::silhouette::Silhouette;

/// A silhouette's rows grown by a pixel in all directions, px from the axis.
#[derive(Clone, Debug)]
pub struct GrownRows {
    rows: Vec<Vec<(f32, f32)>>,
}

/// The nearest and farthest depth inside all silhouettes, per pixel, px; NaN
/// outside the view's own silhouette and where no depth satisfies all views.
#[derive(Clone, Debug)]
pub struct HullDepth {
    pub near_px: Vec<f32>,
    pub far_px: Vec<f32>,
}

impl GrownRows {
    pub fn new(silhouette: &Silhouette) -> Self {
        const GROWTH_PX: f32 = 1.0;
        let mask = silhouette.mask();
        let axis = mask.width() as f32 / 2.0;
        let height = mask.height() as usize;
        let own: Vec<Vec<(f32, f32)>> = mask
            .as_raw()
            .chunks_exact(mask.width() as usize)
            .map(|row| {
                let shift = |(start, end): (usize, usize)| {
                    (start as f32 - axis - GROWTH_PX, end as f32 - axis + GROWTH_PX)
                };
                runs(row).map(shift).collect()
            })
            .collect();
        let rows = (0..height)
            .map(|y| {
                let mut all: Vec<(f32, f32)> =
                    own[y.saturating_sub(1)..(y + 2).min(height)].concat();
                all.sort_by(|a, b| a.0.total_cmp(&b.0));
                all.dedup_by(|next, kept| {
                    let meets = next.0 <= kept.1;
                    if meets {
                        kept.1 = kept.1.max(next.1);
                    }
                    meets
                });
                all
            })
            .collect();
        Self { rows }
    }
}

/// Half-open ranges of columns that are not 0.
fn runs(row: &[u8]) -> impl Iterator<Item = (usize, usize)> + '_ {
    let mut next = 0;
    std::iter::from_fn(move || {
        let start = next + row[next..].iter().position(|&level| level != 0)?;
        let length = row[start..].iter().position(|&level| level == 0);
        next = length.map_or(row.len(), |length| start + length);
        Some((start, next))
    })
}

/// Intersects the depth intervals that the other views allow.
///
/// * `others`: rows of every other view and its azimuth from this one, radians.
/// * `reach_px`: depths are within ± this.
pub fn hull_depth(
    silhouette: &Silhouette,
    others: &[(&GrownRows, f64)],
    reach_px: f32,
) -> HullDepth {
    /// Views this close to the view's own direction bound nothing.
    const MIN_SINE: f64 = 0.02;
    let mask = silhouette.mask();
    let width = mask.width() as usize;
    let axis = width as f32 / 2.0;
    let angles: Vec<(&GrownRows, f32, f32)> = others
        .iter()
        .filter(|(_, angle)| angle.sin().abs() > MIN_SINE)
        .map(|&(rows, angle)| (rows, angle.sin() as f32, angle.cos() as f32))
        .collect();
    let mut near_px = vec![f32::NAN; mask.as_raw().len()];
    let mut far_px = near_px.clone();
    let (mut allowed, mut next) = (Vec::new(), Vec::new());
    for (index, _) in mask.as_raw().iter().enumerate().filter(|(_, level)| **level != 0) {
        let (x, y) = ((index % width) as f32 + 0.5 - axis, index / width);
        allowed.clear();
        allowed.push((-reach_px, reach_px));
        for &(rows, sine, cosine) in &angles {
            intersect(&allowed, &rows.rows[y], (x * cosine, sine), &mut next);
            std::mem::swap(&mut allowed, &mut next);
            if allowed.is_empty() {
                break;
            }
        }
        if let (Some(first), Some(last)) = (allowed.first(), allowed.last()) {
            near_px[index] = first.0;
            far_px[index] = last.1;
        }
    }
    HullDepth { near_px, far_px }
}

/// Cuts `allowed` depths down to those whose column in another view is in one
/// of its `runs`.
fn intersect(
    allowed: &[(f32, f32)],
    runs: &[(f32, f32)],
    (shift, sine): (f32, f32),
    result: &mut Vec<(f32, f32)>,
) {
    result.clear();
    let mut clip = |&(left, right): &(f32, f32)| {
        let (a, b) = ((left - shift) / sine, (right - shift) / sine);
        let (low, high) = (a.min(b), a.max(b));
        for &(near, far) in allowed {
            if near.max(low) < far.min(high) {
                result.push((near.max(low), far.min(high)));
            }
        }
    };
    if sine > 0.0 {
        runs.iter().for_each(&mut clip);
    } else {
        runs.iter().rev().for_each(&mut clip);
    }
}
