//! The method from a sheet to a draft: which stage follows which.

use std::borrow::Cow;

use frames::{Azimuth, Elevation, NoElevation, NotFinite, Viewpoint};
use mesh::shading::CREASE_ANGLE_DEG;
use progress::{Cancelled, Observer, Share, Stage, Steps, Unreported};
use remesh::{QuadMesh, QuadOptions};
use sheet::{HoleDocument, Sheet, View};

use crate::depth::{self, DepthError, ViewDepth};
use crate::elevated::{self, ElevatedError, ElevatedView, Placed};
use crate::fit;
use crate::options::{SolidOptions, TurntableOptions};
use crate::registration::{self, ViewRegistration};
use crate::silhouette::{Silhouette, SilhouetteError, Silhouettes};
use crate::solid::{self, ElevatedInput, HoleHint, Solid, SolidError, SolidInput, ViewDepthMap};
use crate::surface::projection::Rig;
use crate::views::{MINIMUM_VIEWS, ViewSet, ViewSetError};

/// What the method finds.
pub struct Draft<'a> {
    /// The level ones, as registered, if asked for.
    pub views: ViewSet<'a>,
    /// Per view, in the order of `views`, as are the silhouettes and depths.
    pub registrations: Vec<ViewRegistration>,
    /// The subject's area in each view.
    pub silhouettes: Silhouettes,
    /// Each view's depth.
    pub depths: Vec<ViewDepth>,
    /// Views from above and below.
    pub elevated: Vec<ElevatedView<'a>>,
    /// The closed surface.
    pub solid: Solid,
}

/// One view of a draft, level or not.
#[derive(Clone, Copy, Debug)]
pub struct DraftView<'d> {
    /// The drawing, as registered.
    pub view: &'d View,
    /// The subject's area in it.
    pub silhouette: &'d Silhouette,
    /// How it agrees with the others.
    pub registration: &'d ViewRegistration,
    /// The depth of each of its pixels.
    pub depth: &'d ViewDepth,
}

impl DraftView<'_> {
    /// Where its camera stands.
    pub fn viewpoint(&self) -> Viewpoint {
        self.view.viewpoint()
    }
}

impl Draft<'_> {
    /// All views: the level ones, then those from above and below.
    pub fn all_views(&self) -> Vec<DraftView<'_>> {
        let level = self.views.views().iter().zip(&self.silhouettes.silhouettes);
        let level = level.zip(&self.registrations).zip(&self.depths).map(
            |(((view, silhouette), registration), depth)| DraftView {
                view: view.as_ref(),
                silhouette,
                registration,
                depth,
            },
        );
        let elevated = self.elevated.iter().map(|found| DraftView {
            view: found.view.as_ref(),
            silhouette: &found.silhouette,
            registration: &found.registration,
            depth: &found.depth,
        });
        level.chain(elevated).collect()
    }

    /// The solid's surface as quads, about half as many as it may have triangles.
    ///
    /// # Errors
    /// [`Cancelled`] if `observer` says so.
    pub fn quads(
        &self,
        options: &SolidOptions,
        observer: &dyn Observer,
    ) -> Result<QuadMesh, Cancelled> {
        let wanted = QuadOptions {
            faces: options.target_faces as usize / 2,
            crease_angle_deg: CREASE_ANGLE_DEG,
        };
        let made = remesh::quads(&self.solid.mesh, &wanted, &|| observer.is_cancelled());
        observer.check()?;
        Ok(made.unwrap_or_default())
    }

    /// The cameras of [`all_views`](Self::all_views), in their order.
    pub fn rig(&self) -> Rig {
        let mut rig = Rig::of_views(&self.views);
        rig.viewpoints.extend(self.elevated.iter().map(|found| found.view.viewpoint()));
        rig
    }
}

/// Why there is no draft.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DraftError {
    /// Too few of the views are level.
    #[error(
        "{found} of {all} views are level, {required} are required; add level ones, such as front and side"
    )]
    TooFewLevelViews {
        /// Level views.
        found: usize,
        /// Of so many.
        all: usize,
        /// The fewest that are taken.
        required: usize,
    },
    /// The views do not fit together.
    #[error(transparent)]
    Views(#[from] ViewSetError),
    /// A view shows no subject.
    #[error(transparent)]
    Silhouette(#[from] SilhouetteError),
    /// No depth maps.
    #[error(transparent)]
    Depth(DepthError),
    /// No solid.
    #[error(transparent)]
    Solid(SolidError),
    /// A hole's azimuth is no angle.
    #[error(transparent)]
    Hole(#[from] NotFinite),
    /// A hole's elevation is none.
    #[error(transparent)]
    HoleElevation(#[from] NoElevation),
    /// Somebody asked to stop.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

impl From<ElevatedError> for DraftError {
    fn from(error: ElevatedError) -> Self {
        match error {
            ElevatedError::View(error) => Self::Views(error),
            ElevatedError::Silhouette(error) => Self::Silhouette(error),
        }
    }
}

impl From<DepthError> for DraftError {
    fn from(error: DepthError) -> Self {
        match error {
            DepthError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            other => Self::Depth(other),
        }
    }
}

impl From<SolidError> for DraftError {
    fn from(error: SolidError) -> Self {
        match error {
            SolidError::Cancelled(cancelled) => Self::Cancelled(cancelled),
            other => Self::Solid(other),
        }
    }
}

/// Where silhouettes end and depth ends within the method's work.
const SILHOUETTES: f64 = 0.05;
const DEPTHS: f64 = 0.6;

/// What the method may hold in memory at once, bytes a pixel of every view:
/// drawing, lines, grid and surface, were all views solved at once.
const WORKING_BYTES_PER_PIXEL: u64 = 80;

/// About how much memory the method takes for `views` of so many pixels each, bytes.
pub fn working_bytes(views: usize, pixels: u64) -> u64 {
    pixels.saturating_mul(views as u64).saturating_mul(WORKING_BYTES_PER_PIXEL)
}

/// Makes a draft from a sheet, on rayon's current pool.
///
/// * `holes`: places that the sheet says one sees through.
///
/// ```
/// use image::{GrayImage, Luma};
/// use sheet::{Sheet, View};
///
/// // A block, 40 px wide from every side: its outline on white paper.
/// let block = GrayImage::from_fn(64, 64, |x, y| {
///     let edge = [12, 51].contains(&x) || [12, 51].contains(&y);
///     let inside = (12..52).contains(&x) && (12..52).contains(&y);
///     Luma([if edge && inside { 0 } else { 255 }])
/// });
/// let view = |degrees| {
///     View::level(frames::Azimuth::from_degrees(degrees).unwrap(), block.clone(), None)
/// };
/// let sheet = Sheet::new(vec![view(0.0), view(90.0)]).unwrap();
/// let options = turntable::options::TurntableOptions::default();
/// let draft = turntable::reconstruct(&sheet, &[], &options, &progress::Silent).unwrap();
/// let (low, high) = draft.solid.mesh.bounds().unwrap();
/// assert!((high.z - low.z - 40.0).abs() < 2.0);
/// ```
///
/// # Errors
/// [`DraftError`] for views that cannot make a solid, and if `observer` says
/// so.
pub fn reconstruct<'a>(
    sheet: &'a Sheet,
    holes: &[HoleDocument],
    options: &TurntableOptions,
    observer: &dyn Observer,
) -> Result<Draft<'a>, DraftError> {
    let (views, silhouettes, registrations) = registered(view_set(sheet)?, options)?;
    let above: Vec<&View> =
        sheet.views().iter().filter(|view| !view.viewpoint().is_level()).collect();
    let hull = if above.is_empty() { Vec::new() } else { solid::hull_points(&views, &silhouettes) };
    let placed = elevated::placed(&above, &views, &hull, &options.silhouette, options.register)?;
    let cutting: Vec<ElevatedInput<'_>> = placed.iter().map(Placed::input).collect();
    let share = Share::new(observer, 0.0, SILHOUETTES);
    Steps::new(&share, Stage::Silhouettes, 1).done(1, "silhouettes")?;
    let share = Share::new(observer, SILHOUETTES, DEPTHS);
    let estimates = depth::estimate(&views, &silhouettes, &options.depth, &share)?;
    let hole_hints = hole_hints(holes)?;
    let build = |registrations: &[ViewRegistration], observer: &dyn Observer| {
        let (agreeing, outlines) = agreeing(&views, &silhouettes, registrations);
        let estimates = estimates.iter().zip(registrations);
        let depth_maps: Vec<ViewDepthMap<'_>> = estimates
            .filter(|(_, found)| !found.contradicts)
            .filter_map(|(view, _)| {
                Some(ViewDepthMap { azimuth: view.azimuth, map: view.map.as_ref().ok()? })
            })
            .collect();
        let input = SolidInput {
            views: &agreeing,
            silhouettes: &outlines,
            elevated: &cutting,
            depth_maps: &depth_maps,
            hole_hints: &hole_hints,
        };
        solid::build(&input, &options.solid, observer)
    };
    let solid = build(&registrations, &Share::new(observer, DEPTHS, 1.0))?;
    let rig = Rig::of_views(&views);
    let ious = |solid: &Solid| fit::silhouette_ious(&solid.mesh, &rig, &silhouettes.silhouettes);
    let again = |fewer: &[ViewRegistration]| build(fewer, &Unreported(observer));
    let (solid, registrations) = without_contradicting(solid, registrations, &again, &ious)?;
    let from = options.depth.from;
    let depths = depth::read_depth(&solid.mesh, &views, &silhouettes, estimates, from);
    let elevated = placed.into_iter().map(|view| view.seen(&solid, &views)).collect();
    Ok(Draft { views, registrations, silhouettes, depths, elevated, solid })
}

/// A view that the draft, drawn again, fits worse than this contradicts others,
/// IoU of the silhouettes.
const MISFIT: f64 = 0.8;
/// Leaving views out must make the others fit so much better, mean IoU.
const MIN_GAIN: f64 = 0.03;
/// The solid keeps at least as many views, and half of them.
const MIN_KEPT: usize = 3;

/// Leaves views out of `solid` that it fits badly, while the others then fit better.
///
/// * `build`: makes a solid without those that contradict.
/// * `ious`: how a solid's silhouettes agree with those of each view.
fn without_contradicting(
    mut solid: Solid,
    mut registrations: Vec<ViewRegistration>,
    build: &dyn Fn(&[ViewRegistration]) -> Result<Solid, SolidError>,
    ious: &dyn Fn(&Solid) -> Vec<f64>,
) -> Result<(Solid, Vec<ViewRegistration>), Cancelled> {
    if spare_views(&registrations) == 0 {
        return Ok((solid, registrations));
    }
    let mut known = ious(&solid);
    while let Some(fewer) = without_misfits(&registrations, &known) {
        let again = match build(&fewer) {
            Ok(again) => again,
            Err(SolidError::Cancelled(cancelled)) => return Err(cancelled),
            // Too little is left to make a solid of.
            Err(_) => break,
        };
        let found = ious(&again);
        if mean_of_kept(&found, &fewer) < mean_of_kept(&known, &fewer) + MIN_GAIN {
            break;
        }
        (solid, known, registrations) = (again, found, fewer);
    }
    Ok((solid, registrations))
}

/// How many more views the solid could do without.
fn spare_views(registrations: &[ViewRegistration]) -> usize {
    let kept = registrations.iter().filter(|found| !found.contradicts).count();
    kept.saturating_sub(MIN_KEPT.max(registrations.len().div_ceil(2)))
}

/// The views that fit worst taken for contradicting, if others are left: all
/// misfits, or the worst of them where they are too many.
fn without_misfits(
    registrations: &[ViewRegistration],
    ious: &[f64],
) -> Option<Vec<ViewRegistration>> {
    let kept = |index: &usize| !registrations[*index].contradicts;
    let mut order: Vec<usize> = (0..registrations.len()).filter(kept).collect();
    order.sort_by(|&a, &b| ious[a].total_cmp(&ious[b]));
    let misfits = order.iter().take_while(|&&index| ious[index] < MISFIT).count();
    let left_out = &order[..misfits.min(spare_views(registrations))];
    if left_out.is_empty() {
        return None;
    }
    let mut fewer = registrations.to_vec();
    left_out.iter().for_each(|&index| fewer[index].contradicts = true);
    Some(fewer)
}

fn mean_of_kept(ious: &[f64], registrations: &[ViewRegistration]) -> f64 {
    let kept = ious.iter().zip(registrations).filter(|(_, found)| !found.contradicts);
    let kept: Vec<f64> = kept.map(|(&iou, _)| iou).collect();
    kept.iter().sum::<f64>() / kept.len().max(1) as f64
}

/// What the solid is made of: views that contradict the others would carve
/// away what these show.
fn agreeing<'v, 'a>(
    views: &'v ViewSet<'a>,
    silhouettes: &'v Silhouettes,
    registrations: &[ViewRegistration],
) -> (Cow<'v, ViewSet<'a>>, Cow<'v, Silhouettes>) {
    let keeps = |index: &usize| !registrations[*index].contradicts;
    let kept: Vec<usize> = (0..registrations.len()).filter(keeps).collect();
    match views.subset(&kept) {
        Ok(fewer) if kept.len() < registrations.len() => {
            let of_kept = kept.iter().map(|&index| silhouettes.silhouettes[index].clone());
            let opposites = silhouettes.opposites.clone();
            let silhouettes = Silhouettes { silhouettes: of_kept.collect(), opposites };
            (Cow::Owned(fewer), Cow::Owned(silhouettes))
        }
        _ => (Cow::Borrowed(views), Cow::Borrowed(silhouettes)),
    }
}

fn view_set(sheet: &Sheet) -> Result<ViewSet<'_>, DraftError> {
    let all = sheet.views();
    let level: Vec<_> = all.iter().filter(|view| view.viewpoint().is_level()).collect();
    let (found, required) = (level.len(), MINIMUM_VIEWS);
    if found < required && found < all.len() {
        return Err(DraftError::TooFewLevelViews { found, all: all.len(), required });
    }
    Ok(ViewSet::new(level.into_iter().map(Cow::Borrowed).collect())?)
}

type Registered<'a> = (ViewSet<'a>, Silhouettes, Vec<ViewRegistration>);

/// Silhouettes, and how well they agree; views moved to fit if asked for.
fn registered<'a>(
    views: ViewSet<'a>,
    options: &TurntableOptions,
) -> Result<Registered<'a>, SilhouetteError> {
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

fn hole_hints(holes: &[HoleDocument]) -> Result<Vec<HoleHint>, DraftError> {
    let hint = |hole: &HoleDocument| {
        let azimuth = Azimuth::from_degrees(hole.azimuth_deg)?;
        let elevation = Elevation::from_degrees(hole.elevation_deg.unwrap_or(0.0))?;
        let viewpoint = Viewpoint { azimuth, elevation };
        Ok(HoleHint { viewpoint, x_px: hole.x, y_px: hole.y })
    };
    holes.iter().map(hint).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn azimuth() -> Azimuth {
        Azimuth::from_degrees(0.0).unwrap()
    }

    fn left_out(ious: &[f64], contradicting: &[usize]) -> Option<Vec<usize>> {
        let mut registrations = vec![ViewRegistration::agreeing(azimuth()); ious.len()];
        contradicting.iter().for_each(|&index| registrations[index].contradicts = true);
        let fewer = without_misfits(&registrations, ious)?;
        Some((0..ious.len()).filter(|&index| fewer[index].contradicts).collect())
    }

    #[test]
    fn views_that_fit_badly_are_left_out_while_others_remain() {
        assert_eq!(left_out(&[0.95, 0.9, 0.97, 0.85], &[]), None);
        assert_eq!(left_out(&[0.95, 0.5, 0.97, 0.9], &[]), Some(vec![1]));
        // Half of the views stay, and three at least.
        assert_eq!(left_out(&[0.5, 0.6, 0.7, 0.55, 0.9, 0.9], &[]), Some(vec![0, 1, 3]));
        assert_eq!(left_out(&[0.95, 0.5, 0.97], &[]), None);
        // One that is out already is no more asked, and counts as one of all.
        assert_eq!(left_out(&[0.95, 0.5, 0.97, 0.9, 0.7], &[1]), Some(vec![1, 4]));
        assert_eq!(left_out(&[0.95, 0.5, 0.97, 0.9, 0.7, 0.4], &[1, 4, 5]), None);
    }

    #[test]
    fn the_mean_is_of_kept_views() {
        let mut registrations = vec![ViewRegistration::agreeing(azimuth()); 3];
        registrations[1].contradicts = true;
        assert!((mean_of_kept(&[0.8, 0.1, 0.9], &registrations) - 0.85).abs() < 1e-12);
    }
}
