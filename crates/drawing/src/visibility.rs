//! Hidden line removal.

use std::cell::Cell;

use nalgebra::{Point2, Point3};

use super::DrawError;
use super::bvh::{Bvh, TriangleTree, ViewBox};
use super::features::{Host, LineKind, Segment, ViewedModel};

/// A surface hides a line that lies at least this far behind it, pixels: more than rounding,
/// less than can be seen.
const DEPTH_TOLERANCE_PX: f64 = 0.02;

/// Triangles hide this far beyond their sides, pixels, so that no line shows through between two
/// that meet right in front of it, as rings of a level view do.
const OVERLAP_PX: f64 = 1e-4;

/// Pairs of lines and triangles that one view may compare: some seconds' work.
const MAX_VISITED: u64 = 1 << 28;

/// Finds what of the lines is seen.
///
/// Exact up to rounding: over every triangle in front of it, the part of a segment that the
/// triangle hides is an interval, found by clipping; the union of the intervals is hidden.
pub(super) struct Visibility<'a> {
    viewed: &'a ViewedModel<'a>,
    tree: Bvh<'a>,
    /// Triangles looked at so far.
    visited: Cell<u64>,
}

impl<'a> Visibility<'a> {
    pub(crate) fn new(viewed: &'a ViewedModel<'a>, tree: &'a TriangleTree) -> Self {
        let faces = 0..viewed.model.mesh.triangles.len();
        let boxes = faces.map(|face| ViewBox::of(&viewed.corners(face))).collect();
        Self { viewed, tree: tree.over(boxes), visited: Cell::new(0) }
    }

    /// # Errors
    /// [`DrawError::TooComplex`] once more was compared than a drawing needs.
    pub(crate) fn check_work(&self) -> Result<(), DrawError> {
        if self.visited.get() > MAX_VISITED {
            return Err(DrawError::TooComplex { limit: MAX_VISITED });
        }
        Ok(())
    }

    /// The visible parts of a segment as intervals of its parameter, ascending.
    pub(crate) fn visible_parts(&self, segment: &Segment) -> Vec<[f64; 2]> {
        let [p, q] = [segment.ends[0].1, segment.ends[1].1];
        let mut hidden: Vec<[f64; 2]> = Vec::new();
        let place = ViewBox::of(&[p, q]);
        let farthest = p.z.max(q.z);
        self.tree.visit(&place, farthest, |face| {
            self.visited.set(self.visited.get() + 1);
            if !self.hosts(segment.host, face) {
                hidden.extend(hidden_part(p, q, self.viewed.corners(face as usize)));
            }
            hidden.last().is_none_or(|&[from, to]| from > 0.0 || to < 1.0)
        });
        complement(hidden, (q - p).xy().norm())
    }

    fn hosts(&self, host: Host, face: u32) -> bool {
        let model = self.viewed.model;
        match host {
            Host::Edge(edge) => {
                let faces = model.faces_of(&model.edges[edge as usize]);
                faces.iter().any(|side| side.face == face)
            }
            Host::Face(own) => {
                let own = model.mesh.triangles[own as usize];
                let other = model.mesh.triangles[face as usize];
                own.iter().any(|vertex| other.contains(vertex))
            }
        }
    }

    /// Splits a visible part into silhouettes, the contours and borders with nothing beyond them,
    /// and the rest.
    pub(crate) fn resolved(
        &self,
        segment: &Segment,
        [from, to]: [f64; 2],
    ) -> Vec<([f64; 2], LineKind)> {
        const STEP_PX: f64 = 4.0;
        let outlines = matches!(segment.kind, LineKind::Contour | LineKind::Border);
        if !outlines || segment.outward.norm_squared() == 0.0 {
            return vec![([from, to], segment.kind)];
        }
        let [p, q] = [segment.ends[0].1, segment.ends[1].1];
        let length_px = (q - p).xy().norm() * (to - from);
        let steps = (length_px / STEP_PX).ceil().clamp(1.0, 4096.0) as usize;
        let at = |step: f64| from + (to - from) * step / steps as f64;
        let mut start = from;
        let mut kind = self.kind_at(segment, at(0.5));
        let mut resolved = Vec::new();
        for step in 1..steps {
            let next = self.kind_at(segment, at(step as f64 + 0.5));
            if next != kind {
                let around = [at(step as f64 - 0.5), at(step as f64 + 0.5)];
                let change = self.change(segment, around, kind);
                resolved.push(([start, change], kind));
                (start, kind) = (change, next);
            }
        }
        resolved.push(([start, to], kind));
        resolved
    }

    /// Where within an interval the kind stops being `kind`, by bisection.
    fn change(&self, segment: &Segment, [mut low, mut high]: [f64; 2], kind: LineKind) -> f64 {
        for _ in 0..8 {
            let middle = (low + high) / 2.0;
            if self.kind_at(segment, middle) == kind {
                low = middle;
            } else {
                high = middle;
            }
        }
        high
    }

    fn kind_at(&self, segment: &Segment, t: f64) -> LineKind {
        const BEYOND_PX: f64 = 0.5;
        let [p, q] = [segment.ends[0].1, segment.ends[1].1];
        let beyond = (p + (q - p) * t).xy() + segment.outward * BEYOND_PX;
        if self.covers(beyond) { segment.kind } else { LineKind::Silhouette }
    }

    /// Whether any triangle lies over a point of the picture.
    fn covers(&self, point: Point2<f64>) -> bool {
        let place = ViewBox::of(&[Point3::new(point.x, point.y, 0.0)]);
        let mut covered = false;
        self.tree.visit(&place, f64::INFINITY, |face| {
            self.visited.set(self.visited.get() + 1);
            covered = contains(self.viewed.corners(face as usize), point);
            !covered
        });
        covered
    }
}

fn contains([a, b, c]: [Point3<f64>; 3], point: Point2<f64>) -> bool {
    let side = |p: Point3<f64>, q: Point3<f64>| (q - p).xy().perp(&(point - p.xy()));
    let sides = [side(a, b), side(b, c), side(c, a)];
    sides.iter().all(|&s| s >= 0.0) || sides.iter().all(|&s| s <= 0.0)
}

/// The interval of the segment p-q that lies behind a triangle, or just beyond its sides.
fn hidden_part(p: Point3<f64>, q: Point3<f64>, [a, b, c]: [Point3<f64>; 3]) -> Option<[f64; 2]> {
    let area = (b - a).xy().perp(&(c - a).xy());
    let longest = [(b - a), (c - b), (a - c)]
        .iter()
        .fold(0.0_f64, |longest, side| longest.max(side.xy().norm_squared()));
    // Seen edge-on, a triangle hides nothing, and its depth has no slope.
    if area.abs() <= 1e-9 * longest {
        return None;
    }
    // A sliver's tip reaches far beyond its sides: the overlap shrinks with its height.
    let height_px = area.abs() / longest.sqrt();
    let overlap_px = OVERLAP_PX * height_px.min(1.0);
    let mut interval = [0.0, 1.0];
    for [from, to] in [[a, b], [b, c], [c, a]] {
        let along = (to - from).xy();
        let slack = overlap_px * along.norm();
        let side = |r: Point3<f64>| along.perp(&(r - from).xy()) * area.signum() + slack;
        clip(&mut interval, side(p), side(q))?;
    }
    let depth_behind = |r: Point3<f64>| {
        let v = (c - a).xy().perp(&(r - a).xy()) / -area;
        let w = (b - a).xy().perp(&(r - a).xy()) / area;
        r.z - (a.z + v * (b.z - a.z) + w * (c.z - a.z)) - DEPTH_TOLERANCE_PX
    };
    clip(&mut interval, depth_behind(p), depth_behind(q))?;
    Some(interval)
}

/// Keeps the part of the interval where a linear function, given at 0 and 1, is positive.
fn clip(interval: &mut [f64; 2], at_0: f64, at_1: f64) -> Option<()> {
    let crossing = at_0 / (at_0 - at_1);
    match (at_0 > 0.0, at_1 > 0.0) {
        (true, true) => {}
        (false, false) => return None,
        (true, false) => interval[1] = interval[1].min(crossing),
        (false, true) => interval[0] = interval[0].max(crossing),
    }
    (interval[0] < interval[1]).then_some(())
}

/// What the hidden intervals leave of [0, 1]. Neither gaps nor hidden intervals too short to see
/// count: rounding leaves both where triangles meet.
fn complement(mut hidden: Vec<[f64; 2]>, length_px: f64) -> Vec<[f64; 2]> {
    const SHORTEST_PX: f64 = 0.01;
    let shortest = SHORTEST_PX / length_px.max(SHORTEST_PX);
    hidden.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
    let mut merged: Vec<[f64; 2]> = Vec::new();
    for [from, to] in hidden {
        match merged.last_mut() {
            Some(last) if from - last[1] <= shortest => last[1] = last[1].max(to),
            _ => merged.push([from, to]),
        }
    }
    merged.retain(|[from, to]| to - from >= shortest);
    let mut visible = Vec::new();
    let mut reached = 0.0;
    for [from, to] in merged {
        if from - reached > shortest {
            visible.push([reached, from]);
        }
        reached = to;
    }
    if reached == 0.0 || 1.0 - reached > shortest {
        visible.push([reached, 1.0]);
    }
    visible
}
