//! How thick removed lines were drawn: an edge along one makes it thicker.

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
        let middle = (line.at + line.slope * (along - line.from as i64) as f64).floor() as i64;
        let reach = line.thickness.ceil() as i64 + 1;
        let at = |across: i64| {
            let (x, y) = if line.upright { (across, along) } else { (along, across) };
            self.ink.at(x + self.corner.0, y + self.corner.1)
        };
        let Some(start) = (0..=reach).flat_map(|d| [middle - d, middle + d]).find(|y| at(*y))
        else {
            return 0;
        };
        let most = 2 * reach + 1;
        let run = |way: i64| (1..=most).take_while(|d| at(start + way * d)).count();
        (1 + run(-1) + run(1)).min(most as usize)
    }
}
