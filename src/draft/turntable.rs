//! The method `turntable` as a job: reconstruct, measure, export.

use artifacts::{Artifact, ArtifactName, Delivery, Files, ViewArtifact};
use evaluation::{
    TruthReport, ViewComparison, ViewTruth, compare_silhouettes, disparity_from_depth,
    evaluate_view, true_mask,
};
use frames::{Placement, UpAxis, Viewpoint};
use picture::png;
use progress::Observer;
use rayon::ThreadPool;
use sheet::ViewDocument;
use turntable::export::{Frames, model_files, view_files};
use turntable::fit::{ViewFit, redraw};
use turntable::{Draft, metrics};

use super::cleaned::cleaned;
use super::exporter::Exporter;
use super::report::{MetricsDocument, SheetReport};
use super::subjects::Preparation;
use super::truth::Truths;
use super::{DraftError, Run, Summary};
use crate::kinds::FitSummary;
use crate::provenance::PROGRAM;

/// Mesh, metrics, bundle and timings follow the views.
const UNITS_AFTER_VIEWS: usize = 4;

/// Runs the method and hands over what it leaves behind.
pub(super) fn run(run: &Run<'_>, delivery: Delivery<'_>) -> Result<Summary, DraftError> {
    let Run { document, sheet, preparation, options, provenance, .. } = *run;
    let Run { truths, pool, threads, timed, .. } = *run;
    let own = &options.turntable;
    let reconstructing = timed.reconstructing();
    let draft = pool.install(|| turntable::reconstruct(sheet, run.holes, own, &reconstructing))?;
    timed.computed();
    let (redrawn, quads) = pool
        .install(|| rayon::join(|| redraw(&draft), || draft.quads(&own.solid, &reconstructing)));
    let quads = quads?;
    let mut found = metrics::measure(&draft, &redrawn, own);
    let said = preparation.map_or(&[][..], |done| &done.warnings);
    let doubts = document.views.iter().filter_map(ViewDocument::doubt);
    found.warnings.splice(0..0, doubts.chain(said.iter().cloned()));
    let exporting = timed.exporting();
    let truth = against_truth(&draft, truths, pool, &exporting)?;
    let bounds = draft.solid.mesh.bounds();
    let bounds = bounds.ok_or_else(|| DraftError::internal("a solid without points"))?;
    let mut on_sheet = options.clone();
    // Options tell of the drawings as sent.
    let reduction = preparation.map_or(1.0, Preparation::reduction);
    let metre = &mut on_sheet.export.pixels_per_metre;
    *metre = metre.map(|pixels| pixels / reduction);
    let placement = Placement::new(bounds, &on_sheet.export);
    let axes = |auto| {
        let axes = options.export.file_axes(auto);
        axes.ok_or_else(|| DraftError::internal("options that conflict"))
    };
    let frames = Frames { obj: axes(UpAxis::Y)?, print: axes(UpAxis::Z)? };
    let all_views = draft.all_views();
    let units = all_views.len() + UNITS_AFTER_VIEWS;
    let mut exporter = Exporter::new(units, pool, &exporting, delivery);
    let views: Vec<_> = all_views.iter().zip(&redrawn).collect();
    exporter.each(&views, |(view, redrawn)| {
        let mut files = view_files(view, redrawn)?;
        files.artifacts.extend(cut_out(preparation, view.viewpoint())?);
        files.artifacts.extend(trust_map(preparation, view.viewpoint())?);
        Ok(files)
    })?;
    let cleaned =
        Files { artifacts: cleaned(&draft, document, run.holes, &on_sheet)?, ..Files::default() };
    exporter.take(cleaned)?;
    let planes = own.reference_planes;
    let models = || model_files(&draft, &quads, &placement, &frames, planes, &exporting);
    exporter.take(pool.install(models)?)?;
    exporter.unit_done("mesh")?;
    for name in [ArtifactName::Cloud, ArtifactName::Hull] {
        exporter.take(Files::none(name, "the method turntable makes solid.glb instead"))?;
    }
    let json = MetricsDocument {
        version: PROGRAM.version,
        provenance,
        width_px: draft.views.width(),
        height_px: draft.views.height(),
        options,
        metrics: &found,
        sheet: preparation.map(SheetReport::of),
        truth: truth.as_ref(),
        pixels_per_metre: Some(placement.pixels_per_metre()),
        depth_pictures: exporter.take_depth_pictures(),
        artifacts: exporter.names(),
        absent_artifacts: exporter.absent(),
    }
    .to_json()?;
    exporter.take(Files::one(Artifact::new(ArtifactName::Metrics, json)))?;
    exporter.unit_done("metrics")?;
    Ok(Summary {
        views: sheet.views().len(),
        pairs: 0,
        usable_pairs: 0,
        artifacts: exporter.finish(timed, threads)?,
        fit: redrawn.iter().map(|view| summary_of(&view.fit)).collect(),
        warnings: found.warnings,
    })
}

fn summary_of(fit: &ViewFit) -> FitSummary {
    FitSummary {
        azimuth_deg: fit.azimuth_deg,
        elevation_deg: fit.elevation_deg,
        silhouette_iou: fit.silhouette_iou,
        outline_distance_px: fit.outline_distance_px,
        ink_explained: fit.ink_explained,
    }
}

/// The subject cut out of its drawing, in colour.
fn cut_out(
    preparation: Option<&Preparation>,
    view: Viewpoint,
) -> Result<Option<Artifact>, DraftError> {
    let pictures = preparation.map_or(&[][..], |done| &done.cut_outs);
    let Some((_, picture)) = pictures.iter().find(|(own, _)| *own == view) else {
        return Ok(None);
    };
    let name = ArtifactName::View(view, ViewArtifact::SubjectPng);
    Ok(Some(Artifact::new(name, png(picture)?)))
}

/// Where a view lacks what the others show.
fn trust_map(
    preparation: Option<&Preparation>,
    view: Viewpoint,
) -> Result<Option<Artifact>, DraftError> {
    let maps = preparation.map_or(&[][..], |done| &done.trust);
    let Some((_, map)) = maps.iter().find(|(own, _)| *own == view) else { return Ok(None) };
    Ok(Some(Artifact::new(ArtifactName::View(view, ViewArtifact::TrustPng), png(map)?)))
}

/// Holds the maps and the solid against what is known to be true.
fn against_truth(
    draft: &Draft<'_>,
    truths: Option<&Truths<'_>>,
    pool: &ThreadPool,
    observer: &dyn Observer,
) -> Result<Option<TruthReport>, DraftError> {
    let Some(truths) = truths else { return Ok(None) };
    let compare = |view, truth: &ViewTruth| compare_view(draft, view, truth);
    truths.evaluate(&compare, Ok(&draft.solid.mesh), pool, observer).map(Some)
}

fn compare_view(
    draft: &Draft<'_>,
    viewpoint: Viewpoint,
    truth: &ViewTruth,
) -> Result<ViewComparison, DraftError> {
    let mut views = draft.all_views().into_iter();
    let Some(view) = views.find(|view| view.viewpoint() == viewpoint) else {
        return Ok(ViewComparison::default());
    };
    let silhouette = view.silhouette;
    // A sheet laid on a canvas of its own cannot be compared pixel by pixel.
    let truly = true_mask(truth);
    if truly.dimensions() != silhouette.mask().dimensions() {
        return Ok(ViewComparison::default());
    }
    let depth = evaluate_view(&disparity_from_depth(&view.depth.map.depth_px), truth)
        .map_err(DraftError::internal)?;
    let silhouette =
        compare_silhouettes(silhouette.mask(), &truly).map_err(DraftError::internal)?;
    // The disparity served is the depth's: one figure tells of both.
    Ok(ViewComparison { disparity: None, depth: Some(depth), silhouette: Some(silhouette) })
}
