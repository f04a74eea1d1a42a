//! The drawn lines of a view, as crossings with the rows and chains of them.

use super::filters::gaussian;
use crate::ink::{INK_THRESHOLD, InkMap};
use crate::silhouette::Silhouette;

/// Runs wider than this follow the row rather than cross it, px.
const MAX_RUN_PX: u32 = 40;
/// Gaps between chains that are bridged, rows.
const MAX_BRIDGE_ROWS: u32 = 6;
/// Crossings that a chain's end slope is taken over.
const END_CROSSINGS: usize = 6;
/// How close the outside must be for a crossing to lie on the outline, px.
const OUTSIDE_REACH_PX: i64 = 3;

/// Where a drawn line crosses a row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Crossing {
    pub y: u32,
    /// Columns of the run of ink, half open.
    pub start: u32,
    pub end: u32,
    /// The line's middle, px from the axis, sub-pixel.
    pub x_px: f64,
    /// Columns per row along the chain.
    pub slope: f64,
    /// Whether the subject's outside is right beside the line.
    pub outside_left: bool,
    pub outside_right: bool,
}

impl Crossing {
    pub(super) fn run_px(&self) -> u32 {
        self.end - self.start
    }

    pub(super) fn on_outline(&self) -> bool {
        self.outside_left || self.outside_right
    }

    /// The column of the pixel that holds the line's middle.
    pub(super) fn column(&self, width: usize) -> usize {
        let column = (self.x_px + width as f64 / 2.0).floor();
        column.clamp(0.0, width as f64 - 1.0) as usize
    }
}

/// The crossings of a view, row by row and left to right, and the chains they
/// form from top to bottom.
#[derive(Clone, Debug)]
pub(super) struct Contours {
    pub crossings: Vec<Crossing>,
    /// Per row the number of its first crossing; one more at the end.
    pub row_starts: Vec<usize>,
    /// Crossings along each line, downward.
    pub chains: Vec<Vec<u32>>,
    /// The chain each crossing is in.
    pub chain_of: Vec<Option<u32>>,
}

impl Contours {
    pub(super) fn new(ink: &InkMap, silhouette: &Silhouette) -> Self {
        let (mut crossings, row_starts) = crossings(ink, silhouette);
        let chains = bridged(&crossings, linked(&crossings, &row_starts));
        let mut chain_of = vec![None; crossings.len()];
        for (number, chain) in chains.iter().enumerate() {
            for &crossing in chain {
                chain_of[crossing as usize] = Some(number as u32);
            }
            smooth(&mut crossings, chain);
        }
        Self { crossings, row_starts, chains, chain_of }
    }

    pub(super) fn in_row(&self, y: u32) -> std::ops::Range<usize> {
        self.row_starts[y as usize]..self.row_starts[y as usize + 1]
    }
}

fn crossings(ink: &InkMap, silhouette: &Silhouette) -> (Vec<Crossing>, Vec<usize>) {
    let mut crossings = Vec::new();
    let mut row_starts = Vec::with_capacity(ink.height() + 1);
    for y in 0..ink.height() {
        row_starts.push(crossings.len());
        let row = ink.row(y);
        let mut column = 0;
        while column < row.len() {
            if row[column] <= INK_THRESHOLD {
                column += 1;
                continue;
            }
            let length = row[column..].iter().take_while(|&&share| share > INK_THRESHOLD).count();
            crossings.push(crossing(row, y, column..column + length, silhouette));
            column += length;
        }
    }
    row_starts.push(crossings.len());
    (crossings, row_starts)
}

fn crossing(
    row: &[f32],
    y: usize,
    run: std::ops::Range<usize>,
    silhouette: &Silhouette,
) -> Crossing {
    let (low, high) = (run.start.saturating_sub(1), (run.end + 1).min(row.len()));
    let (mut moment, mut total) = (0.0, 0.0);
    for (column, share) in (low..high).zip(&row[low..high]) {
        let share = f64::from(*share);
        moment += share * (column as f64 + 0.5);
        total += share;
    }
    let outside = |columns: std::ops::Range<i64>| {
        columns.into_iter().any(|column| !silhouette.contains(column, y as i64))
    };
    let (start, end) = (run.start as i64, run.end as i64);
    Crossing {
        y: y as u32,
        start: run.start as u32,
        end: run.end as u32,
        x_px: moment / total - row.len() as f64 / 2.0,
        slope: 0.0,
        outside_left: outside(start - OUTSIDE_REACH_PX..start + 1),
        outside_right: outside(end - 1..end + OUTSIDE_REACH_PX),
    }
}

/// Chains of runs that overlap in adjacent rows and have no other to overlap.
fn linked(crossings: &[Crossing], row_starts: &[usize]) -> Vec<Vec<u32>> {
    let mut below = vec![(0_u8, 0_u32); crossings.len()];
    let mut above = vec![(0_u8, 0_u32); crossings.len()];
    for rows in row_starts.windows(3) {
        for upper in rows[0]..rows[1] {
            for lower in rows[1]..rows[2] {
                let (a, b) = (&crossings[upper], &crossings[lower]);
                if a.start <= b.end && b.start <= a.end {
                    below[upper] = (below[upper].0.saturating_add(1), lower as u32);
                    above[lower] = (above[lower].0.saturating_add(1), upper as u32);
                }
            }
        }
    }
    let narrow = |index: usize| crossings[index].run_px() <= MAX_RUN_PX;
    let next = |index: usize| {
        let (count, lower) = below[index];
        let lower = lower as usize;
        (count == 1 && above[lower].0 == 1 && narrow(index) && narrow(lower)).then_some(lower)
    };
    let mut has_previous = vec![false; crossings.len()];
    for index in 0..crossings.len() {
        if let Some(lower) = next(index) {
            has_previous[lower] = true;
        }
    }
    (0..crossings.len())
        .filter(|&index| !has_previous[index] && narrow(index))
        .map(|first| {
            std::iter::successors(Some(first), |&index| next(index)).map(|i| i as u32).collect()
        })
        .collect()
}

/// Joins chains over junctions and gaps where one goes on as the other points.
fn bridged(crossings: &[Crossing], chains: Vec<Vec<u32>>) -> Vec<Vec<u32>> {
    let mut candidates = bridge_candidates(crossings, &chains);
    candidates.sort_by(|a, b| a.0.total_cmp(&b.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut follower = vec![None; chains.len()];
    let mut followed = vec![false; chains.len()];
    for (_, upper, lower) in candidates {
        if follower[upper].is_none() && !followed[lower] {
            follower[upper] = Some(lower);
            followed[lower] = true;
        }
    }
    (0..chains.len())
        .filter(|&index| !followed[index])
        .map(|first| {
            std::iter::successors(Some(first), |&index| follower[index])
                .flat_map(|index| chains[index].iter().copied())
                .collect()
        })
        .collect()
}

/// Pairs of chains that may be one line, upper and lower, with a cost.
fn bridge_candidates(crossings: &[Crossing], chains: &[Vec<u32>]) -> Vec<(f64, usize, usize)> {
    let long = |chain: &&Vec<u32>| chain.len() >= 4;
    let height = crossings.last().map_or(0, |crossing| crossing.y as usize + 1);
    let mut starting_at = vec![Vec::new(); height + MAX_BRIDGE_ROWS as usize + 1];
    for (index, chain) in chains.iter().enumerate().filter(|(_, chain)| long(chain)) {
        starting_at[crossings[chain[0] as usize].y as usize].push(index);
    }
    let mut candidates = Vec::new();
    for (upper, chain) in chains.iter().enumerate().filter(|(_, chain)| long(chain)) {
        let last = &crossings[chain[chain.len() - 1] as usize];
        let slope = fitted_slope(crossings, &chain[chain.len().saturating_sub(END_CROSSINGS)..]);
        for rows in 1..=MAX_BRIDGE_ROWS {
            for &lower in &starting_at[(last.y + rows) as usize] {
                let start = &chains[lower][..chains[lower].len().min(END_CROSSINGS)];
                let slope_below = fitted_slope(crossings, start);
                let mean = f64::midpoint(slope, slope_below);
                let first = &crossings[start[0] as usize];
                let miss = (first.x_px - last.x_px - f64::from(rows) * mean).abs();
                let turn = (slope - slope_below).abs();
                if miss < 1.0 + 0.3 * slope.abs() && turn < 0.25 * (1.0 + slope.abs()) {
                    candidates.push((miss + 0.3 * f64::from(rows) + 3.0 * turn, upper, lower));
                }
            }
        }
    }
    candidates
}

/// Columns per row, by least squares.
fn fitted_slope(crossings: &[Crossing], part: &[u32]) -> f64 {
    let points = || part.iter().map(|&index| &crossings[index as usize]);
    let count = part.len() as f64;
    let mean_y = points().map(|crossing| f64::from(crossing.y)).sum::<f64>() / count;
    let mean_x = points().map(|crossing| crossing.x_px).sum::<f64>() / count;
    let (mut moment, mut spread) = (0.0, 0.0);
    for crossing in points() {
        let dy = f64::from(crossing.y) - mean_y;
        moment += dy * (crossing.x_px - mean_x);
        spread += dy * dy;
    }
    if spread > 0.0 { moment / spread } else { 0.0 }
}

/// Smooths positions and sets slopes along a chain of three or more.
fn smooth(crossings: &mut [Crossing], chain: &[u32]) {
    const KEPT_ENDS: usize = 2;
    if chain.len() < 3 {
        return;
    }
    let at = |k: usize| &crossings[chain[k] as usize];
    let xs: Vec<f64> = (0..chain.len()).map(|k| at(k).x_px).collect();
    let gradient: Vec<f64> = (0..chain.len())
        .map(|k| {
            let (low, high) = (k.saturating_sub(1), (k + 1).min(chain.len() - 1));
            (xs[high] - xs[low]) / f64::from(at(high).y - at(low).y)
        })
        .collect();
    let slopes = gaussian(&gradient, 2.0);
    let smooth = gaussian(&xs, 1.2);
    for (k, &index) in chain.iter().enumerate() {
        let crossing = &mut crossings[index as usize];
        crossing.slope = slopes[k];
        if chain.len() > 5 && (KEPT_ENDS..chain.len() - KEPT_ENDS).contains(&k) {
            crossing.x_px = smooth[k];
        }
    }
}
