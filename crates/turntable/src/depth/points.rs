//! What the lines of other views say about a view's surface.

use super::contours::{Contours, Crossing};
use super::fill::Hint;
use super::graph::{NONE, Owner, PixelGraph};
use super::line_of_sight::Sight;
use super::lines::{LineDepths, LineView, angle_between};
use super::predicted_lines::{crossing_at, predict};
use crate::depth_map::Confidence;

const POINT_WEIGHT: f32 = 0.5;
/// The weight of the hull where the surface presses against it, and where it
/// has come off it by less than a pixel: a bound does not hold what leaves it,
/// but lets go by degrees, so that the next solution does not swing back.
const HULL_WEIGHT: f32 = 5.0;
const HULL_PARTING_WEIGHT: f32 = 0.1;
/// Points farther than this behind the surface must contradict it to count, units.
const BEHIND: f32 = 15.0;
/// Steeper surfaces are left to the bulge, depth per column.
const MAX_KNOWN_SLOPE: f32 = 2.5;

/// The share of a contour's radius that a neighbouring view finds at least.
const ROUND_SHARE: f64 = 0.5;

/// Points of lines on the surface, each seen by the view it was drawn in.
pub(super) struct PointCloud {
    points: Vec<WorldPoint>,
}

struct WorldPoint {
    azimuth_rad: f64,
    y: u32,
    x_px: f64,
    depth_px: f64,
    /// Where the line is surely a smooth contour: the side its surface is on.
    smooth: Option<Owner>,
}

/// A point of another view's lines in a view's own frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Point {
    pub y: u32,
    pub x_px: f32,
    pub depth_px: f32,
    /// Depth per column of the surface here, where it is known.
    pub slope: Option<f32>,
    /// From this view to the one that drew the point.
    pub drawn_from_rad: f32,
}

impl PointCloud {
    pub(super) fn new(views: &[LineView<'_>], lines: &[LineDepths]) -> Self {
        const MAX_SLOPE: f64 = 4.0;
        const MAX_RUN_PX: u32 = 14;
        let all = lines;
        let of_view = |(view, lines): (&LineView<'_>, &LineDepths)| {
            let azimuth_rad = view.azimuth_rad;
            let usable = |(index, crossing): (usize, &Crossing)| {
                let clear = crossing.slope.abs() < MAX_SLOPE && crossing.run_px() < MAX_RUN_PX;
                let depth_px = lines.depth_px[index];
                (clear && !depth_px.is_nan()).then(|| WorldPoint {
                    azimuth_rad,
                    y: crossing.y,
                    x_px: crossing.x_px,
                    depth_px,
                    smooth: smooth_side(crossing, lines, index, view.bounds.unit_px)
                        .filter(|_| is_confirmed(views, all, view, (crossing, lines, index))),
                })
            };
            view.contours.crossings.iter().enumerate().filter_map(usable).collect::<Vec<_>>()
        };
        Self { points: views.iter().zip(lines).flat_map(of_view).collect() }
    }

    /// The points turned into the frame of the view at `azimuth_rad`, without its own.
    pub(super) fn seen_from(&self, azimuth_rad: f64) -> Vec<Point> {
        let turned = |point: &WorldPoint| {
            let (sine, cosine) = (azimuth_rad - point.azimuth_rad).sin_cos();
            // A contour's surface faces sideways: away from it on one side of its view.
            let faces_away = match point.smooth {
                Some(Owner::Right) => sine > 0.0,
                Some(Owner::Left) => sine < 0.0,
                None => false,
            };
            (!faces_away).then(|| Point {
                y: point.y,
                x_px: (point.x_px * cosine + point.depth_px * sine) as f32,
                depth_px: (point.depth_px * cosine - point.x_px * sine) as f32,
                slope: point
                    .smooth
                    .map(|_| (cosine / sine) as f32)
                    .filter(|slope| slope.abs() < MAX_KNOWN_SLOPE),
                drawn_from_rad: angle_between(azimuth_rad, point.azimuth_rad) as f32,
            })
        };
        let others = self.points.iter().filter(|point| point.azimuth_rad != azimuth_rad);
        others.filter_map(turned).collect()
    }
}

/// The side of the surface that a line surely curves over to.
fn smooth_side(
    crossing: &Crossing,
    lines: &LineDepths,
    index: usize,
    unit_px: f64,
) -> Option<Owner> {
    let (rho, sigma) = (lines.rho_px[index], lines.rho_sigma_px[index]);
    let owner = if rho < 0.0 { Owner::Right } else { Owner::Left };
    let sure = lines.rho_is_tracked[index] && rho.abs() > (3.0 * sigma).max(8.0 * unit_px);
    let fits = match owner {
        Owner::Left => !crossing.outside_left,
        Owner::Right => !crossing.outside_right,
    };
    (sure && fits).then_some(owner)
}

/// Whether a neighbouring view finds the contour round too, or has no line
/// where its curvature takes it: what is round in one view only is lines taken
/// for one another.
fn is_confirmed(
    views: &[LineView<'_>],
    lines: &[LineDepths],
    view: &LineView<'_>,
    (crossing, own, index): (&Crossing, &LineDepths, usize),
) -> bool {
    let rho_px = own.rho_px[index];
    [view.before, view.after].into_iter().flatten().any(|other| {
        let angle = angle_between(view.azimuth_rad, views[other].azimuth_rad);
        let (column, _) = predict(own, index, crossing.x_px, angle);
        let found = crossing_at(views[other].contours, crossing.y, column);
        let as_round = |at: usize| {
            lines[other].rho_is_tracked[at] && lines[other].rho_px[at] / rho_px > ROUND_SHARE
        };
        found.is_none_or(as_round)
    })
}

/// Whether a point is of a line that the view draws itself: beside the line,
/// it may have come to lie on the wrong side of the cut along it.
fn is_own_line(point: &Point, (contours, lines): (&Contours, &LineDepths), unit_px: f32) -> bool {
    contours.in_row(point.y).any(|index| {
        let crossing = &contours.crossings[index];
        let beside = (crossing.x_px as f32 - point.x_px).abs();
        let apart = (lines.depth_px[index] as f32 - point.depth_px).abs();
        beside < 2.5 + 0.5 * crossing.slope.abs() as f32 && apart < 25.0 * unit_px
    })
}

/// * `behind_px`: how far the surface is behind the hull's near side.
fn hull_weight(behind_px: f32) -> f32 {
    if behind_px <= 0.0 {
        HULL_WEIGHT
    } else if behind_px < 1.0 {
        HULL_PARTING_WEIGHT
    } else {
        0.0
    }
}

/// Turns points and the hull's bound into hints for the next solution.
pub(super) struct Refinement<'a> {
    graph: &'a PixelGraph,
    near_px: &'a [f32],
    /// The points that may lie on the view's surface, and their nodes.
    points: Vec<(usize, Point)>,
    sight: Sight<'a>,
    unit_px: f32,
}

impl<'a> Refinement<'a> {
    pub(super) fn new(
        graph: &'a PixelGraph,
        near_px: &'a [f32],
        points: Vec<Point>,
        own: (&Contours, &LineDepths),
        unit_px: f32,
    ) -> Self {
        let axis = graph.width as f32 / 2.0;
        let on_graph = |point: Point| {
            if is_own_line(&point, own, unit_px) {
                return None;
            }
            let column = (point.x_px + axis).floor();
            let inside = column >= 0.0 && column < graph.width as f32;
            let pixel = point.y as usize * graph.width + column as usize;
            let node = if inside { graph.node_of[pixel] } else { NONE };
            let possible = node != NONE && point.depth_px > near_px[node as usize] - 8.0 * unit_px;
            possible.then_some((node as usize, point))
        };
        let points = points.into_iter().filter_map(on_graph).collect();
        let sight = Sight::new(graph, own.0, unit_px);
        Self { graph, near_px, points, sight, unit_px }
    }

    /// Points not hidden by the surface, and the hull where the surface is before it.
    ///
    /// * `depth_px`: the surface so far, not before the hull.
    pub(super) fn hints(&self, depth_px: &[f32]) -> Vec<Hint> {
        let (nearest, slopes) = self.nearest_points(depth_px);
        let mut hints = vec![Hint::default(); depth_px.len()];
        for (node, hint) in hints.iter_mut().enumerate() {
            let (mut weight, mut sum) = (0.0, 0.0);
            if self.is_unhidden(node, &nearest) {
                hint.slope = slopes[node];
                weight += POINT_WEIGHT;
                sum += POINT_WEIGHT * nearest[node];
            }
            let near = self.near_px[node];
            let hull_weight = hull_weight(depth_px[node] - near);
            weight += hull_weight;
            sum += if hull_weight > 0.0 { hull_weight * near } else { 0.0 };
            if weight > 0.0 {
                (hint.weight, hint.depth_px) = (weight, sum / weight);
            }
        }
        hints
    }

    /// Per node depth and slope of the nearest point that the surface does not
    /// hide; NaN where there is none.
    fn nearest_points(&self, depth_px: &[f32]) -> (Vec<f32>, Vec<Option<f32>>) {
        let mut nearest = vec![f32::NAN; depth_px.len()];
        let mut slopes = vec![None; depth_px.len()];
        let is_seen = |node: usize, point: &Point| {
            let depth = point.depth_px;
            depth < depth_px[node] + BEHIND * self.unit_px
                || self.sight.contradicts(depth_px, node, depth, point.drawn_from_rad)
        };
        for (node, point) in &self.points {
            let hidden = point.depth_px >= nearest[*node];
            if !hidden && is_seen(*node, point) {
                nearest[*node] = point.depth_px;
                slopes[*node] = point.slope;
            }
        }
        (nearest, slopes)
    }

    /// Whether no point around a node's is clearly nearer.
    fn is_unhidden(&self, node: usize, nearest: &[f32]) -> bool {
        const REACH: (isize, u32) = (4, 2);
        if nearest[node].is_nan() {
            return false;
        }
        let limit = nearest[node] - 25.0 * self.unit_px;
        let (x, y) = self.graph.positions[node];
        let rows = y.saturating_sub(REACH.1)..=y.saturating_add(REACH.1);
        rows.into_iter().all(|row| {
            (-REACH.0..=REACH.0).all(|dx| {
                let beside = self.graph.node_beside(row, x as usize, dx);
                !beside.is_some_and(|node| nearest[node] <= limit)
            })
        })
    }

    /// What each node's final depth rests on.
    pub(super) fn confidence(
        &self,
        depth_px: &[f32],
        line_weights: impl Iterator<Item = f32>,
    ) -> Vec<Confidence> {
        const REACH_PX: isize = 3;
        let (nearest, _) = self.nearest_points(depth_px);
        let known: Vec<bool> = line_weights
            .enumerate()
            .map(|(node, weight)| weight > 0.0 || self.is_unhidden(node, &nearest))
            .collect();
        (0..depth_px.len())
            .map(|node| {
                let (x, y) = self.graph.positions[node];
                let at_line = (-REACH_PX..=REACH_PX).any(|step| {
                    let beside = self.graph.node_beside(y, x as usize, step);
                    beside.is_some_and(|node| known[node])
                });
                if at_line {
                    Confidence::Lines
                } else if depth_px[node] < self.near_px[node] + 1.0 {
                    Confidence::Hull
                } else {
                    Confidence::Guessed
                }
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::depth::triples::Bounds;

    /// One line in one row, at the column where the contour of a cylinder on
    /// the axis is, or elsewhere.
    fn contours(x_px: f64) -> Contours {
        let crossing = Crossing {
            y: 0,
            start: 0,
            end: 2,
            x_px,
            slope: 0.0,
            outside_left: false,
            outside_right: true,
        };
        Contours {
            crossings: vec![crossing],
            row_starts: vec![0, 1],
            chains: Vec::new(),
            chain_of: vec![None],
        }
    }

    /// Whether a contour of radius 50 is confirmed by a view 5 degrees on with
    /// a line at `x_px` of radius `rho_px`, tracked or not.
    fn confirmed_by(x_px: f64, rho_px: f64, tracked: bool) -> bool {
        let contours = [contours(50.0), contours(x_px)];
        let line = |rho_px, tracked| LineDepths {
            depth_px: vec![0.0],
            rho_px: vec![rho_px],
            rho_sigma_px: vec![3.0],
            rho_is_tracked: vec![tracked],
        };
        let lines = [line(50.0, true), line(rho_px, tracked)];
        let view = |index: usize| LineView {
            azimuth_rad: 5.0_f64.to_radians() * index as f64,
            contours: &contours[index],
            bounds: Bounds { radius_px: 50.0, unit_px: 1.0, hull_px: &[] },
            before: None,
            after: (index == 0).then_some(1),
        };
        let views = [view(0), view(1)];
        is_confirmed(&views, &lines, &views[0], (&contours[0].crossings[0], &lines[0], 0))
    }

    #[test]
    fn a_contour_that_is_round_in_one_view_only_is_not_believed() {
        assert!(confirmed_by(50.0, 48.0, true));
        assert!(!confirmed_by(50.0, 5.0, true) && !confirmed_by(50.0, 48.0, false));
        // Hidden in the other view: nothing tells against it.
        assert!(confirmed_by(20.0, 5.0, true));
    }

    #[test]
    fn the_hull_holds_what_presses_against_it_and_lets_go_of_what_leaves() {
        assert_eq!([-3.0, 0.0].map(hull_weight), [HULL_WEIGHT; 2]);
        assert!(hull_weight(0.5) < 0.1 * HULL_WEIGHT && hull_weight(2.0) == 0.0);
    }
}
