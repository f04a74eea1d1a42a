//! What other views say about a region that may be a hole.

use std::collections::BTreeSet;
use std::f64::consts::PI;

use super::regions::{Region, columns_of};
use crate::raster::stroke_scale;
use crate::solid::outline::{Outline, difference, intersection, length, union};
use crate::solid::rounding::rounded;
use crate::solid::section::{Section, covered, sections_of_row};
use crate::solid::solid_views::SolidSheet;
use crate::solid::symmetry::MirrorPlane;

/// How alike a region and the opposite view's must be.
const MIN_OPPOSITE_IOU: f64 = 0.9;
/// How alike a region must be to where one would see through a hole of another view.
const MIN_THROUGH_IOU: f64 = 0.75;
/// Regions keep so far away from ink, and the subject ends in the middle of the line, px.
const LINE_MARGIN_PX: f64 = 3.0;
/// Every so many rows of small drawings are tested.
const ROW_STEP: f64 = 2.0;

type Intervals = Vec<(f64, f64)>;

/// All regions of a sheet, to be told holes from surfaces.
pub(super) struct Evidence<'a> {
    pub sheet: &'a SolidSheet,
    pub regions: &'a [Region],
    /// Views from the two sides of the subject's mirror plane are alike
    /// whatever they show and confirm nothing.
    pub plane: Option<&'a MirrorPlane>,
}

/// What would have nothing behind it.
pub(super) struct Uncovered {
    /// The share of the other silhouettes.
    pub share: f64,
    /// The share of rows that lose what a line is drawn on.
    pub inked_share: f64,
}

impl Evidence<'_> {
    /// Whether `required` other views show that `region` is a hole; `otherwise`
    /// if none could.
    ///
    /// The opposite view must show the mirrored region. Without one, views from
    /// the side may show a region where one would see through the hole.
    pub(super) fn confirms(&self, region: &Region, required: usize, otherwise: bool) -> bool {
        match self.opposite_region(region) {
            Some(false) => false,
            Some(true) => required <= 1 || self.is_seen_through(region, required - 1),
            None => otherwise || self.is_seen_through(region, required),
        }
    }

    /// Whether the opposite view, if there is one that can tell, shows the
    /// mirrored region.
    fn opposite_region(&self, region: &Region) -> Option<bool> {
        let own_rad = self.sheet.views[region.view].outline.azimuth_rad;
        let across = opposite(self.sheet, region.view)?;
        let mirrored_rad = self.plane.map(|plane| plane.azimuth_rad(own_rad));
        if mirrored_rad.is_some_and(|mirrored_rad| (mirrored_rad - own_rad).cos() < -0.999) {
            return None;
        }
        let width = self.sheet.width;
        let mut others = self.regions.iter().filter(|other| other.view == across);
        Some(others.any(|other| mirrored_iou(region, other, width) > MIN_OPPOSITE_IOU))
    }

    /// Whether one sees through the hole in `required` views from the side.
    fn is_seen_through(&self, region: &Region, required: usize) -> bool {
        let own = &self.sheet.views[region.view].outline;
        let candidates = self.regions.iter().filter(|other| {
            let outline = &self.sheet.views[other.view].outline;
            !outline.is_parallel_to(own) && share_rows(region, other)
        });
        let mut views = BTreeSet::new();
        for other in candidates {
            if !views.contains(&other.view)
                && (self.through_iou(region, other) > MIN_THROUGH_IOU
                    || self.through_iou(other, region) > MIN_THROUGH_IOU)
            {
                views.insert(other.view);
            }
            if views.len() >= required {
                return true;
            }
        }
        false
    }

    /// How alike `seen` is to where its view would see through the subject if
    /// `carved` was a hole: the better of a subject with sharp corners and a
    /// round one.
    fn through_iou(&self, carved: &Region, seen: &Region) -> f64 {
        let bounds = self.bounds(carved.view);
        let axis = self.sheet.views[seen.view].outline.right();
        let rows = self.tested_rows(&[carved, seen]);
        let (mut shared, mut either) = ([0.0; 2], [0.0; 2]);
        for y in rows {
            let (before, after) = self.sections(&bounds, carved, y);
            let region = union(columns_of(seen, y, LINE_MARGIN_PX, self.sheet.axis_px));
            for (form, round) in [false, true].into_iter().enumerate() {
                let cover = |sections: &[Section]| cover(sections, &axis, round);
                let through = difference(&cover(&before), &cover(&after));
                let both = length(&intersection(&through, &region));
                shared[form] += both;
                either[form] += length(&through) + length(&region) - both;
            }
        }
        let iou = |form: usize| if either[form] > 0.0 { shared[form] / either[form] } else { 0.0 };
        iou(0).max(iou(1))
    }

    /// What the other views show in the region's rows that nothing would stand
    /// behind once the region is carved.
    pub(super) fn uncovered(&self, region: &Region) -> Uncovered {
        let bounds = self.bounds(region.view);
        let rows = self.tested_rows(&[region]);
        let (mut lost, mut total) = (0.0, 0.0);
        let (mut inked, mut compared) = (0, 0);
        for y in rows {
            let (before, after) = self.sections(&bounds, region, y);
            for &view in &bounds[1..] {
                let axis = self.sheet.views[view].outline.right();
                // Another candidate's region may be open too.
                let candidates = self.regions.iter().filter(|other| other.view == view);
                let open: Intervals = candidates
                    .flat_map(|other| columns_of(other, y, LINE_MARGIN_PX, self.sheet.axis_px))
                    .collect();
                let covered = difference(&cover(&before, &axis, false), &union(open));
                let bare = difference(&covered, &cover(&after, &axis, false));
                total += length(&covered);
                lost += length(&bare);
                compared += 1;
                inked += usize::from(bare.iter().any(|&range| self.has_ink(view, y, range)));
            }
        }
        if total > 0.0 {
            Uncovered { share: lost / total, inked_share: inked as f64 / f64::from(compared) }
        } else {
            Uncovered { share: 1.0, inked_share: 1.0 }
        }
    }

    /// How long the passage through the other views' hull is, over the smaller
    /// of its width and height.
    pub(super) fn length_over_width(&self, region: &Region) -> f64 {
        let bounds = self.bounds(region.view);
        let outlines: Vec<&Outline> =
            bounds.iter().map(|&view| &self.sheet.views[view].outline).collect();
        let toward = outlines[0].toward_camera();
        let (mut lengths, mut count) = (0.0, 0);
        for y in self.tested_rows(&[region]) {
            let open = union(columns_of(region, y, 0.0, self.sheet.axis_px));
            let mut rows: Vec<&[(f64, f64)]> =
                outlines.iter().map(|outline| outline.row(y)).collect();
            rows[0] = &open;
            let passage = sections_of_row(&outlines, &rows, self.sheet.width as f64);
            lengths += length(&covered(&passage, &toward));
            count += 1;
        }
        let columns = region.runs.iter().map(|run| (run.1, run.2));
        let (left, right) = columns.fold((usize::MAX, 0), |(l, r), (a, b)| (l.min(a), r.max(b)));
        let height = region.runs[region.runs.len() - 1].0 + 1 - region.runs[0].0;
        let width = right.saturating_sub(left).min(height).max(1);
        lengths / f64::from(count.max(1)) / width as f64
    }

    /// Whether a line crosses row `y` well within a range of columns.
    fn has_ink(&self, view: usize, y: usize, (low, high): (f64, f64)) -> bool {
        let column = |px: f64| (px + self.sheet.axis_px).max(0.0) as usize;
        let (from, to) = (column(low + LINE_MARGIN_PX), column(high - LINE_MARGIN_PX));
        let row = &self.sheet.ink[self.sheet.views[view].drawing][y * self.sheet.width..];
        from < to && row[from..to.min(self.sheet.width).max(from)].contains(&true)
    }

    /// As many rows of large drawings as of small ones: each costs a section
    /// through all views.
    fn tested_rows(&self, regions: &[&Region]) -> BTreeSet<usize> {
        let step = (ROW_STEP * stroke_scale(self.sheet.height)).round() as usize;
        let rows = regions.iter().flat_map(|region| region.runs.iter().map(|run| run.0));
        rows.filter(|row| row % step == 0).collect()
    }

    /// One view a direction, `first` before all.
    fn bounds(&self, first: usize) -> Vec<usize> {
        let outline = |view: usize| &self.sheet.views[view].outline;
        let mut bounds = vec![first];
        for view in 0..self.sheet.views.len() {
            if !bounds.iter().any(|&bound| outline(bound).is_parallel_to(outline(view))) {
                bounds.push(view);
            }
        }
        bounds
    }

    /// The sections of row `y` as they are, and without `carved`, a region of
    /// the first of `bounds`.
    fn sections(
        &self,
        bounds: &[usize],
        carved: &Region,
        y: usize,
    ) -> (Vec<Section>, Vec<Section>) {
        let outlines: Vec<&Outline> =
            bounds.iter().map(|&view| &self.sheet.views[view].outline).collect();
        let mut rows: Vec<&[(f64, f64)]> = outlines.iter().map(|outline| outline.row(y)).collect();
        let half_px = self.sheet.width as f64;
        let before = sections_of_row(&outlines, &rows, half_px);
        let open = union(columns_of(carved, y, LINE_MARGIN_PX, self.sheet.axis_px));
        let left = difference(rows[0], &open);
        rows[0] = &left;
        (before, sections_of_row(&outlines, &rows, half_px))
    }
}

/// What sections cover along `axis`, as they are or rounded.
fn cover(sections: &[Section], axis: &nalgebra::Vector2<f64>, round: bool) -> Intervals {
    if !round {
        return covered(sections, axis);
    }
    let extent = |section: &Section| {
        let outline = rounded(section, &vec![false; section.len()]);
        let columns = outline.iter().map(|point| axis.dot(&point.coords));
        columns.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), u| (l.min(u), h.max(u)))
    };
    union(sections.iter().map(extent).collect())
}

/// The drawn view at the opposite azimuth.
pub(super) fn opposite(sheet: &SolidSheet, view: usize) -> Option<usize> {
    let azimuth = |view: usize| sheet.views[view].outline.azimuth_rad;
    (0..sheet.views.len()).find(|&other| (azimuth(other) - azimuth(view) - PI).cos() > 1.0 - 1e-6)
}

/// Whether half of the rows of the lower region are rows of the other.
fn share_rows(a: &Region, b: &Region) -> bool {
    let range = |region: &Region| (region.runs[0].0, region.runs[region.runs.len() - 1].0 + 1);
    let ((a0, a1), (b0, b1)) = (range(a), range(b));
    a1.min(b1).saturating_sub(a0.max(b0)) * 2 >= (a1 - a0).min(b1 - b0)
}

fn mirrored_iou(a: &Region, b: &Region, width: usize) -> f64 {
    let mirrored = b.runs.iter().map(|&(y, from, to)| (y, width - to, width - from));
    let mut shared = 0;
    for (y, from, to) in mirrored {
        for run in a.runs.iter().filter(|run| run.0 == y) {
            shared += to.min(run.2).saturating_sub(from.max(run.1));
        }
    }
    shared as f64 / (a.area + b.area - shared) as f64
}
