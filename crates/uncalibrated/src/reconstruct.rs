//! The pipeline from a sheet to maps, clouds and the hull.

use nalgebra::{Point3, Similarity3};
use rayon::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use super::correspond::ViewFeatures;
use super::merge::{Merged, merge};
use super::pair::{self, PairMaps, PairResult, process_pair};
use super::pairs::{PlannedPair, SkippedPair, plan_pairs};
use super::tracker::Tracker;
use crate::Options;
use crate::options::DepthRelation;
use crate::vision::{
    self, HullError, PartneredMap, ViewCloud, affine_depth, detect_and_describe, inverse_depth,
    mean_map,
};
use frames::Azimuth;
use mesh::Mesh;
use picture::FloatImage;
use progress::{Cancelled, Observer, Stage};
use sheet::{Sheet, View};

/// The fewest views the method works from.
pub const MINIMUM_VIEWS: usize = 3;
/// Per pixel and view: the drawing, two disparity maps, their mean and depth, the
/// last three of corners too.
const BYTES_PER_PIXEL: u64 = 29;

/// Why a sheet gave no reconstruction.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum PipelineError {
    /// Somebody asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The method needs more views.
    #[error("the sheet has {found} views; the method takes at least {required}")]
    TooFewViews {
        /// Views of the sheet.
        found: usize,
        /// The fewest that are taken.
        required: usize,
    },
    /// The drawings are not all of one size.
    #[error(
        "view {azimuth} is {width_px}x{height_px} px, the first view {first_width_px}x{first_height_px}; make all views one size"
    )]
    SizesDiffer {
        /// The view that differs from the first.
        azimuth: Azimuth,
        /// Its width, px.
        width_px: u32,
        /// Its height, px.
        height_px: u32,
        /// Width of the first view, px.
        first_width_px: u32,
        /// Height of the first view, px.
        first_height_px: u32,
    },
    /// One reason a pair.
    #[error("no pair of neighbouring views could be used: {}", reasons.join("; "))]
    NoUsablePair {
        /// What went wrong, each with the pair's name.
        reasons: Vec<String>,
    },
    /// The operating system gave no threads.
    #[error("no worker threads: {reason}")]
    NoThreads {
        /// Its own message.
        reason: String,
    },
}

impl PipelineError {
    /// A stable name for the kind of error.
    pub fn code(&self) -> &'static str {
        match self {
            Self::Cancelled(_) => "cancelled",
            Self::TooFewViews { .. } => "too_few_views",
            Self::SizesDiffer { .. } => "sizes_differ",
            Self::NoUsablePair { .. } => "no_usable_pair",
            Self::NoThreads { .. } => "no_threads",
        }
    }
}

/// What is known of one view in the end.
#[derive(Clone, Debug)]
pub struct ViewResult {
    /// The view's azimuth.
    pub azimuth: Azimuth,
    /// Keypoints found by the options as given; 0 if detection failed.
    pub keypoints: usize,
    /// px; the mean of both neighbours' maps; `None` without a usable pair.
    pub disparity: Option<FloatImage>,
    /// px, growing away from the camera; `None` without a usable pair.
    pub depth: Option<FloatImage>,
    /// The same at the matched corners alone, if clouds are made of them.
    pub corner_depth: Option<FloatImage>,
}

impl ViewResult {
    /// The depth that the view's cloud is made of.
    pub fn cloud_depth(&self) -> Option<&FloatImage> {
        self.corner_depth.as_ref().or(self.depth.as_ref())
    }
}

/// Everything the pipeline found out about a sheet.
#[derive(Clone, Debug)]
pub struct Reconstruction {
    /// By rising azimuth.
    pub views: Vec<ViewResult>,
    /// Neighbours that were worked on, failed ones too.
    pub pairs: Vec<PairResult>,
    /// Neighbours too far apart to be worked on.
    pub skipped_pairs: Vec<SkippedPair>,
    /// Which clouds were joined, and how.
    pub merged: Merged,
    /// How many points could be corners of the hull.
    pub hull_candidates: usize,
    /// Turntable frame, px.
    pub hull: Result<Mesh, HullError>,
}

impl Reconstruction {
    /// The pairs that have disparity maps.
    pub fn usable_pairs(&self) -> impl Iterator<Item = &PairResult> {
        self.pairs.iter().filter(|pair| pair.rectification().is_some())
    }

    /// The signed angles from the view at `azimuth` to the neighbours whose
    /// pairs its disparity comes from, degrees.
    pub fn pair_degs_of(&self, azimuth: Azimuth) -> Vec<f64> {
        let towards = |pair: &PairResult| {
            let ahead = (pair.name.left == azimuth).then_some(pair.angle_deg);
            ahead.or((pair.name.right == azimuth).then_some(-pair.angle_deg))
        };
        self.usable_pairs().filter_map(towards).collect()
    }

    /// The merged cloud, turntable frame, px: every `stride`-th pixel of every
    /// `stride`-th row of each joined view, in chain order.
    pub fn cloud(&self, stride: u32) -> impl Iterator<Item = Point3<f64>> {
        self.merged.views.iter().flat_map(move |(view, turntable_from_view)| {
            let depth = self.views[*view].cloud_depth().into_iter();
            depth.flat_map(move |depth| {
                ViewCloud::new(depth).points(stride).map(move |point| turntable_from_view * point)
            })
        })
    }
}

/// Reconstructs a sheet by the method `uncalibrated` (Arys 2020, §3).
///
/// * `threads`: how many may compute; the result does not depend on it.
///
/// Pairs that fail are reported in the result and the others go on.
///
/// # Errors
/// [`PipelineError`]: cancelled, an unsuitable sheet, or no usable pair.
pub fn reconstruct(
    sheet: &Sheet,
    options: &Options,
    threads: usize,
    observer: &dyn Observer,
) -> Result<Reconstruction, PipelineError> {
    let views = sheet.views();
    check_sheet(views)?;
    let pool = ThreadPoolBuilder::new()
        .num_threads(threads.max(1))
        .build()
        .map_err(|error| PipelineError::NoThreads { reason: error.to_string() })?;
    let (plans, skipped_pairs) = plan_pairs(sheet, options.max_pair_angle_deg);
    let features = detect_all(&pool, views, options, observer)?;
    let (pairs, maps) = process_all(&pool, &plans, sheet, &features, options, observer)?;
    if maps.iter().all(Option::is_none) {
        return Err(no_usable_pair(&pairs, &skipped_pairs));
    }
    let view_results = combine_all(&pool, views, &features, &plans, maps, options, observer)?;
    let extremes = cloud_extremes(&pool, &view_results, observer)?;
    let merged = merge(&view_results, &plans, &pairs, options);
    let candidates = placed(&extremes, &merged);
    Tracker::new(observer, Stage::Merge, 1, 1).finish("clouds".to_owned(), 1)?;
    let hull = vision::convex_hull(&candidates);
    Tracker::new(observer, Stage::Hull, 1, 1).finish("hull".to_owned(), 1)?;
    Ok(Reconstruction {
        views: view_results,
        pairs,
        skipped_pairs,
        merged,
        hull_candidates: candidates.len(),
        hull,
    })
}

/// About how much memory `views` of one size take, bytes.
pub fn working_bytes(
    views: usize,
    width_px: u32,
    height_px: u32,
    options: &Options,
    threads: usize,
) -> u64 {
    let pixels = u64::from(width_px) * u64::from(height_px) * views as u64;
    let matching = vision::working_bytes(width_px, height_px, &options.disparity);
    let detection = vision::detection_bytes(width_px, height_px, &options.detection);
    let at_once = threads.clamp(1, views.max(1)) as u64;
    (pixels * BYTES_PER_PIXEL).saturating_add(matching.max(detection).saturating_mul(at_once))
}

fn check_sheet(views: &[View]) -> Result<(), PipelineError> {
    let required = MINIMUM_VIEWS;
    let Some(first) = views.first().filter(|_| views.len() >= required) else {
        return Err(PipelineError::TooFewViews { found: views.len(), required });
    };
    let (first_width_px, first_height_px) = first.image.dimensions();
    for view in views {
        let (width_px, height_px) = view.image.dimensions();
        if (width_px, height_px) != (first_width_px, first_height_px) {
            return Err(PipelineError::SizesDiffer {
                azimuth: view.azimuth,
                width_px,
                height_px,
                first_width_px,
                first_height_px,
            });
        }
    }
    Ok(())
}

/// Maps `items` in parallel, results in their order; the first error stops.
fn in_order<T: Sync, R: Send>(
    pool: &ThreadPool,
    items: &[T],
    work: impl Fn(&T) -> Result<R, Cancelled> + Sync + Send,
) -> Result<Vec<R>, Cancelled> {
    pool.install(|| items.par_iter().with_max_len(1).map(work).collect())
}

fn detect_all(
    pool: &ThreadPool,
    views: &[View],
    options: &Options,
    observer: &dyn Observer,
) -> Result<Vec<ViewFeatures>, Cancelled> {
    let tracker = Tracker::new(observer, Stage::Features, views.len(), 1);
    in_order(pool, views, |view| {
        let features = detect_and_describe(&view.image, &options.detection);
        tracker.finish(view.azimuth.to_string(), 1)?;
        Ok(features)
    })
}

type PairsAndMaps = (Vec<PairResult>, Vec<Option<PairMaps>>);

fn process_all(
    pool: &ThreadPool,
    plans: &[PlannedPair],
    sheet: &Sheet,
    features: &[ViewFeatures],
    options: &Options,
    observer: &dyn Observer,
) -> Result<PairsAndMaps, Cancelled> {
    let tracker = Tracker::new(observer, Stage::Pairs, plans.len(), pair::STEPS);
    let processed =
        in_order(pool, plans, |plan| process_pair(plan, sheet, features, options, &tracker))?;
    Ok(processed.into_iter().unzip())
}

fn no_usable_pair(pairs: &[PairResult], skipped: &[SkippedPair]) -> PipelineError {
    let failed =
        pairs.iter().filter_map(|pair| Some(format!("{}: {}", pair.name, pair.failure()?)));
    let wide = skipped.iter().map(|skip| {
        format!(
            "{}: {} degrees apart, more than max_pair_angle_deg, {}",
            skip.pair, skip.angle_deg, skip.max_pair_angle_deg
        )
    });
    PipelineError::NoUsablePair { reasons: failed.chain(wide).collect() }
}

/// A view's maps: as the left view of one pair, as the right view of another.
#[derive(Default)]
struct ViewMaps {
    as_left: Option<(FloatImage, f64)>,
    as_right: Option<(FloatImage, f64)>,
}

/// All of a view's maps: of every pixel and of the corners.
#[derive(Default)]
struct AllMaps {
    dense: ViewMaps,
    corners: ViewMaps,
}

fn combine_all(
    pool: &ThreadPool,
    views: &[View],
    features: &[ViewFeatures],
    plans: &[PlannedPair],
    maps: Vec<Option<PairMaps>>,
    options: &Options,
    observer: &dyn Observer,
) -> Result<Vec<ViewResult>, Cancelled> {
    let mut of_views: Vec<AllMaps> = views.iter().map(|_| AllMaps::default()).collect();
    for (plan, maps) in plans.iter().zip(maps) {
        let Some(maps) = maps else { continue };
        let angle = plan.angle_deg.to_radians();
        of_views[plan.left].dense.as_left = Some((maps.left, angle));
        of_views[plan.right].dense.as_right = Some((maps.right, -angle));
        if let Some([left, right]) = maps.corners {
            of_views[plan.left].corners.as_left = Some((left, angle));
            of_views[plan.right].corners.as_right = Some((right, -angle));
        }
    }
    let tracker = Tracker::new(observer, Stage::Combine, views.len(), 1);
    let indices: Vec<usize> = (0..views.len()).collect();
    in_order(pool, &indices, |&index| {
        let (view, maps) = (&views[index], &of_views[index]);
        let (disparity, depth) = combine(view, &maps.dense, options).unzip();
        let corner_depth = combine(view, &maps.corners, options).map(|(_, depth)| depth);
        tracker.finish(views[index].azimuth.to_string(), 1)?;
        Ok(ViewResult {
            azimuth: views[index].azimuth,
            keypoints: features[index].as_ref().map_or(0, |found| found.keypoints.len()),
            disparity,
            depth,
            corner_depth,
        })
    })
}

/// A view's disparity and depth; depth only inside the view's mask, if it has
/// one.
fn combine(view: &View, maps: &ViewMaps, options: &Options) -> Option<(FloatImage, FloatImage)> {
    let given: Vec<_> = [&maps.as_left, &maps.as_right].into_iter().flatten().collect();
    let disparity = match given.as_slice() {
        [] => return None,
        [(only, _)] => only.clone(),
        [(first, _), (second, _), ..] => mean_map(first.clone(), second),
    };
    let mut depth = match options.cloud.depth {
        DepthRelation::Inverse => inverse_depth(&disparity, options.cloud.inverse_scale_px2),
        DepthRelation::Affine => {
            let partnered: Vec<_> = given
                .iter()
                .map(|(disparity, to_partner_rad)| PartneredMap {
                    disparity,
                    to_partner_rad: *to_partner_rad,
                })
                .collect();
            affine_depth(&partnered)
        }
    };
    if let Some(mask) = &view.mask {
        for (value, inside) in depth.iter_mut().zip(mask.iter()) {
            *value = if *inside > 127 { *value } else { f32::NAN };
        }
    }
    Some((disparity, depth))
}

/// Of each view's cloud, in its own frame, the points that can be corners of a
/// hull.
fn cloud_extremes(
    pool: &ThreadPool,
    views: &[ViewResult],
    observer: &dyn Observer,
) -> Result<Vec<Vec<Point3<f64>>>, Cancelled> {
    let tracker = Tracker::new(observer, Stage::Cloud, views.len(), 1);
    in_order(pool, views, |view| {
        let cloud = view.cloud_depth().map(ViewCloud::new);
        let extremes = cloud.map_or_else(Vec::new, |cloud| vision::row_extremes(&cloud));
        tracker.finish(view.azimuth.to_string(), 1)?;
        Ok(extremes)
    })
}

/// The joined views' points in the turntable frame.
fn placed(points: &[Vec<Point3<f64>>], merged: &Merged) -> Vec<Point3<f64>> {
    let of_view = |(view, turntable_from_view): &(usize, Similarity3<f64>)| {
        let placement = *turntable_from_view;
        points[*view].iter().map(move |point| placement * point)
    };
    merged.views.iter().flat_map(of_view).collect()
}
