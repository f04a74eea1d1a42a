//! Depth everywhere inside the silhouette, from the depth of its lines.
//!
//! The surface is a membrane `r` through the lines minus a bulge
//! `w = sqrt(c u)`. `u` solves `-u_xx - u_yy / 5 = 2` with `u = 0` on the
//! contours that bound a surface, so that `w` is exactly an ellipse on a row,
//! its normal in the image plane at the contour, as a smooth occluding
//! contour's is. Rows are linked weakly: sections change fast where an outline
//! runs along the rows. `c` follows from the contour's curvature:
//! `c = 2 rho / u_x`.

use super::contours::{Contours, Crossing};
use super::graph::{Cuts, Owner, PixelGraph};
use super::lines::LineDepths;
use super::multigrid::{Hierarchy, Link};
use super::owners::{cut_inner, is_straight, line_weight};
use mesh::connected::components;

/// The bulge of a contour that tells nothing, and how firmly it is assumed.
const PRIOR_BULGE: f64 = 0.5;
const PRIOR_SIGMA: f64 = 0.5;
/// The odds that a contour's surface is flat, before its curvature is known:
/// of any line's and of a straight one's.
const FLAT_ODDS: f64 = 0.3;
const FLAT_ODDS_STRAIGHT: f64 = 3.0;
const MAX_BULGE: f64 = 3.0;
const VERTICAL_LINK: f32 = 0.5;
/// The same for the shape of the bulge.
const VERTICAL_LINK_BULGE: f32 = 0.2;
const ACROSS_INK: f32 = 0.02;
/// Cut links are not quite cut, so that a part without lines hangs on to the rest.
const LEAK: f32 = 1e-4;
const FIXED: f32 = 1e4;
const LINE_WEIGHT: f32 = 10.0;
const BULGE_WEIGHT: f32 = 0.3;

/// Depths known on single pixels beside the lines' own.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Hint {
    pub weight: f32,
    pub depth_px: f32,
    /// Depth per column of the surface, where it is known.
    pub slope: Option<f32>,
}

/// How well the equations are solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Accuracy {
    /// On every other pixel, errors a thousandth of the depth.
    Rough,
    Final,
}

/// The equations of one view, solved again as hints change.
pub(super) struct Fill<'a> {
    graph: &'a PixelGraph,
    hierarchy: Hierarchy,
    /// Per node: the bulge towards the camera, px.
    bulge_px: Vec<f32>,
    /// Per node: the lines' weight and weighted depth.
    lines: Vec<(f32, f32)>,
    /// The lines' mean depth, px, where nothing tells.
    level_px: f32,
    membrane: Option<Vec<f32>>,
    /// Links to the right that are not cut.
    right_links: Vec<(u32, u32)>,
    /// Per node: on a contour, where the bulge has the right slope.
    on_contour: Vec<bool>,
}

impl<'a> Fill<'a> {
    pub(super) fn new(
        graph: &'a PixelGraph,
        contours: &Contours,
        lines: &LineDepths,
        owners: &[Option<Owner>],
    ) -> Self {
        let mut cuts = Cuts::none(graph);
        cut_inner(&mut cuts, graph, contours, owners, 1);
        let cut_or_leak = |(link, cut): (Link, u16)| {
            let weight = if cut == 0 { link.weight.max(LEAK) } else { LEAK };
            Link { weight, ..link }
        };
        let links = |vertical: f32| graph.links(&cuts, vertical, ACROSS_INK).map(cut_or_leak);
        let (base, hierarchy) = rayon::join(
            || inflation(graph, links(VERTICAL_LINK_BULGE).collect(), contours, owners),
            || Hierarchy::new(&graph.positions, links(VERTICAL_LINK)),
        );
        let strength = strength(graph, &hierarchy, contours, lines, owners, &base);
        let bulge_px =
            base.iter().zip(&strength).map(|(u, c)| (u.max(0.0) * c.max(0.0)).sqrt()).collect();
        let stamped = stamp(graph, contours, |index, crossing| {
            let depth = lines.depth_px[index];
            (!depth.is_nan()).then(|| (depth, line_weight(crossing)))
        });
        let known = stamped.iter().filter(|(weight, _)| *weight > 0.0);
        let (count, sum) = known.fold((0.0_f64, 0.0_f64), |(count, sum), &(weight, weighted)| {
            (count + 1.0, sum + f64::from(weighted / weight))
        });
        let level_px = if count > 0.0 { (sum / count) as f32 } else { 0.0 };
        let same_row = |link: &Link| {
            let row = |node: u32| graph.positions[node as usize].1;
            row(link.a) == row(link.b) && link.weight > LEAK
        };
        let mut on_contour = vec![false; graph.nodes()];
        for (index, crossing) in contours.crossings.iter().enumerate() {
            if owners[index].is_some() && !lines.rho_px[index].is_nan() {
                graph.node_at(crossing).into_iter().for_each(|node| on_contour[node] = true);
            }
        }
        Self {
            level_px,
            membrane: None,
            right_links: links(VERTICAL_LINK)
                .filter(same_row)
                .map(|link| (link.a, link.b))
                .collect(),
            on_contour,
            graph,
            hierarchy,
            bulge_px,
            lines: stamped,
        }
    }

    /// Spreads the difference between known slopes and the bulge's: how much
    /// steeper, per column, the surface is than membrane and bulge.
    fn spread_tilt(&self, hints: &[Hint]) -> Vec<f32> {
        const TILT_WEIGHT: f32 = 0.5;
        const TILT_PRIOR: f32 = 1e-5;
        const MAX_TILT: f32 = 3.0;
        let mut screen = vec![TILT_PRIOR; self.graph.nodes()];
        let mut right = vec![0.0; self.graph.nodes()];
        for node in self.on_contour.iter().enumerate().filter(|(_, is)| **is).map(|(node, _)| node)
        {
            screen[node] += TILT_WEIGHT;
        }
        for (node, hint) in hints.iter().enumerate() {
            let (x, y) = self.graph.positions[node];
            let bulge = |step| {
                let beside = self.graph.node_beside(y, x as usize, step);
                beside.map(|node| self.bulge_px[node])
            };
            let (Some(slope), Some(left), Some(after)) = (hint.slope, bulge(-1), bulge(1)) else {
                continue;
            };
            let tilt = slope + (after - left) / 2.0;
            if tilt.abs() < MAX_TILT && !self.on_contour[node] {
                screen[node] += TILT_WEIGHT;
                right[node] += TILT_WEIGHT * tilt;
            }
        }
        self.hierarchy.operator(&screen).solve_roughly(&right, 1e-2, 20)
    }

    /// Per node the weight of line depths on it.
    pub(super) fn line_weights(&self) -> impl Iterator<Item = f32> + '_ {
        self.lines.iter().map(|(weight, _)| *weight)
    }

    /// Depth per node, px, through the lines and near the hints.
    ///
    /// * `accuracy`: rough, to see which hints apply, or final.
    pub(super) fn solve(&mut self, hints: &[Hint], accuracy: Accuracy) -> Vec<f32> {
        const ANCHOR: f32 = 1e-7;
        let mut screen = vec![ANCHOR; self.graph.nodes()];
        let mut right = vec![ANCHOR * self.level_px; self.graph.nodes()];
        for (node, &(weight, sum)) in self.lines.iter().enumerate() {
            screen[node] += LINE_WEIGHT * weight;
            right[node] += LINE_WEIGHT * (sum + weight * self.bulge_px[node]);
        }
        for (node, hint) in hints.iter().enumerate() {
            screen[node] += hint.weight;
            right[node] += hint.weight * (hint.depth_px + self.bulge_px[node]);
        }
        if hints.iter().any(|hint| hint.slope.is_some()) {
            let tilt = self.spread_tilt(hints);
            for &(a, b) in &self.right_links {
                let tilt = f32::midpoint(tilt[a as usize], tilt[b as usize]);
                right[a as usize] -= tilt;
                right[b as usize] += tilt;
            }
        }
        let operator = self.hierarchy.operator(&screen);
        let membrane = match accuracy {
            Accuracy::Rough => operator.solve_roughly(&right, 1e-3, 40),
            Accuracy::Final => operator.solve(&right, self.membrane.as_deref(), 5e-4, 40),
        };
        let depth = membrane.iter().zip(&self.bulge_px).map(|(r, w)| r - w).collect();
        self.membrane = Some(membrane);
        depth
    }
}

/// Sums weighted values of crossings on the nodes of their middles.
fn stamp(
    graph: &PixelGraph,
    contours: &Contours,
    value: impl Fn(usize, &Crossing) -> Option<(f64, f64)>,
) -> Vec<(f32, f32)> {
    let mut sums = vec![(0.0, 0.0); graph.nodes()];
    for (index, crossing) in contours.crossings.iter().enumerate() {
        if let (Some((value, weight)), Some(node)) =
            (value(index, crossing), graph.node_at(crossing))
        {
            sums[node].0 += weight as f32;
            sums[node].1 += (weight * value) as f32;
        }
    }
    sums
}

/// Whether a crossing's line can bound a bulge.
fn bounds_bulge(crossing: &Crossing) -> bool {
    const MAX_RUN_PX: u32 = 30;
    crossing.slope.abs() < 8.0 && crossing.run_px() < MAX_RUN_PX
}

/// `u`: 0 on the contours that bound a surface.
fn inflation(
    graph: &PixelGraph,
    links: Vec<Link>,
    contours: &Contours,
    owners: &[Option<Owner>],
) -> Vec<f32> {
    let mut fixed = vec![false; graph.nodes()];
    for (index, crossing) in contours.crossings.iter().enumerate() {
        if owners[index].is_some()
            && bounds_bulge(crossing)
            && let Some(node) = graph.node_at(crossing)
        {
            fixed[node] = true;
        }
        fix_stroke_outside(graph, crossing, &mut fixed);
    }
    let strong = links.iter().filter(|link| link.weight > LEAK).map(|link| (link.a, link.b));
    let (labels, count) = components(graph.nodes(), strong);
    let mut bounded = vec![false; count];
    for (&label, &is_fixed) in labels.iter().zip(&fixed) {
        bounded[label as usize] |= is_fixed;
    }
    for (label, is_fixed) in labels.iter().zip(&mut fixed) {
        *is_fixed |= !bounded[*label as usize];
    }
    let screen: Vec<f32> = fixed.iter().map(|&is| if is { FIXED } else { 1e-7 }).collect();
    let right: Vec<f32> = fixed.iter().map(|&is| if is { 0.0 } else { 2.0 }).collect();
    let hierarchy = Hierarchy::new(&graph.positions, links);
    hierarchy.operator(&screen).solve(&right, None, 1e-3, 60)
}

/// The outer half of the outline's stroke is not surface.
fn fix_stroke_outside(graph: &PixelGraph, crossing: &Crossing, fixed: &mut [bool]) {
    const REACH_PX: isize = 4;
    if crossing.run_px() >= 30 {
        return;
    }
    let column = crossing.column(graph.width);
    for (outside, step) in [(crossing.outside_left, -1), (crossing.outside_right, 1)] {
        if !outside {
            continue;
        }
        for k in 1..=REACH_PX {
            let near_edge = (k + 1..=k + 2)
                .any(|beyond| graph.node_beside(crossing.y, column, step * beyond).is_none());
            match graph.node_beside(crossing.y, column, step * k) {
                Some(node) if near_edge => fixed[node] = true,
                Some(_) => {}
                None => break,
            }
        }
    }
}

/// `c`: the bulge that the contours' curvature asks for, spread as a membrane.
fn strength(
    graph: &PixelGraph,
    hierarchy: &Hierarchy,
    contours: &Contours,
    lines: &LineDepths,
    owners: &[Option<Owner>],
    base: &[f32],
) -> Vec<f32> {
    let mut straight = vec![false; contours.crossings.len()];
    for chain in contours.chains.iter().filter(|chain| is_straight(contours, chain)) {
        chain.iter().for_each(|&index| straight[index as usize] = true);
    }
    let known = stamp(graph, contours, |index, crossing| {
        let owner = owners[index].filter(|_| bounds_bulge(crossing))?;
        let rho = match owner {
            Owner::Left => lines.rho_px[index],
            Owner::Right => -lines.rho_px[index],
        };
        let (rise, end) = rise(graph, crossing, owner, base)?;
        let curvature =
            Curvature { rho, sigma: lines.rho_sigma_px[index], straight: straight[index] };
        (!rho.is_nan() && end > 2.0).then(|| (curvature.bulge(rise), 1.0))
    });
    let screen: Vec<f32> = known.iter().map(|(weight, _)| BULGE_WEIGHT * weight + 1e-6).collect();
    let right: Vec<f32> =
        known.iter().map(|(_, sum)| BULGE_WEIGHT * sum + 1e-6 * PRIOR_BULGE as f32).collect();
    hierarchy.operator(&screen).solve_roughly(&right, 1e-3, 40)
}

/// How steeply `u` rises from a contour into its owner, and its value 4 px in.
fn rise(graph: &PixelGraph, crossing: &Crossing, owner: Owner, base: &[f32]) -> Option<(f64, f64)> {
    let column = crossing.column(graph.width);
    let at = |distance: isize| {
        graph
            .node_beside(crossing.y, column, owner.step() * distance)
            .map(|node| f64::from(base[node]))
    };
    Some((at(3)? / 3.0, at(4)?))
}

/// A contour's radius of curvature, positive towards its owner.
struct Curvature {
    rho: f64,
    sigma: f64,
    straight: bool,
}

impl Curvature {
    /// The bulge strength, between what is measured and the prior, as far as
    /// the surface is round rather than flat.
    fn bulge(&self, rise: f64) -> f64 {
        let measured = (2.0 * self.rho / rise).clamp(0.0, MAX_BULGE);
        let weight = (2.0 * self.sigma / rise).powi(-2);
        let prior = PRIOR_SIGMA.powi(-2);
        let round = (weight * measured + prior * PRIOR_BULGE) / (weight + prior);
        round * self.roundness(rise / 2.0)
    }

    /// The probability that the surface is round: a flat side's edge has no
    /// curvature, a round one's about that of an ellipse.
    ///
    /// * `full_px`: the radius of curvature for a bulge of 1.
    fn roundness(&self, full_px: f64) -> f64 {
        const FLAT_SIGMA_PX: f64 = 4.0;
        let density = |off: f64, sigma: f64| (-0.5 * (off / sigma).powi(2)).exp() / sigma;
        let odds = if self.straight { FLAT_ODDS_STRAIGHT } else { FLAT_ODDS };
        let flat = odds * density(self.rho.max(0.0), self.sigma + FLAT_SIGMA_PX);
        let spread = self.sigma.hypot(PRIOR_SIGMA * full_px);
        let round = density(self.rho - PRIOR_BULGE * full_px, spread);
        if round > 0.0 { round / (round + flat) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_that_is_surely_not_curved_does_not_bulge() {
        let edge = |rho, sigma, straight| Curvature { rho, sigma, straight }.bulge(100.0);
        assert!(edge(0.0, 2.0, true) < 0.01);
        assert!(edge(0.0, 2.0, false) < 0.05);
        // Where little is known, a straight line is still more likely an edge.
        let unsure = [true, false].map(|straight| edge(3.0, 20.0, straight));
        assert!(unsure[0] < 0.5 * unsure[1] && unsure[1] > 0.1, "{unsure:?}");
        assert!(edge(90.0, 20.0, true) > 0.5);
    }

    #[test]
    fn a_sure_curvature_outweighs_the_prior() {
        let bulge = |rho| Curvature { rho, sigma: 3.0, straight: false }.bulge(100.0);
        assert!((bulge(50.0) - 1.0).abs() < 0.01);
        assert!((bulge(75.0) - 1.5).abs() < 0.02);
        assert!(bulge(1000.0) < 3.01);
    }
}
