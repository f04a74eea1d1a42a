//! The depth of each view from its lines, and whether they tell enough.

use image::{GrayImage, ImageBuffer, Luma};
use rayon::prelude::*;

use super::contours::Contours;
use super::fill::{Accuracy, Fill};
use super::graph::{Owner, PixelGraph};
use super::hull::{HullDepth, Hulls};
use super::lines::{LineDepths, LineView, angle_between, line_depths};
use super::owners::owners;
use super::points::{PointCloud, Refinement};
use super::steps::steps;
use super::triples::Bounds;
use crate::depth_map::{Confidence, DepthMap};
use crate::ink::InkMap;
pub use crate::options::DepthOptions;
use crate::silhouette::{Silhouette, Silhouettes};
use crate::views::ViewSet;
use frames::Azimuth;
use progress::{Cancelled, Observer, Stage, Steps};

/// Why a view's depth does not rest on its lines.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[serde(tag = "reason", rename_all = "snake_case")]
pub enum Fallback {
    /// Fewer than three views within reach of each other.
    NoNeighbours {
        /// The angle to the nearest other view, degrees.
        nearest_deg: f64,
    },
    /// Views are near, but hardly a line could be matched between them.
    TooFewLines {
        /// Crossings of the view's lines with rows whose depth is known.
        matched: usize,
        /// The fewest that are relied on.
        required: usize,
    },
}

/// What the lines of one view tell.
#[derive(Clone, Debug)]
pub struct LineEstimate {
    /// The view's azimuth.
    pub azimuth: Azimuth,
    /// The share of the crossings of lines with rows whose depth is known.
    pub matched_share: f64,
    /// The depth map, or why lines give none.
    pub map: Result<DepthMap, Fallback>,
}

/// What a view's depth was read from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum DepthSource {
    /// The view's own lines.
    Lines,
    /// The solid's surface.
    Solid,
}

/// The depth of one view.
#[derive(Clone, Debug)]
pub struct ViewDepth {
    /// The view's azimuth.
    pub azimuth: Azimuth,
    /// Depth of each pixel, px.
    pub map: DepthMap,
    /// The share of the crossings of lines with rows whose depth is known.
    pub matched_share: f64,
    /// What the map was read from.
    pub source: DepthSource,
    /// Why the view's own lines tell nothing.
    pub fallback: Option<Fallback>,
}

impl LineEstimate {
    /// The depth by lines alone, where they give one.
    pub(super) fn alone(self) -> Option<ViewDepth> {
        Some(ViewDepth {
            azimuth: self.azimuth,
            map: self.map.ok()?,
            matched_share: self.matched_share,
            source: DepthSource::Lines,
            fallback: None,
        })
    }
}

/// Lines, matching, surfaces.
const STEPS: usize = 3;

/// Why no depth maps were made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DepthError {
    /// There is not one silhouette for each view.
    #[error("{silhouettes} silhouettes were given for {views} views")]
    SilhouettesDiffer {
        /// How many silhouettes were given.
        silhouettes: usize,
        /// How many views there are.
        views: usize,
    },
    /// Somebody asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Estimates the depth of every view from its lines.
///
/// * `silhouettes`: of `views`, in their order.
/// * `observer`: told each step as it ends.
///
/// Views without lines matched to neighbours within `options.max_neighbour_deg`
/// get none, and say why.
///
/// Takes about 20 bytes per pixel and view, and 40 more where it is being solved.
///
/// # Errors
/// [`DepthError`] if the silhouettes are not those of the views, or when cancelled.
pub fn estimate(
    views: &ViewSet,
    silhouettes: &Silhouettes,
    options: &DepthOptions,
    observer: &dyn Observer,
) -> Result<Vec<LineEstimate>, DepthError> {
    let steps = Steps::new(observer, Stage::Depth, STEPS);
    let silhouettes = &silhouettes.silhouettes;
    if silhouettes.len() != views.views().len() {
        return Err(DepthError::SilhouettesDiffer {
            silhouettes: silhouettes.len(),
            views: views.views().len(),
        });
    }
    steps.done(0, "")?;
    let subject = Subject::new(views, silhouettes);
    let drawings = drawings(views, silhouettes, &subject);
    steps.done(1, "lines")?;
    let line_views = line_views(views, &drawings, &subject, options);
    let lines = line_depths(&line_views);
    steps.done(2, "matching")?;
    let cloud = PointCloud::new(&line_views, &lines);
    let estimates = (0..drawings.len())
        .into_par_iter()
        .map(|index| {
            let has_neighbours =
                line_views[index].before.is_some() || line_views[index].after.is_some();
            let surface = Surface {
                drawing: &drawings[index],
                lines: &lines[index],
                silhouette: &silhouettes[index],
                subject: &subject,
                refinements: options.refinements,
            };
            let fallback = fallback(&line_views, index, &lines[index], has_neighbours);
            LineEstimate {
                azimuth: views.views()[index].azimuth,
                matched_share: lines[index].matched_share(),
                map: match fallback {
                    None => Ok(surface.of_lines(&cloud, line_views[index].azimuth_rad)),
                    Some(fallback) => Err(fallback),
                },
            }
        })
        .collect();
    steps.done(STEPS, "surfaces")?;
    Ok(estimates)
}

/// The subject's size, which thresholds on depth scale with.
pub(super) struct Subject {
    radius_px: f64,
    unit_px: f64,
}

impl Subject {
    pub(super) fn new(views: &ViewSet, silhouettes: &[Silhouette]) -> Self {
        /// Half the diagonal of a subject that fills a drawing 540 px high.
        const REFERENCE_PX: f64 = 300.0;
        let (mut radius, mut rows) = (1.0_f64, 1.0_f64);
        for silhouette in silhouettes {
            let mut tall = 0;
            for y in 0..views.height() as usize {
                let runs = silhouette.intervals_px(y);
                tall += usize::from(!runs.is_empty());
                for &(left, right) in runs {
                    radius = radius.max(views.axis_px() - left).max(right - views.axis_px());
                }
            }
            rows = rows.max(tall as f64);
        }
        Self { radius_px: radius, unit_px: radius.hypot(rows / 2.0) / REFERENCE_PX }
    }

    /// Depths are within ± this.
    pub(super) fn reach_px(&self) -> f32 {
        (1.35 * self.radius_px + 20.0 * self.unit_px) as f32
    }
}

/// A view's lines, and the hull along its lines of sight.
struct Drawing {
    contours: Contours,
    hull: HullDepth,
    /// Per crossing the hull's nearest and farthest depth.
    hull_at_lines: Vec<(f64, f64)>,
}

fn drawings(views: &ViewSet, silhouettes: &[Silhouette], subject: &Subject) -> Vec<Drawing> {
    let hulls = Hulls::new(views, silhouettes, subject.reach_px());
    (0..views.views().len())
        .into_par_iter()
        .map(|index| {
            let hull = hulls.of_view(index);
            let ink = InkMap::from_image(&views.views()[index].image);
            let contours = Contours::new(&ink, &silhouettes[index]);
            let hull_at_lines = hull_at_lines(&contours, &hull, ink.width());
            Drawing { contours, hull, hull_at_lines }
        })
        .collect()
}

/// The hull's interval over the pixels at each crossing.
fn hull_at_lines(contours: &Contours, hull: &HullDepth, width: usize) -> Vec<(f64, f64)> {
    let interval = |crossing: &super::contours::Crossing| {
        let column = crossing.column(width);
        let row = crossing.y as usize * width;
        let pixels = row + column.saturating_sub(2)..row + (column + 3).min(width);
        let near = hull.near_px[pixels.clone()].iter().copied().fold(f32::NAN, f32::min);
        let far = hull.far_px[pixels].iter().copied().fold(f32::NAN, f32::max);
        (f64::from(near), f64::from(far))
    };
    contours.crossings.iter().map(interval).collect()
}

fn line_views<'a>(
    views: &ViewSet,
    drawings: &'a [Drawing],
    subject: &Subject,
    options: &DepthOptions,
) -> Vec<LineView<'a>> {
    let azimuths: Vec<Azimuth> = views.azimuths().collect();
    let neighbour = |index: usize, forward: bool| {
        let ahead = |other: usize| {
            let (from, to) = if forward { (index, other) } else { (other, index) };
            azimuths[from].degrees_to(azimuths[to])
        };
        let misfit = |other: usize| (ahead(other) / options.preferred_neighbour_deg).ln().abs();
        (0..azimuths.len())
            .filter(|&other| other != index && ahead(other) <= options.max_neighbour_deg)
            .min_by(|&a, &b| misfit(a).total_cmp(&misfit(b)))
    };
    drawings
        .iter()
        .enumerate()
        .map(|(index, drawing)| LineView {
            azimuth_rad: azimuths[index].radians(),
            contours: &drawing.contours,
            bounds: Bounds {
                radius_px: subject.radius_px,
                unit_px: subject.unit_px,
                hull_px: &drawing.hull_at_lines,
            },
            before: neighbour(index, false),
            after: neighbour(index, true),
        })
        .collect()
}

fn fallback(
    views: &[LineView<'_>],
    index: usize,
    lines: &LineDepths,
    has_neighbours: bool,
) -> Option<Fallback> {
    const MIN_CROSSINGS: usize = 20;
    let matched = lines.depth_px.iter().filter(|depth| !depth.is_nan()).count();
    if matched >= MIN_CROSSINGS {
        return None;
    }
    if has_neighbours && views.len() > 2 {
        return Some(Fallback::TooFewLines { matched, required: MIN_CROSSINGS });
    }
    let angle = |other: &LineView<'_>| {
        angle_between(views[index].azimuth_rad, other.azimuth_rad).to_degrees().abs()
    };
    let others = views.iter().enumerate().filter(|(other, _)| *other != index);
    let nearest_deg = others.map(|(_, other)| angle(other)).fold(f64::INFINITY, f64::min);
    Some(Fallback::NoNeighbours { nearest_deg })
}

/// What one view's surface is solved from.
struct Surface<'a> {
    drawing: &'a Drawing,
    lines: &'a LineDepths,
    silhouette: &'a Silhouette,
    subject: &'a Subject,
    refinements: u32,
}

impl Surface<'_> {
    fn of_lines(&self, cloud: &PointCloud, azimuth_rad: f64) -> DepthMap {
        let contours = &self.drawing.contours;
        let mut graph = PixelGraph::new(self.silhouette.mask(), contours);
        let (owners, blocks) = owners(&graph, contours, self.lines, self.subject.unit_px);
        graph.steps = steps(&graph, &blocks, self.subject.unit_px);
        let (depth, confidence) = self.filled(&graph, &owners, cloud.seen_from(azimuth_rad));
        self.on_pixels(depth, confidence)
    }

    fn filled(
        &self,
        graph: &PixelGraph,
        owners: &[Option<Owner>],
        points: Vec<super::points::Point>,
    ) -> (Vec<f32>, Vec<Confidence>) {
        let mut fill = Fill::new(graph, &self.drawing.contours, self.lines, owners);
        let accuracy = |left| if left == 0 { Accuracy::Final } else { Accuracy::Rough };
        let mut depth = fill.solve(&[], accuracy(self.refinements));
        let near: Vec<f32> =
            (0..graph.nodes()).map(|node| self.drawing.hull.near_px[graph.pixel(node)]).collect();
        let refinement = Refinement::new(
            graph,
            &near,
            points,
            (&self.drawing.contours, self.lines),
            self.subject.unit_px as f32,
        );
        for left in (0..self.refinements).rev() {
            depth = fill.solve(&refinement.hints(&depth), accuracy(left));
            for (depth, near) in depth.iter_mut().zip(&near) {
                *depth = depth.max(*near);
            }
        }
        let confidence = refinement.confidence(&depth, fill.line_weights());
        (depth, confidence)
    }

    fn on_pixels(&self, depth: Vec<f32>, confidence: Vec<Confidence>) -> DepthMap {
        let mask = self.silhouette.mask();
        let (width, height) = mask.dimensions();
        let mut depth_px = ImageBuffer::from_pixel(width, height, Luma([f32::NAN]));
        let mut levels = GrayImage::new(width, height);
        let inside = mask.as_raw().iter().enumerate().filter(|(_, level)| **level != 0);
        for ((pixel, _), (depth, confidence)) in inside.zip(depth.into_iter().zip(confidence)) {
            depth_px.as_mut()[pixel] = depth;
            levels.as_mut()[pixel] = confidence as u8;
        }
        DepthMap { depth_px, confidence: levels }
    }
}
