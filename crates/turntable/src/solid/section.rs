//! Convex sections of the visual hull: one horizontal plane cut by one
//! interval per direction.

use std::borrow::Borrow;
use std::f64::consts::{PI, TAU};

use nalgebra::{Point2, Vector2};

use super::outline::{Outline, union};

/// Which silhouette interval's end an edge lies on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct EdgeSource {
    /// Index of the direction; `None` for the frame that bounds everything.
    pub direction: Option<u16>,
    /// Whether the edge is the interval's upper end.
    pub high: bool,
}

/// A convex polygon, counter-clockwise, and where its edges come from.
#[derive(Clone, Debug)]
pub(super) struct Section {
    pub corners: Vec<Point2<f64>>,
    /// Edge `i` runs from corner `i` to the next.
    pub sources: Vec<EdgeSource>,
    /// Outward angle of each edge's normal, radians in [0, 2 pi).
    pub normals_rad: Vec<f64>,
    /// Per direction, the index of the interval in its row.
    pub intervals: Vec<u16>,
}

/// Sections smaller than this are noise, px^2.
const MIN_AREA_PX2: f64 = 0.5;
/// No row of a drawing has so many separate sections.
const MAX_SECTIONS: usize = 512;

impl Section {
    /// The square of half width `half_px` about the axis.
    fn frame(half_px: f64) -> Self {
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let none = EdgeSource { direction: None, high: false };
        Self {
            corners: corners.iter().map(|&(x, y)| Point2::new(x * half_px, y * half_px)).collect(),
            sources: vec![none; 4],
            normals_rad: vec![1.5 * PI, 0.0, 0.5 * PI, PI],
            intervals: Vec::new(),
        }
    }

    pub(super) fn len(&self) -> usize {
        self.corners.len()
    }

    pub(super) fn area_px2(&self) -> f64 {
        let n = self.len();
        let cross = |i: usize| self.corners[i].coords.perp(&self.corners[(i + 1) % n].coords);
        (0..n).map(cross).sum::<f64>() / 2.0
    }

    pub(super) fn centre(&self) -> Point2<f64> {
        let sum: Vector2<f64> = self.corners.iter().map(|corner| corner.coords).sum();
        Point2::from(sum / self.len().max(1) as f64)
    }

    /// The range of the section's projection on `axis`.
    pub(super) fn extent_along(&self, axis: &Vector2<f64>) -> (f64, f64) {
        self.corners
            .iter()
            .map(|corner| axis.dot(&corner.coords))
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
                (low.min(value), high.max(value))
            })
    }

    /// How far the outline turns at corner `i`, radians.
    pub(super) fn turning_rad(&self, i: usize) -> f64 {
        let before = (i + self.len() - 1) % self.len();
        (self.normals_rad[i] - self.normals_rad[before]).rem_euclid(TAU)
    }

    /// Keeps what lies at `normal . p <= offset`; the new edge has `source`.
    fn clip(&mut self, normal: Vector2<f64>, offset: f64, source: EdgeSource) {
        let signed: Vec<f64> =
            self.corners.iter().map(|corner| normal.dot(&corner.coords) - offset).collect();
        if signed.iter().all(|&s| s <= 1e-9) {
            return;
        }
        let n = self.len();
        let angle = normal.y.atan2(normal.x).rem_euclid(TAU);
        let mut kept = Self {
            corners: Vec::with_capacity(n + 1),
            sources: Vec::with_capacity(n + 1),
            normals_rad: Vec::with_capacity(n + 1),
            intervals: std::mem::take(&mut self.intervals),
        };
        for i in 0..n {
            let j = (i + 1) % n;
            let (from, to) = (signed[i], signed[j]);
            let crossing =
                || self.corners[i] + (self.corners[j] - self.corners[i]) * (from / (from - to));
            if from <= 0.0 {
                kept.push(self.corners[i], self.sources[i], self.normals_rad[i]);
                if to > 0.0 {
                    kept.push(crossing(), source, angle);
                }
            } else if to <= 0.0 {
                kept.push(crossing(), self.sources[i], self.normals_rad[i]);
            }
        }
        *self = kept;
    }

    fn push(&mut self, corner: Point2<f64>, source: EdgeSource, normal_rad: f64) {
        self.corners.push(corner);
        self.sources.push(source);
        self.normals_rad.push(normal_rad);
    }

    /// The section cut to one interval of `direction`; `None` if nothing is left.
    fn cut(
        &self,
        outline: &Outline,
        direction: u16,
        interval: u16,
    ) -> impl Fn((f64, f64)) -> Option<Self> {
        let right = outline.right();
        move |(low, high)| {
            let mut cut = self.clone();
            let source = |high| EdgeSource { direction: Some(direction), high };
            cut.clip(right, high, source(true));
            if cut.len() >= 3 {
                cut.clip(-right, -low, source(false));
            }
            cut.intervals.push(interval);
            (cut.len() >= 3).then_some(cut)
        }
    }

    /// The section cut to `range` of `direction`, px from the axis; `None` if
    /// nothing is left.
    pub(super) fn narrowed(
        &self,
        outline: &Outline,
        direction: usize,
        range: (f64, f64),
    ) -> Option<Self> {
        let mut cut = self.cut(outline, direction as u16, 0)(range)?;
        cut.intervals.pop();
        let cut = cut.without_short_edges(1e-6);
        (cut.area_px2() >= MIN_AREA_PX2).then_some(cut)
    }

    /// Drops edges shorter than `min_px`: they come from bounds that only
    /// touch a corner.
    fn without_short_edges(mut self, min_px: f64) -> Self {
        let mut i = 0;
        while i < self.len() && self.len() > 3 {
            let next = (i + 1) % self.len();
            if (self.corners[next] - self.corners[i]).norm() < min_px {
                self.corners.remove(next);
                // The edge that ended the short one now starts at its corner.
                self.sources.remove(i);
                self.normals_rad.remove(i);
                if next == 0 {
                    break;
                }
            } else {
                i += 1;
            }
        }
        self
    }
}

/// The sections of the visual hull at one row.
///
/// * `outlines`: one per direction, no two parallel.
/// * `row`: per direction, the row's intervals, px from the axis.
/// * `half_px`: nothing is farther from the axis than this.
///
/// Empty where a direction sees nothing.
pub(super) fn sections_of_row<O: Borrow<Outline>>(
    outlines: &[O],
    row: &[&[(f64, f64)]],
    half_px: f64,
) -> Vec<Section> {
    let mut sections = vec![Section::frame(half_px)];
    for (direction, (outline, intervals)) in outlines.iter().zip(row).enumerate() {
        let outline = outline.borrow();
        let mut next = Vec::with_capacity(sections.len());
        for section in &sections {
            let (low, high) = section.extent_along(&outline.right());
            for (index, &interval) in intervals.iter().enumerate() {
                if interval.1 > low && interval.0 < high {
                    // A row has fewer intervals than half its pixels, a sheet fewer views.
                    next.extend(section.cut(outline, direction as u16, index as u16)(interval));
                }
            }
        }
        next.truncate(MAX_SECTIONS);
        sections = next;
    }
    sections
        .into_iter()
        .map(|section| section.without_short_edges(1e-6))
        .filter(|section| section.area_px2() >= MIN_AREA_PX2)
        .collect()
}

/// What all sections cover along `axis`.
pub(super) fn covered(sections: &[Section], axis: &Vector2<f64>) -> Vec<(f64, f64)> {
    union(sections.iter().map(|section| section.extent_along(axis)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outlines(degrees: &[f64]) -> Vec<Outline> {
        let outline =
            |&degrees: &f64| Outline { azimuth_rad: degrees.to_radians(), rows: Vec::new() };
        degrees.iter().map(outline).collect()
    }

    #[test]
    fn two_views_leave_the_rectangle() {
        let row: [&[(f64, f64)]; 2] = [&[(-3.0, 5.0)], &[(-1.0, 2.0)]];
        let sections = sections_of_row(&outlines(&[0.0, 90.0]), &row, 100.0);
        assert_eq!(sections.len(), 1);
        assert!((sections[0].area_px2() - 24.0).abs() < 1e-9);
        assert!((0..4).all(|i| (sections[0].turning_rad(i) - PI / 2.0).abs() < 1e-9));
        assert!(sections[0].sources.iter().all(|source| source.direction.is_some()));
    }

    #[test]
    fn a_diagonal_view_cuts_ghosts() {
        // Two squares on the diagonal: front and side alone see four.
        let pair: &[(f64, f64)] = &[(-6.0, -4.0), (4.0, 6.0)];
        let row = [pair, pair];
        assert_eq!(sections_of_row(&outlines(&[0.0, 90.0]), &row, 100.0).len(), 4);
        let half = 2.0_f64.sqrt();
        let diagonal: &[(f64, f64)] = &[(-half, half)];
        let row = [pair, pair, diagonal];
        let sections = sections_of_row(&outlines(&[0.0, 90.0, 135.0]), &row, 100.0);
        assert_eq!(sections.len(), 2);
        assert!(sections.iter().all(|section| (section.area_px2() - 4.0).abs() < 1e-9));
    }

    #[test]
    fn an_empty_row_has_no_section() {
        let row: [&[(f64, f64)]; 2] = [&[(-3.0, 5.0)], &[]];
        assert!(sections_of_row(&outlines(&[0.0, 90.0]), &row, 100.0).is_empty());
    }
}
