//! How thick removed lines were drawn: an edge along one makes it thicker.

use super::runs;
use crate::raster::Bits;
use crate::straight::Line;

/// A line along which an edge is drawn, or within which a stroke goes on, is so much thicker, px.
const THICKER_PX: f64 = 0.9;

/// What was drawn before lines were removed.
pub(crate) struct Drawn<'a> {
    pub(crate) ink: &'a Bits,
    /// Where the raster that lines are on begins, px of `ink`.
    pub(crate) corner: (i64, i64),
}

impl Drawn<'_> {
    /// Whether a line is thicker between two places along it than it is alone.
    pub(super) fn is_thicker<'l>(
        &self,
        line: &'l Line,
    ) -> impl Fn(usize, usize) -> bool + use<'_, 'l> {
        let alone = self.thickness_alone(line);
        move |from, to| self.thickness(line, from, to) >= alone + THICKER_PX
    }

    /// Stretches of a line along which an edge is drawn, each at least `least` px long without what
    /// crosses it there.
    pub(super) fn edges_along(&self, line: &Line, least: usize) -> Vec<(usize, usize)> {
        let enough = self.thickness_alone(line) + THICKER_PX;
        let most = self.most(line);
        let thick: Vec<Option<bool>> = (line.from..line.to)
            .map(|along| self.run(line, along as i64))
            .map(|run| (run < most).then_some(run as f64 >= enough))
            .collect();
        // A pixel or two of noise end no edge.
        let is_edge = |at: usize| {
            let near = &thick[at.saturating_sub(2)..(at + 3).min(thick.len())];
            let count = |is| near.iter().filter(|thick| **thick == Some(is)).count();
            count(true) > count(false) || (count(false) == 0 && count(true) == 0)
        };
        let stretches = runs(0..thick.len(), is_edge).into_iter();
        stretches
            .filter(|(from, to)| {
                thick[*from..=*to].iter().filter(|thick| **thick == Some(true)).count() >= least
            })
            .map(|(from, to)| (from + line.from, to + line.from))
            .collect()
    }

    /// Draws what was drawn along a line in one place again, on a raster of its own corner: what is
    /// beside the line, and so much of the line that a stroke `stroke_px` wide is whole.
    pub(super) fn draw_again(&self, line: &Line, along: usize, stroke_px: f64, to: &mut Bits) {
        let Some((mut low, mut high)) = self.span(line, along as i64) else { return };
        let (middle, half) = (line.across(along), line.thickness / 2.0);
        let (first, last) = ((middle - half).round() as i64, (middle + half).round() as i64 - 1);
        let stroke = stroke_px.round().max(1.0) as i64;
        match (low < first, high > last) {
            (true, false) => high = high.min((first - 1).max(low + stroke - 1)),
            (false, true) => low = low.max((last + 1).min(high - stroke + 1)),
            _ => {}
        }
        for across in low..=high {
            let (x, y) = line.pixel(along as i64, across);
            to.set(x, y, true);
        }
    }

    /// How thick a line is where nothing is drawn along it, px.
    fn thickness_alone(&self, line: &Line) -> f64 {
        let length = if line.upright { self.ink.height } else { self.ink.width } as i64;
        let shift = if line.upright { self.corner.1 } else { self.corner.0 };
        let mut runs: Vec<usize> = (-shift..length - shift)
            .map(|along| self.run(line, along))
            .filter(|run| *run > 0)
            .collect();
        if runs.is_empty() {
            return line.thickness;
        }
        let quarter = runs.len() / 4;
        *runs.select_nth_unstable(quarter).1 as f64
    }

    /// How thick a line is between two places along it, on average, px; what crosses it counts little.
    fn thickness(&self, line: &Line, from: usize, to: usize) -> f64 {
        let runs: Vec<usize> =
            (from as i64 + 1..to as i64).map(|along| self.run(line, along)).collect();
        runs.iter().sum::<usize>() as f64 / runs.len().max(1) as f64
    }

    /// The pixels drawn across a line in one place, px.
    fn run(&self, line: &Line, along: i64) -> usize {
        let span = self.span(line, along);
        span.map_or(0, |(low, high)| (high - low + 1) as usize).min(self.most(line))
    }

    /// What is thicker crosses a line, px.
    fn most(&self, line: &Line) -> usize {
        2 * (line.thickness.ceil() as usize + 1) + 1
    }

    /// The first and the last pixel of those drawn across a line in one place.
    fn span(&self, line: &Line, along: i64) -> Option<(i64, i64)> {
        let middle = (line.at + line.slope * (along - line.from as i64) as f64).floor() as i64;
        let reach = line.thickness.ceil() as i64 + 1;
        let at = |across: i64| {
            let (x, y) = line.pixel(along, across);
            self.ink.at(x + self.corner.0, y + self.corner.1)
        };
        let start = (0..=reach).flat_map(|d| [middle - d, middle + d]).find(|y| at(*y))?;
        let most = self.most(line) as i64;
        let run = |way: i64| (1..=most).take_while(|d| at(start + way * d)).count() as i64;
        Some((start - run(-1), start + run(1)))
    }
}
