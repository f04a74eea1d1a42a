//! The visual hull's depth interval along a view's lines of sight.

use rayon::prelude::*;

use super::lines::angle_between;
use crate::raster::runs;
use crate::silhouette::Silhouette;
use crate::views::ViewSet;

/// A silhouette's rows grown by a pixel in all directions, px from the axis.
#[derive(Clone, Debug)]
struct GrownRows {
    rows: Vec<Vec<(f32, f32)>>,
}

/// The nearest and farthest depth inside all silhouettes, per pixel, px; NaN
/// outside the view's own silhouette and where no depth satisfies all views.
#[derive(Clone, Debug)]
pub(super) struct HullDepth {
    pub near_px: Vec<f32>,
    pub far_px: Vec<f32>,
}

/// The silhouettes of all views, to bound depths with.
pub(super) struct Hulls<'a> {
    silhouettes: &'a [Silhouette],
    grown: Vec<GrownRows>,
    azimuths_rad: Vec<f64>,
    reach_px: f32,
}

impl<'a> Hulls<'a> {
    /// * `silhouettes`: of `views`, in their order.
    /// * `reach_px`: depths are within ± this.
    pub(super) fn new(views: &ViewSet, silhouettes: &'a [Silhouette], reach_px: f32) -> Self {
        Self {
            silhouettes,
            grown: silhouettes.par_iter().map(GrownRows::new).collect(),
            azimuths_rad: views.azimuths().map(|azimuth| azimuth.radians()).collect(),
            reach_px,
        }
    }

    /// The hull along the lines of sight of view `index`, by all other views.
    pub(super) fn of_view(&self, index: usize) -> HullDepth {
        let own = self.azimuths_rad[index];
        let others = self.grown.iter().zip(&self.azimuths_rad).enumerate();
        let others: Vec<_> = others
            .filter(|(other, _)| *other != index)
            .map(|(_, (rows, &azimuth))| (rows, angle_between(own, azimuth)))
            .collect();
        hull_depth(&self.silhouettes[index], &others, self.reach_px)
    }
}

impl GrownRows {
    fn new(silhouette: &Silhouette) -> Self {
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

/// Another view's row: the columns that its silhouette covers, and sine and
/// cosine of its azimuth from the view whose depth is asked for.
#[derive(Clone, Copy)]
struct OtherRow<'a> {
    runs: &'a [(f32, f32)],
    sine: f32,
    cosine: f32,
}

/// Intersects the depth intervals that the other views allow.
///
/// * `others`: rows of every other view and its azimuth from this one, radians.
/// * `reach_px`: depths are within ± this.
fn hull_depth(silhouette: &Silhouette, others: &[(&GrownRows, f64)], reach_px: f32) -> HullDepth {
    /// Views this close to the view's own direction bound nothing.
    const MIN_SINE: f64 = 0.02;
    let mask = silhouette.mask();
    let width = mask.width() as usize;
    let bounding: Vec<_> =
        others.iter().filter(|(_, angle)| angle.sin().abs() > MIN_SINE).collect();
    let mut near_px = vec![f32::NAN; mask.as_raw().len()];
    let mut far_px = near_px.clone();
    let mut row = HullRow::default();
    for (y, levels) in mask.as_raw().chunks_exact(width).enumerate() {
        let others = bounding.iter().map(|(rows, angle)| OtherRow {
            runs: &rows.rows[y],
            sine: angle.sin() as f32,
            cosine: angle.cos() as f32,
        });
        let others: Vec<OtherRow<'_>> = others.collect();
        let (first, last) =
            (levels.iter().position(|&l| l != 0), levels.iter().rposition(|&l| l != 0));
        let (Some(first), Some(last)) = (first, last) else { continue };
        row.intersect(first as f32 + 0.5 - width as f32 / 2.0, last + 1 - first, &others, reach_px);
        for (k, level) in levels[first..=last].iter().enumerate() {
            if *level != 0 && row.near[k] < row.far[k] {
                near_px[y * width + first + k] = row.near[k];
                far_px[y * width + first + k] = row.far[k];
            }
        }
    }
    HullDepth { near_px, far_px }
}

/// The depth intervals of a row's pixels.
#[derive(Default)]
struct HullRow {
    near: Vec<f32>,
    far: Vec<f32>,
    allowed: Vec<(f32, f32)>,
    next: Vec<(f32, f32)>,
}

impl HullRow {
    /// * `first_px`: from the axis to the middle of the first of `pixels`.
    fn intersect(&mut self, first_px: f32, pixels: usize, others: &[OtherRow<'_>], reach_px: f32) {
        self.near.clear();
        self.near.resize(pixels, -reach_px);
        self.far.clear();
        self.far.resize(pixels, reach_px);
        for other in others {
            match other.runs {
                [] => self.far.fill(f32::NEG_INFINITY),
                &[run] => self.clip(first_px, other, run),
                _ => {}
            }
        }
        let split: Vec<_> = others.iter().filter(|other| other.runs.len() > 1).collect();
        if split.is_empty() {
            return;
        }
        for k in 0..pixels {
            self.allowed.clear();
            self.allowed.push((self.near[k], self.far[k]));
            for other in &split {
                let shift = (first_px + k as f32) * other.cosine;
                cut_down(&self.allowed, other.runs, (shift, other.sine), &mut self.next);
                std::mem::swap(&mut self.allowed, &mut self.next);
            }
            let bounds = self.allowed.first().zip(self.allowed.last());
            (self.near[k], self.far[k]) =
                bounds.map_or((0.0, f32::NEG_INFINITY), |(first, last)| (first.0, last.1));
        }
    }

    /// Clips to a view with one run.
    fn clip(&mut self, first_px: f32, other: &OtherRow<'_>, (left, right): (f32, f32)) {
        let (low, high) = if other.sine > 0.0 { (left, right) } else { (right, left) };
        let per_sine = 1.0 / other.sine;
        for (k, (near, far)) in self.near.iter_mut().zip(&mut self.far).enumerate() {
            let shift = (first_px + k as f32) * other.cosine;
            *near = near.max((low - shift) * per_sine);
            *far = far.min((high - shift) * per_sine);
        }
    }
}

/// Cuts `allowed` depths down to those whose column in another view is in one
/// of its `runs`.
fn cut_down(
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_run_clips_as_several_do() {
        // A body 20 wide, in one run and in two that meet.
        let (whole, halves) = ([(-10.0, 10.0)], [(-10.0, 2.0), (2.0, 10.0)]);
        for angle in [0.3_f32, 1.2, -0.7, 2.5] {
            let (sine, cosine) = angle.sin_cos();
            let bounds = |runs: &[(f32, f32)]| {
                let mut row = HullRow::default();
                row.intersect(-7.5, 15, &[OtherRow { runs, sine, cosine }], 40.0);
                (row.near, row.far)
            };
            let (one, two) = (bounds(&whole), bounds(&halves));
            for k in 0..15 {
                assert!((one.0[k] - two.0[k]).abs() < 1e-4 && (one.1[k] - two.1[k]).abs() < 1e-4);
                let depth = (one.0[k] + one.1[k]) / 2.0;
                let column = (k as f32 - 7.5) * cosine + depth * sine;
                assert!(column.abs() <= 10.0, "{column}");
            }
        }
    }

    #[test]
    fn nothing_is_left_where_another_view_is_empty() {
        let mut row = HullRow::default();
        row.intersect(0.0, 3, &[OtherRow { runs: &[], sine: 1.0, cosine: 0.0 }], 40.0);
        assert!(row.near.iter().zip(&row.far).all(|(near, far)| near >= far));
    }
}
