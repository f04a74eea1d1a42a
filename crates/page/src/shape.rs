//! A view's shape: row profile, symmetry, and where its inner detail is.

use subject::raster::{Bits, Raster};

/// Rows of a profile, whatever the drawing's height.
pub(crate) const PROFILE_ROWS: usize = 48;
/// The upper part in which a face is looked for, share of the height.
const HEAD: f64 = 0.24;
/// The lowest part, which feet are in.
const FEET: f64 = 0.07;
/// The outline's stroke is not inner detail, share of the height.
const STROKE: f64 = 0.012;

/// Leftmost and rightmost pixels row by row, in heights, from the middle of
/// the columns.
#[derive(Clone, Debug)]
pub(crate) struct Profile {
    left: Vec<f64>,
    right: Vec<f64>,
}

impl Profile {
    /// Of the set pixels; `None` if there are none.
    pub(crate) fn of(bits: &Bits) -> Option<Self> {
        let bounds = bits.bounds()?;
        let height = f64::from(bounds.height());
        let middle = f64::from(bounds.left + bounds.right) / 2.0;
        let mut left = Vec::with_capacity(PROFILE_ROWS);
        let mut right = Vec::with_capacity(PROFILE_ROWS);
        for k in 0..PROFILE_ROWS {
            let row = |k: usize| {
                let y = (k as f64 / PROFILE_ROWS as f64 * height) as usize;
                y.min(bounds.height() as usize - 1)
            };
            let (from, to) = (row(k), row(k + 1).max(row(k) + 1));
            let mut sums = (0.0, 0.0, 0.0);
            for y in from..to {
                let row = bits.row(y + bounds.top as usize);
                if let Some(first) = row.iter().position(|is| *is) {
                    let last = row.iter().rposition(|is| *is).unwrap_or(first) + 1;
                    sums.0 += first as f64 - middle;
                    sums.1 += last as f64 - middle;
                    sums.2 += 1.0;
                }
            }
            let count = f64::max(sums.2, 1.0);
            left.push(sums.0 / count / height);
            right.push(sums.1 / count / height);
        }
        Some(Self { left, right })
    }

    pub(crate) fn width(&self, row: usize) -> f64 {
        (self.right[row] - self.left[row]).max(0.0)
    }

    pub(crate) fn middle(&self, row: usize) -> f64 {
        (self.right[row] + self.left[row]) / 2.0
    }

    pub(crate) fn mean_width(&self) -> f64 {
        (0..PROFILE_ROWS).map(|y| self.width(y)).sum::<f64>() / PROFILE_ROWS as f64
    }

    /// The mean of the middles, wide rows counting more.
    pub(crate) fn axis(&self) -> f64 {
        let weight: f64 = (0..PROFILE_ROWS).map(|y| self.width(y)).sum();
        let sum: f64 = (0..PROFILE_ROWS).map(|y| self.width(y) * self.middle(y)).sum();
        if weight > 0.0 { sum / weight } else { 0.0 }
    }

    /// The profile of the upper `share`, in its own height.
    pub(crate) fn upper(&self, share: f64) -> Self {
        let at = |values: &[f64], k: usize| {
            let place = (k as f64 * share) as usize;
            values[place.min(PROFILE_ROWS - 1)] / share
        };
        Self {
            left: (0..PROFILE_ROWS).map(|k| at(&self.left, k)).collect(),
            right: (0..PROFILE_ROWS).map(|k| at(&self.right, k)).collect(),
        }
    }
}

/// Rows and columns of a [`Relief`].
const RELIEF_ROWS: usize = 32;
const RELIEF_COLUMNS: usize = 48;
/// What lies farther aside on a round body is too oblique to be followed, degrees.
const OBLIQUE_DEG: f64 = 75.0;
/// Fewer cells seen in both views tell nothing.
const LEAST_SHARED: usize = 64;

/// How much the brightness changes inside of a view, row by row from its left to its right end.
#[derive(Clone, Debug)]
pub(crate) struct Relief(Vec<[f64; RELIEF_COLUMNS]>);

impl Relief {
    fn of(inner: &Bits, detail: &Raster<u8>, top: usize, bottom: usize) -> Self {
        let mut rows = vec![[0.0; RELIEF_COLUMNS]; RELIEF_ROWS];
        for (k, cells) in rows.iter_mut().enumerate() {
            let row = |k: usize| top + k * (bottom - top) / RELIEF_ROWS;
            let mut counts = [0.0_f64; RELIEF_COLUMNS];
            for y in row(k)..row(k + 1).max(row(k) + 1).min(inner.height) {
                let set = inner.row(y);
                let (Some(first), Some(last)) =
                    (set.iter().position(|is| *is), set.iter().rposition(|is| *is))
                else {
                    continue;
                };
                for x in (first..=last).filter(|x| set[*x]) {
                    let cell = (x - first) * RELIEF_COLUMNS / (last + 1 - first);
                    cells[cell] += f64::from(detail.data[y * inner.width + x]);
                    counts[cell] += 1.0;
                }
            }
            cells.iter_mut().zip(&counts).for_each(|(sum, count)| *sum /= count.max(1.0));
        }
        Self(rows)
    }

    /// How well what is drawn in this view is found where a round body turned by `turn_deg`, as
    /// azimuths grow, shows it in `other`, less how well where one turned the other way does:
    /// -1 to 1, 0 where nothing can be followed.
    pub(crate) fn turned(&self, other: &Self, turn_deg: f64) -> f64 {
        (self.correlation(other, turn_deg) - self.correlation(other, -turn_deg)) / 2.0
    }

    fn correlation(&self, other: &Self, turn_deg: f64) -> f64 {
        let (mut count, mut sums) = (0_usize, [0.0_f64; 5]);
        for column in 0..RELIEF_COLUMNS {
            let aside = (column as f64 + 0.5) / RELIEF_COLUMNS as f64 * 2.0 - 1.0;
            // What is in front moves to the left as azimuths grow.
            let before = aside.asin().to_degrees() + turn_deg;
            let seen = aside.asin().to_degrees().abs() <= OBLIQUE_DEG;
            if !seen || before.abs() > OBLIQUE_DEG {
                continue;
            }
            let from = (before.to_radians().sin() + 1.0) / 2.0 * RELIEF_COLUMNS as f64;
            let from = (from as usize).min(RELIEF_COLUMNS - 1);
            for (own, other) in self.0.iter().zip(&other.0) {
                let (a, b) = (own[from], other[column]);
                let terms = [a, b, a * a, b * b, a * b];
                sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
                count += 1;
            }
        }
        if count < LEAST_SHARED {
            return 0.0;
        }
        let [a, b, aa, bb, ab] = sums.map(|sum| sum / count as f64);
        let spread = ((aa - a * a) * (bb - b * b)).max(0.0).sqrt();
        if spread > 1e-9 { (ab - a * b) / spread } else { 0.0 }
    }
}

/// What of a view tells how it is turned.
#[derive(Clone, Debug)]
pub(crate) struct Shape {
    pub(crate) profile: Profile,
    /// How much the brightness changes inside the head, and inside all of it.
    pub(crate) head_detail: f64,
    pub(crate) body_detail: f64,
    /// Which way head and feet point, -1 left to 1 right, 0 if they do not.
    pub(crate) head_side: f64,
    pub(crate) feet_side: f64,
    pub(crate) relief: Relief,
}

impl Shape {
    /// * `mask`: the view; `detail`: how much the brightness changes, same size.
    pub(crate) fn of(mask: &Bits, detail: &Raster<u8>) -> Option<Self> {
        let bounds = mask.bounds()?;
        let height = f64::from(bounds.height());
        let inner = mask.eroded((STROKE * height).max(1.5) as f32);
        let profile = Profile::of(mask)?;
        let row = |share: f64| bounds.top as usize + (share * height) as usize;
        let all = moments(&inner, detail, row(0.0), bounds.bottom as usize);
        let head = moments(&inner, detail, row(0.0), row(HEAD).max(row(0.0) + 1));
        let head_side = if head.area > 4.0 && head.detail > 0.0 {
            ((head.detail_x - head.area_x) / head.spread.max(1.0)).clamp(-1.0, 1.0)
        } else {
            0.0
        };
        Some(Self {
            head_detail: head.detail / head.area.max(1.0),
            body_detail: all.detail / all.area.max(1.0),
            head_side,
            feet_side: feet_side(&profile),
            relief: Relief::of(&inner, detail, bounds.top as usize, bounds.bottom as usize),
            profile,
        })
    }
}

/// How far the lowest rows reach beyond the legs above them, to either side.
fn feet_side(profile: &Profile) -> f64 {
    let low = ((1.0 - FEET) * PROFILE_ROWS as f64) as usize;
    let (from, to) = ((0.78 * PROFILE_ROWS as f64) as usize, (0.9 * PROFILE_ROWS as f64) as usize);
    let mean = |values: &[f64], rows: std::ops::Range<usize>| {
        let count = rows.len().max(1) as f64;
        values[rows].iter().sum::<f64>() / count
    };
    let left = mean(&profile.left, from..to) - mean(&profile.left, low..PROFILE_ROWS);
    let right = mean(&profile.right, low..PROFILE_ROWS) - mean(&profile.right, from..to);
    // A shoe's toe is a tenth of the height at most.
    ((right - left) / 0.05).clamp(-1.0, 1.0)
}

struct Moments {
    area: f64,
    detail: f64,
    area_x: f64,
    detail_x: f64,
    spread: f64,
}

fn moments(inner: &Bits, detail: &Raster<u8>, from: usize, to: usize) -> Moments {
    let (mut area, mut ax, mut axx) = (0.0, 0.0, 0.0);
    let (mut sum, mut dx) = (0.0, 0.0);
    for y in from..to.min(inner.height) {
        for x in 0..inner.width {
            let at = y * inner.width + x;
            if inner.data[at] {
                let level = f64::from(detail.data[at]);
                let x = x as f64;
                area += 1.0;
                ax += x;
                axx += x * x;
                sum += level;
                dx += level * x;
            }
        }
    }
    let area_x = if area > 0.0 { ax / area } else { 0.0 };
    let spread = if area > 0.0 { (axx / area - area_x * area_x).max(0.0).sqrt() } else { 0.0 };
    let detail_x = if sum > 0.0 { dx / sum } else { area_x };
    Moments { area, detail: sum, area_x, detail_x, spread }
}
