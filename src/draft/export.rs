use rayon::ThreadPool;

use super::outbox::{Files, Outbox};
use super::timing::Timed;
use super::truth::Truths;
use super::{DraftError, EmitArtifact};
use crate::evaluation::{
    TruthReport, ViewComparison, ViewTruth, disparity_from_depth, disparity_from_pairs,
    evaluate_view,
};
use crate::export::{
    Artifact, ArtifactName, ExportFrame, MeshExtras, MetricsDocument, PairArtifact, ViewArtifact,
    cloud_ply, glb, matches_json, matches_png, rectified_png, thumbnail,
};
use crate::options::Options;
use crate::pipeline::{Metrics, Observer, PairResult, Reconstruction, ViewResult, rectified_pair};
use crate::sheet::{Azimuth, Sheet, View};

/// Makes the artifacts of the method `uncalibrated`, in a fixed order.
pub(super) struct Exporter<'a> {
    sheet: &'a Sheet,
    reconstruction: &'a Reconstruction,
    options: &'a Options,
    outbox: Outbox<'a>,
    frame: Option<ExportFrame>,
}

impl<'a> Exporter<'a> {
    pub fn new(
        sheet: &'a Sheet,
        reconstruction: &'a Reconstruction,
        options: &'a Options,
        pool: &'a ThreadPool,
        observer: &'a dyn Observer,
        emit: EmitArtifact<'a>,
    ) -> Self {
        // Cloud, mesh, metrics, bundle and timings follow views and pairs.
        let units = reconstruction.views.len() + reconstruction.pairs.len() + 5;
        Self {
            sheet,
            reconstruction,
            options,
            outbox: Outbox::new(units, pool, observer, emit),
            frame: frame(reconstruction, options),
        }
    }

    pub fn views(&mut self) -> Result<(), DraftError> {
        self.outbox.each(&self.reconstruction.views, view_files)
    }

    pub fn pairs(&mut self) -> Result<(), DraftError> {
        let sheet = self.sheet;
        self.outbox.each(&self.reconstruction.pairs, |pair| pair_files(pair, sheet))
    }

    /// The merged cloud of all joined views.
    pub fn cloud(&mut self) -> Result<(), DraftError> {
        let files = match &self.frame {
            Some(frame) => {
                let points = self.reconstruction.cloud(self.options.cloud.stride_px);
                let bytes = cloud_ply(points, frame);
                Files::one(Artifact::new(ArtifactName::Cloud, bytes))
            }
            None => Files::none(ArtifactName::Cloud, "no view has a point"),
        };
        self.outbox.take(files)?;
        self.outbox.unit_done("cloud")
    }

    /// The hull and its picture.
    pub fn mesh(&mut self) -> Result<(), DraftError> {
        match (&self.reconstruction.hull, &self.frame) {
            (Ok(mesh), Some(frame)) => {
                let extras = self.mesh_extras(frame);
                let hull = Artifact::new(ArtifactName::Hull, glb(mesh, "hull", frame, &extras)?);
                let picture = Artifact::new(ArtifactName::Thumbnail, thumbnail(mesh)?);
                self.outbox.take(Files { artifacts: vec![hull, picture], ..Files::default() })?;
            }
            (Err(error), _) => {
                let reason = error.to_string();
                self.outbox.take(Files::none(ArtifactName::Hull, &reason))?;
                self.outbox.take(Files::none(ArtifactName::Thumbnail, "there is no mesh"))?;
            }
            (Ok(_), None) => {
                return Err(DraftError::Internal("a hull without a cloud".to_owned()));
            }
        }
        self.outbox.unit_done("mesh")
    }

    pub fn metrics(
        &mut self,
        metrics: &Metrics,
        truth: Option<&TruthReport>,
    ) -> Result<(), DraftError> {
        let (width_px, height_px) =
            self.sheet.views().first().map_or((0, 0), |view| view.image.dimensions());
        let json = MetricsDocument {
            version: env!("CARGO_PKG_VERSION"),
            width_px,
            height_px,
            options: self.options,
            metrics,
            truth,
            pixels_per_metre: self.frame.map(|frame| frame.pixels_per_metre()),
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

    fn mesh_extras(&self, frame: &ExportFrame) -> MeshExtras {
        let azimuths = self.reconstruction.views.iter().map(|view| view.azimuth.degrees());
        let method = serde_json::to_value(self.options.method).ok();
        MeshExtras {
            azimuths_deg: azimuths.collect(),
            pixels_per_metre: frame.pixels_per_metre(),
            method: method.and_then(|m| m.as_str().map(str::to_owned)).unwrap_or_default(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
        }
    }
}

/// Holds the maps and the hull against what is known to be true.
pub(super) fn against_truth(
    reconstruction: &Reconstruction,
    truths: Option<&Truths<'_>>,
    pool: &ThreadPool,
    observer: &dyn Observer,
) -> Result<Option<TruthReport>, DraftError> {
    let Some(truths) = truths else { return Ok(None) };
    let compare = |azimuth, truth: &ViewTruth| compare_view(reconstruction, azimuth, truth);
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
    let report =
        |map| evaluate_view(&map, truth).map_err(|error| DraftError::Internal(error.to_string()));
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
fn frame(reconstruction: &Reconstruction, options: &Options) -> Option<ExportFrame> {
    let bounds = match &reconstruction.hull {
        Ok(mesh) => mesh.bounds(),
        Err(_) => reconstruction.cloud(1).fold(None, |bounds, point| {
            let (low, high) = bounds.unwrap_or((point, point));
            Some((low.inf(&point), high.sup(&point)))
        }),
    };
    bounds.map(|bounds| ExportFrame::new(bounds, &options.export))
}

fn view_files(view: &ViewResult) -> Result<Files, DraftError> {
    match (&view.disparity, &view.depth) {
        (Some(disparity), Some(depth)) => Files::of_maps(view.azimuth, disparity, depth),
        _ => {
            use ViewArtifact::{DepthPfm, DepthPng, DisparityPfm, DisparityPng};
            let mut files = Files::default();
            for artifact in [DisparityPng, DisparityPfm, DepthPng, DepthPfm] {
                let name = ArtifactName::View(view.azimuth, artifact);
                files
                    .absent
                    .extend(Files::none(name, "none of the view's pairs was usable").absent);
            }
            Ok(files)
        }
    }
}

fn pair_files(pair: &PairResult, sheet: &Sheet) -> Result<Files, DraftError> {
    let name = |artifact| ArtifactName::Pair(pair.name.left, pair.name.right, artifact);
    let drawing = |azimuth| {
        let found = sheet.views().iter().find(|view: &&View| view.azimuth == azimuth);
        found
            .map(|view| &view.image)
            .ok_or_else(|| DraftError::Internal(format!("pair {} has no view", pair.name)))
    };
    let drawings = [drawing(pair.name.left)?, drawing(pair.name.right)?];
    let mut files = Files {
        artifacts: vec![
            Artifact::new(name(PairArtifact::MatchesPng), matches_png(pair, drawings)?),
            Artifact::new(name(PairArtifact::MatchesJson), matches_json(pair)?),
        ],
        ..Files::default()
    };
    match pair.rectification() {
        Some(rectification) => {
            let rectified = rectified_pair(drawings, rectification)
                .map_err(|error| DraftError::Internal(error.to_string()))?;
            let picture = rectified_png(pair, rectification, [&rectified[0], &rectified[1]])?;
            files.artifacts.push(Artifact::new(name(PairArtifact::RectifiedPng), picture));
        }
        None => {
            let none = Files::none(name(PairArtifact::RectifiedPng), "the pair was not usable");
            files.absent.extend(none.absent);
        }
    }
    Ok(files)
}
