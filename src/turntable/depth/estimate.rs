use std::ops::ControlFlow;

use image::{GrayImage, ImageBuffer, Luma};
use rayon::prelude::*;

use super::super::ink::InkMap;
use super::super::silhouette::{Silhouette, Silhouettes};
use super::super::views::ViewSet;
use super::contours::Contours;
use super::fill::{Accuracy, Fill};
use super::graph::{Owner, PixelGraph};
use super::hull::{GrownRows, HullDepth, hull_depth};
use super::lines::{LineDepths, LineView, angle_between, line_depths};
use super::owners::{outline_owners, owners};
use super::points::{PointCloud, Refinement};
use super::steps::steps;
use super::triples::Bounds;
pub use crate::options::DepthOptions;
use crate::sheet::Azimuth;

/// What a pixel's depth rests on, as stored in [`ViewDepth::confidence`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Confidence {
    /// No surface here.
    Outside = 0,
    /// Carried on from lines farther off.
    Guessed = 1,
    /// At the visual hull's bound.
    Hull = 2,
    /// At a line that several views agree on.
    Lines = 3,
}

/// Why a view's depth does not rest on its lines.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
#[serde(tag = "reason", rename_all = "snake_case")]
pub enum Fallback {
    /// Fewer than three views within reach of each other: the depth is that
    /// of a body rounded inside the visual hull.
    NoNeighbours {
        /// The angle to the nearest other view, degrees.
        nearest_deg: f64,
    },
    /// Views are near, but hardly a line could be matched between them.
    TooFewLines { matched: usize, required: usize },
}

/// The depth of one view.
#[derive(Clone, Debug)]
pub struct ViewDepth {
    pub azimuth: Azimuth,
    /// Depth along the view direction from the axis plane in the turntable
    /// frame, px, growing away from the camera; NaN outside the silhouette.
    pub depth_px: ImageBuffer<Luma<f32>, Vec<f32>>,
    /// [`Confidence`] per pixel.
    pub confidence: GrayImage,
    /// The share of the crossings of lines with rows whose depth is known.
    pub matched_share: f64,
    pub fallback: Option<Fallback>,
}

/// The stages of [`estimate`], in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DepthStage {
    Lines,
    Matching,
    Surfaces,
}

/// Why no depth maps were made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DepthError {
    #[error("{silhouettes} silhouettes were given for {views} views")]
    SilhouettesDiffer { silhouettes: usize, views: usize },
    #[error("cancelled before {0:?}")]
    Cancelled(DepthStage),
}

/// Estimates the depth of every view.
///
/// * `silhouettes`: of `views`, in their order.
/// * `on_stage`: told each stage as it begins; `Break` cancels.
///
/// Views with lines matched to neighbours within `options.max_neighbour_deg`
/// get depth from lines, others from the visual hull, and say so.
///
/// Takes about 20 bytes per pixel and view, and 40 more where it is being solved.
///
/// # Errors
/// [`DepthError`] if the silhouettes are not those of the views, or when cancelled.
pub fn estimate(
    views: &ViewSet,
    silhouettes: &Silhouettes,
    options: &DepthOptions,
    on_stage: &dyn Fn(DepthStage) -> ControlFlow<()>,
) -> Result<Vec<ViewDepth>, DepthError> {
    estimate_some(views, silhouettes, options, on_stage, |_| true)
}

/// [`estimate`] for the views that are `wanted`, with the lines of all.
///
/// # Errors
/// As [`estimate`].
pub fn estimate_some(
    views: &ViewSet,
    silhouettes: &Silhouettes,
    options: &DepthOptions,
    on_stage: &dyn Fn(DepthStage) -> ControlFlow<()>,
    wanted: impl Fn(Azimuth) -> bool,
) -> Result<Vec<ViewDepth>, DepthError> {
    let stage = |stage| match on_stage(stage) {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(DepthError::Cancelled(stage)),
    };
    let silhouettes = &silhouettes.silhouettes;
    if silhouettes.len() != views.views().len() {
        return Err(DepthError::SilhouettesDiffer {
            silhouettes: silhouettes.len(),
            views: views.views().len(),
        });
    }
    stage(DepthStage::Lines)?;
    let subject = Subject::new(views, silhouettes);
    let drawings = drawings(views, silhouettes, &subject);
    stage(DepthStage::Matching)?;
    let line_views = line_views(views, &drawings, &subject, options);
    let lines = line_depths(&line_views);
    stage(DepthStage::Surfaces)?;
    let cloud = PointCloud::new(&line_views, &lines);
    let wanted: Vec<usize> =
        (0..drawings.len()).filter(|&index| wanted(views.views()[index].azimuth)).collect();
    let maps = wanted
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
            let (depth, confidence) = match fallback {
                None => surface.of_lines(&cloud, line_views[index].azimuth_rad),
                Some(_) => surface.of_hull(),
            };
            surface.view_depth(views.views()[index].azimuth, depth, confidence, fallback)
        })
        .collect();
    Ok(maps)
}

/// The subject's size, which thresholds on depth scale with.
struct Subject {
    radius_px: f64,
    unit_px: f64,
}

impl Subject {
    fn new(views: &ViewSet, silhouettes: &[Silhouette]) -> Self {
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
    fn reach_px(&self) -> f64 {
        1.35 * self.radius_px + 20.0 * self.unit_px
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
    let grown: Vec<GrownRows> = silhouettes.par_iter().map(GrownRows::new).collect();
    let views = views.views();
    (0..views.len())
        .into_par_iter()
        .map(|index| {
            let others: Vec<_> = (0..views.len())
                .filter(|&other| other != index)
                .map(|other| {
                    let (own, other_rad) =
                        (views[index].azimuth.radians(), views[other].azimuth.radians());
                    (&grown[other], angle_between(own, other_rad))
                })
                .collect();
            let hull = hull_depth(&silhouettes[index], &others, subject.reach_px() as f32);
            let ink = InkMap::from_image(&views[index].image);
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

type Nodes = (Vec<f32>, Vec<Confidence>);

impl Surface<'_> {
    fn of_lines(&self, cloud: &PointCloud, azimuth_rad: f64) -> Nodes {
        let contours = &self.drawing.contours;
        let mut graph = PixelGraph::new(self.silhouette.mask(), contours);
        let (owners, blocks) = owners(&graph, contours, self.lines, self.subject.unit_px);
        graph.steps = steps(&graph, &blocks, self.subject.unit_px);
        let points = cloud.seen_from(azimuth_rad);
        self.filled(&graph, self.lines, &owners, points)
    }

    /// The outline in the middle of the hull's depth, the rest bulging from it.
    fn of_hull(&self) -> Nodes {
        let contours = &self.drawing.contours;
        let graph = PixelGraph::new(self.silhouette.mask(), contours);
        let owners = outline_owners(contours);
        let mut lines = LineDepths::unknown(contours.crossings.len());
        for (index, &(near, far)) in self.drawing.hull_at_lines.iter().enumerate() {
            if contours.crossings[index].on_outline() {
                lines.depth_px[index] = f64::midpoint(near, far);
            }
        }
        let (depth, mut confidence) = self.filled(&graph, &lines, &owners, Vec::new());
        for level in &mut confidence {
            *level = (*level).min(Confidence::Hull);
        }
        (depth, confidence)
    }

    fn filled(
        &self,
        graph: &PixelGraph,
        lines: &LineDepths,
        owners: &[Option<Owner>],
        points: Vec<super::points::Point>,
    ) -> Nodes {
        let mut fill = Fill::new(graph, &self.drawing.contours, lines, owners);
        let accuracy = |left| if left == 0 { Accuracy::Final } else { Accuracy::Rough };
        let mut depth = fill.solve(&[], accuracy(self.refinements));
        let near: Vec<f32> =
            (0..graph.nodes()).map(|node| self.drawing.hull.near_px[graph.pixel(node)]).collect();
        let refinement = Refinement::new(
            graph,
            &near,
            points,
            (&self.drawing.contours, lines),
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

    fn view_depth(
        &self,
        azimuth: Azimuth,
        depth: Vec<f32>,
        confidence: Vec<Confidence>,
        fallback: Option<Fallback>,
    ) -> ViewDepth {
        let mask = self.silhouette.mask();
        let (width, height) = mask.dimensions();
        let mut depth_px = ImageBuffer::from_pixel(width, height, Luma([f32::NAN]));
        let mut levels = GrayImage::new(width, height);
        let inside = mask.as_raw().iter().enumerate().filter(|(_, level)| **level != 0);
        for ((pixel, _), (depth, confidence)) in inside.zip(depth.into_iter().zip(confidence)) {
            depth_px.as_mut()[pixel] = depth;
            levels.as_mut()[pixel] = confidence as u8;
        }
        let known = self.lines.depth_px.iter().filter(|depth| !depth.is_nan()).count();
        ViewDepth {
            azimuth,
            depth_px,
            confidence: levels,
            matched_share: known as f64 / self.lines.depth_px.len().max(1) as f64,
            fallback,
        }
    }
}
