//! The solid from few views: the visual hull slice by slice, rounded where no
//! line says that it is sharp.

mod agreement;
mod boxiness;
mod branches;
mod carving;
mod coverage;
mod crease;
mod cuts;
mod fusion;
mod guessed;
mod holes;
mod hull;
mod learned;
mod outline;
mod parts;
mod phantoms;
mod redraw;
mod report;
mod rounding;
mod section;
mod smoothing;
mod solid_views;
mod symmetry;
#[cfg(test)]
mod tests;
mod tunnels;
mod voxel;

use std::cell::LazyCell;

use nalgebra::Point2;

use crate::depth_map::DepthMap;
use crate::fit;
pub use crate::options::{Holes, SolidKind, SolidOptions, Switch};
use crate::silhouette::Silhouettes;
use crate::surface::field::{Field, Lattice, Plane};
use crate::surface::marching::marching_cubes;
use crate::surface::occupancy::Occupancy;
use crate::surface::projection::Rig;
use crate::surface::support::{Support, Witness, vertex_support};
use crate::surface::{clusters, decimate, quad_mesh};
use crate::views::ViewSet;
use carving::CarvingView;
use crease::Slice;
use cuts::{Bounds, Cut};
pub use cuts::{CutReport, ElevatedInput};
use frames::Azimuth;
pub use holes::{Hole, HoleHint};
pub(crate) use hull::hull_points;
use mesh::shading::{CREASE_ANGLE_DEG, crease_edges};
use mesh::{Mesh, components};
use outline::Outline;
use progress::{Observer, Stage, Steps, Unreported};
pub use redraw::Explained;
pub use report::{PriorReport, Solid, SolidError, SolidReport};
use solid_views::SolidSheet;
pub use symmetry::MirrorPlane;

/// The depths of one view.
#[derive(Clone, Copy, Debug)]
pub struct ViewDepthMap<'a> {
    /// The view's azimuth.
    pub azimuth: Azimuth,
    /// Depth of each pixel, px.
    pub map: &'a DepthMap,
}

/// What a solid is built from.
#[derive(Clone, Copy)]
pub struct SolidInput<'a> {
    /// The views that bound it, moved to agree.
    pub views: &'a ViewSet<'a>,
    /// Those of `views`, in their order.
    pub silhouettes: &'a Silhouettes,
    /// Views from above and below, which cut it; may be none.
    pub elevated: &'a [ElevatedInput<'a>],
    /// Of some of the views, or none.
    pub depth_maps: &'a [ViewDepthMap<'a>],
    /// Points that somebody marked as holes; may be empty.
    pub hole_hints: &'a [HoleHint],
}

/// Views, slices, creases, field, surface, decimation, support.
const STEPS: usize = 7;
/// How much less of the outlines the solid with the prior may cover, IoU.
const MAX_LOST_SILHOUETTE: f64 = 0.03;
/// How much of the share of steps in depth that have ink on them it keeps, where
/// more than the second share of corners are drawn: of what is round, few are.
const MIN_INKED_STEPS: f64 = 0.8;
const ROUND: f64 = 0.25;
/// With less ink inside, share, drawings are outlines alone: nothing says round.
const OUTLINES_ONLY: f64 = 0.002;
/// Outlines that are straight up or across to this share are of something boxy.
const BOXY: f64 = 0.6;
/// A solid with holes that covers less of some drawing's outline, IoU, is held
/// against one without.
const MIN_COVER: f64 = 0.95;
/// The holes are none if without them so much more is covered, IoU, and if they
/// leave less than this share of the volume: panels of a solid body, say.
const MIN_COVER_GAIN: f64 = 0.03;
const MAX_HOLLOWED: f64 = 0.5;
/// Outlines are nowhere narrower than this, share of the pitch: sheets seen edge-on are strokes.
const THINNEST: f64 = 1.5;
/// Fewer triangles bound no shape worth having.
const MIN_TARGET_FACES: usize = 100;

/// Builds the solid that the silhouettes, lines and depths of views show.
///
/// # Errors
/// [`SolidError`] for silhouettes that share nothing, and if `observer` says so.
pub fn build(
    input: &SolidInput,
    options: &SolidOptions,
    observer: &dyn Observer,
) -> Result<Solid, SolidError> {
    let steps = Steps::new(observer, Stage::Solid, STEPS);
    steps.done(0, "")?;
    let Full { mut sheet, mesh: mut full, mut report } = full(input, options, &steps, observer)?;
    let rig = Rig::of_views(input.views);
    let cover = |mesh| {
        let views = fit::silhouette_ious(mesh, &rig, &input.silhouettes.silhouettes);
        views.into_iter().fold(1.0, f64::min)
    };
    if options.holes == Holes::Auto && !report.holes.is_empty() {
        let with_holes = cover(&full);
        if with_holes < MIN_COVER {
            let options = SolidOptions { holes: Holes::Off, ..options.clone() };
            let again = Unreported(observer);
            let steps = Steps::new(&again, Stage::Solid, STEPS);
            let closed = self::full(input, &options, &steps, &again)?;
            let hollow = full.signed_volume() < MAX_HOLLOWED * closed.mesh.signed_volume();
            if hollow && cover(&closed.mesh) > with_holes + MIN_COVER_GAIN {
                let mut candidates = std::mem::take(&mut report.holes);
                candidates.append(&mut report.hole_candidates);
                Full { sheet, mesh: full, report } = closed;
                candidates.retain(|hole| !report.holes.contains(hole));
                report.hole_candidates = candidates;
            }
        }
    }
    steps.done(5, "surface")?;
    let mesh = decimate::decimated(
        &full,
        (options.target_faces as usize).max(MIN_TARGET_FACES),
        options.tolerance_px,
    );
    report.faces = mesh.triangles.len();
    steps.done(6, "decimation")?;
    let support = support_of(&mesh, input, &sheet);
    steps.done(STEPS, "support")?;
    Ok(Solid { creases: crease_edges(&mesh, CREASE_ANGLE_DEG), support, mesh, report })
}

/// The solid before it is decimated.
struct Full {
    sheet: SolidSheet,
    mesh: Mesh,
    report: SolidReport,
}

fn full(
    input: &SolidInput<'_>,
    options: &SolidOptions,
    steps: &Steps<'_>,
    observer: &dyn Observer,
) -> Result<Full, SolidError> {
    let mut report = SolidReport::default();
    let sheet = prepared_sheet(input, options, &mut report);
    let full = full_mesh(&sheet, input, options, steps, observer, &mut report)?;
    let (mesh, pieces) = components::without_floaters(&full, options.min_piece_percent / 100.0);
    report.pieces = pieces;
    if mesh.triangles.is_empty() {
        return Err(SolidError::Empty);
    }
    Ok(Full { sheet, mesh, report })
}

/// The views with their holes cut out, and mirrored ones.
fn prepared_sheet(
    input: &SolidInput,
    options: &SolidOptions,
    report: &mut SolidReport,
) -> SolidSheet {
    let mut sheet = SolidSheet::new(input.views, input.silhouettes);
    let silhouettes = input.silhouettes.silhouettes.iter();
    let (masks, half_line_px): (Vec<_>, Vec<_>) =
        silhouettes.map(|silhouette| (silhouette.mask(), silhouette.half_line_px())).unzip();
    report.straight_share = boxiness::straight_share(&masks);
    let seen = symmetry::detect(&sheet.drawings(), false);
    report.symmetric_about = seen;
    if options.holes != Holes::Off || !input.hole_hints.is_empty() {
        let found = holes::carve(
            &mut sheet,
            &masks,
            &half_line_px,
            seen.as_ref(),
            input.hole_hints,
            options.holes,
        );
        (report.holes, report.hole_candidates) = (found.carved, found.candidates);
    }
    if options.symmetry != Switch::Off && options.kind == SolidKind::Creased {
        let forced = options.symmetry == Switch::On;
        let plane =
            seen.or_else(|| forced.then(|| symmetry::detect(&sheet.drawings(), true)).flatten());
        if let Some(plane) = plane {
            let images = sheet.mirrored(&plane);
            if forced || symmetry::leaves_covered(&sheet, &images) {
                report.mirror_plane = Some(plane);
                sheet.views.extend(images);
            }
        }
    }
    sheet
}

/// The solid's surface, coarser where it is flat.
fn full_mesh(
    sheet: &SolidSheet,
    input: &SolidInput,
    options: &SolidOptions,
    steps: &Steps<'_>,
    observer: &dyn Observer,
    report: &mut SolidReport,
) -> Result<Mesh, SolidError> {
    let directions = sheet.directions();
    report.directions = directions.len();
    let boxy = is_boxy(options, report);
    let bounding = hull::bounding(&directions, boxy);
    report.depth_guessed = bounding.len() > directions.len();
    steps.done(1, "views")?;
    let lattice = hull::lattice_of(sheet, &bounding, options)?;
    let wide = |outlines: Vec<Outline>| -> Vec<Outline> {
        outlines.iter().map(|outline| outline.widened(THINNEST * lattice.pitch_px)).collect()
    };
    let (directions, bounding) = (wide(directions), wide(bounding));
    report.pitch_px = lattice.pitch_px;
    let rig = Rig::of_views(input.views);
    // Where a guessed depth begins says nothing of where a view from above lies.
    let elevated = if report.depth_guessed { &[][..] } else { input.elevated };
    let cuts = elevated.iter().map(|view| Cut::new(view, &rig, input.hole_hints));
    let cuts: Vec<Cut> = cuts.collect();
    if options.kind == SolidKind::Voxel {
        steps.done(4, "field")?;
        let occupancy = voxel::carve(&lattice, &bounding, sheet.origin_row_px, &cuts);
        let mesh = marching_cubes(&lattice, &occupancy);
        report.full_faces = mesh.triangles.len();
        return Ok(mesh);
    }
    let mut slices = hull::slices_of(sheet, &bounding, &lattice);
    report.slices = slices.len();
    report.agreement = agreement::of_slices(&slices, &directions);
    // Flat walls are known from their outlines, wherever those are.
    let apart = if boxy { 0.0 } else { agreement::apart(report.agreement) };
    let apart = apart as f32;
    if options.drop_ghosts && !report.depth_guessed && options.kind == SolidKind::Creased {
        report.ghosts = phantoms::drop_ghosts(&mut slices, &directions, &sheet.ink_evidence());
    }
    if options.parts && !report.depth_guessed && options.kind == SolidKind::Creased {
        let evidence = sheet.ink_evidence();
        report.parts = parts::cut_parts(&mut slices, &directions, &evidence, lattice.pitch_px);
    }
    steps.done(2, "slices")?;
    let (outlines, drawn) = outlines_of(sheet, &slices, &lattice, options, report);
    steps.done(3, "creases")?;
    let mut field = match &directions[..] {
        [front] if options.kind == SolidKind::Creased && !boxy => {
            let rows: Vec<usize> = slices.iter().map(|slice| slice.row).collect();
            guessed::inflated(front, &lattice, &rows)
        }
        _ => field_of(lattice, outlines),
    };
    // The plain hull without cuts needs none.
    let hulls = LazyCell::new(|| hull::planes(&lattice, &slices));
    if options.fusion && options.kind == SolidKind::Creased && !input.depth_maps.is_empty() {
        let views =
            CarvingView::of_sheet(sheet, input.depth_maps, fusion::reach_px(&field.lattice));
        report.carving_views = views.len();
        fuse(&mut field, &slices, &hulls, &directions, &views);
    }
    steps.done(4, "field")?;
    let bounds = (!cuts.is_empty())
        .then(|| Bounds::new(cuts, &lattice, &hulls, &directions, &mut report.cuts))
        .flatten();
    let surface = |field: &Field| match &bounds {
        None => surface_of(field, options),
        Some(bounds) => surface_of(&bounds.applied(field), options),
    };
    let asks = options.prior != Switch::Off && options.kind == SolidKind::Creased;
    // Only creased solids are smoothed, and kept within their hulls.
    let hulls = if options.kind == SolidKind::Creased { &hulls[..] } else { &[] };
    let without = || match options.kind {
        SolidKind::Creased => surface(&smoothing::smoothed(&field, hulls, &directions, apart)),
        _ => surface(&field),
    };
    let (mesh, full_faces) = if asks {
        let has_depth = report.carving_views > 0;
        let guessed = bounding[directions.len()..].first();
        let with = || -> Result<_, SolidError> {
            let logits = learned::logits(sheet, input.views, guessed, observer)?;
            let blended =
                learned::blend(&field, hulls, &directions, &logits, has_depth, &drawn, apart);
            Ok(surface(&blended))
        };
        if options.prior == Switch::On {
            report.prior = Some(PriorReport { used: true, without: None, with: None });
            with()?
        } else {
            // Either has steps that one thread takes.
            let (with, without) = rayon::join(with, without);
            let with = with?;
            let explained = |mesh: &Mesh| redraw::explained(mesh, &rig, sheet, input.silhouettes);
            let scores = (explained(&without.0), explained(&with.0));
            let drawn_corners = report.sharp_corners as f64 / report.corners.max(1) as f64;
            let is_round = drawn_corners < ROUND && scores.0.drawn > OUTLINES_ONLY;
            let used = scores.1.silhouettes >= scores.0.silhouettes - MAX_LOST_SILHOUETTE
                && (is_round || scores.1.steps >= MIN_INKED_STEPS * scores.0.steps);
            report.prior =
                Some(PriorReport { used, without: Some(scores.0), with: Some(scores.1) });
            if used { with } else { without }
        }
    } else {
        without()
    };
    report.full_faces = full_faces;
    Ok(mesh)
}

/// The field's surface and how many triangles it had before flat ones were joined.
fn surface_of(field: &Field, options: &SolidOptions) -> (Mesh, usize) {
    let occupancy = Occupancy::of_field(field);
    let quads = quad_mesh::quads_of_field(field, &occupancy);
    let faces = quads.quads.len() * 2;
    (clusters::clustered(&quads, &occupancy, options.tolerance_px), faces)
}

fn support_of(mesh: &Mesh, input: &SolidInput, sheet: &SolidSheet) -> Vec<Support> {
    let above: Vec<Vec<bool>> = input
        .elevated
        .iter()
        .map(|view| solid_views::near_ink(view.image, view.silhouette))
        .collect();
    let silhouettes = input.silhouettes.silhouettes.iter().enumerate();
    let level = silhouettes.map(|(drawing, silhouette)| Witness {
        silhouette,
        near_ink: sheet.near_ink(drawing),
        depth_px: input
            .depth_maps
            .iter()
            .find(|map| map.azimuth == silhouette.azimuth())
            .map(|found| &found.map.depth_px),
    });
    let elevated = input.elevated.iter().zip(&above).map(|(view, near_ink)| Witness {
        silhouette: view.silhouette,
        near_ink,
        depth_px: None,
    });
    let witnesses: Vec<Witness> = level.chain(elevated).collect();
    let mut rig = Rig::of_views(input.views);
    rig.viewpoints.extend(input.elevated.iter().map(|view| view.viewpoint));
    vertex_support(mesh, &rig, &witnesses)
}

/// The height over which ink along a crease is averaged, as a share of the subject's.
const CREASE_WINDOW: f64 = 0.08;

/// Per slice, the outlines of its sections and where creases cross it.
struct SliceOutlines {
    polygons: Vec<Vec<Point2<f64>>>,
    creases: Vec<Point2<f64>>,
}

/// The outlines of the slices, and per slice the share of its corners that are
/// drawn as lines, averaged over the slices about it.
fn outlines_of(
    sheet: &SolidSheet,
    slices: &[Slice],
    lattice: &Lattice,
    options: &SolidOptions,
    report: &mut SolidReport,
) -> (Vec<SliceOutlines>, Vec<f32>) {
    let sharp: Vec<Vec<Vec<bool>>> = if options.kind == SolidKind::Creased && options.creases {
        let window_px = CREASE_WINDOW * slices.len() as f64 * lattice.pitch_px;
        let evidence = sheet.ink_evidence();
        let boxy = is_boxy(options, report);
        crease::sharp_corners(slices, &evidence, lattice.pitch_px, window_px, boxy)
    } else {
        let all = options.kind != SolidKind::Creased;
        let of_slice = |slice: &Slice| slice.sections.iter().map(|s| vec![all; s.len()]).collect();
        slices.iter().map(of_slice).collect()
    };
    report.corners = sharp.iter().flatten().map(Vec::len).sum();
    report.sharp_corners = sharp.iter().flatten().flatten().filter(|&&sharp| sharp).count();
    let outlines = slices.iter().zip(&sharp).map(|(slice, sharp)| {
        let pairs = || slice.sections.iter().zip(sharp);
        let corners = pairs().flat_map(|(section, sharp)| section.corners.iter().zip(sharp));
        SliceOutlines {
            polygons: pairs().map(|(section, sharp)| rounding::rounded(section, sharp)).collect(),
            creases: corners.filter(|(_, sharp)| **sharp).map(|(corner, _)| *corner).collect(),
        }
    });
    let outlines = outlines.collect();
    let counts: Vec<[usize; 2]> = sharp
        .iter()
        .map(|slice| {
            let all = || slice.iter().flatten();
            [all().filter(|&&sharp| sharp).count(), all().count()]
        })
        .collect();
    let reach = (CREASE_WINDOW * slices.len() as f64 / 2.0).ceil() as usize;
    let share = |k: usize| {
        let near = &counts[k.saturating_sub(reach)..(k + reach + 1).min(counts.len())];
        let sum = |index: usize| near.iter().map(|count| count[index]).sum::<usize>() as f32;
        sum(0) / sum(1).max(1.0)
    };
    (outlines, (0..counts.len()).map(share).collect())
}

/// Whether the subject is made of flat walls, by its outlines or because it is said.
fn is_boxy(options: &SolidOptions, report: &SolidReport) -> bool {
    match options.boxy {
        Switch::Auto => report.straight_share >= BOXY,
        switch => switch == Switch::On,
    }
}

fn field_of(lattice: Lattice, outlines: Vec<SliceOutlines>) -> Field {
    use rayon::prelude::*;
    let planes = outlines.into_par_iter().map(|outlines| {
        let mut plane = Plane::of_polygons(&lattice, &outlines.polygons);
        plane.creases = outlines.creases;
        plane
    });
    Field { lattice, planes: planes.collect() }
}

/// * `hulls`: of `slices`.
fn fuse(
    field: &mut Field,
    slices: &[Slice],
    hulls: &[Plane],
    directions: &[Outline],
    views: &[CarvingView],
) {
    use rayon::prelude::*;
    let lattice = field.lattice;
    let of_slice = |((prior, slice), hull): ((&Plane, &Slice), &Plane)| {
        fusion::corrections(prior, hull, &lattice, slice.row, views)
    };
    let corrections: Vec<_> =
        field.planes.par_iter().zip(slices).zip(hulls).map(of_slice).collect();
    field.planes.par_iter_mut().zip(hulls).enumerate().for_each(|(k, (plane, hull))| {
        let around = [k.saturating_sub(1), k, (k + 1).min(corrections.len() - 1)];
        fusion::correct(plane, hull, around.map(|k| &corrections[k]), &lattice);
        coverage::restore(plane, hull, &lattice, directions, 0);
    });
}
