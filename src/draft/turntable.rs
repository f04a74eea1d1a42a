//! The method `turntable`: silhouettes, depth from lines, the solid.

use std::borrow::Cow;
use std::ops::ControlFlow;

use rayon::ThreadPool;

use super::DraftError;
use crate::options::Options;
use crate::pipeline::{Cancelled, Observer, Progress, Stage};
use crate::sheet::{Azimuth, Sheet, SheetDocument};
use crate::turntable::depth::{self, DepthError, DepthStage, LineEstimate, ViewDepth};
use crate::turntable::registration::{self, ViewRegistration};
use crate::turntable::silhouette::{SilhouetteError, Silhouettes};
use crate::turntable::solid::{
    self, DepthMap, HoleHint, Solid, SolidError, SolidInput, SolidStage,
};
use crate::turntable::{View, ViewSet};

/// What the method finds.
pub struct TurntableDraft {
    /// As registered, if asked for.
    pub views: ViewSet,
    /// Per view, in the order of `views`, as are all below.
    pub registrations: Vec<ViewRegistration>,
    pub silhouettes: Silhouettes,
    pub depths: Vec<ViewDepth>,
    pub solid: Solid,
}

/// Where silhouettes end and depth ends within the method's work.
const SILHOUETTES: f64 = 0.05;
const DEPTHS: f64 = 0.6;
const SOLID_STAGES: usize = 7;
const DEPTH_STAGES: usize = 3;

/// Runs the method's stages on `pool`.
///
/// # Errors
/// [`DraftError::Input`] for views that cannot make a solid,
/// [`DraftError::Cancelled`] if `observer` says so.
pub(super) fn compute(
    sheet: &Sheet,
    document: &SheetDocument,
    options: &Options,
    pool: &ThreadPool,
    observer: &dyn Observer,
) -> Result<TurntableDraft, DraftError> {
    let views = view_set(sheet)?;
    let (views, silhouettes, registrations) =
        pool.install(|| registered(views, options)).map_err(silhouette_error)?;
    tell(observer, Stage::Silhouettes, (1, 1), "silhouettes", SILHOUETTES)?;
    let estimates = estimates(&views, &silhouettes, options, pool, observer)?;
    let hole_hints = hole_hints(document)?;
    let (agreeing, outlines) = agreeing(&views, &silhouettes, &registrations);
    let depth_maps: Vec<DepthMap> = estimates
        .iter()
        .zip(&registrations)
        .filter(|(_, found)| !found.contradicts)
        .filter_map(|(view, _)| Some((view.azimuth, view.map.as_ref().ok()?)))
        .map(|(azimuth, map)| DepthMap {
            azimuth,
            depth: map.depth_px.clone(),
            confidence: Some(map.confidence.clone()),
        })
        .collect();
    let input = SolidInput {
        views: &agreeing,
        silhouettes: &outlines,
        depth_maps: &depth_maps,
        hole_hints: &hole_hints,
    };
    let solid = build(&input, options, pool, observer)?;
    let from = options.turntable.depth.from;
    let depths =
        pool.install(|| depth::read_depth(&solid.mesh, &views, &silhouettes, estimates, from));
    Ok(TurntableDraft { views, registrations, silhouettes, depths, solid })
}

/// What the solid is made of: views that contradict the others would carve
/// away what these show.
fn agreeing<'a>(
    views: &'a ViewSet,
    silhouettes: &'a Silhouettes,
    registrations: &[ViewRegistration],
) -> (Cow<'a, ViewSet>, Cow<'a, Silhouettes>) {
    let keeps = |index: &usize| !registrations[*index].contradicts;
    let kept: Vec<usize> = (0..registrations.len()).filter(keeps).collect();
    let fewer = ViewSet::new(kept.iter().map(|&index| views.views()[index].clone()).collect());
    match fewer {
        Ok(fewer) if kept.len() < registrations.len() => {
            let of_kept = kept.iter().map(|&index| silhouettes.silhouettes[index].clone());
            let opposites = silhouettes.opposites.clone();
            let silhouettes = Silhouettes { silhouettes: of_kept.collect(), opposites };
            (Cow::Owned(fewer), Cow::Owned(silhouettes))
        }
        _ => (Cow::Borrowed(views), Cow::Borrowed(silhouettes)),
    }
}

fn view_set(sheet: &Sheet) -> Result<ViewSet, DraftError> {
    if let Some(view) = sheet.views().iter().find(|view| view.elevation_deg != 0.0) {
        let detail = format!(
            "view {} is at elevation {} degrees; the method takes level views: leave it out",
            view.azimuth, view.elevation_deg
        );
        return Err(DraftError::input("elevation_unsupported", detail));
    }
    let views = sheet.views().iter().map(|view| View {
        azimuth: view.azimuth,
        image: view.image.clone(),
        mask: view.mask.clone(),
    });
    ViewSet::new(views.collect()).map_err(|error| DraftError::input("invalid_views", error))
}

type Registered = (ViewSet, Silhouettes, Vec<ViewRegistration>);

/// Silhouettes, and how well they agree; views moved to fit if asked for.
fn registered(views: ViewSet, options: &Options) -> Result<Registered, SilhouetteError> {
    let options = &options.turntable;
    let alone = Silhouettes::of_views_alone(&views, &options.silhouette)?;
    let found = registration::register(&views, &alone);
    match registration::corrected(&views, &found).filter(|_| options.register) {
        Some(views) => {
            let moved = |index: usize| found[index].corrects();
            let silhouettes = alone.with_changed(&views, moved, &options.silhouette)?;
            Ok((views, silhouettes.joined(&options.silhouette), found))
        }
        None => Ok((views, alone.joined(&options.silhouette), found)),
    }
}

fn silhouette_error(error: SilhouetteError) -> DraftError {
    match error {
        SilhouetteError::TooSmall { .. } => DraftError::input(
            "blank_view",
            format!("{error}; draw dark lines on light paper, give a mask, or leave the view out"),
        ),
        SilhouetteError::CoversImage { .. } => DraftError::input(
            "no_paper",
            format!("{error}; leave a margin around the subject, or give its mask"),
        ),
    }
}

fn estimates(
    views: &ViewSet,
    silhouettes: &Silhouettes,
    options: &Options,
    pool: &ThreadPool,
    observer: &dyn Observer,
) -> Result<Vec<LineEstimate>, DraftError> {
    let on_stage = |stage: DepthStage| {
        let (done, name) = match stage {
            DepthStage::Lines => (0, "silhouettes"),
            DepthStage::Matching => (1, "lines"),
            DepthStage::Surfaces => (2, "matching"),
        };
        let fraction = between(SILHOUETTES, DEPTHS, done, DEPTH_STAGES);
        flow(tell(observer, Stage::Depth, (done, DEPTH_STAGES), name, fraction))
    };
    let estimates = pool
        .install(|| depth::estimate(views, silhouettes, &options.turntable.depth, &on_stage))
        .map_err(|error| match error {
            DepthError::Cancelled(_) => DraftError::Cancelled(Cancelled),
            DepthError::SilhouettesDiffer { .. } => DraftError::Internal(error.to_string()),
        })?;
    tell(observer, Stage::Depth, (DEPTH_STAGES, DEPTH_STAGES), "surfaces", DEPTHS)?;
    Ok(estimates)
}

fn hole_hints(document: &SheetDocument) -> Result<Vec<HoleHint>, DraftError> {
    let hint = |hole: &crate::sheet::HoleDocument| {
        let azimuth = Azimuth::from_degrees(hole.azimuth_deg)
            .map_err(|error| DraftError::input("invalid_azimuth", error))?;
        Ok(HoleHint { azimuth, x_px: hole.x, y_px: hole.y })
    };
    document.holes.iter().map(hint).collect()
}

fn build(
    input: &SolidInput<'_>,
    options: &Options,
    pool: &ThreadPool,
    observer: &dyn Observer,
) -> Result<Solid, DraftError> {
    let solid = pool.install(|| {
        let mut progress = |stage: SolidStage| {
            let (done, name) = match stage {
                SolidStage::Views => (0, "depth"),
                SolidStage::Slices => (1, "views"),
                SolidStage::Creases => (2, "slices"),
                SolidStage::Field => (3, "creases"),
                SolidStage::Surface => (4, "field"),
                SolidStage::Decimation => (5, "surface"),
                SolidStage::Support => (6, "decimation"),
            };
            let fraction = between(DEPTHS, 1.0, done, SOLID_STAGES);
            flow(tell(observer, Stage::Solid, (done, SOLID_STAGES), name, fraction))
        };
        solid::build(input, &options.turntable.solid, &mut progress)
    });
    let solid = solid.map_err(solid_error)?;
    tell(observer, Stage::Solid, (SOLID_STAGES, SOLID_STAGES), "support", 1.0)?;
    Ok(solid)
}

fn solid_error(error: SolidError) -> DraftError {
    let input = |code, remedy| DraftError::input(code, format!("{error}; {remedy}"));
    match error {
        SolidError::TooFewDirections { .. } => {
            input("too_few_directions", "add a view from another side")
        }
        SolidError::NoCommonRow => {
            input("no_common_row", "draw all views at one height and one scale")
        }
        SolidError::Empty => {
            input("contradicting_views", "check the views' angles and that all show one subject")
        }
        SolidError::Cancelled => DraftError::Cancelled(Cancelled),
    }
}

fn between(start: f64, end: f64, done: usize, total: usize) -> f64 {
    start + (end - start) * done as f64 / total as f64
}

fn flow(told: Result<(), Cancelled>) -> ControlFlow<()> {
    match told {
        Ok(()) => ControlFlow::Continue(()),
        Err(Cancelled) => ControlFlow::Break(()),
    }
}

/// Reports that `unit` is done and asks whether to go on.
fn tell(
    observer: &dyn Observer,
    stage: Stage,
    (done, total): (usize, usize),
    unit: &str,
    fraction: f64,
) -> Result<(), Cancelled> {
    let unit = (done > 0).then(|| unit.to_owned());
    observer.progress(Progress { stage, done, total, unit, fraction });
    observer.check()
}
