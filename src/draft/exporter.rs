//! Makes a job's files in parallel and hands them over in order.

use artifacts::{AbsentArtifact, Artifact, ArtifactName, Delivery, DepthPicture, Files};
use progress::{Observer, Progress, Stage};
use rayon::ThreadPool;
use rayon::prelude::*;

use super::DraftError;
use super::timing::Timed;

/// Hands artifacts over one by one; never more than a few are in memory.
pub(super) struct Exporter<'a, 'e> {
    pool: &'a ThreadPool,
    observer: &'a dyn Observer,
    /// Gone once it has failed.
    delivery: Option<Delivery<'e>>,
    names: Vec<String>,
    absent: Vec<AbsentArtifact>,
    depth_pictures: Vec<DepthPicture>,
    units: usize,
    units_done: usize,
}

impl<'a, 'e> Exporter<'a, 'e> {
    /// * `units`: how often [`Self::unit_done`] will be called, with the two of
    ///   [`Self::finish`].
    pub(super) fn new(
        units: usize,
        pool: &'a ThreadPool,
        observer: &'a dyn Observer,
        delivery: Delivery<'e>,
    ) -> Self {
        Self {
            pool,
            observer,
            delivery: Some(delivery),
            names: Vec::new(),
            absent: Vec::new(),
            depth_pictures: Vec::new(),
            units,
            units_done: 0,
        }
    }

    pub(super) fn names(&self) -> &[String] {
        &self.names
    }

    pub(super) fn absent(&self) -> &[AbsentArtifact] {
        &self.absent
    }

    pub(super) fn take_depth_pictures(&mut self) -> Vec<DepthPicture> {
        std::mem::take(&mut self.depth_pictures)
    }

    /// Makes the files of `items` in parallel, as many at a time as there are
    /// threads, and takes them in order.
    pub(super) fn each<T: Sync>(
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

    pub(super) fn take(&mut self, files: Files) -> Result<(), DraftError> {
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
    pub(super) fn finish(
        mut self,
        timed: &Timed<'_>,
        threads: usize,
    ) -> Result<Vec<String>, DraftError> {
        let sink = self.delivery.take().ok_or_else(stopped)?.finish()?;
        self.names.push(ArtifactName::Bundle.to_string());
        self.unit_done("bundle")?;
        let json =
            serde_json::to_vec_pretty(&timed.timings(threads)).map_err(DraftError::internal)?;
        let timings = Artifact::new(ArtifactName::Timings, json);
        self.names.push(timings.name.clone());
        sink.put(timings)?;
        self.unit_done("timings")?;
        Ok(self.names)
    }

    fn hand_over(&mut self, artifact: Artifact) -> Result<(), DraftError> {
        self.names.push(artifact.name.clone());
        let delivery = self.delivery.take_if(|delivery| !delivery.send(artifact));
        delivery.map_or(Ok(()), |failed| {
            Err(failed.finish().err().map_or_else(stopped, DraftError::from))
        })
    }

    pub(super) fn unit_done(&mut self, unit: &str) -> Result<(), DraftError> {
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
    DraftError::internal("artifacts are no longer taken")
}
