use rayon::ThreadPool;
use rayon::prelude::*;

use super::timing::Timed;
use super::{DraftError, EmitArtifact};
use crate::export::{
    AbsentArtifact, Artifact, ArtifactName, Bundle, DepthPicture, ExportFrame, MeshExtras,
    MetricsDocument, PairArtifact, ViewArtifact, cloud_ply, depth_png, disparity_png, glb,
    matches_json, matches_png, rectified_png, thumbnail,
};
use crate::float_image::encode_pfm;
use crate::options::Options;
use crate::pipeline::{
    Metrics, Observer, PairResult, Progress, Reconstruction, Stage, ViewResult, rectified_pair,
};
use crate::sheet::{Sheet, View};

/// Makes artifacts in a fixed order and hands them over one by one; never more
/// than a few are in memory beside the bundle.
pub(super) struct Exporter<'a> {
    sheet: &'a Sheet,
    reconstruction: &'a Reconstruction,
    options: &'a Options,
    pool: &'a ThreadPool,
    observer: &'a dyn Observer,
    emit: EmitArtifact<'a>,
    bundle: Bundle,
    names: Vec<String>,
    absent: Vec<AbsentArtifact>,
    depth_pictures: Vec<DepthPicture>,
    frame: Option<ExportFrame>,
    units_done: usize,
}

/// The files of one view or pair.
#[derive(Default)]
struct Files {
    artifacts: Vec<Artifact>,
    absent: Vec<AbsentArtifact>,
    depth_picture: Option<DepthPicture>,
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
        Self {
            sheet,
            reconstruction,
            options,
            pool,
            observer,
            emit,
            bundle: Bundle::default(),
            names: Vec::new(),
            absent: Vec::new(),
            depth_pictures: Vec::new(),
            frame: frame(reconstruction, options),
            units_done: 0,
        }
    }

    pub fn views(&mut self) -> Result<(), DraftError> {
        self.each(&self.reconstruction.views, view_files)
    }

    pub fn pairs(&mut self) -> Result<(), DraftError> {
        let sheet = self.sheet;
        self.each(&self.reconstruction.pairs, |pair| pair_files(pair, sheet))
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
        self.take(files)?;
        self.unit_done("cloud")
    }

    /// The hull and its picture.
    pub fn mesh(&mut self) -> Result<(), DraftError> {
        match (&self.reconstruction.hull, &self.frame) {
            (Ok(mesh), Some(frame)) => {
                let extras = self.mesh_extras(frame);
                let hull = Artifact::new(ArtifactName::Hull, glb(mesh, "hull", frame, &extras)?);
                let picture = Artifact::new(ArtifactName::Thumbnail, thumbnail(mesh)?);
                self.take(Files { artifacts: vec![hull, picture], ..Files::default() })?;
            }
            (Err(error), _) => {
                let reason = error.to_string();
                self.take(Files::none(ArtifactName::Hull, &reason))?;
                self.take(Files::none(ArtifactName::Thumbnail, "there is no mesh"))?;
            }
            (Ok(_), None) => {
                return Err(DraftError::Internal("a hull without a cloud".to_owned()));
            }
        }
        self.unit_done("mesh")
    }

    pub fn metrics(&mut self, metrics: &Metrics) -> Result<(), DraftError> {
        let (width_px, height_px) =
            self.sheet.views().first().map_or((0, 0), |view| view.image.dimensions());
        let json = MetricsDocument {
            version: env!("CARGO_PKG_VERSION"),
            width_px,
            height_px,
            options: self.options,
            metrics,
            pixels_per_metre: self.frame.map(|frame| frame.pixels_per_metre()),
            depth_pictures: std::mem::take(&mut self.depth_pictures),
            artifacts: &self.names,
            absent_artifacts: &self.absent,
        }
        .to_json()?;
        self.take(Files::one(Artifact::new(ArtifactName::Metrics, json)))?;
        self.unit_done("metrics")
    }

    /// The zip of everything so far.
    pub fn bundle(&mut self) -> Result<(), DraftError> {
        let bytes = std::mem::take(&mut self.bundle).finish()?;
        self.hand_over(Artifact::new(ArtifactName::Bundle, bytes))?;
        self.unit_done("bundle")
    }

    /// How long everything took; not part of the bundle, as it differs from run
    /// to run.
    pub fn timings(&mut self, timed: &Timed<'_>, threads: usize) -> Result<(), DraftError> {
        let json = serde_json::to_vec_pretty(&timed.timings(threads))
            .map_err(|error| DraftError::Internal(error.to_string()))?;
        self.hand_over(Artifact::new(ArtifactName::Timings, json))?;
        self.unit_done("timings")
    }

    /// The names of what was handed over.
    pub fn into_names(self) -> Vec<String> {
        self.names
    }

    /// Makes the files of `items` in parallel, as many at a time as there are
    /// threads, and takes them in order.
    fn each<T: Sync>(
        &mut self,
        items: &[T],
        make: impl Fn(&T) -> Result<Files, DraftError> + Sync,
    ) -> Result<(), DraftError> {
        for chunk in items.chunks(self.pool.current_num_threads()) {
            self.observer.check()?;
            let made: Vec<_> = self.pool.install(|| chunk.par_iter().map(&make).collect());
            for files in made {
                self.take(files?)?;
                self.unit_done("files")?;
            }
        }
        Ok(())
    }

    fn take(&mut self, files: Files) -> Result<(), DraftError> {
        self.absent.extend(files.absent);
        self.depth_pictures.extend(files.depth_picture);
        for artifact in files.artifacts {
            self.bundle.add(&artifact)?;
            self.hand_over(artifact)?;
        }
        Ok(())
    }

    fn hand_over(&mut self, artifact: Artifact) -> Result<(), DraftError> {
        self.names.push(artifact.name.clone());
        Ok((self.emit)(artifact)?)
    }

    fn unit_done(&mut self, unit: &str) -> Result<(), DraftError> {
        // Cloud, mesh, metrics, bundle and timings follow views and pairs.
        let total = self.reconstruction.views.len() + self.reconstruction.pairs.len() + 5;
        self.units_done += 1;
        self.observer.progress(Progress {
            stage: Stage::Export,
            done: self.units_done,
            total,
            unit: Some(unit.to_owned()),
            fraction: self.units_done as f64 / total as f64,
        });
        Ok(self.observer.check()?)
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

impl Files {
    fn one(artifact: Artifact) -> Self {
        Self { artifacts: vec![artifact], ..Self::default() }
    }

    fn none(name: ArtifactName, reason: &str) -> Self {
        let absent = AbsentArtifact { name: name.to_string(), reason: reason.to_owned() };
        Self { absent: vec![absent], ..Self::default() }
    }
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
    let name = |artifact| ArtifactName::View(view.azimuth, artifact);
    let mut files = Files::default();
    let (Some(disparity), Some(depth)) = (&view.disparity, &view.depth) else {
        use ViewArtifact::{DepthPfm, DepthPng, DisparityPfm, DisparityPng};
        for artifact in [DisparityPng, DisparityPfm, DepthPng, DepthPfm] {
            let none = Files::none(name(artifact), "none of the view's pairs was usable");
            files.absent.extend(none.absent);
        }
        return Ok(files);
    };
    let (depth_picture, encoding) = depth_png(depth)?;
    let depth_name = name(ViewArtifact::DepthPng);
    files.depth_picture = Some(DepthPicture { name: depth_name.to_string(), encoding });
    files.artifacts = vec![
        Artifact::new(name(ViewArtifact::DisparityPng), disparity_png(disparity)?),
        Artifact::new(name(ViewArtifact::DisparityPfm), encode_pfm(disparity)),
        Artifact::new(depth_name, depth_picture),
        Artifact::new(name(ViewArtifact::DepthPfm), encode_pfm(depth)),
    ];
    Ok(files)
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
