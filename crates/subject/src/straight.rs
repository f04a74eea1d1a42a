//! Long, straight, thin, level or upright lines in an inked raster.

use crate::raster::Bits;

/// One straight line: a chain of thin runs along columns, in a raster that is
/// transposed for upright lines.
#[derive(Clone, Debug)]
pub(crate) struct Line {
    /// Whether it is upright: then `from` and `to` are rows, `at` a column.
    pub(crate) upright: bool,
    pub(crate) from: usize,
    pub(crate) to: usize,
    /// Position across at `from`, and its change per pixel along.
    pub(crate) at: f64,
    pub(crate) slope: f64,
    pub(crate) thickness: f64,
    /// Per pixel along: bare on both sides.
    pub(crate) alone: Vec<bool>,
    /// How far nothing is drawn straight on from its first end, and its last.
    pub(crate) ahead: [usize; 2],
}

impl Line {
    pub(crate) fn across(&self, along: usize) -> f64 {
        self.at + self.slope * (along as f64 - self.from as f64)
    }

    /// The pixel, `(x, y)`, in a place along it and across.
    pub(crate) fn pixel(&self, along: i64, across: i64) -> (i64, i64) {
        if self.upright { (across, along) } else { (along, across) }
    }

    pub(crate) fn length(&self) -> usize {
        self.to - self.from
    }

    /// How far it goes on alone from its first end, and from its last; 0 where
    /// something else goes on there.
    pub(crate) fn overhangs(&self) -> [usize; 2] {
        let run = |mut it: Box<dyn Iterator<Item = bool> + '_>| {
            // The very last pixel may be blurred.
            let first = usize::from(it.next() == Some(true));
            first + it.take_while(|is| *is).count()
        };
        let ends = [
            run(Box::new(self.alone.iter().copied())),
            run(Box::new(self.alone.iter().rev().copied())),
        ];
        [0, 1].map(|k| if self.ahead[k] > 0 { ends[k] } else { 0 })
    }

    pub(crate) fn alone_share(&self) -> f64 {
        self.alone.iter().filter(|is| **is).count() as f64 / self.alone.len().max(1) as f64
    }
}

/// What counts as a straight thin line, px.
pub(crate) struct Limits {
    pub(crate) least_run: usize,
    pub(crate) most_thickness: usize,
    /// Paper beside the line must be this wide for it to be alone.
    pub(crate) bare: usize,
}

struct Run {
    from: usize,
    to: usize,
    y: usize,
}

/// The level lines of `ink`; of its transposed raster those are upright.
pub(crate) fn level_lines(ink: &Bits, limits: &Limits, upright: bool) -> Vec<Line> {
    let thin = thin_across(ink, limits.most_thickness);
    let pieces = straight_pieces(&thin, limits);
    let chains = chained(pieces, limits);
    chains.into_iter().map(|piece| measured(piece, ink, &thin, limits, upright)).collect()
}

/// Exactly level lines by their rows alone: those along which much thin ink is
/// bare on both sides, wherever it is and however short its runs are.
pub(crate) fn level_rows(ink: &Bits, limits: &Limits, least: usize, upright: bool) -> Vec<Line> {
    let (w, h) = (ink.width, ink.height);
    let thin = thin_across(ink, limits.most_thickness);
    // Per row how many bare thin runs have their middle there, their sum of
    // lengths, and the first and last column of them.
    let mut rows = vec![(0_usize, 0_usize, w, 0_usize); h];
    for x in 0..w {
        let mut y = 0;
        while y < h {
            if !thin.data[y * w + x] {
                y += 1;
                continue;
            }
            let from = y;
            while y < h && thin.data[y * w + x] {
                y += 1;
            }
            let above = (from.saturating_sub(limits.bare)..from).any(|v| ink.data[v * w + x]);
            let below = (y..(y + limits.bare).min(h)).any(|v| ink.data[v * w + x]);
            if !above && !below {
                let row = &mut rows[(from + y - 1) / 2];
                *row = (row.0 + 1, row.1 + y - from, row.2.min(x), row.3.max(x));
            }
        }
    }
    let near = |y: usize| y.saturating_sub(1)..(y + 2).min(h);
    let count = |y: usize| near(y).map(|v| rows[v].0).sum::<usize>();
    let is_peak = |y: &usize| {
        let own = count(*y);
        own >= least && near(*y).all(|v| (count(v), v) <= (own, *y))
    };
    let piece = |y: usize| {
        let sum: usize = near(y).map(|v| rows[v].1).sum();
        let place: f64 = near(y).map(|v| (v as f64 + 0.5) * rows[v].0 as f64).sum();
        Straight {
            from: near(y).map(|v| rows[v].2).min().unwrap_or(0),
            to: near(y).map(|v| rows[v].3).max().unwrap_or(0) + 1,
            at: place / count(y) as f64,
            slope: 0.0,
            thickness: sum as f64 / count(y) as f64,
        }
    };
    (0..h).filter(is_peak).map(|y| measured(piece(y), ink, &thin, limits, upright)).collect()
}

/// Ink whose run down its column is no longer than `most`.
fn thin_across(ink: &Bits, most: usize) -> Bits {
    let (w, h) = (ink.width, ink.height);
    let mut length = vec![0_u16; w];
    let mut thin = Bits::filled(w, h, false);
    for y in 0..=h {
        for (x, length) in length.iter_mut().enumerate() {
            if y < h && ink.data[y * w + x] {
                *length = length.saturating_add(1);
            } else if *length > 0 {
                let run = usize::from(*length);
                if run <= most {
                    (y - run..y).for_each(|y| thin.data[y * w + x] = true);
                }
                *length = 0;
            }
        }
    }
    thin
}

/// A straight piece: its ends, position and slope.
#[derive(Clone, Debug)]
struct Straight {
    from: usize,
    to: usize,
    at: f64,
    slope: f64,
    thickness: f64,
}

impl Straight {
    fn across(&self, along: f64) -> f64 {
        self.at + self.slope * (along - self.from as f64)
    }
}

/// Connected bundles of long runs, as straight pieces.
fn straight_pieces(thin: &Bits, limits: &Limits) -> Vec<Straight> {
    let (w, h) = (thin.width, thin.height);
    let mut runs: Vec<Run> = Vec::new();
    let mut starts = Vec::with_capacity(h + 1);
    for y in 0..h {
        starts.push(runs.len());
        let row = thin.row(y);
        let mut x = 0;
        while x < w {
            if !row[x] {
                x += 1;
                continue;
            }
            let from = x;
            // A bare pixel does not end a run.
            while x < w && (row[x] || (x + 1 < w && row[x + 1])) {
                x += 1;
            }
            if x - from >= limits.least_run {
                runs.push(Run { from, to: x, y });
            }
        }
    }
    starts.push(runs.len());
    let mut parent: Vec<usize> = (0..runs.len()).collect();
    fn root(parent: &mut [usize], mut k: usize) -> usize {
        while parent[k] != k {
            parent[k] = parent[parent[k]];
            k = parent[k];
        }
        k
    }
    for y in 1..h {
        for a in starts[y - 1]..starts[y] {
            for b in starts[y]..starts[y + 1] {
                let touch = runs[a].from <= runs[b].to + 2 && runs[b].from <= runs[a].to + 2;
                if touch {
                    let (a, b) = (root(&mut parent, a), root(&mut parent, b));
                    parent[a.max(b)] = a.min(b);
                }
            }
        }
    }
    let mut groups: std::collections::BTreeMap<usize, Vec<usize>> = Default::default();
    for k in 0..runs.len() {
        let top = root(&mut parent, k);
        groups.entry(top).or_default().push(k);
    }
    groups.into_values().filter_map(|group| fitted(&group, &runs, limits)).collect()
}

fn fitted(group: &[usize], runs: &[Run], limits: &Limits) -> Option<Straight> {
    let from = group.iter().map(|&k| runs[k].from).min()?;
    let to = group.iter().map(|&k| runs[k].to).max()?;
    // Weighted least squares over all pixels of the runs.
    let (mut n, mut sx, mut sy, mut sxx, mut sxy) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for &k in group {
        let run = &runs[k];
        let count = (run.to - run.from) as f64;
        let (a, b) = (run.from as f64, run.to as f64);
        let mid = (a + b) / 2.0;
        let y = run.y as f64 + 0.5;
        n += count;
        sx += count * mid;
        sy += count * y;
        sxx += count * (mid * mid + count * count / 12.0);
        sxy += count * mid * y;
    }
    let spread = sxx - sx * sx / n;
    let slope = if spread > 0.0 { (sxy - sx * sy / n) / spread } else { 0.0 };
    let line = |x: f64| sy / n + slope * (x - sx / n);
    let length = (to - from) as f64;
    let thickness = n / length;
    let worst = group.iter().map(|&k| {
        let run = &runs[k];
        let y = run.y as f64 + 0.5;
        (y - line(run.from as f64)).abs().max((y - line(run.to as f64)).abs())
    });
    let worst = worst.fold(0.0, f64::max);
    let straight = slope.abs() < 0.04
        && thickness <= limits.most_thickness as f64
        && worst <= limits.most_thickness as f64 * 0.5 + 1.5 + 0.003 * length;
    straight.then(|| Straight { from, to, at: line(from as f64), slope, thickness })
}

/// Pieces that continue each other, joined.
fn chained(mut pieces: Vec<Straight>, limits: &Limits) -> Vec<Straight> {
    pieces.sort_by_key(|piece| (piece.from, piece.to));
    let mut chains: Vec<Straight> = Vec::new();
    for piece in pieces {
        let near = 1.5 + 0.25 * limits.most_thickness as f64;
        let continues = |chain: &Straight| {
            let (a, b) = (chain.to as f64, piece.from as f64);
            let reach = chain.across(b) - piece.across(b);
            let back = chain.across(a) - piece.across(a);
            piece.from + 2 >= chain.to.min(piece.from + 2)
                && piece.to > chain.to
                && reach.abs() <= near
                && back.abs() <= near
                && (chain.thickness - piece.thickness).abs() <= 0.5 * chain.thickness + 0.8
        };
        match chains.iter_mut().rev().find(|chain| continues(chain)) {
            Some(chain) => {
                let (a, b) = ((chain.to - chain.from) as f64, (piece.to - piece.from) as f64);
                let end = piece.across(piece.to as f64);
                let slope = (end - chain.at) / (piece.to - chain.from) as f64;
                chain.thickness = (chain.thickness * a + piece.thickness * b) / (a + b);
                chain.slope = slope;
                chain.to = piece.to;
            }
            None => chains.push(piece),
        }
    }
    chains
}

fn measured(piece: Straight, ink: &Bits, thin: &Bits, limits: &Limits, upright: bool) -> Line {
    let half = piece.thickness / 2.0 + 1.0;
    let along = piece.from..piece.to;
    let state = |x: usize| {
        let y = piece.across(x as f64 + 0.5);
        let (low, high) = ((y - half).floor() as i64, (y + half).ceil() as i64);
        let own = (low..high).any(|y| thin.at(x as i64, y));
        let bare = limits.bare as i64;
        let beside = (low - bare..low).chain(high..high + bare).any(|y| ink.at(x as i64, y));
        (own, own && !beside)
    };
    let states: Vec<bool> = along.map(|x| state(x).1).collect();
    let ahead = |end: usize, way: i64| {
        let (end, bare) = (end as i64, limits.bare as i64);
        let y = piece.across(end as f64);
        let (low, high) = ((y - half).floor() as i64 - bare, (y + half).ceil() as i64 + bare);
        let to_border = if way < 0 { end } else { ink.width as i64 - 1 - end };
        let bare_at = |step: i64| (low..high).all(|y| !ink.at(end + way * step, y));
        // A stroke across the end is a corner. The last pixels may be blurred.
        let corner = (1..3).any(|step| {
            let beside = (low..low + bare).chain(high - bare..high);
            beside.into_iter().any(|y| ink.at(end + way * step, y))
        });
        if corner || !(3..3 + bare.max(4)).all(bare_at) {
            return 0;
        }
        let clear = (3..to_border).take_while(|step| bare_at(*step)).count() + 3;
        // What reaches the page's border has nothing ahead.
        if clear as i64 >= to_border { usize::MAX } else { clear }
    };
    Line {
        upright,
        from: piece.from,
        to: piece.to,
        at: piece.at,
        slope: piece.slope,
        thickness: piece.thickness,
        alone: states,
        ahead: [ahead(piece.from, -1), ahead(piece.to - 1, 1)],
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_through_a_block_is_one_chain() {
        let mut ink = Bits::filled(300, 80, false);
        for x in 10..290 {
            for y in 40..42 {
                ink.set(x, y, true);
            }
        }
        for x in 120..160 {
            for y in 20..70 {
                ink.set(x, y, true);
            }
        }
        let limits = Limits { least_run: 15, most_thickness: 4, bare: 5 };
        let lines = level_lines(&ink, &limits, false);
        assert_eq!(lines.len(), 1, "{lines:?}");
        assert_eq!((lines[0].from, lines[0].to), (10, 290));
        assert!(lines[0].overhangs()[0] >= 105);
    }
}
