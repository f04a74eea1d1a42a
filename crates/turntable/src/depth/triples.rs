//! Lines matched between three neighbouring views.
//!
//! A point of a line at column `x` and depth `d`, on a horizontal section of
//! radius of curvature `rho` (0 at a crease, positive on a right contour), is
//! at `x cos t + d sin t + rho (1 - cos t)` in the view `t` further on. Two
//! neighbours give `d` and `rho`; `rho` must fit the kind of line, and
//! neighbouring crossings of a chain must fit each other, which a Viterbi pass
//! along each chain sees to.

use super::contours::{Contours, Crossing};

/// The cost of leaving a crossing unmatched.
const UNMATCHED: f64 = 4.0;
/// The cost of beginning or ending a matched stretch.
const ENTER_OR_LEAVE: f64 = 2.0;
const CHANGE_OF_CHAIN: f64 = 0.5;
const MAX_COST: f64 = 12.0;
const MAX_STATES: usize = 48;
/// Standard deviation of a crossing's position on an upright line, px.
const POSITION_SIGMA_PX: f64 = 0.45;
/// How far a bend may have the wrong sign, px.
const BEND_SLACK_PX: f64 = 0.15;
/// The largest radius of curvature of an inner line, in subject radii.
const INNER_RADIUS: f64 = 0.45;
const OUTLINE_RADIUS: f64 = 1.8;

/// A neighbouring view and its azimuth from the middle view.
#[derive(Clone, Copy)]
pub(super) struct Neighbour<'a> {
    pub contours: &'a Contours,
    pub angle_rad: f64,
}

/// Where the middle view's lines can be in depth.
#[derive(Clone, Copy)]
pub(super) struct Bounds<'a> {
    /// The largest distance of the subject's outline from the axis, px.
    pub radius_px: f64,
    /// The depth unit that thresholds scale with, px.
    pub unit_px: f64,
    /// Per crossing, the visual hull's nearest and farthest depth, px.
    pub hull_px: &'a [(f64, f64)],
}

/// A crossing's partners in the two neighbouring views.
#[derive(Clone, Copy, Debug)]
pub(super) struct Match {
    pub before: u32,
    pub after: u32,
    pub depth_px: f64,
    /// The signed radius of curvature of the horizontal section, px.
    pub rho_px: f64,
}

/// How two neighbours' columns give depth and curvature.
pub(super) struct TripleGeometry {
    before: (f64, f64),
    after: (f64, f64),
    determinant: f64,
    /// Standard deviation of rho, px, for positions of unit deviation.
    pub rho_noise: f64,
}

impl TripleGeometry {
    pub(super) fn new(before_rad: f64, after_rad: f64) -> Self {
        let (before, after) = (before_rad.sin_cos(), after_rad.sin_cos());
        let determinant = before.0 * (1.0 - after.1) - after.0 * (1.0 - before.1);
        let middle = after.0 * before.1 - before.0 * after.1;
        let rho_noise = (before.0.hypot(after.0).hypot(middle) / determinant).abs();
        Self { before, after, determinant, rho_noise }
    }

    /// Depth and radius of curvature, px, from the columns in the three views.
    pub(super) fn solve(&self, before_px: f64, middle_px: f64, after_px: f64) -> (f64, f64) {
        let a = before_px - middle_px * self.before.1;
        let b = after_px - middle_px * self.after.1;
        (
            (a * (1.0 - self.after.1) - b * (1.0 - self.before.1)) / self.determinant,
            (self.before.0 * b - self.after.0 * a) / self.determinant,
        )
    }

    /// Pixels of bend per pixel of rho: how far the middle column is off the
    /// neighbours' mean, scaled so that its noise is that of evenly spaced views.
    fn bend_per_rho(&self) -> f64 {
        6.0_f64.sqrt() / self.rho_noise
    }
}

struct State {
    matched: Match,
    cost: f64,
}

/// Matches every crossing of `middle` that it can.
///
/// * `before`, `after`: neighbours on either side, the first angle negative.
pub(super) fn match_triples(
    before: Neighbour<'_>,
    middle: &Contours,
    after: Neighbour<'_>,
    bounds: Bounds<'_>,
) -> Vec<Option<Match>> {
    let matcher = Matcher {
        geometry: TripleGeometry::new(before.angle_rad, after.angle_rad),
        before: before.contours,
        middle,
        after: after.contours,
        bounds,
    };
    let mut used =
        (vec![false; before.contours.crossings.len()], vec![false; after.contours.crossings.len()]);
    let mut order: Vec<usize> = (0..middle.chains.len()).collect();
    order.sort_by_key(|&chain| std::cmp::Reverse(middle.chains[chain].len()));
    let mut matches = vec![None; middle.crossings.len()];
    for chain in order {
        let chain = &middle.chains[chain];
        if chain.len() < 3 {
            continue;
        }
        let states: Vec<_> =
            chain.iter().map(|&index| matcher.states(index as usize, &used)).collect();
        for (&index, found) in chain.iter().zip(matcher.best_path(&states)) {
            if let Some(found) = found {
                used.0[found.before as usize] = true;
                used.1[found.after as usize] = true;
            }
            matches[index as usize] = found;
        }
    }
    matches
}

struct Matcher<'a> {
    geometry: TripleGeometry,
    before: &'a Contours,
    middle: &'a Contours,
    after: &'a Contours,
    bounds: Bounds<'a>,
}

impl Matcher<'_> {
    /// The pairs of crossings in the same row that may be partners of `index`.
    fn states(&self, index: usize, used: &(Vec<bool>, Vec<bool>)) -> Vec<State> {
        let crossing = &self.middle.crossings[index];
        let alone = |contours: &Contours, used: &[bool]| -> Vec<(usize, f64)> {
            let cost = |other: usize| partner_cost(crossing, &contours.crossings[other]);
            let again = |other: usize| if used[other] { 3.0 } else { 0.0 };
            let row = contours.in_row(crossing.y);
            row.map(|other| (other, cost(other) + again(other)))
                .filter(|&(_, cost)| cost < MAX_COST)
                .collect()
        };
        let befores = alone(self.before, &used.0);
        let afters = alone(self.after, &used.1);
        let mut states = Vec::new();
        for &(before, cost_before) in &befores {
            for &(after, cost_after) in &afters {
                let (matched, cost) = self.pair_cost(index, before, after);
                let cost = cost + cost_before + cost_after;
                if cost < MAX_COST {
                    states.push(State { matched, cost });
                }
            }
        }
        if states.len() > MAX_STATES {
            states.sort_by(|a, b| a.cost.total_cmp(&b.cost));
            states.truncate(MAX_STATES);
        }
        states
    }

    fn pair_cost(&self, index: usize, before: usize, after: usize) -> (Match, f64) {
        let crossing = &self.middle.crossings[index];
        let (a, c) = (&self.before.crossings[before], &self.after.crossings[after]);
        let (depth_px, rho_px) = self.geometry.solve(a.x_px, crossing.x_px, c.x_px);
        let matched = Match { before: before as u32, after: after as u32, depth_px, rho_px };
        let steep = crossing.slope.abs();
        let sigma = POSITION_SIGMA_PX * (1.0 + 0.5 * steep);
        let bend = rho_px * self.geometry.bend_per_rho();
        let (low, high) = self.bend_range(crossing);
        let excess = (bend - high).max(low - bend).max(0.0) / sigma;
        let reach = depth_px.hypot(crossing.x_px) / (1.35 * self.bounds.radius_px);
        let turn = (a.slope + c.slope - 2.0 * crossing.slope).abs() / (0.25 + 0.5 * steep);
        let shear = (c.slope - a.slope).abs() / (0.5 + 0.7 * steep);
        let cost = (excess * excess).min(50.0)
            + 0.15 * bend.abs() / sigma
            + 0.7 * turn.min(3.0)
            + 0.3 * shear.min(3.0)
            + 40.0 * (reach - 1.0).max(0.0)
            + 0.3 * depth_px.abs() / self.bounds.radius_px
            + self.hull_cost(index, depth_px);
        (matched, cost)
    }

    /// The bends that a crossing may have: a right contour's section curves
    /// one way, a left one's the other, an inner line's hardly.
    fn bend_range(&self, crossing: &Crossing) -> (f64, f64) {
        let unit = self.bounds.radius_px * self.geometry.bend_per_rho();
        let inner = (INNER_RADIUS * unit).max(0.4);
        let outer = (OUTLINE_RADIUS * unit).max(1.0);
        match (crossing.outside_left, crossing.outside_right) {
            (false, true) => (-BEND_SLACK_PX, outer),
            (true, false) => (-outer, BEND_SLACK_PX),
            _ => (-inner, inner),
        }
    }

    fn hull_cost(&self, index: usize, depth_px: f64) -> f64 {
        let (near, far) = self.bounds.hull_px[index];
        let outside = (near - depth_px).max(depth_px - far) / self.bounds.unit_px - 6.0;
        // NaN, where the hull is unknown, costs nothing.
        if outside > 0.0 { (outside / 6.0).powi(2).min(20.0) } else { 0.0 }
    }

    /// The cheapest assignment along a chain.
    fn best_path(&self, states: &[Vec<State>]) -> Vec<Option<Match>> {
        let mut totals: Vec<f64> = Vec::new();
        let mut origins: Vec<Vec<u16>> = Vec::with_capacity(states.len());
        for (k, here) in states.iter().enumerate() {
            let unary = here.iter().map(|state| state.cost).chain([UNMATCHED]);
            if k == 0 {
                totals = unary.collect();
                origins.push(vec![0; totals.len()]);
                continue;
            }
            let (next, origin) = unary
                .enumerate()
                .map(|(to, cost)| {
                    let (from, best) = self.cheapest_origin(&states[k - 1], &totals, here.get(to));
                    // A crossing has fewer candidates than its row pixels.
                    (best + cost, from as u16)
                })
                .unzip();
            totals = next;
            origins.push(origin);
        }
        let cheapest = (0..totals.len()).min_by(|&a, &b| totals[a].total_cmp(&totals[b]));
        let mut at = cheapest.unwrap_or(0);
        let mut path = vec![None; states.len()];
        for k in (0..states.len()).rev() {
            path[k] = states[k].get(at).map(|state| state.matched);
            at = usize::from(origins[k][at]);
        }
        path
    }

    /// The state, or the last number for unmatched, from which `to` is reached best.
    fn cheapest_origin(&self, from: &[State], totals: &[f64], to: Option<&State>) -> (usize, f64) {
        let unmatched =
            (from.len(), totals[from.len()] + if to.is_some() { ENTER_OR_LEAVE } else { 0.0 });
        let step = |state: &State| match to {
            Some(to) => self.transition(&state.matched, &to.matched),
            None => ENTER_OR_LEAVE,
        };
        from.iter()
            .zip(totals)
            .map(|(state, total)| total + step(state))
            .enumerate()
            .fold(unmatched, |best, (k, cost)| if cost < best.1 { (k, cost) } else { best })
    }

    fn transition(&self, from: &Match, to: &Match) -> f64 {
        let change = |contours: &Contours, a: u32, b: u32| {
            let chain = contours.chain_of[b as usize];
            if chain.is_some() && contours.chain_of[a as usize] == chain {
                0.0
            } else {
                CHANGE_OF_CHAIN
            }
        };
        let jump = (from.depth_px - to.depth_px).abs() / (12.0 * self.bounds.unit_px);
        change(self.before, from.before, to.before)
            + change(self.after, from.after, to.after)
            + 0.8 * jump.min(6.0)
    }
}

/// What tells a crossing of a neighbouring view from the one it is matched with.
fn partner_cost(crossing: &Crossing, other: &Crossing) -> f64 {
    let flags = u8::from(other.outside_left != crossing.outside_left)
        + u8::from(other.outside_right != crossing.outside_right);
    1.2 * f64::from(flags) + 0.02 * f64::from(other.run_px().abs_diff(crossing.run_px()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn geometry_recovers_depth_and_curvature_from_uneven_angles() {
        let (x, d, rho) = (40.0, -25.0, 60.0);
        let at = |t: f64| x * t.cos() + d * t.sin() + rho * (1.0 - t.cos());
        for (before, after) in [(-0.1, 0.1), (-0.2, 0.07), (0.1, 0.2)] {
            let (depth, radius) =
                TripleGeometry::new(before, after).solve(at(before), x, at(after));
            assert!((depth - d).abs() < 1e-9 && (radius - rho).abs() < 1e-7);
        }
    }

    #[test]
    fn curvature_noise_is_that_of_a_second_difference() {
        let noise = TripleGeometry::new(-0.05, 0.05).rho_noise;
        let expected = 6.0_f64.sqrt() / (0.05 * 0.05);
        assert!((noise / expected - 1.0).abs() < 0.01);
    }
}
