use rayon::ThreadPool;
use rayon::prelude::*;

use super::DraftError;
use super::carrier::Carrier;
use super::timing::Timed;
use crate::export::{
    AbsentArtifact, Artifact, ArtifactName, DepthPicture, ViewArtifact, depth_png, disparity_png,
};
use crate::float_image::{FloatImage, encode_pfm};
use crate::pipeline::{Observer, Progress, Stage};
use crate::sheet::Azimuth;

/// Hands artifacts over one by one; never more than a few are in memory.
pub(super) struct Outbox<'a, 'e> {
    pool: &'a ThreadPool,
    observer: &'a dyn Observer,
    /// Gone once it has failed.
    carrier: Option<Carrier<'e>>,
    names: Vec<String>,
    absent: Vec<AbsentArtifact>,
    depth_pictures: Vec<DepthPicture>,
    units: usize,
    units_done: usize,
}

/// Files that are made together.
#[derive(Default)]
pub(super) struct Files {
    pub artifacts: Vec<Artifact>,
    pub absent: Vec<AbsentArtifact>,
    pub depth_picture: Option<DepthPicture>,
}

impl<'a, 'e> Outbox<'a, 'e> {
    /// * `units`: how often [`Self::unit_done`] will be called, with the two of
    ///   [`Self::finish`].
    pub fn new(
        units: usize,
        pool: &'a ThreadPool,
        observer: &'a dyn Observer,
        carrier: Carrier<'e>,
    ) -> Self {
        Self {
            pool,
            observer,
            carrier: Some(carrier),
            names: Vec::new(),
            absent: Vec::new(),
            depth_pictures: Vec::new(),
            units,
            units_done: 0,
        }
    }

    pub fn names(&self) -> &[String] {
        &self.names
    }

    pub fn absent(&self) -> &[AbsentArtifact] {
        &self.absent
    }

    pub fn take_depth_pictures(&mut self) -> Vec<DepthPicture> {
        std::mem::take(&mut self.depth_pictures)
    }

    /// Makes the files of `items` in parallel, as many at a time as there are
    /// threads, and takes them in order.
    pub fn each<T: Sync>(
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

    pub fn take(&mut self, files: Files) -> Result<(), DraftError> {
        self.absent.extend(files.absent);
        self.depth_pictures.extend(files.depth_picture);
        for artifact in files.artifacts {
            self.hand_over(artifact)?;
        }
        Ok(())
    }

    /// The zip of everything so far, then how long everything took, which is
    /// not part of it, as it differs from run to run. Returns the names of what
    /// was handed over.
    pub fn finish(mut self, timed: &Timed<'_>, threads: usize) -> Result<Vec<String>, DraftError> {
        let sink = self.carrier.take().ok_or_else(stopped)?.finish()?;
        self.names.push(ArtifactName::Bundle.to_string());
        self.unit_done("bundle")?;
        let json = serde_json::to_vec_pretty(&timed.timings(threads))
            .map_err(|error| DraftError::Internal(error.to_string()))?;
        let timings = Artifact::new(ArtifactName::Timings, json);
        self.names.push(timings.name.clone());
        sink.put(timings)?;
        self.unit_done("timings")?;
        Ok(self.names)
    }

    fn hand_over(&mut self, artifact: Artifact) -> Result<(), DraftError> {
        self.names.push(artifact.name.clone());
        let carrier = self.carrier.take_if(|carrier| !carrier.send(artifact));
        carrier.map_or(Ok(()), |failed| Err(failed.finish().err().unwrap_or_else(stopped)))
    }

    pub fn unit_done(&mut self, unit: &str) -> Result<(), DraftError> {
        self.units_done += 1;
        self.observer.progress(Progress {
            stage: Stage::Export,
            done: self.units_done,
            total: self.units,
            unit: Some(unit.to_owned()),
            fraction: self.units_done as f64 / self.units as f64,
        });
        Ok(self.observer.check()?)
    }
}

fn stopped() -> DraftError {
    DraftError::Internal("artifacts are no longer taken".to_owned())
}

impl Files {
    pub fn one(artifact: Artifact) -> Self {
        Self { artifacts: vec![artifact], ..Self::default() }
    }

    pub fn none(name: ArtifactName, reason: &str) -> Self {
        let absent = AbsentArtifact { name: name.to_string(), reason: reason.to_owned() };
        Self { absent: vec![absent], ..Self::default() }
    }

    /// Disparity and depth of a view, as pictures and as values.
    pub fn of_maps(
        azimuth: Azimuth,
        disparity_px: &FloatImage,
        depth_px: &FloatImage,
    ) -> Result<Self, DraftError> {
        let name = |artifact| ArtifactName::View(azimuth, artifact);
        let (depth_picture, encoding) = depth_png(depth_px)?;
        let depth_name = name(ViewArtifact::DepthPng);
        Ok(Self {
            depth_picture: Some(DepthPicture { name: depth_name.to_string(), encoding }),
            artifacts: vec![
                Artifact::new(name(ViewArtifact::DisparityPng), disparity_png(disparity_px)?),
                Artifact::new(name(ViewArtifact::DisparityPfm), encode_pfm(disparity_px)),
                Artifact::new(depth_name, depth_picture),
                Artifact::new(name(ViewArtifact::DepthPfm), encode_pfm(depth_px)),
            ],
            absent: Vec::new(),
        })
    }
}
