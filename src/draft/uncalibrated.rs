//! The method `uncalibrated` as a job: reconstruct, measure, export.

use artifacts::{Artifact, ArtifactName, Delivery, Files};
use evaluation::{
    TruthReport, ViewComparison, ViewTruth, disparity_from_depth, disparity_from_pairs,
    evaluate_view,
};
use frames::{Azimuth, Placement, Viewpoint};
use mesh::thumbnail;
use mesh::write::cloud_ply;
use progress::Observer;
use rayon::ThreadPool;
use sheet::Sheet;
use uncalibrated::{
    MeshExtras, Metrics, Reconstruction, hull_glb, measure, pair_files, reconstruct, view_files,
};

use super::exporter::Exporter;
use super::options::Options;
use super::report::{MetricsDocument, Provenance};
use super::timing::Timed;
use super::truth::Truths;
use super::{DraftError, Run, Summary};
use crate::provenance::PROGRAM;

/// Runs the method and hands over what it leaves behind.
pub(super) fn run(run: &Run<'_>, delivery: Delivery<'_>) -> Result<Summary, DraftError> {
    let Run { sheet, options, truths, pool, threads, timed, .. } = *run;
    let reconstruction =
        reconstruct(sheet, &options.uncalibrated(), threads, &timed.reconstructing())?;
    timed.computed();
    let (width_px, height_px) =
        sheet.views().first().map_or((0, 0), |view| view.image.dimensions());
    let metrics = measure(&reconstruction, width_px, height_px);
    let exporting = timed.exporting();
    let truth = against_truth(&reconstruction, truths, pool, &exporting)?;
    let mut files = Uncalibrated::new(sheet, &reconstruction, options, pool, &exporting, delivery);
    files.views()?;
    files.pairs()?;
    files.cloud()?;
    files.mesh()?;
    files.metrics(&metrics, truth.as_ref(), run.provenance)?;
    Ok(Summary {
        views: sheet.views().len(),
        pairs: reconstruction.pairs.len(),
        usable_pairs: reconstruction.usable_pairs().count(),
        artifacts: files.finish(timed, threads)?,
        fit: Vec::new(),
        warnings: metrics.warnings,
    })
}

/// Makes the artifacts of the method `uncalibrated`, in a fixed order.
struct Uncalibrated<'a, 'e> {
    sheet: &'a Sheet,
    reconstruction: &'a Reconstruction,
    options: &'a Options,
    exporter: Exporter<'a, 'e>,
    placement: Option<Placement>,
}

impl<'a, 'e> Uncalibrated<'a, 'e> {
    fn new(
        sheet: &'a Sheet,
        reconstruction: &'a Reconstruction,
        options: &'a Options,
        pool: &'a ThreadPool,
        observer: &'a dyn Observer,
        delivery: Delivery<'e>,
    ) -> Self {
        // Cloud, mesh, metrics, bundle and timings follow views and pairs.
        let units = reconstruction.views.len() + reconstruction.pairs.len() + 5;
        Self {
            sheet,
            reconstruction,
            options,
            exporter: Exporter::new(units, pool, observer, delivery),
            placement: placement(reconstruction, options),
        }
    }

    fn views(&mut self) -> Result<(), DraftError> {
        let sheet = self.sheet;
        self.exporter.each(&self.reconstruction.views, |view| Ok(view_files(view, sheet)?))
    }

    fn pairs(&mut self) -> Result<(), DraftError> {
        let sheet = self.sheet;
        self.exporter.each(&self.reconstruction.pairs, |pair| Ok(pair_files(pair, sheet)?))
    }

    /// The merged cloud of all joined views.
    fn cloud(&mut self) -> Result<(), DraftError> {
        let files = match &self.placement {
            Some(placement) => {
                let points = self.reconstruction.cloud(self.options.cloud.stride_px);
                let bytes = cloud_ply(points, placement);
                Files::one(Artifact::new(ArtifactName::Cloud, bytes))
            }
            None => Files::none(ArtifactName::Cloud, "no view has a point"),
        };
        self.exporter.take(files)?;
        self.exporter.unit_done("cloud")
    }

    /// The hull and its picture.
    fn mesh(&mut self) -> Result<(), DraftError> {
        match (&self.reconstruction.hull, &self.placement) {
            (Ok(mesh), Some(placement)) => {
                let extras = self.mesh_extras(placement);
                let hull = Artifact::new(ArtifactName::Hull, hull_glb(mesh, placement, &extras)?);
                let picture = Artifact::new(ArtifactName::Thumbnail, thumbnail(mesh)?);
                self.exporter.take(Files { artifacts: vec![hull, picture], ..Files::default() })?;
            }
            (Err(error), _) => {
                let reason = error.to_string();
                self.exporter.take(Files::none(ArtifactName::Hull, &reason))?;
                self.exporter.take(Files::none(ArtifactName::Thumbnail, "there is no mesh"))?;
            }
            (Ok(_), None) => {
                return Err(DraftError::internal("a hull without a cloud"));
            }
        }
        self.exporter.unit_done("mesh")
    }

    fn metrics(
        &mut self,
        metrics: &Metrics,
        truth: Option<&TruthReport>,
        provenance: &Provenance,
    ) -> Result<(), DraftError> {
        let (width_px, height_px) =
            self.sheet.views().first().map_or((0, 0), |view| view.image.dimensions());
        let json = MetricsDocument {
            version: PROGRAM.version,
            provenance,
            width_px,
            height_px,
            options: self.options,
            metrics,
            sheet: None,
            truth,
            pixels_per_metre: self.placement.map(|placement| placement.pixels_per_metre()),
            depth_pictures: self.exporter.take_depth_pictures(),
            artifacts: self.exporter.names(),
            absent_artifacts: self.exporter.absent(),
        }
        .to_json()?;
        self.exporter.take(Files::one(Artifact::new(ArtifactName::Metrics, json)))?;
        self.exporter.unit_done("metrics")
    }

    /// The zip of everything so far, the timings, and the names of all files.
    fn finish(self, timed: &Timed<'_>, threads: usize) -> Result<Vec<String>, DraftError> {
        self.exporter.finish(timed, threads)
    }

    fn mesh_extras(&self, placement: &Placement) -> MeshExtras {
        let azimuths = self.reconstruction.views.iter().map(|view| view.azimuth.degrees());
        let method = serde_json::to_value(self.options.method).ok();
        MeshExtras {
            azimuths_deg: azimuths.collect(),
            pixels_per_metre: placement.pixels_per_metre(),
            method: method.and_then(|m| m.as_str().map(str::to_owned)).unwrap_or_default(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
        }
    }
}

/// Holds the maps and the hull against what is known to be true.
fn against_truth(
    reconstruction: &Reconstruction,
    truths: Option<&Truths<'_>>,
    pool: &ThreadPool,
    observer: &dyn Observer,
) -> Result<Option<TruthReport>, DraftError> {
    let Some(truths) = truths else { return Ok(None) };
    let compare =
        |view: Viewpoint, truth: &ViewTruth| compare_view(reconstruction, view.azimuth, truth);
    let hull = reconstruction.hull.as_ref().map_err(|error| format!("no hull: {error}"));
    truths.evaluate(&compare, hull, pool, observer).map(Some)
}

fn compare_view(
    reconstruction: &Reconstruction,
    azimuth: Azimuth,
    truth: &ViewTruth,
) -> Result<ViewComparison, DraftError> {
    let Some(view) = reconstruction.views.iter().find(|view| view.azimuth == azimuth) else {
        return Ok(ViewComparison::default());
    };
    let pair_degs = reconstruction.pair_degs_of(azimuth);
    let report = |map| evaluate_view(&map, truth).map_err(DraftError::internal);
    let disparity =
        view.disparity.as_ref().map(|map| report(disparity_from_pairs(map, &pair_degs)));
    let depth = view.depth.as_ref().map(|map| report(disparity_from_depth(map)));
    Ok(ViewComparison {
        disparity: disparity.transpose()?,
        depth: depth.transpose()?,
        silhouette: None,
    })
}

/// The frame is laid by the hull, or by the whole cloud if it has none.
fn placement(reconstruction: &Reconstruction, options: &Options) -> Option<Placement> {
    let bounds = match &reconstruction.hull {
        Ok(mesh) => mesh.bounds(),
        Err(_) => reconstruction.cloud(1).fold(None, |bounds, point| {
            let (low, high) = bounds.unwrap_or((point, point));
            Some((low.inf(&point), high.sup(&point)))
        }),
    };
    bounds.map(|bounds| Placement::new(bounds, &options.export))
}
