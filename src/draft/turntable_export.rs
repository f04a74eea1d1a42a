//! The artifacts and metrics of the method `turntable`.

use image::{ImageBuffer, Luma};
use rayon::ThreadPool;
use serde::Serialize;

use super::DraftError;
use super::carrier::Carrier;
use super::outbox::{Files, Outbox};
use super::timing::Timed;
use super::truth::Truths;
use super::turntable::TurntableDraft;
use crate::evaluation::{
    TruthReport, ViewComparison, ViewTruth, compare_silhouettes, disparity_from_depth,
    evaluate_view, true_mask,
};
use crate::export::{
    Artifact, ArtifactName, ExportFrame, MetricsDocument, TurntableGlbError, TurntableSheet,
    ViewArtifact, normals_png, quad_obj, silhouette_png, solid_glb, textured_glb, thumbnail,
};
use crate::geometry::Mesh;
use crate::options::Options;
use crate::pipeline::{Observer, ValueRange};
use crate::sheet::Azimuth;
use crate::turntable::depth::{DepthSource, Fallback, ViewDepth, normals_from_depth};
use crate::turntable::mesh::texture::best_views;
use crate::turntable::mesh::topology::check_manifold;
use crate::turntable::registration::ViewRegistration;
use crate::turntable::silhouette::{OppositePair, Silhouette, SilhouetteSource};
use crate::turntable::solid::{SolidReport, rig_of};

/// Disparity is that towards a view this far on, degrees.
const DISPARITY_ANGLE_DEG: f64 = 5.0;
/// Neighbouring depths that differ by more are different surfaces, px.
const MAX_NORMAL_STEP_PX: f32 = 4.0;
/// A view that fits its neighbours in fewer rows contradicts them.
const MIN_CONSISTENCY: f64 = 0.8;
/// Mesh, metrics, bundle and timings follow the views.
const UNITS_AFTER_VIEWS: usize = 4;

/// What is measured of the whole.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct TurntableMetrics {
    views: Vec<ViewMetrics>,
    opposite_views: Vec<OppositePair>,
    solid: SolidReport,
    mesh: MeshMetrics,
    /// Angle of the pair that disparity maps stand for, degrees.
    disparity_angle_deg: f64,
    pub warnings: Vec<String>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct ViewMetrics {
    azimuth_deg: f64,
    silhouette: SilhouetteMetrics,
    registration: ViewRegistration,
    /// Whether the drawing was moved as `registration` says.
    corrected: bool,
    depth: DepthMetrics,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct SilhouetteMetrics {
    source: SilhouetteSource,
    area_px: usize,
    half_line_px: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct DepthMetrics {
    range_px: Option<ValueRange>,
    /// Share of the crossings of lines with rows whose depth is known.
    matched_share: f64,
    /// What the depth was read from.
    source: DepthSource,
    /// Why the view's own lines tell nothing.
    fallback: Option<Fallback>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct MeshMetrics {
    vertices: usize,
    triangles: usize,
    /// Whether it is closed and a 2-manifold.
    watertight: bool,
    /// What is wrong with it.
    defect: Option<String>,
    height_px: f64,
}

/// Makes the artifacts in a fixed order.
pub(super) struct TurntableExporter<'a, 'e> {
    draft: &'a TurntableDraft,
    options: &'a Options,
    frame: ExportFrame,
    outbox: Outbox<'a, 'e>,
}

impl<'a, 'e> TurntableExporter<'a, 'e> {
    pub fn new(
        draft: &'a TurntableDraft,
        options: &'a Options,
        pool: &'a ThreadPool,
        observer: &'a dyn Observer,
        carrier: Carrier<'e>,
    ) -> Result<Self, DraftError> {
        let bounds = draft.solid.mesh.bounds();
        let bounds = bounds.ok_or_else(|| DraftError::Internal("a solid without points".into()))?;
        let units = draft.depths.len() + UNITS_AFTER_VIEWS;
        let outbox = Outbox::new(units, pool, observer, carrier);
        Ok(Self { draft, options, frame: ExportFrame::new(bounds, &options.export), outbox })
    }

    pub fn views(&mut self) -> Result<(), DraftError> {
        let silhouettes = self.draft.silhouettes.silhouettes.iter();
        let views: Vec<_> = self.draft.depths.iter().zip(silhouettes).collect();
        self.outbox.each(&views, |(depth, silhouette)| view_files(depth, silhouette))
    }

    /// The solid as models, and its picture.
    pub fn mesh(&mut self) -> Result<(), DraftError> {
        let solid = &self.draft.solid;
        let rig = rig_of(&self.draft.views);
        let drawings: Vec<_> =
            self.draft.views.views().iter().map(|view| view.image.clone()).collect();
        let placement = self.frame.placement();
        let mut sheet =
            TurntableSheet { rig: &rig, drawings: &drawings, placement, reference_planes: false };
        let glb = solid_glb(&solid.mesh, &solid.support, &sheet).map_err(internal)?;
        sheet.reference_planes = self.options.turntable.reference_planes;
        let labels = best_views(&solid.mesh, &rig);
        let textured = textured_glb(&solid.mesh, &labels, &sheet).map_err(internal)?;
        let obj = quad_obj(&solid.mesh, &placement).into_bytes();
        let artifacts = vec![
            Artifact::new(ArtifactName::Solid, glb),
            Artifact::new(ArtifactName::SolidObj, obj),
            Artifact::new(ArtifactName::Textured, textured),
            Artifact::new(ArtifactName::Thumbnail, thumbnail(&solid.mesh)?),
        ];
        self.outbox.take(Files { artifacts, ..Files::default() })?;
        self.outbox.unit_done("mesh")
    }

    pub fn metrics(
        &mut self,
        metrics: &TurntableMetrics,
        truth: Option<&TruthReport>,
    ) -> Result<(), DraftError> {
        for name in [ArtifactName::Cloud, ArtifactName::Hull] {
            self.outbox.take(Files::none(name, "the method turntable makes solid.glb instead"))?;
        }
        let json = MetricsDocument {
            version: env!("CARGO_PKG_VERSION"),
            width_px: self.draft.views.width(),
            height_px: self.draft.views.height(),
            options: self.options,
            metrics,
            truth,
            pixels_per_metre: Some(self.frame.pixels_per_metre()),
            depth_pictures: self.outbox.take_depth_pictures(),
            artifacts: self.outbox.names(),
            absent_artifacts: self.outbox.absent(),
        }
        .to_json()?;
        self.outbox.take(Files::one(Artifact::new(ArtifactName::Metrics, json)))?;
        self.outbox.unit_done("metrics")
    }

    /// The zip of everything so far, the timings, and the names of all files.
    pub fn finish(self, timed: &Timed<'_>, threads: usize) -> Result<Vec<String>, DraftError> {
        self.outbox.finish(timed, threads)
    }
}

/// Holds the maps and the solid against what is known to be true.
pub(super) fn against_truth(
    draft: &TurntableDraft,
    truths: Option<&Truths<'_>>,
    pool: &ThreadPool,
    observer: &dyn Observer,
) -> Result<Option<TruthReport>, DraftError> {
    let Some(truths) = truths else { return Ok(None) };
    let compare = |azimuth, truth: &ViewTruth| compare_view(draft, azimuth, truth);
    truths.evaluate(&compare, Ok(&draft.solid.mesh), pool, observer).map(Some)
}

fn compare_view(
    draft: &TurntableDraft,
    azimuth: Azimuth,
    truth: &ViewTruth,
) -> Result<ViewComparison, DraftError> {
    let views = draft.depths.iter().zip(&draft.silhouettes.silhouettes);
    let Some((view, silhouette)) = views.into_iter().find(|(view, _)| view.azimuth == azimuth)
    else {
        return Ok(ViewComparison::default());
    };
    let internal = |error: &dyn std::error::Error| DraftError::Internal(error.to_string());
    let depth = evaluate_view(&disparity_from_depth(&view.map.depth_px), truth)
        .map_err(|error| internal(&error))?;
    let silhouette = compare_silhouettes(silhouette.mask(), &true_mask(truth))
        .map_err(|error| internal(&error))?;
    // The disparity served is the depth's: one figure tells of both.
    Ok(ViewComparison { disparity: None, depth: Some(depth), silhouette: Some(silhouette) })
}

/// Puts together what each stage says.
pub(super) fn measure(draft: &TurntableDraft, options: &Options) -> TurntableMetrics {
    let silhouettes = draft.silhouettes.silhouettes.iter();
    let views = silhouettes.zip(&draft.registrations).zip(&draft.depths);
    let views: Vec<_> = views
        .map(|((silhouette, registration), depth)| ViewMetrics {
            azimuth_deg: depth.azimuth.degrees(),
            silhouette: SilhouetteMetrics {
                source: silhouette.source(),
                area_px: silhouette.area_px(),
                half_line_px: silhouette.half_line_px(),
            },
            registration: *registration,
            corrected: options.turntable.register && registration.corrects(),
            depth: DepthMetrics {
                range_px: ValueRange::of(&depth.map.depth_px),
                matched_share: depth.matched_share,
                source: depth.source,
                fallback: depth.fallback,
            },
        })
        .collect();
    let mesh = mesh_metrics(&draft.solid.mesh);
    TurntableMetrics {
        warnings: warnings(&views, &mesh),
        views,
        opposite_views: draft.silhouettes.opposites.clone(),
        solid: draft.solid.report.clone(),
        mesh,
        disparity_angle_deg: DISPARITY_ANGLE_DEG,
    }
}

fn mesh_metrics(mesh: &Mesh) -> MeshMetrics {
    let defect = check_manifold(mesh).err();
    MeshMetrics {
        vertices: mesh.positions.len(),
        triangles: mesh.triangles.len(),
        watertight: defect.is_none(),
        defect: defect.map(|defect| defect.to_string()),
        height_px: mesh.bounds().map_or(0.0, |(low, high)| high.z - low.z),
    }
}

fn warnings(views: &[ViewMetrics], mesh: &MeshMetrics) -> Vec<String> {
    let mut warnings = Vec::new();
    for view in views {
        let (azimuth, share) = (view.azimuth_deg, view.registration.consistency);
        if view.registration.contradicts {
            warnings.push(format!(
                "view {azimuth} contradicts the others, which agree better without it; it is left out of the solid; check its angle and drawing"
            ));
        } else if share < MIN_CONSISTENCY {
            warnings.push(format!(
                "view {azimuth} fits its neighbours in {:.0} % of its rows; check its angle and drawing",
                share * 100.0
            ));
        }
        if let Some(Fallback::TooFewLines { matched, required }) = view.depth.fallback {
            warnings.push(format!(
                "view {azimuth}: {matched} line points matched to neighbours, {required} are required; its depth is the solid's"
            ));
        }
    }
    let without =
        |view: &&ViewMetrics| matches!(view.depth.fallback, Some(Fallback::NoNeighbours { .. }));
    let count = views.iter().filter(without).count();
    if count > 0 {
        warnings.push(format!(
            "{count} of {} views have too few neighbours near; their depth is the solid's alone",
            views.len()
        ));
    }
    warnings.extend(mesh.defect.as_ref().map(|defect| format!("the mesh is not closed: {defect}")));
    warnings
}

fn view_files(view: &ViewDepth, silhouette: &Silhouette) -> Result<Files, DraftError> {
    let name = |artifact| ArtifactName::View(view.azimuth, artifact);
    let mut files =
        Files::of_maps(view.azimuth, &disparity(&view.map.depth_px), &view.map.depth_px)?;
    let normals = normals_png(&normals_from_depth(&view.map.depth_px, MAX_NORMAL_STEP_PX))?;
    files.artifacts.push(Artifact::new(name(ViewArtifact::NormalsPng), normals));
    let mask = silhouette_png(silhouette.mask())?;
    files.artifacts.push(Artifact::new(name(ViewArtifact::SilhouettePng), mask));
    Ok(files)
}

/// How far points lie from where the axis plane's would, towards the view
/// 5 degrees on, px: near is large.
fn disparity(depth_px: &ImageBuffer<Luma<f32>, Vec<f32>>) -> ImageBuffer<Luma<f32>, Vec<f32>> {
    let sine = DISPARITY_ANGLE_DEG.to_radians().sin() as f32;
    let mut disparity = depth_px.clone();
    disparity.iter_mut().for_each(|value| *value *= -sine);
    disparity
}

fn internal(error: TurntableGlbError) -> DraftError {
    DraftError::Internal(error.to_string())
}
